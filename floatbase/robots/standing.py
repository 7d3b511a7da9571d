"""Standing states: every foot is on the ground, found by minimum-norm steps."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._validation import Array, as_array, as_bool, as_callable, as_half_spaces
from floatbase.errors import InputError
from floatbase.linear_algebra import RANK_TOLERANCE
from floatbase.robots._checks import joint_limits
from floatbase.robots.robot import Foot, Robot
from floatbase.robots.state import State

_TOLERANCE = 1e-11  # m and rad: about a hundred rounding errors for a robot of 1 m
_MAX_ERROR = 1e-6  # m and rad: of a robot without joints that could correct rounded lengths
_MAX_STEPS = 50  # the catalogue's robots take five
_UP = (0.0, 0.0, 1.0)  # normal of the ground
_LEAST_RISE = 1e-9  # m: a surface that is higher above the planes by less is the plane, rounded
_MIN_VERTICAL = 1e-6  # smallest vertical component of the normal of a plane that has a height
_LARGEST_STEP = 0.2  # m and rad: the Jacobian of Gauss-Newton is accurate over this distance

# normals, shape (n, 3), and offsets, shape (n,), m: normal · x = offset
_Planes: TypeAlias = tuple[Array, Array]


def find_standing_state(
    robot: Robot,
    height: float | None = None,
    normal: npt.ArrayLike | None = None,
    offset: npt.ArrayLike | None = None,
    surface: Callable[[Array], float] | None = None,
    balanced: bool = False,
) -> State:
    """Find the standing state at rest nearest to `robot.posture`; see `Robot.standing`."""
    posture = State(robot, robot.posture)
    normals, offsets = _UP if normal is None else normal, 0.0 if offset is None else offset
    planes = as_half_spaces("the ground", normals, offsets)
    height = None if height is None else float(as_array("height", height, (), "m"))
    if surface is not None:
        as_callable("surface", surface, "surface(xy)")
    if not robot.is_floating or not robot.feet:
        return posture
    q = posture.q.copy()
    q[2] = (
        height
        if height is not None
        else q[2] - min(_clearance(posture, foot, planes, surface)[0] for foot in robot.feet)
    )
    com_offset = _com_offset(robot.standing()) if as_bool("balanced", balanced) else None
    state, (joints, index, lower, upper) = State(robot, q), joint_limits(robot.model)
    v_index = np.array(robot.model.idx_vs)[joints]
    for _ in range(_MAX_STEPS):
        error, J = _standing_residual(state, posture, height, planes, surface, com_offset)
        remaining = np.max(np.abs(error))
        if remaining < _TOLERANCE:
            return state
        at_limit = np.zeros(len(joints), dtype=bool)  # joints at a limit that the step would exceed
        while True:
            step = -np.linalg.pinv(J, rcond=RANK_TOLERANCE) @ error
            newly_at_limit = ~at_limit & (
                (state.q[index] <= lower) & (step[v_index] < 0.0)
                | (state.q[index] >= upper) & (step[v_index] > 0.0)
            )
            if not np.any(newly_at_limit):
                break
            at_limit |= newly_at_limit
            J[:, v_index[at_limit]] = 0.0
        q = pin.integrate(robot.model, state.q, np.clip(step, -_LARGEST_STEP, _LARGEST_STEP))
        q[index] = np.clip(q[index], lower, upper)
        state = State(robot, q)
    if remaining < _MAX_ERROR:
        return state
    height_text = "" if height is None else f" with its base at height {height:g} m"
    limited = [
        f"{robot.model.names[joint]} at {x:.3g}"
        for joint, x in zip(joints[at_limit].tolist(), state.q[index[at_limit]], strict=True)
    ]
    reason = f", with these joints at their limits: {', '.join(limited)}" if limited else ""
    advice = "Choose another height or ground, or load the robot with another posture."
    raise InputError(
        f"{robot.name} cannot put all its feet on the ground{height_text}: an error of "
        f"{remaining:.2g} m remains{reason}. {advice}"
    )


def _standing_residual(
    state: State,
    posture: State,
    height: float | None,
    planes: _Planes,
    surface: Callable[[Array], float] | None,
    com_offset: Array | None,
) -> tuple[Array, Array]:
    """Return the residual that is zero when the robot stands, and its Jacobian.

    Soles touch the ground and are parallel to it. The base has the orientation of the posture, and
    either the base has the horizontal position of the posture or the CoM has a given offset from
    the feet, shape (2,) [m]. The height of the base follows from the feet or is given.
    """
    errors, rows, middles = [], [], []
    for foot in state.robot.feet:
        clearance, n = _clearance(state, foot, planes, surface)
        errors.append(clearance)
        R, J = state.frame_pose(foot.frame).rotation, state.frame_jacobian(foot.frame)
        J_middle = J[:3] - pin.skew(R @ foot.middle) @ J[3:]
        middles.append(J_middle[:2])
        rows.append(n @ J_middle)
        if foot.is_flat:
            errors += [*np.cross(n, R[:, 2])]
            rows += [*(-pin.skew(n) @ pin.skew(R[:, 2]) @ J[3:])]  # d(up)/dt = ω × up
    R, J_base = state.frame_pose("base").rotation, np.eye(6, state.robot.nv)
    errors += [*pin.log3(posture.frame_pose("base").rotation.T @ R)]
    rows += [*J_base[3:]]
    if com_offset is None:
        errors += [*(state.q[:2] - posture.q[:2])]
        rows += [*(R @ J_base[:3])[:2]]
    else:
        errors += [*(_com_offset(state) - com_offset)]
        rows += [*(state.com_jacobian[:2] - np.mean(middles, axis=0))]
    if height is not None:
        errors.append(state.q[2] - height)
        rows.append((R @ J_base[:3])[2])
    return np.array(errors), np.array(rows)


def _com_offset(state: State) -> Array:
    """Return the horizontal position of the CoM relative to the middle of the feet, (2,) [m]."""
    feet = [state.point(foot.frame, foot.middle) for foot in state.robot.feet]
    offset: Array = (state.com - np.mean(feet, axis=0))[:2]
    return offset


def _clearance(
    state: State, foot: Foot, planes: _Planes, surface: Callable[[Array], float] | None
) -> tuple[float, Array]:
    """Return the clearance of a foot above the ground [m], and the normal of the ground there.

    The clearance is the distance of the foot's lowest point from the nearest plane, or its height
    above the highest box below the foot, negative below it. The normal has shape (3,).
    """
    normals, offsets = planes
    middle = state.point(foot.frame, foot.middle)
    distances = normals @ middle - offsets
    nearest = int(np.argmin(distances))
    R = state.frame_pose(foot.frame).rotation
    if surface is not None:
        under = [state.point(foot.frame, point)[:2] for point in (foot.middle, *foot.points)]
        tops = [
            top for xy in under if (top := surface(xy)) > _plane_height(xy, planes) + _LEAST_RISE
        ]
        above_surface = middle[2] - max(tops, default=-np.inf)
        if above_surface < distances[nearest]:
            up = np.array(_UP)
            return float(above_surface - foot.depth(R, up)), up
    return float(distances[nearest] - foot.depth(R, normals[nearest])), normals[nearest]


def _plane_height(xy: Array, planes: _Planes) -> float:
    """Return the height of the highest plane at a horizontal position, shape (2,) [m]."""
    normals, offsets = planes
    upward = normals[:, 2] > _MIN_VERTICAL
    heights = (offsets - normals[:, :2] @ xy)[upward] / normals[upward, 2]
    return float(np.max(heights, initial=-np.inf))
