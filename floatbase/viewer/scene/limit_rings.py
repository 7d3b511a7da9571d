"""Rings around the axes of joints that are near a position limit, or whose limit is active."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from floatbase.control import JointLimits
from floatbase.robots import Robot, State
from floatbase.viewer.scene import geometry, unit_shapes
from floatbase.viewer.scene.colours import ALARM, WARNING
from floatbase.viewer.scene.shapes import Item, Picture, path_part, transform

NEAR = 0.05  # fraction of its range within which a joint is near a limit
_RADIUS = 0.075  # fraction of the robot's size


def limit_rings(
    state: State, limits: JointLimits, qdd: npt.ArrayLike | None, size: float
) -> Picture:
    """Draw a ring at each joint that is near a position limit, or whose limit is active."""
    robot = state.robot
    near = limits.near(state, NEAR)
    active = np.zeros_like(near) if qdd is None else limits.reached(state, qdd)
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
def _axis_frames(robot: Robot) -> list[npt.NDArray[np.float64]]:
    """Return, for each joint, a rotation in the joint's frame whose z axis is the joint's axis."""
    frames = []
    for joint in list(robot.model.joints)[robot.model.njoints - robot.d :]:
        # translation along and rotation about the axis, of which one is zero
        parts = np.asarray(joint.createData().S).reshape(2, 3)
        frames.append(geometry.rotation_with_z_axis(parts.sum(axis=0)))
    return frames
