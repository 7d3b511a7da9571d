"""Lesson A, Fictitious forces: a figure of eight for an arm, a base that circles, and how far balls
have rolled.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import floatbase as fb
from floatbase._geometry import minimum_jerk
from floatbase._validation import Array
from floatbase.behaviours import pitch_and_yaw
from floatbase.simulation import Rollout

SWING_AMPLITUDE = np.array(
    [0.5, 0.35, -0.5, 0.0, 0.0, 0.0]
)  # rad: how far ur5's joints swing on the figure of eight
SWINGS_PER_PERIOD = np.array([1.0, 2.0, 2.0, 0.0, 0.0, 0.0])  # swings of each joint in one period
TRANSIENT_FRACTION = 1.0 / 3.0  # of a record: what comes before does not count as an error
FULL_TURN = 2.0 * np.pi  # rad

Trajectory = Callable[[float], tuple[Array, Array, Array]]


def figure_of_eight(home: fb.State, period: float) -> Trajectory:
    """Joint positions, velocities and accelerations as functions of t, each (6,), with which ur5's
    tool draws an eight.

    period: s, of one eight.
    """
    w = FULL_TURN * SWINGS_PER_PERIOD / period

    def path(t: float) -> tuple[Array, Array, Array]:
        swing = SWING_AMPLITUDE * np.sin(w * t)
        return home.q + swing, SWING_AMPLITUDE * w * np.cos(w * t), -(w**2) * swing

    return path


def tool_error(record: Rollout, path: Trajectory) -> float:
    """Root mean square of the tool's distance from where the path has it, mm, after the first third
    of a record.
    """
    rows = range(round(TRANSIENT_FRACTION * len(record)), len(record), 5)
    wanted = [fb.State(record.robot, path(record.time[i])[0]).point("tool0") for i in rows]
    off = np.array([record.state(i).point("tool0") for i in rows]) - wanted
    return float(1000.0 * np.sqrt(np.mean(np.sum(off**2, axis=1))))


def elliptic_rotation(
    pitch: float, yaw: float, rate: float, loops: int, phase: float = 90.0
) -> Trajectory:
    """Base orientations that describe an ellipse in pitch and yaw `loops` times, as
    `OrientationTask` takes them.

    The ellipse grows from nothing in the first loop and shrinks to nothing in the last. Returns R
    (3, 3), angular velocity and acceleration, rad/s and rad/s², world, as a function of t.

    pitch, yaw: rad, half the widths of the ellipse. rate: loops for each second.
    phase: degrees between the two; 0 makes a line of the ellipse, to and fro.
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
