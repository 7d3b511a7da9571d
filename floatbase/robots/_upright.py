"""Detection of robots that are upside down, often because of a quaternion in another order."""

from __future__ import annotations

import numpy as np

from floatbase.robots.state import State

_MIN_COSINE = 0.5  # of a base's tilt: beyond 60°, no controller keeps a robot up


def is_upright(state: State) -> bool:
    """Return whether the feet are below the centre of mass, and their soles face down."""
    feet = state.robot.feet
    if not feet:
        return bool(state.frame_pose("base").rotation[2, 2] > -0.5)  # beyond 120° from upright
    middle = np.mean([state.point(foot.frame, foot.middle) for foot in feet], axis=0)
    soles = [state.frame_pose(foot.frame) for foot in feet if foot.is_flat]
    return bool(middle[2] < state.com[2] and all(sole.rotation[2, 2] > 0.0 for sole in soles))


def pose_question(state: State) -> str:
    """Return a question for the message of a controller that fails upside down, else ""."""
    if not state.robot.is_floating:
        return ""
    # the vertical in the axes of the base
    upright, vertical = (
        each.frame_pose("base").rotation[2] for each in (state.robot.standing(), state)
    )
    if upright @ vertical > _MIN_COSINE and is_upright(state):
        return ""
    return (
        "The robot is upside down or on its side. Is its quaternion in the order w x y z, as in "
        "MuJoCo? The order in q is x y z w; floatbase.simulation.MujocoAdapter converts states. "
        "Are the joints in the order of robot.joint_names?"
    )
