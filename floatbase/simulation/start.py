"""The initial state of a simulation: the robot stands on the ground with all feet."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from floatbase._validation import Array
from floatbase.dynamics import UP
from floatbase.robots import Robot, State
from floatbase.simulation.ground import Ground

_ROUNDING = 1e-9  # m: a foot on the ground may be this far below it


def standing_on(robot: Robot, ground: Ground) -> State:
    """Return the robot standing on the ground with all feet touching."""
    planes: dict[str, Any] = {"normal": ground.normals, "offset": ground.offsets}
    is_biped, is_single_plane = len(robot.feet) <= 2, len(ground.normals) == 1
    if not is_single_plane:
        state = robot.standing(**planes)
    elif robot.is_floating and is_biped and ground.normals[0, 2] < 1.0:
        state = robot.standing(normal=ground.normals[0], balanced=True)
        if robot.feet:  # where the tilted robot would have its feet
            tilted = _tilted_state(robot, ground)
            shift = np.mean(_foot_middles(tilted) - _foot_middles(state), axis=0)
            state = state.replace(q=np.concatenate([state.q[:3] + shift, state.q[3:]]))
    else:
        state = _tilted_state(robot, ground)
    if robot.is_floating and robot.feet and ground.boxes:
        middles = _foot_middles(state)
        clearances = middles[:, 2] - ground.height(middles[:, :2])
        if np.any(clearances < np.array([foot.radius for foot in robot.feet]) - _ROUNDING):
            return robot.standing(**planes, surface=ground.height, balanced=is_biped)
    return state


def _tilted_state(robot: Robot, ground: Ground) -> State:
    """Return the level standing state, tilted with the only plane of the ground."""
    state = robot.standing()
    if not robot.is_floating:
        return state
    normal, offset = ground.normals[0], ground.offsets[0]
    rotation = pin.Quaternion.FromTwoVectors(np.array(UP), np.array(normal))
    orientation = (rotation * pin.Quaternion(*state.q[[6, 3, 4, 5]])).normalized()
    position = rotation.matrix() @ state.q[:3] + offset * normal
    return state.replace(q=np.concatenate([position, orientation.coeffs(), state.q[7:]]))


def _foot_middles(state: State) -> Array:
    """Return the middle of each foot's sole or ball, shape (feet, 3), world frame [m]."""
    return np.array([state.point(foot.frame, foot.middle) for foot in state.robot.feet])
