"""Orientations that are given as angles through time, with the velocity and acceleration that a
task on them needs.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from floatbase._validation import Array, as_callable

# s, of the differences: their error is below 1e-5 of what a base does in a second
_DIFFERENCE_STEP = 1e-4


def pitch_and_yaw(
    angles: Callable[[float], Array],
) -> Callable[[float], tuple[Array, Array, Array]]:
    """Orientations with these angles of pitch and yaw, as `OrientationTask` takes them.

    angles: angles(t) is (2,), rad, about the body's y axis after the turn about the world's z axis;
        smooth in t, s.
    Returns R (3, 3), angular velocity and acceleration, rad/s and rad/s², world, as a function of
    t.
    """
    as_callable("angles", angles, "angles(t)")

    def path(t: float) -> tuple[Array, Array, Array]:
        before, now, after = angles(t - _DIFFERENCE_STEP), angles(t), angles(t + _DIFFERENCE_STEP)
        (p1, y1), (p2, y2) = (
            (after - before) / (2.0 * _DIFFERENCE_STEP),
            (after - 2.0 * now + before) / _DIFFERENCE_STEP**2,
        )
        R = pin.rpy.rpyToMatrix(0.0, now[0], now[1])
        yaw_axis, pitch_axis = np.array([0.0, 0.0, 1.0]), R[:, 1]  # the axes of yaw and of pitch
        return (
            R,
            y1 * yaw_axis + p1 * pitch_axis,
            y2 * yaw_axis + p2 * pitch_axis + y1 * p1 * np.cross(yaw_axis, pitch_axis),
        )

    return path
