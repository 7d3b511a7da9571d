"""The constrained equations of motion at one state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_forces,
    as_instance,
    as_number,
    cached_property,
)
from floatbase.dynamics.contacts import Contacts
from floatbase.robots import Robot, State

Block: TypeAlias = Literal["qdd", "tau", "forces"]  # the three unknowns of eq. (7): q̈, τ, λ


def _computed(compute: Callable[[Any], Array]) -> Any:
    """Make a field that is computed on first use unless it was passed to the constructor."""
    return cached_property(compute)


def _inertia_matrix(eom: EquationsOfMotion) -> Array:
    """Inertia matrix, shape (nv, nv) [kg, kg·m, kg·m²]."""
    return eom.state.M


def _bias_forces(eom: EquationsOfMotion) -> Array:
    """Coriolis, centrifugal and gravity forces, shape (nv,) [N, N·m]."""
    return eom.state.h


def _actuation_matrix(eom: EquationsOfMotion) -> Array:
    """Actuation matrix of eq. (3), shape (nv, d), dimensionless."""
    return eom.state.robot.S


def _jacobian(eom: EquationsOfMotion) -> Array:
    """Jacobian of the points where λ acts, shape (k, nv), in world axes."""
    return eom._contact_matrices[0]


def _constraint_matrix(eom: EquationsOfMotion) -> Array:
    """Matrix of the constraint rows of eq. (5), shape (m, nv)."""
    return eom._contact_matrices[1]


def _constraint_right_hand_side(eom: EquationsOfMotion) -> Array:
    """Right-hand side of the rows, shape (m,) [m/s², or rad/s² for angular rows]."""
    return eom._contact_matrices[2]


@dataclass(frozen=True, eq=False, init=False)
class EquationsOfMotion(Value):
    """The equations of motion M q̈ + h = S τ + Jᵀ λ with the constraint A q̈ = b, at one state.

    For point contacts A = J and b = -J̇ q̇, as in the course text. Without contacts, the constraint
    and λ are empty. With a fixed base and no contacts the equations reduce to M q̈ + h = τ.

    Parameters
    ----------
    state : State
        State of the robot.
    contacts : Contacts
        Contacts and other constraints.
    t : float, optional
        Time at which moving constraints are evaluated [s].
    **matrices : ndarray
        Any of `M`, `h`, `S`, `J`, `A` and `b`, with the shapes of these attributes. Matrices that
        are not given are computed on first use. `dataclasses.replace(eom, M=…)` replaces some.

    Notes
    -----
    [FBR]_, eqs. (1), (4), (7).
    """

    _example = "fb.equations_of_motion(state, contacts)"
    state: State
    contacts: Contacts
    t: float = 0.0
    M: Array = _computed(_inertia_matrix)  # noqa: RUF009
    h: Array = _computed(_bias_forces)  # noqa: RUF009
    S: Array = _computed(_actuation_matrix)  # noqa: RUF009
    J: Array = _computed(_jacobian)  # noqa: RUF009
    A: Array = _computed(_constraint_matrix)  # noqa: RUF009
    b: Array = _computed(_constraint_right_hand_side)  # noqa: RUF009

    def __init__(self, state: State, contacts: Contacts, t: float = 0.0, **matrices: Array) -> None:
        if unknown := matrices.keys() - set("MhSJAb"):
            raise TypeError(
                f"EquationsOfMotion has no {', '.join(sorted(unknown))}. Its matrices are M, h, S, "
                f"J, A and b."
            )
        vars(self).update(state=state, contacts=contacts, t=t, **matrices)

    @cached_property
    def _contact_matrices(self) -> tuple[Array, Array, Array]:
        """Compute J, A and b of the contacts."""
        return self.contacts._jacobian_and_constraint(self.state, self.t)

    @property
    def robot(self) -> Robot:
        """Robot that the equations describe."""
        return self.state.robot

    @property
    def nv(self) -> int:
        """Length of q̈ and v."""
        return self.robot.nv

    @property
    def d(self) -> int:
        """Length of τ: the number of actuated joints, unless another S was given."""
        return int(self.S.shape[1])

    @property
    def k(self) -> int:
        """Length of λ: that of `contacts`, unless another J was given."""
        return len(vars(self)["J"]) if "J" in vars(self) else self.contacts.k

    def acceleration(self, tau: npt.ArrayLike, forces: npt.ArrayLike) -> Array:
        """Compute q̈ = M⁻¹ (S τ + Jᵀ λ - h), regardless of the constraint A q̈ = b.

        Parameters
        ----------
        tau : array_like, shape (d,)
            Joint torques τ [N·m, or N for prismatic joints].
        forces : array_like, shape (k,) or (k / 3, 3)
            Contact forces λ in world axes [N].

        Returns
        -------
        ndarray, shape (nv,)
            Acceleration q̈ [m/s², rad/s²]: the base in its own frame, then the joints.

        Notes
        -----
        [FBR]_, eq. (4).
        """
        tau = as_array("tau", tau, (self.d,), "N·m")
        forces = as_forces(forces, self.k)
        return np.linalg.solve(self.M, self.S @ tau + self.J.T @ forces - self.h)

    def residual(
        self, qdd: npt.ArrayLike, tau: npt.ArrayLike, forces: npt.ArrayLike
    ) -> tuple[Array, Array]:
        """Compute how far (q̈, τ, λ) is from satisfying both equations.

        Parameters
        ----------
        qdd : array_like, shape (nv,)
            Acceleration q̈ [m/s², rad/s²]: the base in its own frame, then the joints.
        tau : array_like, shape (d,)
            Joint torques τ [N·m, or N for prismatic joints].
        forces : array_like, shape (k,) or (k / 3, 3)
            Contact forces λ in world axes [N].

        Returns
        -------
        dynamics : ndarray, shape (nv,)
            M q̈ + h - S τ - Jᵀ λ [N, N·m].
        constraint : ndarray, shape (m,)
            A q̈ - b [m/s², or rad/s² for angular rows].
        """
        qdd = as_array("qdd", qdd, (self.nv,))
        tau = as_array("tau", tau, (self.d,), "N·m")
        forces = as_forces(forces, self.k)
        return self.M @ qdd + self.h - self.S @ tau - self.J.T @ forces, self.A @ qdd - self.b


def equations_of_motion(state: State, contacts: Contacts, t: float = 0.0) -> EquationsOfMotion:
    """Set up the constrained equations of motion of a robot in contact.

    Parameters
    ----------
    state : State
        State of the robot, such as `robot.standing()`.
    contacts : Contacts
        Contacts and other constraints, such as `fb.Contacts.points(robot)`.
    t : float, optional
        Time [s]. Only moving constraints depend on it.

    Returns
    -------
    EquationsOfMotion
        M q̈ + h = S τ + Jᵀ λ and A q̈ = b at this state.

    Raises
    ------
    InputError
        If an argument has the wrong type, or if a contact returns arrays of the wrong shape.
    UnknownNameError
        If a contact refers to a frame that the robot does not have.

    Notes
    -----
    [FBR]_, eq. (7).

    Examples
    --------
    >>> robot = fb.load("go2")
    >>> eom = fb.equations_of_motion(robot.standing(), fb.Contacts.points(robot))
    >>> eom.M.shape, eom.S.shape, eom.J.shape
    ((18, 18), (18, 12), (12, 18))
    """
    as_instance("state", state, State)
    as_instance("contacts", contacts, Contacts)
    eom = EquationsOfMotion(state, contacts, as_number("t", t, "s"))
    _ = eom._contact_matrices  # raises here if the contacts do not fit the robot
    return eom
