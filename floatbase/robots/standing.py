"""A standing state: every foot on the ground, found by steps of smallest size."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._arrays import Array, checked, half_spaces
from floatbase.errors import InputError
from floatbase.linear_algebra import RANK_TOLERANCE
from floatbase.robots.robot import Foot, Robot, joint_limits
from floatbase.robots.state import State

_TOLERANCE = 1e-11  # m and rad: a hundred roundings of a robot of 1 m
_STEPS = 50  # the catalogue's robots take five
_LEVEL = (0.0, 0.0, 1.0)  # normal of the ground
_LARGEST_STEP = 0.2  # m and rad: Gauss-Newton's Jacobian is good that far

_Planes: TypeAlias = tuple[Array, Array]  # normals, shape (n, 3), and offsets, shape (n,), m: normal · x = offset


def stand(
    robot: Robot, height: float | None = None, normal: npt.ArrayLike | None = None, offset: npt.ArrayLike | None = None
) -> State:
    """The standing state nearest to `robot.posture`, at rest; see `Robot.standing`."""
    posture = State(robot, robot.posture)
    upwards, through = _LEVEL if normal is None else normal, 0.0 if offset is None else offset
    planes = half_spaces("the ground", upwards, through)
    height = None if height is None else float(checked("height", height, (), "m"))
    if not robot.is_floating or not robot.feet:
        return posture
    q = posture.q.copy()
    q[2] = height if height is not None else q[2] - min(_clearance(posture, foot, planes)[0] for foot in robot.feet)
    state, (joints, at, low, high) = State(robot, q), joint_limits(robot.model)
    in_v = np.array(robot.model.idx_vs)[joints]
    for _ in range(_STEPS):
        error, J = _gap(state, posture, height, planes)
        remains = np.max(np.abs(error))
        if remains < _TOLERANCE:
            return state
        held = np.zeros(len(joints), dtype=bool)  # joints at a limit that the step would take beyond it
        while True:
            step = -np.linalg.pinv(J, rcond=RANK_TOLERANCE) @ error
            more = ~held & ((state.q[at] <= low) & (step[in_v] < 0.0) | (state.q[at] >= high) & (step[in_v] > 0.0))
            if not np.any(more):
                break
            held |= more
            J[:, in_v[held]] = 0.0
        q = pin.integrate(robot.model, state.q, np.clip(step, -_LARGEST_STEP, _LARGEST_STEP))
        q[at] = np.clip(q[at], low, high)
        state = State(robot, q)
    where = "" if height is None else f" with its base {height:g} m above it"
    ends = [f"{robot.model.names[joint]} at {x:.3g}" for joint, x in zip(joints[held].tolist(), state.q[at[held]], strict=True)]
    reason = f", with joints at their limits: {', '.join(ends)}" if ends else ""
    advice = "Ask for another height, or load it with another posture."
    raise InputError(f"{robot.name} cannot put all its feet on the ground{where}: {remains:.2g} m remain{reason}. {advice}")


def _gap(state: State, posture: State, height: float | None, planes: _Planes) -> tuple[Array, Array]:
    """What must be zero when the robot stands, and its Jacobian.

    Soles on the ground and along it; the base where the posture has it, but for its height, which follows the feet or is given.
    """
    errors, rows = [], []
    for foot in state.robot.feet:
        clearance, n = _clearance(state, foot, planes)
        errors.append(clearance)
        R, J = state.frame_pose(foot.frame).rotation, state.frame_jacobian(foot.frame)
        rows.append(n @ (J[:3] - pin.skew(R @ foot.middle) @ J[3:]))
        if foot.is_flat:
            errors += [*np.cross(n, R[:, 2])]
            rows += [*(-pin.skew(n) @ pin.skew(R[:, 2]) @ J[3:])]  # d(up)/dt = ω × up
    R, J_base = state.frame_pose("base").rotation, np.eye(6, state.robot.nv)
    target = posture.q[:2] if height is None else [*posture.q[:2], height]
    errors += [*pin.log3(posture.frame_pose("base").rotation.T @ R), *(state.q[: len(target)] - target)]
    rows += [*J_base[3:], *(R @ J_base[:3])[: len(target)]]
    return np.array(errors), np.array(rows)


def _clearance(state: State, foot: Foot, planes: _Planes) -> tuple[float, Array]:
    """Distance of the foot's lowest point from the nearest plane, m, negative below it, and that plane's normal, shape (3,)."""
    normals, offsets = planes
    distances = normals @ state.point(foot.frame, foot.middle) - offsets
    nearest = int(np.argmin(distances))
    return float(distances[nearest] - foot.radius), normals[nearest]
