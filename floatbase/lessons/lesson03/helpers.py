"""Lesson 03: states, points and directions in the space of possible motions."""

from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt

import floatbase as fb
from floatbase._validation import Array
from floatbase.dynamics import EquationsOfMotion, FeasibleSpace
from floatbase.linear_algebra import RANK_TOLERANCE, null_space
from floatbase.robots import Robot


@cache
def standing_go2_eom() -> EquationsOfMotion:
    """Return the equations of motion of go2 standing on four feet."""
    robot = fb.load("go2")
    return fb.equations_of_motion(robot.standing(), fb.Contacts.points(robot, mu=0.7))


@cache
def tilted_go2_eom() -> EquationsOfMotion:
    """Return the equations of motion of go2 on four feet, tilted and moving.

    Notes
    -----
    [FBR]_, eq. (7).
    """
    robot = fb.load("go2")
    return fb.equations_of_motion(robot.random_state(4), fb.Contacts.points(robot, mu=0.7))


@cache
def rising_solo8_eom() -> EquationsOfMotion:
    """Return the equations of motion of solo8 in its standing posture, moving on four fixed feet.

    The base moves forwards and upwards and pitches, so b is not zero. J has rank 10 instead of 12.
    All feet move in planes along the body, so b has no component in the lost directions.

    Notes
    -----
    [FBR]_, eq. (7).
    """
    robot = fb.load("solo8")
    contacts = fb.Contacts.points(robot)
    base = np.array([0.2, 0.0, 0.3, 0.0, 0.5, 0.0])  # m/s, rad/s
    J = contacts.jacobian(robot.standing())
    joints = -np.linalg.lstsq(J[:, 6:], J[:, :6] @ base, rcond=RANK_TOLERANCE)[0]
    return fb.equations_of_motion(
        robot.standing().replace(v=np.concatenate([base, joints])), contacts
    )


def beta_direction(space: FeasibleSpace, base: npt.ArrayLike) -> Array:
    """Return the step in β that changes the base's acceleration as given, and the forces least.

    Parameters
    ----------
    space : FeasibleSpace
        The space of possible motions.
    base : array_like, shape (6,)
        Change of the base's acceleration, linear and angular, in the base frame [m/s², rad/s²].

    Returns
    -------
    ndarray, shape (dimension,)
        The step in β.
    """
    to_base, to_forces = space.qdd.A[:6], space.forces.A
    step = np.linalg.pinv(to_base, rcond=RANK_TOLERANCE) @ np.asarray(base, dtype=np.float64)
    idle = null_space(to_base, absolute=True)
    return step - idle @ np.linalg.pinv(to_forces @ idle, rcond=RANK_TOLERANCE) @ (to_forces @ step)


def standing_still_beta(space: FeasibleSpace) -> Array:
    """Return the β with q̈ = 0 and the smallest contact forces that allow it.

    Parameters
    ----------
    space : FeasibleSpace
        The space of possible motions.

    Returns
    -------
    ndarray, shape (dimension,)
        The β.
    """
    eom = space.eom
    J_base, J_joints = eom.J[:, :6], eom.J[:, 6:]
    forces = np.linalg.lstsq(J_base.T, eom.h[:6], rcond=RANK_TOLERANCE)[0]
    return space.coordinates(np.zeros(eom.nv), eom.h[6:] - J_joints.T @ forces, forces)


def upright_solo12(robot: Robot, bend: float) -> fb.State:
    """Return solo12 at rest on the ground with every foot below its hip.

    Parameters
    ----------
    robot : Robot
        solo12.
    bend : float
        Angle by which every knee is bent [rad]; 0 is a straight leg.

    Returns
    -------
    State
        The state.
    """
    q = robot.standing().q.copy()
    for leg in range(4):
        side = 1.0 if leg < 2 else -1.0
        q[7 + 3 * leg : 10 + 3 * leg] = 0.0, side * bend / 2, -side * bend
    for _ in range(3):  # turn the hips until the foot is below the hip's axis
        state = fb.State(robot, q)
        for leg, foot in enumerate(robot.feet):
            joint = robot.model.getJointId(robot.joint_names[3 * leg])
            hip, sole = state.joint_transforms[joint][:3, 3], state.point(foot.frame)
            q[7 + 3 * leg] -= np.arctan2(sole[1] - hip[1], hip[2] - sole[2])
    state = fb.State(robot, q)
    q[2] -= min(state.point(foot.frame)[2] - foot.radius for foot in robot.feet)
    return fb.State(robot, q)
