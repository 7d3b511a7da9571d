"""Constraints other than feet: general linear constraints A q̈ = b and the rolling wheel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_callable,
    as_integer,
    as_positive,
    as_string,
    checked,
    cross,
    short_repr,
    unit_vector,
)
from floatbase.dynamics._compiled import (
    MIN_TILT,
    Acceleration,
    FrameConnection,
    FrameMotion,
    as_acceleration,
)
from floatbase.dynamics.contact import DEFAULT_MU, UP, SinglePointContact
from floatbase.errors import InputError
from floatbase.robots import State

_MAX_ROWS = 1000  # limit for a single constraint


@dataclass(frozen=True, eq=False)
class LinearConstraint(Value):
    """A general constraint A(q, q̇, t) q̈ = b(q, q̇, t), which may depend on time.

    A holonomic constraint φ(q, t) = 0 has A = ∂φ/∂q and b = -Ȧ q̇ - ∂²φ/∂t². A nonholonomic
    constraint g(q, q̇) = 0 leads to eq. (6). The constraint force is Aᵀ λ, with one multiplier λ for
    each row in the unit of that row. The force has no point of application and no friction cone.

    Something physical must supply the force, such as a hinge or a rope, because a controller relies
    on it. If the motors alone should cause a motion, use a task or a pair of
    `floatbase.control.LinearInequality` instead.

    Combine a constraint with other contacts by `contacts + fb.Contacts([constraint])`.

    Parameters
    ----------
    name : str
        Name of the contact, also used in messages.
    m : int
        Number of rows, from 1 to 1000.
    function : callable
        Called as `function(state, t)` with the time t [s]. It returns A, shape (m, nv), and b,
        shape (m,).

    Notes
    -----
    [FBR]_, eq. (5). Note 6 of the course text covers constraints that depend on time.
    """

    name: str = field(metadata=checked(as_string))
    m: int = field(metadata=checked(as_integer, 1, _MAX_ROWS, "the number of rows"))
    function: Callable[[State, float], tuple[Array, Array]] = field(
        metadata=checked(as_callable, "function(state, t)")
    )
    jacobian_is_constraint: ClassVar[bool] = True

    def _label(self) -> str:
        """Return the name of this constraint in messages about its fields."""
        return f"constraint {short_repr(self.name)}"

    @property
    def k(self) -> int:
        """Number of multipliers, one for each row."""
        return self.m

    @property
    def row_names(self) -> tuple[str, ...]:
        """Names of the rows: "row 0", "row 1", …."""
        return tuple(f"row {i}" for i in range(self.m))

    def jacobian(self, state: State, t: float = 0.0) -> Array:
        """Compute the Jacobian of the constraint force Aᵀ λ, which is A itself.

        Parameters
        ----------
        state : State
            State of the robot.
        t : float, optional
            Time [s].

        Returns
        -------
        ndarray, shape (m, nv)
            The matrix A.
        """
        return self.constraint(state, t)[0]

    def constraint(self, state: State, t: float = 0.0) -> tuple[Array, Array]:
        """Evaluate A and b and check their shapes.

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
            Right-hand side, in the units of the rows.

        Raises
        ------
        InputError
            If the function does not return A and b of these shapes.

        Notes
        -----
        [FBR]_, eq. (5).
        """
        result = self.function(state, t)
        if not isinstance(result, tuple | list) or len(result) != 2:
            raise InputError(
                f"function of {self.name} must return the two arrays A and b of A q̈ = b, not "
                f"{short_repr(result)}."
            )
        A = as_array(f"A of {self.name}", result[0], (self.m, state.robot.nv))
        return A, as_array(f"b of {self.name}", result[1], (self.m,))


@dataclass(frozen=True, eq=False)
class RollingWheel(SinglePointContact):
    """A wheel or disc that rolls on a plane without slipping, a nonholonomic constraint.

    The point of the wheel that touches the ground is at rest: g(q, q̇) = v_c + ω × (-r u) = 0. Here
    v_c is the velocity of the wheel's centre. The unit vector u lies in the wheel's plane and
    points up from the contact. Along the normal, the constraint is the derivative of a position
    constraint on the height of the centre. Along the ground it is not: the wheel can reach every
    place, but it cannot move sideways. Differentiating once gives A = ∂g/∂q̇ and b = -(∂g/∂q) q̇.

    Parameters
    ----------
    frame : str
        Name of the wheel's frame.
    axis : array_like, shape (3,)
        Direction of the axle in the wheel's frame, dimensionless; it is scaled to unit length.
    radius : float
        Radius of the wheel [m].
    normal : array_like, shape (3,), optional
        Normal of the ground in the world frame, pointing out of the ground; it is scaled to unit
        length.
    mu : float, optional
        Coefficient of friction, dimensionless.
    centre : array_like, shape (3,), optional
        Centre of the wheel in the frame [m].
    acceleration : array_like, shape (3,), or callable, optional
        Acceleration of the ground, as for `PointContact`.

    Raises
    ------
    InputError
        If the wheel lies flat on its side when `positions`, `jacobian` or `constraint` is called,
        since it then has no single lowest point.

    Notes
    -----
    [FBR]_, eq. (6).
    """

    axis: Array = field(metadata=checked(unit_vector))
    radius: float = field(metadata=checked(as_positive, "m"))
    normal: Array = field(default_factory=lambda: UP, metadata=checked(unit_vector))
    mu: float = field(default=DEFAULT_MU, metadata=checked(as_positive))
    centre: Array = field(
        default_factory=lambda: np.zeros(3), metadata=checked(as_array, (3,), "m")
    )
    jacobian_is_constraint: ClassVar[bool] = True

    def slip(self, state: State) -> Array:
        """Compute the velocity g(q, q̇) of the touching point, zero when the wheel rolls.

        Parameters
        ----------
        state : State
            State of the robot.

        Returns
        -------
        ndarray, shape (3,)
            Slip velocity in the world frame [m/s].
        """
        return self.jacobian(state) @ state.v

    def _arm(self, state: State) -> tuple[Array, Array, Array]:
        """Return R c - r u, its derivative, and ω; u is along n - (n · axle) axle."""
        R, omega = state.frame_pose(self.frame).rotation, state.frame_velocity(self.frame)[3:]
        n, axle, to_centre = self.normal, R @ self.axis, R @ self.centre
        axle_rate = cross(omega, axle)
        w = n - (n @ axle) * axle
        length = float(np.linalg.norm(w))
        if length < MIN_TILT:
            raise InputError(
                f"The wheel {self.frame} lies flat on its side, so it has no single lowest point "
                f"to roll on. Tilt the wheel, or use another contact for it."
            )
        u, w_rate = w / length, -(n @ axle_rate) * axle - (n @ axle) * axle_rate
        u_rate = (w_rate - u * (u @ w_rate)) / length
        rate = cross(omega, to_centre) - self.radius * u_rate
        return to_centre - self.radius * u, rate, omega


def fixed_frame(frame: str) -> LinearConstraint:
    """Fix a frame to the world with six rows, A = J and b = -J̇ q̇ of eq. (5).

    The multipliers λ are the wrench that holds the frame. For the base of a floating-base robot,
    this wrench is the ground reaction in Figure 1 (left) of the course text.

    Parameters
    ----------
    frame : str
        Name of the frame.

    Returns
    -------
    LinearConstraint
        The constraint "bolts of …", whose λ consists of a force [N] and a moment [N·m] in world
        axes.
    """
    return LinearConstraint(f"bolts of {as_string('frame', frame)}", 6, FrameMotion(frame))


def moving_frame(frame: str, acceleration: Acceleration) -> LinearConstraint:
    """Prescribe the acceleration of a frame's origin.

    Parameters
    ----------
    frame : str
        Name of the frame.
    acceleration : array_like, shape (3,), or callable
        Acceleration in the world frame [m/s²], constant or as a function `acceleration(t)` of the
        time [s].

    Returns
    -------
    LinearConstraint
        The constraint "drive of …" with three rows, A q̈ = b(q, q̇, t).

    Notes
    -----
    Note 6 of the course text.
    """
    if acceleration is None:
        raise InputError("acceleration is None. Give an array or a function, or use fixed_frame.")
    function = FrameMotion(frame, as_acceleration("acceleration", acceleration))
    return LinearConstraint(f"drive of {as_string('frame', frame)}", 3, function)


def rigid_between(frame: str, other: str) -> LinearConstraint:
    """Join two frames of the robot rigidly with six rows, as a box in two hands does.

    The velocity g of `frame` relative to the body of `other` stays zero, and A q̈ = b is ġ = 0.

    Parameters
    ----------
    frame : str
        Name of the frame on which the multipliers act.
    other : str
        Name of the other frame, which receives the opposite wrench.

    Returns
    -------
    LinearConstraint
        The constraint "connection of …", whose λ consists of the force [N] and the moment [N·m] on
        `frame` about its origin, in world axes.

    Raises
    ------
    InputError
        If both names are the same, or, when A and b are computed, if both frames belong to one
        link.

    Notes
    -----
    A kinematic loop, as in [FBR]_, eq. (5).
    """
    function = FrameConnection(as_string("frame", frame), as_string("other", other))
    if frame == other:
        raise InputError(f"Both frames are {frame!r}. Name two frames of different links.")
    return LinearConstraint(f"connection of {frame} and {other}", 6, function)
