"""One contact with the ground: the motion it holds and the points where its forces act (§2.1, (5)).

A contact has three parts: the rows A q̈ = b of the motion it holds, the points where its forces act (their Jacobian J brings
them into the equations of motion as Jᵀ λ), and the friction cone of each point. For a point contact A is J. A flat foot
holds 6 rows and has forces at its corners.

Forces are what the ground does to the robot, in the world-aligned frame, three numbers a point, stacked in order.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, Protocol, runtime_checkable

import numpy as np
import pinocchio as pin

from floatbase._arrays import Array, checked, cross, positive, read_only, unit_vector
from floatbase.robots import State, spread_corners

UP = read_only([0.0, 0.0, 1.0])
DEFAULT_MU = 0.7  # coefficient of friction where none is given: rubber on dry concrete


@runtime_checkable
class Contact(Protocol):
    """What every contact offers; `point_names` is empty for a constraint whose forces have no friction cone."""

    @property
    def name(self) -> str:
        """Name in messages, active rows and pictures."""

    @property
    def mu(self) -> float:
        """Coefficient of friction."""

    @property
    def normal(self) -> Array:
        """Unit normal out of the ground, shape (3,), world."""

    @property
    def point_names(self) -> tuple[str, ...]:
        """One name for each point that carries a force."""

    @property
    def k(self) -> int:
        """Number of force components."""

    @property
    def row_names(self) -> tuple[str, ...]:
        """One name for each row of (5)."""

    @property
    def J_is_A(self) -> bool:
        """Whether each force component acts along one row of (5), so that J = A."""

    def positions(self, state: State) -> Array:
        """World positions of the points, shape (n, 3), m."""

    def jacobian(self, state: State, t: float = 0.0) -> Array:
        """J of (4): Jᵀ λ is the generalised force of λ at time t, s; shape (k, nv)."""

    def constraint(self, state: State, t: float = 0.0) -> tuple[Array, Array]:
        """(5) The rows A, shape (m, nv), and b, shape (m,), of A q̈ = b at time t, s."""


@dataclass(frozen=True, eq=False)
class PointContact:
    """A point of the robot that does not move on the ground: A = J, b = -J̇ q̇ (5).

    The contact point is the lowest point of a ball: centre - radius · normal. As the ball rolls, that point moves on the
    ball, which b takes into account.

    frame: name of the frame that carries the point.
    normal: shape (3,), world, out of the ground; it is scaled to unit length.
    mu: coefficient of friction.
    radius: of the ball, m; 0 for a point of the frame's body.
    centre: of the ball, shape (3,), m, in the frame.
    """

    frame: str
    normal: Array = field(default_factory=lambda: UP)
    mu: float = DEFAULT_MU
    radius: float = 0.0
    centre: Array = field(default_factory=lambda: np.zeros(3))
    k: ClassVar[int] = 3
    row_names: ClassVar[tuple[str, ...]] = ("x", "y", "z")  # world-aligned
    J_is_A: ClassVar[bool] = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "normal", unit_vector(f"normal of {self.frame}", self.normal))
        object.__setattr__(self, "mu", positive(f"friction coefficient mu of {self.frame}", self.mu))
        object.__setattr__(self, "radius", positive(f"radius of {self.frame}", self.radius, "m", allow_zero=True))
        object.__setattr__(self, "centre", checked(f"centre of {self.frame}", self.centre, (3,), "m"))

    @property
    def name(self) -> str:
        """The frame's name."""
        return self.frame

    @property
    def point_names(self) -> tuple[str, ...]:
        """The frame's name: one point."""
        return (self.frame,)

    def positions(self, state: State) -> Array:
        """World position of the contact point, shape (1, 3), m."""
        return read_only([state.point(self.frame, self.centre) - self.radius * self.normal])

    def jacobian(self, state: State, t: float = 0.0) -> Array:
        """Jacobian of the contact point, shape (3, nv), world-aligned."""
        return read_only(point_jacobian(state, self.frame, self._arm(state)))

    def constraint(self, state: State, t: float = 0.0) -> tuple[Array, Array]:
        """(5) A = J and b = -J̇ q̇, shapes (3, nv) and (3,), m/s²: the contact point does not accelerate."""
        drift = state.frame_drift(self.frame)
        omega = state.frame_velocity(self.frame)[3:]
        arm = self._arm(state)
        # J v = v_o + ω × (R c - r n): only R c turns with the foot, the contact point stays below the centre
        turning = cross(omega, cross(omega, arm + self.radius * self.normal))
        J_dot_v = drift[:3] + cross(drift[3:], arm) + turning
        return read_only(point_jacobian(state, self.frame, arm)), read_only(-J_dot_v)

    def _arm(self, state: State) -> Array:
        """From the frame's origin to the contact point, shape (3,), m, world."""
        return state.frame_pose(self.frame).rotation @ self.centre - self.radius * self.normal


@dataclass(frozen=True, eq=False)
class FlatFootContact:
    """A foot with area that neither moves nor turns: 6 motion rows, and forces at its corners (note 9 of the document).

    The frame's six rows hold the motion and the corners only carry forces. Twelve rows for the motion of the corners would
    have rank 6, and would be inconsistent when the foot turns.

    frame: name of the foot's frame.
    corners: shape (n, 3), m, in the frame.
    normal: shape (3,), world, out of the ground; it is scaled to unit length.
    mu: coefficient of friction.
    """

    frame: str
    corners: Array
    normal: Array = field(default_factory=lambda: UP)
    mu: float = DEFAULT_MU
    row_names: ClassVar[tuple[str, ...]] = ("x", "y", "z", "angular x", "angular y", "angular z")  # world-aligned
    J_is_A: ClassVar[bool] = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "normal", unit_vector(f"normal of {self.frame}", self.normal))
        object.__setattr__(self, "mu", positive(f"friction coefficient mu of {self.frame}", self.mu))
        corners = checked(f"corners of {self.frame}", self.corners, (None, 3), "m")
        object.__setattr__(self, "corners", spread_corners(self.frame, corners))

    @property
    def name(self) -> str:
        """The frame's name."""
        return self.frame

    @property
    def point_names(self) -> tuple[str, ...]:
        """The corners: frame name and number."""
        return tuple(f"{self.frame} corner {i}" for i in range(len(self.corners)))

    @property
    def k(self) -> int:
        """3 for each corner."""
        return 3 * len(self.corners)

    def positions(self, state: State) -> Array:
        """World positions of the corners, shape (n, 3), m."""
        return read_only([state.point(self.frame, corner) for corner in self.corners])

    def generators(self, state: State) -> Array:
        """Corner forces to their wrench at the frame's origin, shape (6, k), N and N·m, world-aligned: J = generatorsᵀ A."""
        R = state.frame_pose(self.frame).rotation
        return read_only(np.hstack([np.vstack([np.eye(3), pin.skew(R @ corner)]) for corner in self.corners]))

    def jacobian(self, state: State, t: float = 0.0) -> Array:
        """Jacobian of the corners, shape (k, nv), world-aligned; its rank is at most 6."""
        return read_only(self.generators(state).T @ state.frame_jacobian(self.frame))

    def constraint(self, state: State, t: float = 0.0) -> tuple[Array, Array]:
        """(5) The frame's six rows and -J̇ q̇, shapes (6, nv) and (6,), m/s² and rad/s²."""
        return state.frame_jacobian(self.frame), read_only(-state.frame_drift(self.frame))


def point_jacobian(state: State, frame: str, arm: Array) -> Array:
    """Jacobian of the point of a frame's body at `arm` (m, world) from its origin, shape (3, nv), world-aligned."""
    J = state.frame_jacobian(frame)
    return J[:3] - pin.skew(arm) @ J[3:]
