"""One contact: the motion that it constrains and the points where its forces act (§2.1, (5))."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, Protocol, runtime_checkable

import numpy as np
import pinocchio as pin

from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_positive,
    as_string,
    checked,
    cross,
    read_only,
    short_repr,
    unit_vector,
)
from floatbase.robots import State
from floatbase.robots._checks import as_corners

UP = read_only([0.0, 0.0, 1.0])
DEFAULT_MU = 0.7  # coefficient of friction where none is given: rubber on dry concrete


@runtime_checkable
class MotionConstraint(Protocol):
    """What `Contacts` are made of: rows A q̈ = b of (5), and the forces Jᵀ λ that hold them.

    name: in messages, active rows and pictures.
    k: number of force components.
    row_names: one for each row of (5).

    A class whose J is A by definition may say so by a class attribute of its own,
    `jacobian_is_constraint = True`: it is then asked once. Derived classes do not inherit it.
    """

    @property
    def name(self) -> str: ...
    @property
    def k(self) -> int: ...
    @property
    def row_names(self) -> tuple[str, ...]: ...

    def jacobian(self, state: State, t: float = 0.0) -> Array:
        """J of (4): Jᵀ λ is the generalised force of λ at time t, s; shape (k, nv)."""

    def constraint(self, state: State, t: float = 0.0) -> tuple[Array, Array]:
        """(5) The rows A, shape (m, nv), and b, shape (m,), of A q̈ = b at time t, s."""


@runtime_checkable
class FrictionContact(MotionConstraint, Protocol):
    """A constraint whose forces act at points, each inside a friction cone.

    Forces are what the ground does to the robot, world-aligned, three numbers a point, stacked in
    order.

    mu: coefficient of friction.
    normal: unit normal out of the ground, shape (3,), world.
    point_names: one for each point that carries a force.
    """

    @property
    def mu(self) -> float: ...
    @property
    def normal(self) -> Array: ...
    @property
    def point_names(self) -> tuple[str, ...]: ...

    def positions(self, state: State) -> Array:
        """World positions of the points, shape (n, 3), m, with n = len(point_names)."""


@dataclass(frozen=True, eq=False)
class SinglePointContact(Value):
    """What contacts at one point of a frame's body share; `_arm` says where the point is and how it
    moves on the body.
    """

    frame: str = field(metadata=checked(as_string))
    k: ClassVar[int] = 3
    row_names: ClassVar[tuple[str, ...]] = ("x", "y", "z")  # world-aligned

    def _label(self) -> str:
        return f"contact {short_repr(self.frame)}"

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
        return read_only([state.point(self.frame) + self._arm(state)[0]])

    def jacobian(self, state: State, t: float = 0.0) -> Array:
        """Jacobian of the body's point at the contact, shape (3, nv), world-aligned."""
        return self._jacobian(state, self._arm(state)[0])

    def constraint(self, state: State, t: float = 0.0) -> tuple[Array, Array]:
        """(5) A = J and b = -J̇ q̇, shapes (3, nv) and (3,), m/s², where J q̇ = v_frame + ω × arm."""
        arm, arm_rate = self._arm(state)
        drift, omega = state.frame_drift(self.frame), state.frame_velocity(self.frame)[3:]
        b = -(drift[:3] + cross(drift[3:], arm) + cross(omega, arm_rate))
        return self._jacobian(state, arm), read_only(b)

    def _jacobian(self, state: State, arm: Array) -> Array:
        J = state.frame_jacobian(self.frame)
        return read_only(J[:3] - pin.skew(arm) @ J[3:])

    def _arm(self, state: State) -> tuple[Array, Array]:
        """From the frame's origin to the contact point, m, and its derivative, m/s; shapes (3,),
        world.
        """
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class PointContact(SinglePointContact):
    """A point of the robot that does not move on the ground: A = J, b = -J̇ q̇ (5).

    The contact point is the lowest point of a ball: centre - radius · normal. As the ball rolls,
    that point moves on the ball, which b takes into account.

    frame: name of the frame that carries the point.
    normal: shape (3,), world, out of the ground; it is scaled to unit length.
    mu: coefficient of friction.
    radius: of the ball, m; 0 for a point of the frame's body.
    centre: of the ball, shape (3,), m, in the frame.
    """

    normal: Array = field(default_factory=lambda: UP, metadata=checked(unit_vector))
    mu: float = field(default=DEFAULT_MU, metadata=checked(as_positive))
    radius: float = field(default=0.0, metadata=checked(as_positive, "m", allow_zero=True))
    centre: Array = field(
        default_factory=lambda: np.zeros(3), metadata=checked(as_array, (3,), "m")
    )
    jacobian_is_constraint: ClassVar[bool] = True

    def _arm(self, state: State) -> tuple[Array, Array]:
        """R c - r n. Only R c turns with the foot, the contact point stays below the centre."""
        to_centre = state.frame_pose(self.frame).rotation @ self.centre
        return to_centre - self.radius * self.normal, cross(
            state.frame_velocity(self.frame)[3:], to_centre
        )


@dataclass(frozen=True, eq=False)
class FlatFootContact(Value):
    """A foot with area that neither moves nor turns: 6 motion rows, and forces at its corners (note
    9 of the course text).

    The frame's six rows hold the motion and the corners only carry forces. Twelve rows for the
    motion of the corners would have rank 6, and would be inconsistent when the foot turns.

    frame: name of the foot's frame.
    corners: shape (n, 3), m, in the frame.
    normal: shape (3,), world, out of the ground; it is scaled to unit length.
    mu: coefficient of friction.
    """

    frame: str = field(metadata=checked(as_string))
    corners: Array
    normal: Array = field(default_factory=lambda: UP, metadata=checked(unit_vector))
    mu: float = field(default=DEFAULT_MU, metadata=checked(as_positive))
    row_names: ClassVar[tuple[str, ...]] = (
        "x",
        "y",
        "z",
        "angular x",
        "angular y",
        "angular z",
    )  # world-aligned

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "corners", as_corners(self.frame, self.corners))

    def _label(self) -> str:
        return f"contact {short_repr(self.frame)}"

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

    def force_generator_matrix(self, state: State) -> Array:
        """Corner forces to their wrench at the frame's origin, (6, k), N, N·m, world axes: J =
        force_generator_matrixᵀ A.
        """
        return grasp_matrix(self.corners @ state.frame_pose(self.frame).rotation.T, np.zeros(3))

    def jacobian(self, state: State, t: float = 0.0) -> Array:
        """Jacobian of the corners, shape (k, nv), world-aligned; its rank is at most 6."""
        return read_only(self.force_generator_matrix(state).T @ state.frame_jacobian(self.frame))

    def constraint(self, state: State, t: float = 0.0) -> tuple[Array, Array]:
        """(5) The frame's six rows and -J̇ q̇, shapes (6, nv) and (6,), m/s² and rad/s²."""
        return state.frame_jacobian(self.frame), read_only(-state.frame_drift(self.frame))


def grasp_matrix(points: Array, reference_point: Array) -> Array:
    """(20)(21) G_f above G_τ, shape (6, 3n): forces at points, shape (n, 3), m, to their wrench
    about a point, shape (3,).

    Known as the grasp matrix in manipulation. N and N·m, world.
    """
    points, reference_point = (
        as_array("points", points, (None, 3), "m"),
        as_array("reference_point", reference_point, (3,), "m"),
    )
    blocks = [np.vstack([np.eye(3), pin.skew(point - reference_point)]) for point in points]
    return read_only(np.hstack([np.zeros((6, 0)), *blocks]))
