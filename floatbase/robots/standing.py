"""A standing state: every foot on the ground, found by steps of smallest size."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from floatbase._arrays import Array, checked
from floatbase.errors import InputError
from floatbase.linear_algebra import RANK_TOLERANCE
from floatbase.robots.robot import Foot, Robot
from floatbase.robots.state import State

_TOLERANCE = 1e-11  # m and rad: a hundred roundings of a robot of 1 m
_STEPS = 50  # the catalogue's robots take five
_LARGEST_STEP = 0.2  # m and rad: Gauss-Newton's Jacobian is good that far


def stand(robot: Robot, height: float | None = None) -> State:
    """The standing state nearest to `robot.posture`, at rest; see `Robot.standing`."""
    posture = State(robot, robot.posture)
    height = None if height is None else float(checked("height", height, (), "m"))
    if not robot.is_floating or not robot.feet:
        return posture
    q = posture.q.copy()
    q[2] = height if height is not None else q[2] - min(_sole_height(posture, foot) for foot in robot.feet)
    state = State(robot, q)
    for _ in range(_STEPS):
        error, J = _gap(state, posture, height)
        if np.max(np.abs(error)) < _TOLERANCE:
            return state
        step = -np.linalg.pinv(J, rcond=RANK_TOLERANCE) @ error
        state = State(robot, pin.integrate(robot.model, state.q, np.clip(step, -_LARGEST_STEP, _LARGEST_STEP)))
    raise InputError(
        f"{robot.name} cannot put all its feet on the ground"
        + (f" with its base {height:g} m above it" if height is not None else "")
        + f": {np.max(np.abs(error)):.2g} m remain. Ask for another height, or load it with another posture."
    )


def _gap(state: State, posture: State, height: float | None) -> tuple[Array, Array]:
    """What must be zero when the robot stands, and its Jacobian.

    Soles at z = 0 and level; the base where the posture has it, but for its height, which follows the feet or is given.
    """
    errors, rows = [], []
    for foot in state.robot.feet:
        errors.append(_sole_height(state, foot))
        R, J = state.frame_pose(foot.frame).rotation, state.frame_jacobian(foot.frame)
        rows.append(J[2] - (pin.skew(R @ foot.middle) @ J[3:])[2])
        if foot.is_flat:
            up = R[:, 2]
            errors += [up[0], up[1]]
            rows += list((-pin.skew(up) @ J[3:])[:2])  # d(up)/dt = ω × up
    R = state.frame_pose("base").rotation
    J_base = np.eye(state.robot.nv)[:6]
    errors += list(pin.log3(posture.frame_pose("base").rotation.T @ R))
    rows += list(J_base[3:])
    offset = state.q[:3] - [*posture.q[:2], 0.0 if height is None else height]
    fixed = 2 if height is None else 3
    errors += list(offset[:fixed])
    rows += list((R @ J_base[:3])[:fixed])
    return np.array(errors), np.array(rows)


def _sole_height(state: State, foot: Foot) -> float:
    """Height of the foot's lowest point above z = 0, m."""
    return float(state.point(foot.frame, foot.middle)[2] - foot.radius)
