"""A single contact: the motion that it constrains and the points where its forces act."""

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
    frozen,
    read_only,
    short_repr,
    unit_vector,
)
from floatbase.dynamics._compiled import Acceleration, acceleration_at, as_acceleration
from floatbase.robots import State
from floatbase.robots._checks import as_corners

UP = read_only([0.0, 0.0, 1.0])
DEFAULT_MU = 0.7  # default coefficient of friction: rubber on dry concrete


@runtime_checkable
class MotionConstraint(Protocol):
    """An element of `Contacts`: rows A q̈ = b and the forces Jᵀ λ that enforce them.

    User-defined constraints implement this protocol. A class with J = A by definition may set the
    class attribute `jacobian_is_constraint = True`. The equations of motion then call `constraint`
    only. Derived classes do not inherit this attribute.
    """

    @property
    def name(self) -> str:
        """Name in messages, in the names of active rows, and in pictures."""

    @property
    def k(self) -> int:
        """Number of force components."""

    @property
    def row_names(self) -> tuple[str, ...]:
        """Names of the m rows of the constraint."""

    def jacobian(self, state: State, t: float = 0.0) -> Array:
        """Compute the matrix J whose transpose maps λ to generalized forces.

        Parameters
        ----------
        state : State
            State of the robot.
        t : float, optional
            Time [s].

        Returns
        -------
        ndarray, shape (k, nv)
            Jacobian J of eq. (4).
        """

    def constraint(self, state: State, t: float = 0.0) -> tuple[Array, Array]:
        """Compute A and b of the rows A q̈ = b, eq. (5).

        Parameters
        ----------
        state : State
            State of the robot.
        t : float, optional
            Time [s].

        Returns
        -------
        A : ndarray, shape (m, nv)
            Matrix of the constraint rows.
        b : ndarray, shape (m,)
            Right-hand side [m/s², or rad/s² for angular rows].
        """


@runtime_checkable
class FrictionContact(MotionConstraint, Protocol):
    """A constraint whose forces act at points, each with a friction cone.

    λ holds the forces of the ground on the robot in world axes [N]. λ has three entries for each
    point, in the order of the points.
    """

    @property
    def mu(self) -> float:
        """Coefficient of friction, dimensionless."""

    @property
    def normal(self) -> Array:
        """Unit normal pointing out of the ground, shape (3,), world frame."""

    @property
    def point_names(self) -> tuple[str, ...]:
        """Names of the n points that carry a force."""

    def positions(self, state: State) -> Array:
        """Compute the positions of the points.

        Parameters
        ----------
        state : State
            State of the robot.

        Returns
        -------
        ndarray, shape (n, 3)
            Positions in the world frame [m], with n = len(point_names).
        """


@dataclass(frozen=True, eq=False)
class SinglePointContact(Value):
    """Base of contacts at one point of a body.

    Derived classes implement `_arm`, which gives the contact point and its motion on the body.
    """

    frame: str = field(metadata=checked(as_string))
    acceleration: Acceleration = field(
        default=None, kw_only=True, metadata=checked(as_acceleration)
    )
    k: ClassVar[int] = 3
    row_names: ClassVar[tuple[str, ...]] = ("x", "y", "z")  # world-aligned

    def _label(self) -> str:
        """Return the name of this contact in messages about its fields."""
        return f"contact {short_repr(self.frame)}"

    @property
    def name(self) -> str:
        """Name of the contact, which is that of its frame."""
        return self.frame

    @property
    def point_names(self) -> tuple[str, ...]:
        """Name of the single contact point, which is that of the frame."""
        return (self.frame,)

    def positions(self, state: State) -> Array:
        """Compute the position of the contact point."""
        return read_only([state.point(self.frame) + self._arm(state)[0]])

    def jacobian(self, state: State, t: float = 0.0) -> Array:
        """Compute the Jacobian of the body point at the contact."""
        return self._jacobian(state, self._arm(state)[0])

    def constraint(self, state: State, t: float = 0.0) -> tuple[Array, Array]:
        """Compute A = J and b = a - J̇ q̇ of eq. (5), where J q̇ = v_frame + ω × arm."""
        (arm, arm_rate, omega), drift = self._arm(state), state.frame_drift(self.frame)
        b = -(drift[:3] + cross(drift[3:], arm) + cross(omega, arm_rate))
        return self._jacobian(state, arm), frozen(b + acceleration_at(self.acceleration, t))

    def rolling_velocity(self, state: State) -> Array:
        """Compute how fast the contact point moves along the body, as a ball or a wheel rolls.

        Parameters
        ----------
        state : State
            State of the robot.

        Returns
        -------
        ndarray, shape (3,)
            Velocity of the contact point minus that of the body there, in the world frame [m/s].
        """
        arm, arm_rate, omega = self._arm(state)
        return arm_rate - cross(omega, arm)

    def _jacobian(self, state: State, arm: Array) -> Array:
        """Compute the Jacobian of the body point at `arm` from the frame's origin."""
        J = state.frame_jacobian(self.frame)
        return frozen(J[:3] - pin.skew(arm) @ J[3:])

    def _arm(self, state: State) -> tuple[Array, Array, Array]:
        """Return the vector from the frame's origin to the contact point, its derivative, and ω.

        ω is the angular velocity of the body. All have shape (3,) and are in world axes [m], [m/s]
        and [rad/s].
        """
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class PointContact(SinglePointContact):
    """A point or ball foot that does not slip on the ground, with A = J and b = -J̇ q̇ of eq. (5).

    The contact point is the lowest point of the ball, centre - radius · normal. As the ball rolls,
    the contact point moves on the ball; b accounts for this motion.

    Parameters
    ----------
    frame : str
        Name of the frame that carries the point.
    normal : array_like, shape (3,), optional
        Normal of the ground in the world frame, pointing out of the ground; it is scaled to unit
        length.
    mu : float, optional
        Coefficient of friction, dimensionless.
    radius : float, optional
        Radius of the ball [m]; 0 for a point of the body.
    centre : array_like, shape (3,), optional
        Centre of the ball in the frame [m].
    acceleration : array_like, shape (3,), or callable, optional
        Acceleration a of the ground in the world frame [m/s²], constant or as a function
        `acceleration(t)` of the time [s]; then b = a - J̇ q̇. The ground must not rotate.
    """

    normal: Array = field(default_factory=lambda: UP, metadata=checked(unit_vector))
    mu: float = field(default=DEFAULT_MU, metadata=checked(as_positive))
    radius: float = field(default=0.0, metadata=checked(as_positive, "m", allow_zero=True))
    centre: Array = field(
        default_factory=lambda: np.zeros(3), metadata=checked(as_array, (3,), "m")
    )
    jacobian_is_constraint: ClassVar[bool] = True

    def _arm(self, state: State) -> tuple[Array, Array, Array]:
        """Return R c - r n, its derivative, and ω; the contact point stays below the centre."""
        to_centre = state.frame_pose(self.frame).rotation @ self.centre
        omega = state.frame_velocity(self.frame)[3:]
        return to_centre - self.radius * self.normal, cross(omega, to_centre), omega


@dataclass(frozen=True, eq=False)
class FlatFootContact(Value):
    """A foot with area that neither moves nor turns, with forces at its corners.

    The six rows of the frame constrain the motion, and the corners only carry forces. Twelve rows
    for the motion of four corners would have rank 6, and would be inconsistent when the foot turns.

    Parameters
    ----------
    frame : str
        Name of the foot's frame.
    corners : array_like, shape (n, 3)
        Corners of the sole in the foot's frame [m]; at least three, not on one line.
    normal : array_like, shape (3,), optional
        Normal of the ground in the world frame, pointing out of the ground; it is scaled to unit
        length.
    mu : float, optional
        Coefficient of friction, dimensionless.
    acceleration : array_like, shape (3,), or callable, optional
        Acceleration of the ground, as for `PointContact`.

    Notes
    -----
    Note 9 of the course text.
    """

    frame: str = field(metadata=checked(as_string))
    corners: Array
    normal: Array = field(default_factory=lambda: UP, metadata=checked(unit_vector))
    mu: float = field(default=DEFAULT_MU, metadata=checked(as_positive))
    acceleration: Acceleration = field(
        default=None, kw_only=True, metadata=checked(as_acceleration)
    )
    # world-aligned
    row_names: ClassVar[tuple[str, ...]] = "x", "y", "z", "angular x", "angular y", "angular z"

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "corners", as_corners(self.frame, self.corners))

    def _label(self) -> str:
        """Return the name of this contact in messages about its fields."""
        return f"contact {short_repr(self.frame)}"

    @property
    def name(self) -> str:
        """Name of the contact, which is that of its frame."""
        return self.frame

    @property
    def point_names(self) -> tuple[str, ...]:
        """Names of the corners, made of the frame's name and a number."""
        return tuple(f"{self.frame} corner {i}" for i in range(len(self.corners)))

    @property
    def k(self) -> int:
        """Number of force components, three for each corner."""
        return 3 * len(self.corners)

    def positions(self, state: State) -> Array:
        """Compute the positions of the corners.

        Parameters
        ----------
        state : State
            State of the robot.

        Returns
        -------
        ndarray, shape (n, 3)
            Positions in the world frame [m].
        """
        return read_only([state.point(self.frame, corner) for corner in self.corners])

    def force_generator_matrix(self, state: State) -> Array:
        """Compute the matrix that maps corner forces to their wrench at the frame's origin.

        The Jacobian of the corners is J = Gᵀ A, where G is this matrix.

        Parameters
        ----------
        state : State
            State of the robot.

        Returns
        -------
        ndarray, shape (6, k)
            Maps forces in world axes [N] to force [N] and moment [N·m] in world axes.
        """
        return grasp_matrix(self.corners @ state.frame_pose(self.frame).rotation.T, np.zeros(3))

    def jacobian(self, state: State, t: float = 0.0) -> Array:
        """Compute the Jacobian of the corners, whose rank is at most 6.

        Parameters
        ----------
        state : State
            State of the robot.
        t : float, optional
            Time [s]; without effect here.

        Returns
        -------
        ndarray, shape (k, nv)
            Maps v to the velocities of the corners in world axes.
        """
        return read_only(self.force_generator_matrix(state).T @ state.frame_jacobian(self.frame))

    def constraint(self, state: State, t: float = 0.0) -> tuple[Array, Array]:
        """Compute A, the six rows of the frame's Jacobian, and b = -J̇ q̇, plus a in linear rows.

        Parameters
        ----------
        state : State
            State of the robot.
        t : float, optional
            Time at which the ground's acceleration a is evaluated [s].

        Returns
        -------
        A : ndarray, shape (6, nv)
            Jacobian of the frame in world axes, linear rows first.
        b : ndarray, shape (6,)
            Right-hand side [m/s², rad/s²].

        Notes
        -----
        [FBR]_, eq. (5).
        """
        b = -state.frame_drift(self.frame)
        b[:3] += acceleration_at(self.acceleration, t)
        return state.frame_jacobian(self.frame), frozen(b)


def grasp_matrix(points: Array, reference_point: Array) -> Array:
    """Compute the matrix that maps forces at points to their wrench about a reference point.

    The matrix stacks G_f above G_τ, and is known as the grasp matrix in manipulation.

    Parameters
    ----------
    points : array_like, shape (n, 3)
        Points where the forces act, in the world frame [m].
    reference_point : array_like, shape (3,)
        Point about which moments are taken, in the world frame [m].

    Returns
    -------
    ndarray, shape (6, 3n)
        Maps the stacked forces [N] to force [N] and moment [N·m], all in world axes.

    Notes
    -----
    [FBR]_, eqs. (20), (21).
    """
    points = as_array("points", points, (None, 3), "m")
    reference_point = as_array("reference_point", reference_point, (3,), "m")
    blocks = [np.vstack([np.eye(3), pin.skew(point - reference_point)]) for point in points]
    return read_only(np.hstack([np.zeros((6, 0)), *blocks]))
