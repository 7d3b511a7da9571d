"""The constrained equations of motion (1)(4)(7) at one state, as one value."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array, Value, as_array, as_forces, as_instance
from floatbase.dynamics.contacts import Contacts
from floatbase.robots import Robot, State

Block: TypeAlias = Literal["qdd", "tau", "forces"]  # the three unknowns of (7): q̈, τ, λ


@dataclass(frozen=True, eq=False)
class EquationsOfMotion(Value):
    """(1)(4)(7) M q̈ + h = S τ + Jᵀ λ together with A q̈ = b, at one state with one set of
    contacts.

    For point contacts A = J and b = -J̇ q̇, as the course text writes it. Without contacts it is
    (4) with λ empty, and for a fixed base (1). Source: [FBR], §1-§2.1.

    M: (nv, nv), inertia.
    h: (nv,), Coriolis, centrifugal and gravity forces, N and N·m.
    S: (nv, d), actuation (3).
    J: (k, nv), Jacobian of the points where λ acts, world-aligned.
    A, b: (m, nv) and (m,), the rows of (5), in m/s² (rad/s² where they are angular).
    """

    _example = "fb.equations_of_motion(state, contacts)"
    state: State
    contacts: Contacts
    M: Array
    h: Array
    S: Array
    J: Array
    A: Array
    b: Array

    @property
    def robot(self) -> Robot:
        """The robot that moves."""
        return self.state.robot

    @property
    def nv(self) -> int:
        """Length of q̈."""
        return int(self.h.size)

    @property
    def d(self) -> int:
        """Length of τ."""
        return int(self.S.shape[1])

    @property
    def k(self) -> int:
        """Length of λ."""
        return int(self.J.shape[0])

    def acceleration(self, tau: npt.ArrayLike, forces: npt.ArrayLike) -> Array:
        """(4) q̈ = M⁻¹ (S τ + Jᵀ λ - h), shape (nv,), for torques (d,), N·m, and forces (k,), N,
        whatever A q̈ = b asks for.
        """
        tau = as_array("tau", tau, (self.d,), "N·m")
        forces = as_forces(forces, self.k)
        return np.linalg.solve(self.M, self.S @ tau + self.J.T @ forces - self.h)

    def residual(
        self, qdd: npt.ArrayLike, tau: npt.ArrayLike, forces: npt.ArrayLike
    ) -> tuple[Array, Array]:
        """How far (q̈, τ, λ) is from satisfying (7): M q̈ + h - S τ - Jᵀ λ, shape (nv,), and A q̈ -
        b, shape (m,).
        """
        qdd = as_array("qdd", qdd, (self.nv,))
        tau = as_array("tau", tau, (self.d,), "N·m")
        forces = as_forces(forces, self.k)
        return self.M @ qdd + self.h - self.S @ tau - self.J.T @ forces, self.A @ qdd - self.b


def equations_of_motion(state: State, contacts: Contacts, t: float = 0.0) -> EquationsOfMotion:
    """(7) The constrained equations of motion of a state with contacts, at time t in s (which only
    moving constraints feel).

    Raises `InputError` for values of another kind and `UnknownNameError` for a contact on a frame
    the robot lacks.
    """
    as_instance("state", state, State)
    as_instance("contacts", contacts, Contacts)
    J, A, b = contacts._jacobian_and_constraint(state, t)
    return EquationsOfMotion(state, contacts, state.M, state.h, state.robot.S, J, A, b)
