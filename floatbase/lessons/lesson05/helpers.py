"""Lesson 05, Steering the centre of mass: squeezes, leans, a stretched arm, a controller that gives
forces, the rose's one.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt

import floatbase as fb
from floatbase._validation import Array, as_array, as_forces
from floatbase.control import AnalyticController
from floatbase.dynamics import EquationsOfMotion
from floatbase.lessons.controllers import TorqueCommand
from floatbase.lessons.lesson03 import standing_still_beta
from floatbase.objectives import torques_from_forces
from floatbase.robots import Robot

STRETCHED_ARM = (
    np.pi / 2,
    np.pi / 2,
    np.pi,
    0.0,
    0.0,
    0.0,
)  # rad: anymal_kinova's arm, straight forwards


def make_controller() -> AnalyticController:
    """The controller of this lesson, whose push rose ends it: costs alone, on go2."""
    robot = fb.load("go2")
    return AnalyticController(robot, fb.Contacts.points(robot, mu=0.7), robot.standing())


def stretched_arm_state(angle: float) -> fb.State:
    """anymal_kinova at rest with its arm stretched out. angle: rad, of the arm to the left; 0 is
    forwards.
    """
    robot = fb.load("anymal_kinova")
    q = robot.standing().q.copy()
    q[-6:] = STRETCHED_ARM
    q[-6] -= angle
    return fb.State(robot, q)


def com_in_base(state: fb.State) -> Array:
    """Centre of mass seen from the base, in the base's axes, shape (3,), m."""
    pose = state.frame_pose("base")
    return np.asarray(pose.rotation.T @ (state.com - pose.translation))


def squeeze_forces(contacts: fb.Contacts) -> dict[str, Array]:
    """Four of the six squeezes of a quadruped on level ground: name -> forces of 1 N at each foot
    concerned, shape (12,).

    contacts: feet in the order FL, FR, RL, RR, those at the front side by side, as those at the
        rear.
    """
    rows = {
        "front feet apart": [[0, 1, 0], [0, -1, 0], [0, 0, 0], [0, 0, 0]],
        "rear feet apart": [[0, 0, 0], [0, 0, 0], [0, 1, 0], [0, -1, 0]],
        "left feet apart": [[1, 0, 0], [0, 0, 0], [-1, 0, 0], [0, 0, 0]],
        "diagonal": [[0, 0, 1], [0, 0, -1], [0, 0, -1], [0, 0, 1]],
    }
    return {
        name: as_array(name, np.ravel(forces).astype(float), (contacts.k,))
        for name, forces in rows.items()
    }


def friction_ratios(contacts: fb.Contacts, forces: npt.ArrayLike) -> Array:
    """How far the force of each point leans from its normal, tangential over normal part, shape
    (n,).

    μ where a force lies on its cone. Infinite where it has no normal part or pulls. forces: shape
    (k,) or (n, 3), N, world.
    """
    f = as_forces(forces, contacts.k).reshape(-1, 3)
    normal = np.einsum("ij,ij->i", f, contacts.normals)
    tangential = np.linalg.norm(f - normal[:, None] * contacts.normals, axis=1)
    found = np.full(len(f), np.inf)
    np.divide(tangential, normal, out=found, where=normal > 0)
    return found


class ConstantForceController:
    """A controller: in every tick the smallest torques that give the same forces, by (25).

    contacts: its stance. forces: shape (k,), N, world.
    """

    def __init__(self, robot: Robot, contacts: fb.Contacts, forces: npt.ArrayLike):
        self.robot, self.contacts, self.forces = robot, contacts, as_forces(forces, contacts.k)

    def __call__(self, q: Array, v: Array, t: float) -> TorqueCommand:
        """The torques for configuration q and velocity v."""
        eom = fb.equations_of_motion(fb.State(self.robot, q, v), self.contacts)
        return TorqueCommand(torques_from_forces(eom).torque(self.forces), self.forces)


@cache
def three_feet_eom() -> EquationsOfMotion:
    """(7) of go2, tilted and moving, on all feet but FL."""
    robot = fb.load("go2")
    return fb.equations_of_motion(
        robot.random_state(4), fb.Contacts.points(robot, mu=0.7).without("FL_foot")
    )


@cache
def arm_robot_eom() -> EquationsOfMotion:
    """(7) of anymal_kinova standing on four feet."""
    robot = fb.load("anymal_kinova")
    return fb.equations_of_motion(robot.standing(), fb.Contacts.points(robot, mu=0.7))


def squeezed_standing_forces() -> Array:
    """The forces of exercise 05.3, shape (12,), N, world: those of standing still, with 20 N
    between the front feet.
    """
    space = fb.feasible_space(arm_robot_eom())
    forces = space.forces(standing_still_beta(space)).copy()
    for foot, side in (("LF_FOOT", 20.0), ("RF_FOOT", -20.0)):
        forces[arm_robot_eom().contacts.force_slice(foot)] += [0.0, side, 0.0]
    return np.asarray(forces)
