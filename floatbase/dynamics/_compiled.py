"""Parts of constraints that the compiled controller knows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import pinocchio as pin

from floatbase._validation import Array, as_array, as_callable, cross
from floatbase.errors import InputError
from floatbase.robots import State

# sine of the angle between axle and normal below which rounding decides the lowest point
MIN_TILT = 1e-6
# in the world frame [m/s²]: constant, a function of the time, or None for 0
Acceleration: TypeAlias = Array | Callable[[float], Array] | None


def as_acceleration(name: str, value: Any) -> Acceleration:
    """Check an acceleration."""
    if value is None or callable(value):
        return None if value is None else as_callable(name, value, "acceleration(t)")
    return as_array(name, value, (3,), "m/s²")


def acceleration_at(acceleration: Acceleration, t: float) -> Array:
    """Return an acceleration at a time, shape (3,)."""
    if not callable(acceleration):
        return np.zeros(3) if acceleration is None else acceleration
    return as_array("acceleration", acceleration(t), (3,), "m/s²")


@dataclass(frozen=True)
class FrameMotion:
    """Function of a `LinearConstraint` that fixes a frame, or drives the frame's origin."""

    frame: str
    acceleration: Acceleration = None  # of the origin; None for a fixed frame

    def __call__(self, state: State, t: float) -> tuple[Array, Array]:
        """Return A and b."""
        m = 6 if self.acceleration is None else 3
        b = -state.frame_drift(self.frame)[:m]
        b[:3] += acceleration_at(self.acceleration, t)
        return state.frame_jacobian(self.frame)[:m], b


@dataclass(frozen=True)
class FrameConnection:
    """Function of a `LinearConstraint` that joins two frames of a robot rigidly."""

    frame: str
    other: str

    def __call__(self, state: State, t: float) -> tuple[Array, Array]:
        """Return A and b of ġ = 0; g is the velocity of `frame` relative to the other body."""
        robot = state.robot
        ends = [robot.model.frames[robot.frame_id(name)] for name in (self.frame, self.other)]
        if ends[0].parentJoint == ends[1].parentJoint:
            raise InputError(
                f"The frames {self.frame} and {self.other} belong to one link of {robot.name}. "
                f"Name frames of two links."
            )
        J, of_other = state.frame_jacobian(self.frame), state.frame_jacobian(self.other)
        arm = state.point(self.frame) - state.point(self.other)
        v, drift = state.frame_velocity(self.frame), state.frame_drift(self.frame)
        v_other, drift_other = state.frame_velocity(self.other), state.frame_drift(self.other)
        A, b = J - of_other, drift_other - drift
        A[:3] += pin.skew(arm) @ of_other[3:]
        b[:3] += cross(drift_other[3:], arm) + cross(v_other[3:], v[:3] - v_other[:3])
        return A, b


def connected_frames(contact: object) -> tuple[str, ...]:
    """Return the two frames that a constraint connects rigidly, or () for another constraint.

    The second frame of a fixed frame is "universe", Pinocchio's name of the world.
    """
    function = getattr(contact, "function", None)
    if isinstance(function, FrameConnection):
        return function.frame, function.other
    if isinstance(function, FrameMotion) and function.acceleration is None:
        return function.frame, "universe"
    return ()
