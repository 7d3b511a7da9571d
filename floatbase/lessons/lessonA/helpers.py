"""Lesson A: a figure of eight for an arm, errors of its tool, and a base that circles."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import floatbase as fb
from floatbase._geometry import minimum_jerk
from floatbase._validation import Array
from floatbase.behaviours import pitch_and_yaw
from floatbase.simulation import Rollout

# rad: amplitudes of ur5's joints on the figure of eight
SWING_AMPLITUDE = np.array([0.5, 0.35, -0.5, 0.0, 0.0, 0.0])
SWINGS_PER_PERIOD = np.array([1.0, 2.0, 2.0, 0.0, 0.0, 0.0])  # swings of each joint in one period
TRANSIENT_FRACTION = 1.0 / 3.0  # of a record: errors before that do not count
FULL_TURN = 2.0 * np.pi  # rad

Trajectory = Callable[[float], tuple[Array, Array, Array]]


def figure_of_eight(home: fb.State, period: float) -> Trajectory:
    """Return the joint motion with which the tool of ur5 draws a figure of eight.

    Parameters
    ----------
    home : State
        State at the centre of the figure.
    period : float
        Duration of one figure [s].

    Returns
    -------
    callable
        Function of time [s] that returns joint positions [rad], velocities [rad/s] and
        accelerations [rad/s²], each of shape (6,).
    """
    w = FULL_TURN * SWINGS_PER_PERIOD / period

    def path(t: float) -> tuple[Array, Array, Array]:
        swing = SWING_AMPLITUDE * np.sin(w * t)
        return home.q + swing, SWING_AMPLITUDE * w * np.cos(w * t), -(w**2) * swing

    return path


def tool_error(record: Rollout, path: Trajectory) -> float:
    """Return the root mean square distance of the tool from its path.

    The first third of the record does not count.

    Parameters
    ----------
    record : Rollout
        The record.
    path : callable
        The desired motion, from `figure_of_eight`.

    Returns
    -------
    float
        The distance [mm].
    """
    rows = range(round(TRANSIENT_FRACTION * len(record)), len(record), 5)
    wanted = [fb.State(record.robot, path(record.time[i])[0]).point("tool0") for i in rows]
    off = np.array([record.state(i).point("tool0") for i in rows]) - wanted
    return float(1000.0 * np.sqrt(np.mean(np.sum(off**2, axis=1))))


def elliptic_rotation(
    pitch: float, yaw: float, rate: float, loops: int, phase: float = 90.0
) -> Trajectory:
    """Return base orientations that follow an ellipse in pitch and yaw, for `OrientationTask`.

    The ellipse grows from nothing in the first loop and shrinks to nothing in the last.

    Parameters
    ----------
    pitch, yaw : float
        Half the widths of the ellipse [rad].
    rate : float
        Loops per second [1/s].
    loops : int
        Number of loops.
    phase : float, optional
        Phase between pitch and yaw [°]; at 0 the ellipse becomes a line.

    Returns
    -------
    callable
        Function of time [s] that returns the rotation matrix, shape (3, 3), the angular velocity
        [rad/s] and the angular acceleration [rad/s²], both of shape (3,) in the world frame.
    """
    total, shift = loops / rate, np.deg2rad(phase)

    def angles(t: float) -> Array:
        size = minimum_jerk(rate * min(t, total - t))[0]
        return np.asarray(
            size
            * np.array(
                [pitch * np.sin(FULL_TURN * rate * t), yaw * np.sin(FULL_TURN * rate * t + shift)]
            )
        )

    return pitch_and_yaw(angles)
