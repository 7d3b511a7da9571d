"""Constraints beyond feet: any A q̈ = b (5), with time (note 6), and the rolling wheel as the
nonholonomic case (6).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
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
from floatbase.dynamics.contact import DEFAULT_MU, UP, SinglePointContact
from floatbase.errors import InputError
from floatbase.robots import State

_MAX_ROWS = 1000  # of one constraint
# sine of the angle between axle and normal; below it rounding alone chooses the lowest point
_MIN_TILT = 1e-6


@dataclass(frozen=True, eq=False)
class LinearConstraint(Value):
    """(5) Any constraint A(q, q̇, t) q̈ = b(q, q̇, t), time included (note 6 of the course text).

    Holonomic constraints φ(q, t) = 0 give A = ∂φ/∂q and b = -Ȧ q̇ - ∂²φ/∂t², nonholonomic ones g(q,
    q̇) = 0 give (6). The constraint's force is Aᵀ λ with one multiplier λ for each row, in the
    row's own unit; it has no point and no friction cone. Something must give that force, such as a
    hinge or a rope: a controller counts on it. What the motors alone should bring about is a task,
    or a pair of `floatbase.control.LinearInequality`.

    A contact like others: `contacts + fb.Contacts([constraint])`.

    name: in messages and as the contact's name.
    m: number of rows.
    function: function of (state, t in s) that gives A, shape (m, nv), and b, shape (m,).
    """

    name: str = field(metadata=checked(as_string))
    m: int = field(metadata=checked(as_integer, 1, _MAX_ROWS, "the number of rows"))
    function: Callable[[State, float], tuple[Array, Array]] = field(
        metadata=checked(as_callable, "function(state, t)")
    )
    jacobian_is_constraint: ClassVar[bool] = True

    def _label(self) -> str:
        return f"constraint {short_repr(self.name)}"

    @property
    def k(self) -> int:
        """One multiplier for each row."""
        return self.m

    @property
    def row_names(self) -> tuple[str, ...]:
        """row 0, row 1, …"""
        return tuple(f"row {i}" for i in range(self.m))

    def jacobian(self, state: State, t: float = 0.0) -> Array:
        """A itself, shape (m, nv): the constraint's force is Aᵀ λ."""
        return self.constraint(state, t)[0]

    def constraint(self, state: State, t: float = 0.0) -> tuple[Array, Array]:
        """(5) A, shape (m, nv), and b, shape (m,), checked."""
        result = self.function(state, t)
        if not isinstance(result, tuple | list) or len(result) != 2:
            raise InputError(
                f"function of {self.name} must give A and b of A q̈ = b, not {short_repr(result)}."
            )
        A, b = result
        return as_array(f"A of {self.name}", A, (self.m, state.robot.nv)), as_array(
            f"b of {self.name}", b, (self.m,)
        )


@dataclass(frozen=True, eq=False)
class RollingWheel(SinglePointContact):
    """(6) A wheel or disc that rolls on a plane without slipping: the nonholonomic case.

    g(q, q̇) = v_c + ω × (-r u) = 0: the point of the wheel that touches the ground is at rest,
    where c is the wheel's centre and u the unit vector in the wheel's plane that points up from the
    contact. Along the normal this is the derivative of a position constraint, the height of the
    centre. In the ground it is not: where the wheel can go is not limited, only how. Differentiated
    once, A = ∂g/∂q̇ and b = -(∂g/∂q) q̇.

    frame: name of the wheel's frame; its origin is the centre.
    axis: the axle, shape (3,), in the frame; it is scaled to unit length.
    radius: m.
    normal: shape (3,), world, out of the ground; it is scaled to unit length.
    mu: coefficient of friction.

    `positions` and `constraint` raise `InputError` for a wheel that lies flat: it has no lowest
    point.
    """

    axis: Array = field(metadata=checked(unit_vector))
    radius: float = field(metadata=checked(as_positive, "m"))
    normal: Array = field(default_factory=lambda: UP, metadata=checked(unit_vector))
    mu: float = field(default=DEFAULT_MU, metadata=checked(as_positive))
    jacobian_is_constraint: ClassVar[bool] = True

    def slip(self, state: State) -> Array:
        """g(q, q̇), shape (3,), m/s, world: the velocity of the touching point, zero when the wheel
        rolls.
        """
        return self.jacobian(state) @ state.v

    def _arm(self, state: State) -> tuple[Array, Array]:
        """-r u, where u is the normal laid into the wheel's plane, which turns with the axle."""
        n, axle = self.normal, state.frame_pose(self.frame).rotation @ self.axis
        axle_rate = cross(state.frame_velocity(self.frame)[3:], axle)
        w = n - (n @ axle) * axle
        length = float(np.linalg.norm(w))
        if length < _MIN_TILT:
            raise InputError(
                f"wheel {self.frame} lies flat on its side; it has no single lowest point to roll "
                f"on."
            )
        u, w_rate = w / length, -(n @ axle_rate) * axle - (n @ axle) * axle_rate
        return -self.radius * u, -self.radius / length * (w_rate - u * (u @ w_rate))


def fixed_frame(frame: str) -> LinearConstraint:
    """A frame welded to the world: six rows, (5) with A = J and b = -J̇ q̇; λ is the wrench of the
    bolts, N and N·m, world.

    With a floating base bolted by it, λ is what the course text's Figure 1 (left) calls the
    reaction of the ground.
    """
    return LinearConstraint(
        f"bolts of {as_string('frame', frame)}", 6, partial(_fixed_frame_rows, frame)
    )


def moving_frame(frame: str, acceleration: Callable[[float], Array]) -> LinearConstraint:
    """A frame's origin driven with a given acceleration (3,), m/s², world, as a function of t: A q̈
    = b(q, q̇, t) (note 6).
    """
    as_callable("acceleration", acceleration, "acceleration(t)")
    return LinearConstraint(
        f"drive of {as_string('frame', frame)}", 3, partial(_moving_frame_rows, frame, acceleration)
    )


# with names, so that they can be pickled
def _fixed_frame_rows(frame: str, state: State, t: float) -> tuple[Array, Array]:
    return state.frame_jacobian(frame), -state.frame_drift(frame)


def _moving_frame_rows(
    frame: str, acceleration: Callable[[float], Array], state: State, t: float
) -> tuple[Array, Array]:
    return state.frame_jacobian(frame)[:3], as_array(
        "acceleration", acceleration(t), (3,)
    ) - state.frame_drift(frame)[:3]
