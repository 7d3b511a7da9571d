"""Warnings about robots that cannot stand: wrong units, upside down, motors too weak."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from floatbase._validation import Array
from floatbase.errors import InputError
from floatbase.qp import QP, solve
from floatbase.robots._checks import joint_limits
from floatbase.robots._shapes import missing_meshes
from floatbase.robots._upright import is_upright
from floatbase.robots.feet import singular_legs
from floatbase.robots.robot import Foot, Robot
from floatbase.robots.state import State

# kg/m³, mass over the cube of the robot's size: robots have 10 to 200, and air has 1.2.
# With lengths in centimetres it would be a millionth, and in inches a 60 000th.
_MIN_DENSITY = 0.01
# of the forces and moments that balance the robot, relative to the largest fraction of a torque
# limit; and of the forces themselves, which makes them unique
_BALANCE_WEIGHT, _FORCE_WEIGHT = 1e6, 1e-6
_MANY_TURNS = 30.0  # rad: solo12 has 20, and hardly a joint turns by only 30 degrees
_TOLERANCE = 1e-2  # fraction of a torque limit by which the torques of the QP may be wrong


def problems(robot: Robot, given_feet: Sequence[str | Foot], may_bend: bool) -> list[str]:
    """Return warnings, or "", about a robot that cannot stand, or sinks if its base is fixed.

    Straight legs are reported if `may_bend`.
    """
    if not robot.is_floating:
        return [_weak_arm_message(robot)]
    posture = State(robot, robot.posture)
    return [
        _straight_legs_message(robot) if may_bend else "",
        _units_message(robot, posture)
        or _upside_down_message(robot, posture)
        or _weak_motors_message(robot),
        _points_message(robot, given_feet),
        _degrees_message(robot),
    ]


def _straight_legs_message(robot: Robot) -> str:
    """Return a warning if legs are straight in the posture chosen for a robot, else ""."""
    straight = singular_legs(robot)
    if not straight:
        return ""
    return (
        f"The legs of {robot.name} with the feet {', '.join(straight)} are singular in its default "
        f"posture, for example straight. They cannot move their feet in all directions. Pass a "
        f'posture with bent legs, such as posture={{"name of a knee": 0.6}}, or the positions of '
        f"all joints."
    )


def _degrees_message(robot: Robot) -> str:
    """Return a warning if most joints can turn so far that their limits are in degrees, else ""."""
    _, _, lower, upper = joint_limits(robot.model)
    if not _MANY_TURNS < np.median(np.append(upper - lower, 0.0)) < 2 * 360:
        return ""
    return (
        f"Most joints of {robot.name} can turn by many turns. Their limits are probably in "
        f"degrees. Write them in radians, and check the velocities."
    )


def passive_joints_message(robot: Robot) -> str:
    """Return a warning if only some joints have a torque limit: the others may have no motor."""
    unlimited = np.array(robot.joint_names)[np.isinf(robot.torque_limits)].tolist()
    if not 0 < len(unlimited) < robot.d:
        return ""
    return (
        f"The URDF of {robot.name} gives no effort, or effort=0, for {', '.join(unlimited)}. "
        f"Their motors have no torque limits. If these joints are passive, for example in a "
        f"closed loop, lock them with locked=[…]. Otherwise, pass torque_limits."
    )


def missing_meshes_message(robot: Robot) -> str:
    """Return a warning if mesh files do not exist, else ""."""
    missing = missing_meshes(robot.urdf, robot.package_dirs)
    if not missing:
        return ""
    more = f" (and {len(missing) - 1} more)" if len(missing) > 1 else ""
    return (
        f"The mesh file {missing[0]!r}{more} of {robot.name} does not exist. Links "
        f"without their meshes are drawn as other shapes or boxes. Pass the folder that contains "
        f"the meshes or their package, as in package_dirs=[…]."
    )


def _points_message(robot: Robot, given_feet: Sequence[str | Foot]) -> str:
    """Return a warning if a robot touches the ground at one or two points not given as `Foot`."""
    is_chosen = any(isinstance(foot, Foot) for foot in given_feet)
    if is_chosen or any(foot.is_flat for foot in robot.feet) or not 1 <= len(robot.feet) <= 2:
        return ""
    names = [foot.frame for foot in robot.feet]
    advice = (
        f"If it has soles, pass their corners, as in "
        f"feet=[floatbase.robots.Foot({names[0]!r}, corners=[…]), …]."
        if robot.feet[0].axis is None
        else "Its wheels must move to balance it, and floatbase has no task for this."
    )
    return (
        f"{robot.name} cannot stand still on points: it touches the ground only at "
        f"{' and '.join(names)}. {advice}"
    )


def _weak_arm_message(robot: Robot) -> str:
    """Return a warning if the motors of a fixed-base robot cannot hold its posture, else ""."""
    torques = np.abs(State(robot, robot.posture).h)
    weak = _too_weak(robot, torques, robot.torque_limits)
    if not weak:
        return ""
    return (
        f"{robot.name} will sink: its motors are too weak to hold its posture against "
        f"gravity (N·m or N): {weak}."
    )


def _too_weak(robot: Robot, required: Array, tolerated: Array) -> str:
    """Return which joints need more torque than is tolerated, with the limits of their motors."""
    rows = zip(robot.joint_names, required, robot.torque_limits, tolerated, strict=True)
    return ", ".join(
        f"{joint} needs {torque:.3g} and has {limit:.3g}"
        for joint, torque, limit, most in rows
        if torque > most
    )


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
    if is_upright(posture):
        return ""
    return (
        f"{robot.name} is upside down in its posture, or its feet are not below its centre of "
        f"mass. If the posture begins with the position and the quaternion of the base, the order "
        f"of the quaternion must be x, y, z, w. MuJoCo's order is w, x, y, z: an upright base is "
        f"0, 0, 0, 1 here, and 1, 0, 0, 0 there."
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
    required = np.zeros(robot.d)
    required[limited] = np.abs(gravity - torque_map @ x[:n]) * limits
    weak = _too_weak(robot, required, (1.0 + _TOLERANCE) * robot.torque_limits)
    if not weak:
        return ""
    return (
        f"{robot.name} cannot stand: its motors are too weak to carry it on its feet (N·m or N): "
        f"{weak}. Check masses, lengths and the torque limits of the joints in the file, or "
        f"pass torque_limits."
    )


def _foot_jacobian(state: State, foot: Foot) -> Array:
    """Return the Jacobian of a ball's centre, shape (3, nv), or of a sole, shape (6, nv)."""
    J, R = state.frame_jacobian(foot.frame), state.frame_pose(foot.frame).rotation
    return J if foot.is_flat else np.asarray(J[:3] - pin.skew(R @ foot.centre) @ J[3:])
