"""Orientations given as angles over time, with the derivatives that an orientation task needs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._validation import Array, as_array, as_callable, cross

# s, of the finite differences: their error is below 1e-5 of a base's motion in a second
_DIFFERENCE_STEP = 1e-4


def pitch_and_yaw(
    angles: Callable[[float], npt.ArrayLike],
) -> Callable[[float], tuple[Array, Array, Array]]:
    """Convert pitch and yaw angles over time to the target of an `OrientationTask`.

    The derivatives are computed by finite differences.

    Parameters
    ----------
    angles : callable
        Called as angles(t) with the time t [s]. It returns pitch and yaw, shape (2,) [rad], and
        must be smooth. Pitch is about the body's y axis, after the yaw rotation about the world's z
        axis.

    Returns
    -------
    callable
        Function of t that returns the rotation matrix, shape (3, 3), the angular velocity, shape
        (3,) [rad/s], and the angular acceleration, shape (3,) [rad/s²], all in the world frame.
    """
    as_callable("angles", angles, "angles(t)")

    def path(t: float) -> tuple[Array, Array, Array]:
        before, now, after = (
            as_array("the result of angles(t)", angles(t + shift), (2,), "rad")
            for shift in (-_DIFFERENCE_STEP, 0.0, _DIFFERENCE_STEP)
        )
        p1, y1 = (after - before) / (2.0 * _DIFFERENCE_STEP)
        p2, y2 = (after - 2.0 * now + before) / _DIFFERENCE_STEP**2
        R = pin.rpy.rpyToMatrix(0.0, now[0], now[1])
        yaw_axis, pitch_axis = np.array([0.0, 0.0, 1.0]), R[:, 1]  # the axes of yaw and of pitch
        acceleration = y2 * yaw_axis + p2 * pitch_axis + y1 * p1 * cross(yaw_axis, pitch_axis)
        return R, y1 * yaw_axis + p1 * pitch_axis, acceleration

    return path
