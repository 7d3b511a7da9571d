"""Warnings about robots that cannot stand: wrong units, upside down, motors too weak."""

from __future__ import annotations

import warnings

import numpy as np
import pinocchio as pin

from floatbase._validation import Array
from floatbase.errors import InputError, RobotWarning
from floatbase.qp import QP, solve
from floatbase.robots.robot import Foot, Robot
from floatbase.robots.state import State

# kg/m³, mass over the cube of the robot's size: robots have 10 to 200, and air has 1.2. In
# centimetres it is a millionth, and in inches a 60 000th.
_MIN_DENSITY = 0.01
# of the forces and moments that balance the robot, relative to the largest fraction of a torque
# limit; and of the forces themselves, which makes them unique
_BALANCE_WEIGHT, _FORCE_WEIGHT = 1e6, 1e-6
_TOLERANCE = 1e-2  # fraction of a torque limit by which the torques of the QP may be wrong


def warn_if_it_cannot_stand(robot: Robot) -> None:
    """Warn if a floating-base robot is in wrong units, upside down or too weak to stand.

    The warning points at the code that called the loading function.
    """
    if not robot.is_floating or not robot.weight:
        return
    posture = State(robot, robot.posture)
    message = (
        _units_message(robot, posture)
        or _upside_down_message(robot, posture)
        or _weak_motors_message(robot)
    )
    if message:
        warnings.warn(message, RobotWarning, stacklevel=3)


def _units_message(robot: Robot, posture: State) -> str:
    """Return a warning if the robot would be far lighter than air, else ""."""
    size = float(np.ptp([posture.point(frame) for frame in robot.frames], axis=0).max())
    if robot.mass >= _MIN_DENSITY * size**3:
        return ""
    return (
        f"{robot.name} is {size:.3g} m long and has only {robot.mass:.3g} kg. Its lengths are "
        f"probably in centimetres or millimetres. Write them in metres, also those of inertias, "
        f"and torques in N·m."
    )


def _upside_down_message(robot: Robot, posture: State) -> str:
    """Return a warning if the feet are above the centre of mass, or the base is turned over."""
    if robot.feet:
        feet = np.mean([posture.point(foot.frame, foot.middle) for foot in robot.feet], axis=0)
        soles = [posture.frame_pose(foot.frame) for foot in robot.feet if foot.is_flat]
        upright = feet[2] < posture.com[2] and all(sole.rotation[2, 2] > 0.0 for sole in soles)
    else:
        upright = posture.frame_pose("base").rotation[2, 2] > -0.5  # beyond 120° from upright
    if upright:
        return ""
    return (
        f"{robot.name} is upside down in its posture. If the posture begins with the position and "
        f"the quaternion of the base, the order of the quaternion must be x, y, z, w. MuJoCo's "
        f"order is w, x, y, z: an upright base is 0, 0, 0, 1 here, and 1, 0, 0, 0 there."
    )


def _weak_motors_message(robot: Robot) -> str:
    """Return a warning if no forces on the feet let the motors carry the robot, else ""."""
    try:
        state = robot.standing()
    except InputError:  # the feet do not all reach the ground; standing() says so
        return ""
    limited = np.isfinite(robot.torque_limits)
    if not robot.feet or not limited.any():
        return ""
    lift = robot.weight * np.vstack([_foot_jacobian(state, foot) for foot in robot.feet]).T
    normals = np.cumsum([0, *(6 if foot.is_flat else 3 for foot in robot.feet[:-1])]) + 2
    # x = (forces / weight, s): minimize s², where each torque is at most s times its limit
    n, limits = lift.shape[1], robot.torque_limits[limited]
    torque_map, gravity = lift[6:][limited] / limits[:, None], state.h[6:][limited] / limits
    balance, base = lift[:6] / robot.weight, state.h[:6] / robot.weight
    H, g = np.eye(n + 1), np.zeros(n + 1)
    H[:n, :n] = _BALANCE_WEIGHT * balance.T @ balance + _FORCE_WEIGHT * np.eye(n)
    g[:n] = -_BALANCE_WEIGHT * balance.T @ base
    ones = np.ones((len(limits), 1))
    G = np.block([[-torque_map, -ones], [torque_map, -ones]])
    G = np.vstack([G, -np.eye(n + 1)[normals]])  # the ground does not pull
    h = np.concatenate([-gravity, gravity, np.zeros(len(normals))])
    x = solve(QP(H, g, np.zeros((0, n + 1)), np.zeros(0), G, h)).x
    required = np.abs(gravity - torque_map @ x[:n]) * limits
    names = np.array(robot.joint_names)[limited]
    weak = [
        f"{name} needs {torque:.3g} and has {limit:.3g}"
        for name, torque, limit in zip(names, required, limits, strict=True)
        if torque > (1.0 + _TOLERANCE) * limit
    ]
    if not weak:
        return ""
    return (
        f"{robot.name} cannot stand: its motors are too weak to carry it on its feet (N·m or N): "
        f"{', '.join(weak)}. Check masses, lengths and the effort of the joints in the URDF, or "
        f"pass torque_limits."
    )


def _foot_jacobian(state: State, foot: Foot) -> Array:
    """Return the Jacobian of a ball's centre, shape (3, nv), or of a sole, shape (6, nv)."""
    J, R = state.frame_jacobian(foot.frame), state.frame_pose(foot.frame).rotation
    return J if foot.is_flat else np.asarray(J[:3] - pin.skew(R @ foot.centre) @ J[3:])
