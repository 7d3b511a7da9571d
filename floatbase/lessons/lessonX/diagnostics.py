"""Lesson X, The crash investigation: what a record of sensors alone says of motors and ground."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array, cross
from floatbase.lessons.lessonX.black_box import BlackBox

_MIN_LOAD = 5.0  # N of a foot that bears on the ground
# m/s of a contact point: the soft contacts of the physics let feet that hold creep by less
_MIN_SLIP_SPEED = 0.3


def accelerations(box: BlackBox) -> Array:
    """The q̈ of each tick but the last, (n - 1, nv): by how much v has changed in it."""
    return np.asarray(np.diff(box.v, axis=0) / np.diff(box.time)[:, None])


def required_forces(box: BlackBox) -> Array:
    """(7) M q̈ + h - Jᵀ λ with q̈ and λ as they were, (n - 1, nv): what else must have acted.

    In the last d columns these are the torques of the motors, N·m. In the first six, N and N·m in
    the base frame, it is zero as long as nobody touches the robot.
    """
    found = []
    for i, qdd in enumerate(accelerations(box)):
        eom = box.equations(i)
        found.append(eom.M @ qdd + eom.h - eom.J.T @ box.measured[i])
    return np.array(found)


def lagged(orders: npt.ArrayLike, period: float, ms: float) -> Array:
    """Orders, (n, d), after a first-order lag that begins with the first of them.

    period: s, of a row. ms: its time constant.
    """
    given = np.asarray(orders, dtype=np.float64)
    out, share = np.array(given), -np.expm1(-period / (1e-3 * ms)) if ms > 0 else 1.0
    for i in range(1, len(out)):
        out[i] = out[i - 1] + share * (given[i] - out[i - 1])
    return out


def foot_centres(box: BlackBox, i: int | np.integer[Any]) -> Array:
    """The centres of the balls at the feet at row i, (4, 3) m: one radius above the ground,
    whatever its normal.
    """
    state = box.state(i)
    return np.array([state.point(foot.frame, foot.centre) for foot in box.robot.feet])


def ground_normal(box: BlackBox) -> Array:
    """The normal of the plane in which the feet stand, (3,): the mean over the rows in the first
    0.1 s where all four bear.

    Where a foot lifts at once, of the first row.
    """
    rows = np.flatnonzero(box.time - box.time[0] < 0.1)
    bears = [
        i for i in rows if np.linalg.norm(box.measured[i].reshape(-1, 3), axis=1).min() > _MIN_LOAD
    ]
    found = []
    for i in bears or rows[:1]:
        places = foot_centres(box, i)
        normal = np.linalg.svd(places - places.mean(axis=0))[2][2]
        found.append(normal * np.sign(normal[2]))
    mean = np.mean(found, axis=0)
    return np.asarray(mean / np.linalg.norm(mean))


def sliding_friction_ratios(box: BlackBox, normal: npt.ArrayLike) -> Array:
    """|λt| / λn of each foot in each row in which it bears and slides, (m,). normal: of the ground,
    (3,).
    """
    n, ratios = np.asarray(normal), []
    for i in range(0, len(box), 2):
        state = box.state(i)
        for foot, force in zip(box.robot.feet, box.measured[i].reshape(-1, 3), strict=True):
            velocity, pressed = state.frame_velocity(foot.frame), force @ n
            arm = state.frame_pose(foot.frame).rotation @ foot.centre - foot.radius * n
            slip = velocity[:3] + cross(velocity[3:], arm)
            if pressed > _MIN_LOAD and np.linalg.norm(slip - (slip @ n) * n) > _MIN_SLIP_SPEED:
                ratios.append(np.linalg.norm(force - pressed * n) / pressed)
    return np.array(ratios)
