"""Rings around the axes of joints that are near a position limit, or whose limit is active."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array
from floatbase.control.joint_limits import JointLimits, joint_positions
from floatbase.robots import Robot, State
from floatbase.viewer.scene import geometry, unit_shapes
from floatbase.viewer.scene.colours import ALARM, WARNING
from floatbase.viewer.scene.shapes import Item, Picture, path_part, transform

NEAR = 0.05  # fraction of its range within which a joint is near a limit
# difference between a planned acceleration and its bound at which the limit is active, as a
# fraction of 1 rad/s² plus the acceleration: rounding errors of the QP are smaller
_TOLERANCE = 1e-6
_RADIUS = 0.075  # fraction of the robot's size


def limit_rings(state: State, limits: JointLimits, qdd: Array | None, size: float) -> Picture:
    """Draw a ring at each joint that is near a position limit, or whose limit is active.

    Parameters
    ----------
    state : State
        State of the robot.
    limits : JointLimits
        Limits of its joints.
    qdd : ndarray, shape (nv,), or None
        Accelerations that the controller planned in this state [rad/s² or m/s²]. A limit is active
        if a joint's acceleration is at its bound. None for no plan.
    size : float
        Size of the robot [m].

    Returns
    -------
    Picture
        Rings below the paths "active_limit" and "near_limit".
    """
    robot = state.robot
    first = robot.nv - robot.d
    q, (low, high) = joint_positions(robot, state.q), _near_positions(limits)
    near = (q < low) | (q > high)
    active = np.zeros(robot.d, dtype=bool)
    if qdd is not None:
        least, largest = limits.bounds(q, state.v[first:])
        planned = qdd[first:]
        tolerance = _TOLERANCE * (1.0 + np.abs(planned))
        active = (planned >= largest - tolerance) | (planned <= least + tolerance)
    picture: Picture = {}
    for i in np.flatnonzero(near | active).tolist():
        joint = robot.model.njoints - robot.d + i
        pose = state.joint_transforms[joint]
        kind, colour = ("active_limit", ALARM) if active[i] else ("near_limit", WARNING)
        picture[f"{kind}/{path_part(robot.joint_names[i])}"] = Item(
            unit_shapes.ring(colour, thick=bool(active[i])),
            transform(pose[:3, 3], pose[:3, :3] @ _axis_frames(robot)[i], _RADIUS * size),
        )
    return picture


@lru_cache(maxsize=64)
def _near_positions(limits: JointLimits) -> tuple[Array, Array]:
    """Return the positions below and above which joints are near a limit, (d,) each [rad or m].

    A joint that has only one position limit, or none, has no range and is never near a limit.
    """
    span = limits.upper - limits.lower
    margin = np.where(np.isfinite(span), NEAR * span, -np.inf)
    return limits.lower + margin, limits.upper - margin


@lru_cache(maxsize=64)
def _axis_frames(robot: Robot) -> list[npt.NDArray[np.float64]]:
    """Return, for each joint, a rotation in the joint's frame whose z axis is the joint's axis."""
    frames = []
    for joint in list(robot.model.joints)[robot.model.njoints - robot.d :]:
        # translation along and rotation about the axis, of which one is zero
        parts = np.asarray(joint.createData().S).reshape(2, 3)
        frames.append(geometry.rotation_with_z_axis(parts.sum(axis=0)))
    return frames
