"""Parts of constraints that the compiled controller knows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from floatbase._validation import Array, as_array
from floatbase.robots import State

# sine of the angle between axle and normal below which rounding decides the lowest point
MIN_TILT = 1e-6


@dataclass(frozen=True)
class FrameMotion:
    """Function of a `LinearConstraint` that fixes a frame, or drives the frame's origin."""

    frame: str
    acceleration: Callable[[float], Array] | None = None  # of the origin; None for a fixed frame

    def __call__(self, state: State, t: float) -> tuple[Array, Array]:
        """Return A and b."""
        return self.rows(state, self.acceleration_at(t))

    def acceleration_at(self, t: float) -> Array:
        """Return the accelerations that the rows prescribe at a time, one for each row."""
        if self.acceleration is None:
            return np.zeros(6)
        return as_array("acceleration", self.acceleration(t), (3,))

    def rows(self, state: State, acceleration: Array) -> tuple[Array, Array]:
        """Return A and b for accelerations of `acceleration_at`."""
        m = len(acceleration)
        drift = state.frame_drift(self.frame)[:m]
        return state.frame_jacobian(self.frame)[:m], acceleration - drift
