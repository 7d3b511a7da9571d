"""`Command`: one answer of the controller."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from floatbase._validation import Array, Value, cached_property
from floatbase.dynamics import Contacts
from floatbase.qp import Solution


class Command(Value):
    """One answer of `WholeBodyController`.

    tau: (d,) N·m, joint torques to apply.
    qdd: (nv,), the acceleration planned with them: base linear m/s² and angular rad/s² in the base
        frame, then joints.
    forces: (k,) N, world, the contact forces planned with them, stacked as in `contacts`.
    contacts: the contacts that the forces act at.
    backend: which backend answered, "compiled" or "reference".
    solution: what `solution` gives, or a function that makes it when it is first asked for.

    softened: whether the contacts were made soft, since the tick had no solution otherwise.

    It does not change, and its arrays are read-only.
    """

    tau: Array
    qdd: Array
    forces: Array
    contacts: Contacts
    backend: str
    softened: bool
    _solution: Solution | Callable[[], Solution]

    def __init__(
        self,
        tau: Array,
        qdd: Array,
        forces: Array,
        contacts: Contacts,
        backend: str,
        solution: Solution | Callable[[], Solution],
        softened: bool = False,
    ) -> None:
        # a frozen dataclass takes 0.4 µs more at every tick, writing to the dictionary 0.1 µs
        values = self.__dict__
        values["tau"], values["qdd"], values["forces"] = tau, qdd, forces
        values["contacts"], values["backend"], values["_solution"] = contacts, backend, solution
        values["softened"] = softened

    @cached_property
    def solution(self) -> Solution:
        """The QP of this tick with its optimum, multipliers and residuals."""
        return self._solution if isinstance(self._solution, Solution) else self._solution()

    def __getstate__(self) -> dict[str, Any]:
        return super().__getstate__() | {
            "_solution": self.solution
        }  # the function that makes it holds the compiled tick

    def force(self, name: str) -> Array:
        """The planned force of one contact, shape (3,), N, world: for a flat foot the sum over its
        corners.
        """
        return self.contacts.force_of(self.forces, name)

    @property
    def active(self) -> tuple[str, ...]:
        """Names of the active inequalities, such as "FL_foot facet 2": `ConstraintLabel`s, which
        also know kind and owner.
        """
        return self.solution.active

    @property
    def multipliers(self) -> dict[str, float]:
        """Multiplier of each active row, by name."""
        return self.solution.multipliers

    def __repr__(self) -> str:
        return (
            f"Command(|tau|={np.linalg.norm(self.tau):.3g} N·m, "
            f"|forces|={np.linalg.norm(self.forces):.3g} N, "
            f"{len(self.active)} rows active, {self.backend})"
        )
