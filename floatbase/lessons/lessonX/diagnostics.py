"""Lesson X: what a record of sensors says about motors and ground."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array, cross
from floatbase.lessons.lessonX.black_box import BlackBox

_MIN_LOAD = 5.0  # N: smallest contact force of a foot that counts as loaded
# m/s of a contact point; feet that do not slip creep more slowly, since contacts are soft
_MIN_SLIP_SPEED = 0.3


def accelerations(box: BlackBox) -> Array:
    """Return the acceleration q̈ in each control step except the last: the change of v over time."""
    return np.asarray(np.diff(box.v, axis=0) / np.diff(box.time)[:, None])


def required_forces(box: BlackBox) -> Array:
    """Return M q̈ + h - Jᵀ λ with the measured q̈ and λ: what else must have acted on the robot."""
    found = []
    for i, qdd in enumerate(accelerations(box)):
        eom = box.equations(i)
        found.append(eom.M @ qdd + eom.h - eom.J.T @ box.measured[i])
    return np.array(found)


def lagged(orders: npt.ArrayLike, period: float, ms: float) -> Array:
    """Return commands after a first-order lag that starts with the first command.

    Parameters
    ----------
    orders : array_like, shape (n, d)
        The commands.
    period : float
        Time between two rows [s].
    ms : float
        Time constant [ms].

    Returns
    -------
    ndarray, shape (n, d)
        The lagged commands.
    """
    given = np.asarray(orders, dtype=np.float64)
    out, share = np.array(given), -np.expm1(-period / (1e-3 * ms)) if ms > 0 else 1.0
    for i in range(1, len(out)):
        out[i] = out[i - 1] + share * (given[i] - out[i - 1])
    return out


def foot_centres(box: BlackBox, i: int | np.integer[Any]) -> Array:
    """Return the centres of the spherical feet in row i."""
    state = box.state(i)
    return np.array([state.point(foot.frame, foot.centre) for foot in box.robot.feet])


def ground_normal(box: BlackBox) -> Array:
    """Return the normal of the plane through the feet."""
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
    """Return `|λt| / λn` of each foot in each row in which it is loaded and slides.

    Every second row is examined.

    Parameters
    ----------
    box : BlackBox
        The record.
    normal : array_like, shape (3,)
        Normal of the ground in the world frame.

    Returns
    -------
    ndarray, shape (m,)
        The ratios [-].
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
