"""Lesson 05: internal forces, friction, a stretched arm, and controllers of the contact forces."""

from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt
import pinocchio as pin

import floatbase as fb
from floatbase._validation import Array, as_array, as_forces
from floatbase.control import AnalyticController
from floatbase.dynamics import EquationsOfMotion
from floatbase.lessons.controllers import TorqueCommand
from floatbase.lessons.lesson03 import standing_still_beta
from floatbase.objectives import torques_from_forces
from floatbase.robots import Robot

# rad: the arm of anymal_kinova, straight forwards
STRETCHED_ARM = (np.pi / 2, np.pi / 2, np.pi, 0.0, 0.0, 0.0)


def make_controller() -> AnalyticController:
    """Return the controller of the lesson's push-recovery map: objectives alone, on go2."""
    robot = fb.load("go2")
    return AnalyticController(robot, fb.Contacts.points(robot, mu=0.7), robot.standing())


def stretched_arm_state(angle: float) -> fb.State:
    """Return anymal_kinova at rest with its arm stretched out.

    Parameters
    ----------
    angle : float
        Direction of the arm [rad]: 0 is forwards, positive angles are to the left.

    Returns
    -------
    State
        The state.
    """
    robot = fb.load("anymal_kinova")
    q = robot.standing().q.copy()
    q[-6:] = STRETCHED_ARM
    q[-6] -= angle
    return fb.State(robot, q)


def com_in_base(state: fb.State) -> Array:
    """Return the centre of mass relative to the base, shape (3,), base frame [m]."""
    pose = state.frame_pose("base")
    return np.asarray(pose.rotation.T @ (state.com - pose.translation))


def squeeze_forces(contacts: fb.Contacts) -> dict[str, Array]:
    """Return four of the six internal forces of a quadruped on level ground.

    Parameters
    ----------
    contacts : Contacts
        Feet in the order FL, FR, RL, RR. The front feet are side by side, and so are the rear feet.

    Returns
    -------
    dict of str to ndarray, shape (12,)
        For each name: forces of 1 N at each foot involved.
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
    """Return the ratio of tangential to normal force at each contact point.

    The ratio equals μ for a force on the surface of its cone. For a force that pulls or has no
    normal component, the ratio is infinite.

    Parameters
    ----------
    contacts : Contacts
        The contacts.
    forces : array_like, shape (k,) or (n, 3)
        Contact forces in the world frame [N].

    Returns
    -------
    ndarray, shape (n,)
        The ratios [-].
    """
    f = as_forces(forces, contacts.k).reshape(-1, 3)
    normal = np.einsum("ij,ij->i", f, contacts.normals)
    tangential = np.linalg.norm(f - normal[:, None] * contacts.normals, axis=1)
    found = np.full(len(f), np.inf)
    np.divide(tangential, normal, out=found, where=normal > 0)
    return found


class ConstantForceController:
    """Controller that always commands the smallest torques for the same contact forces."""

    def __init__(self, robot: Robot, contacts: fb.Contacts, forces: npt.ArrayLike):
        self.robot, self.contacts, self.forces = robot, contacts, as_forces(forces, contacts.k)

    def __call__(self, q: Array, v: Array, t: float) -> TorqueCommand:
        """Return the torques for configuration q and velocity v."""
        eom = fb.equations_of_motion(fb.State(self.robot, q, v), self.contacts)
        return TorqueCommand(torques_from_forces(eom).torque(self.forces), self.forces)


def rotation_error(now: fb.State, goal: fb.State) -> Array:
    """Return the rotation vector from the base's orientation in one state to that in another."""
    R, R_goal = (state.frame_pose("base").rotation for state in (now, goal))
    return np.asarray(pin.log3(R @ R_goal.T))


@cache
def moving_and_goal_state() -> tuple[fb.State, fb.State]:
    """Return go2 displaced, tilted and moving, and its standing state: test case of 05.1."""
    goal = fb.load("go2").standing()
    displacement, v = np.random.default_rng(5).normal(size=(2, goal.robot.nv))
    q = pin.integrate(goal.robot.model, goal.q, 0.1 * displacement)
    return fb.State(goal.robot, q, 0.3 * v), goal


@cache
def arm_robot_eom() -> EquationsOfMotion:
    """Return the equations of motion of anymal_kinova standing on four feet."""
    robot = fb.load("anymal_kinova")
    return fb.equations_of_motion(robot.standing(), fb.Contacts.points(robot, mu=0.7))


def squeezed_standing_forces() -> Array:
    """Return the contact forces of exercise 05.2, shape (12,), world frame [N]."""
    space = fb.feasible_space(arm_robot_eom())
    forces = space.forces(standing_still_beta(space)).copy()
    for foot, side in (("LF_FOOT", 20.0), ("RF_FOOT", -20.0)):
        forces[arm_robot_eom().contacts.force_slice(foot)] += [0.0, side, 0.0]
    return np.asarray(forces)
