"""Detection of robots that are upside down, often because of a quaternion in another order."""

from __future__ import annotations

import numpy as np

from floatbase.robots.state import State

# cosines of a base's tilt: at 30°, a robot may stand, and beyond 60° no controller keeps it up
_UPRIGHT, _TILTED = 0.87, 0.5


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
    robot = state.robot
    if not robot.is_floating:
        return ""
    upright = robot.standing().frame_pose("base").rotation[2]  # the vertical in the base's axes
    rearranged = np.concatenate([state.q[:3], state.q[[4, 5, 6, 3]], state.q[7:]])
    cosines = [
        float(upright @ each.frame_pose("base").rotation[2])
        for each in (state, state.replace(q=rearranged))
    ]
    is_rearranged = cosines[0] < _TILTED < _UPRIGHT < cosines[1]
    if is_upright(state) and not is_rearranged:
        return ""
    return (
        "The robot is upside down or on its side. Is its quaternion in the order w x y z, as in "
        "MuJoCo? The order in q is x y z w; floatbase.simulation.MujocoAdapter converts states. "
        "Are the joints in the order of robot.joint_names?"
    )
