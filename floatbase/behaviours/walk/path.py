"""`Path`: the commanded motion of the body over the ground."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import cos, sin

import numpy as np

from floatbase._validation import Array


@dataclass(frozen=True, eq=False)
class DesiredMotion:
    """The motion that a path approaches."""

    first: Array
    later: Array
    first_until: float
    begin: float
    acceleration: Array


@dataclass(frozen=True, eq=False)
class Path:
    """Position, yaw and velocity of the body's path at one time."""

    time: float
    position: Array
    yaw: float
    velocity: Array

    @lru_cache(maxsize=64)  # noqa: B019 (a plan needs each of its times for several feet)
    def moved(self, desired: DesiredMotion, t: float) -> Path:
        """Return the path at a later time.

        Each part of the velocity approaches the desired one at the largest acceleration. The chord
        of an arc is approximated by its length, so steps that turn far must be short.
        """
        goal = desired.first if t < desired.first_until else desired.later
        duration = max(0.0, t - max(self.time, desired.begin))
        change = goal - self.velocity
        ramp = np.minimum(duration, np.abs(change) / desired.acceleration)  # s, of each part
        velocity = self.velocity + np.sign(change) * desired.acceleration * ramp
        displacement = (self.velocity + velocity) / 2.0 * ramp + velocity * (duration - ramp)
        heading, yaw = self.yaw + displacement[2] / 2.0, self.yaw + float(displacement[2])
        return Path(t, self.position + rotated_by_yaw(displacement[:2], heading), yaw, velocity)

    def point(self, offset: Array) -> Array:
        """Return a point, shape (2,) [m], that has an offset, (2,), from the path in its frame."""
        return self.position + rotated_by_yaw(offset, self.yaw)

    def point_velocity(self, offset: Array) -> Array:
        """Return the velocity of `point(offset)` in the world frame, shape (2,) [m/s]."""
        turning = self.velocity[2] * np.array([-offset[1], offset[0]])
        return rotated_by_yaw(self.velocity[:2] + turning, self.yaw)


def rotated_by_yaw(vector: Array, yaw: float) -> Array:
    """Return a horizontal vector, (2,), rotated to the left by a yaw angle [rad]."""
    c, s = cos(yaw), sin(yaw)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])


def yaw_of(rotation: Array) -> float:
    """Return the yaw angle, to the left, of a rotation matrix [rad]."""
    return float(np.arctan2(rotation[1, 0], rotation[0, 0]))
