"""Lesson 03, The space of possible motions: points and directions in β, and the states that the
lesson looks at.
"""

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
    """(7) of go2 standing on four feet."""
    robot = fb.load("go2")
    return fb.equations_of_motion(robot.standing(), fb.Contacts.points(robot, mu=0.7))


@cache
def tilted_squeeze() -> tuple[EquationsOfMotion, Array]:
    """(7) of go2 tilted and moving, and forces, shape (12,), N, world: 10 N push the feet FL and RR
    apart along their line.
    """
    robot = fb.load("go2")
    eom = fb.equations_of_motion(robot.random_state(4), fb.Contacts.points(robot, mu=0.7))
    feet = eom.contacts.positions(eom.state)
    line = (feet[0] - feet[3]) / np.linalg.norm(feet[0] - feet[3])
    return eom, np.concatenate([10.0 * line, np.zeros(6), -10.0 * line])


@cache
def rising_solo8_eom() -> EquationsOfMotion:
    """(7) of solo8 in its standing posture, moving forwards, upwards and nodding on four feet that
    stay: b is not zero.

    J has rank 10 of 12 there. All feet move in planes along the body, so b asks for nothing in the
    lost directions.
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
    """The step in β, shape (dimension,), that changes the base's acceleration by `base` and the
    forces as little as possible.

    base: shape (6,), m/s² and rad/s², base frame.
    """
    to_base, to_forces = space.qdd.A[:6], space.forces.A
    step = np.linalg.pinv(to_base, rcond=RANK_TOLERANCE) @ np.asarray(base, dtype=np.float64)
    idle = null_space(to_base, absolute=True)
    return step - idle @ np.linalg.pinv(to_forces @ idle, rcond=RANK_TOLERANCE) @ (to_forces @ step)


def standing_still_beta(space: FeasibleSpace) -> Array:
    """The β with q̈ = 0 and the smallest forces that allow it, shape (dimension,)."""
    eom = space.eom
    J_base, J_joints = eom.J[:, :6], eom.J[:, 6:]
    forces = np.linalg.lstsq(J_base.T, eom.h[:6], rcond=RANK_TOLERANCE)[0]
    return space.coordinates(np.zeros(eom.nv), eom.h[6:] - J_joints.T @ forces, forces)


def upright_solo12(robot: Robot, bend: float) -> fb.State:
    """solo12 at rest on the ground, every foot below its hip, every knee bent by `bend` rad; 0 is a
    straight leg.
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
