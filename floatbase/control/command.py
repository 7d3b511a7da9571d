"""`Command`: one answer of the whole-body controller."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array, Value, cached_property, frozen
from floatbase.control.joint_limits import JointLimits
from floatbase.dynamics import Contacts
from floatbase.qp import Solution

_NO_TARGETS = frozen(np.zeros(0))
_NO_ENTRIES: Mapping[str, slice] = MappingProxyType({})


class Command(Value):
    """One answer of `WholeBodyController`; it is immutable, and its arrays are read-only.

    Parameters
    ----------
    tau : ndarray, shape (d,)
        Joint torques to apply [N·m].
    qdd : ndarray, shape (nv,)
        Generalized acceleration planned with them: the base's linear [m/s²] and angular [rad/s²]
        part in the base frame, then the joints [rad/s² or m/s²].
    forces : ndarray, shape (k,)
        Contact forces planned with them, stacked as in `contacts`, world frame [N].
    contacts : Contacts
        Contacts at which the forces act.
    backend : {"compiled", "reference"}
        Backend that computed the answer.
    solver : str
        Solver that found the answer: "compiled", or the solver of the reference backend. "daqp
        unrefined" means that the constraints hold, but the optimum could not be confirmed: the
        torques may be far from it. "level 1 of 3" means that the levels after the first could not
        be solved within the limit of iterations.
    solution : Solution or callable
        Value of the property `solution`, or a function that computes it on first use.
    softened : tuple of str, optional
        What was softened because the QP had no solution: "limits", "contacts", or both.
    target_values : ndarray, shape (n,), optional
        Targets of all tasks in this control step, as `WholeBodyController.targets_at` returns them.
    target_entries : mapping of str to slice, optional
        Entries of each task in them, as `WholeBodyController.targets`.
    joint_limits : JointLimits, optional
        Joint limits of the QP.
    """

    tau: Array
    qdd: Array
    forces: Array
    contacts: Contacts
    backend: str
    solver: str
    softened: tuple[str, ...]
    target_values: Array
    target_entries: Mapping[str, slice]
    joint_limits: JointLimits | None
    _solution: Solution | Callable[[], Solution]

    def __init__(
        self,
        tau: Array,
        qdd: Array,
        forces: Array,
        contacts: Contacts,
        backend: str,
        solver: str,
        solution: Solution | Callable[[], Solution],
        softened: tuple[str, ...] = (),
        target_values: Array = _NO_TARGETS,
        target_entries: Mapping[str, slice] = _NO_ENTRIES,
        joint_limits: JointLimits | None = None,
    ) -> None:
        # writing to the dictionary takes 0.1 µs per control step, a frozen dataclass 0.4 µs more
        values = self.__dict__
        values["tau"] = tau
        values["qdd"] = qdd
        values["forces"] = forces
        values["contacts"] = contacts
        values["backend"] = backend
        values["solver"] = solver
        values["_solution"] = solution
        values["softened"] = softened
        values["joint_limits"] = joint_limits
        values["target_values"] = target_values
        values["target_entries"] = target_entries

    @property
    def targets(self) -> dict[str, Array]:
        """Targets of each task in this control step, by the task's name.

        Each array holds the target and then its derivatives, for example position, velocity and
        acceleration.
        """
        return {name: self.target_values[part] for name, part in self.target_entries.items()}

    @cached_property
    def solution(self) -> Solution:
        """QP of this control step with its optimum, multipliers and residuals."""
        return self._solution if isinstance(self._solution, Solution) else self._solution()

    def __getstate__(self) -> dict[str, Any]:
        # the function that makes it holds the compiled tick
        return super().__getstate__() | {"_solution": self.solution}

    def force(self, name: str) -> Array:
        """Return the planned force of one contact; for a flat foot, the sum over its corners.

        Parameters
        ----------
        name : str
            Name of the contact.

        Returns
        -------
        ndarray, shape (3,)
            Force in the world frame [N].
        """
        return self.contacts.force_of(self.forces, name)

    @property
    def active(self) -> tuple[str, ...]:
        """Names of the active inequalities, such as "FL_foot facet 2".

        Each name is a `ConstraintLabel`, which also holds the kind and owner of the constraint.
        """
        return self.solution.active

    @property
    def multipliers(self) -> dict[str, float]:
        """Multiplier of each active inequality, by name."""
        return self.solution.multipliers

    @property
    def violations(self) -> dict[str, float]:
        """Violation of each violated soft constraint, by name.

        The unit is that of the constraint: rad/s² or m/s² for joint limits, N for normal forces.
        """
        return self.solution.violations

    def __repr__(self) -> str:
        return (
            f"Command(|tau|={np.linalg.norm(self.tau):.3g} N·m, "
            f"|forces|={np.linalg.norm(self.forces):.3g} N, "
            f"{len(self.active)} active inequalities, {self.backend})"
        )


@dataclass(frozen=True, eq=False)
class CommandBatch(Value):
    """Answers of `WholeBodyController.batch`, one row for each of N states.

    A row without an answer is NaN. The class is immutable, and its arrays are read-only.

    Parameters
    ----------
    tau : ndarray, shape (N, d)
        Joint torques to apply [N·m].
    qdd : ndarray, shape (N, nv)
        Generalized accelerations planned with them, as in `Command`.
    forces : ndarray, shape (N, k)
        Contact forces planned with them, as in `Command` [N].
    status : ndarray of str, shape (N,)
        "compiled" or "reference" is the backend that answered. "infeasible" means that the QP has
        no solution, and "failed" that the solver stopped without one. A call of the controller with
        this state raises an exception with the reasons.
    softened : ndarray of bool, shape (N,)
        Whether limits or contacts were softened because the QP had no solution.
    """

    tau: Array
    qdd: Array
    forces: Array
    status: npt.NDArray[np.str_]
    softened: npt.NDArray[np.bool_]

    @property
    def unsolved(self) -> tuple[int, ...]:
        """Numbers of the rows without an answer."""
        rows = np.flatnonzero(np.isin(self.status, ("infeasible", "failed")))
        return tuple(rows.tolist())
