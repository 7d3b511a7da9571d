"""Lesson 06: a controller that keeps forces inside their cones, and unusual stances."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from scipy.linalg import block_diag

import floatbase as fb
from floatbase._validation import Array, as_instance
from floatbase.dynamics import equations_of_motion
from floatbase.errors import InputError
from floatbase.friction import FrictionPolyhedron
from floatbase.lessons.controllers import TorqueCommand
from floatbase.objectives import (
    centroidal_inertia,
    desired_wrench,
    force_bias,
    torques_from_forces,
    wrench_objective,
)

# 1/s² and 1/s: gains for the centre of mass and for the rotation of the base, as in lesson 05
STIFFNESS, DAMPING = 100.0, 20.0
FACETS = 4  # of each foot's polyhedron, inside its cone
BIAS, NORMAL_BIAS = 1e-3, 0.1  # weight of (23) beside (22), and its α, as in lesson 05
# degrees: slope of each side of the valley in which the centre of mass is beside the feet
VALLEY_SLOPE = 40.0
LEFT_FEET_Y, RIGHT_FEET_Y = 0.16, -0.06  # m: y of the left and the right feet in the valley
# Newton's method for the legs: iterations; m; rad
_MAX_STEPS, _FOOT_TOLERANCE, _LARGEST_STEP = 50, 1e-9, 0.2


class ConeController:
    """Controller that minimizes a cost on the contact forces, subject to the friction polyhedra.

    The torques follow from the contact forces by (25). The cost is that of lesson 05: (22) for the
    wrench that brings back the centre of mass and the base, plus a small multiple of (23). The
    inequality constraints are new. The torques are not limited, and there is no objective for the
    joint motion.

    Parameters
    ----------
    robot : Robot
        The robot.
    contacts : Contacts
        Contacts of the robot with the ground. Each gets a polyhedron of 4 facets inside its cone.
    state : State
        Where to stand.
    moment_weight : float, optional
        Weight of the moment in (22) relative to the force [1/m²].
    """

    def __init__(
        self, robot: fb.Robot, contacts: fb.Contacts, state: fb.State, moment_weight: float = 1.0
    ):
        self.robot = robot
        self.contacts = contacts
        self.state = as_instance("state", state, fb.State)
        self.moment_weight = moment_weight
        cones = zip(contacts.normals, contacts.mus, strict=True)
        self._rows = block_diag(*(FrictionPolyhedron(n, mu, FACETS).face_matrix for n, mu in cones))
        self._bias = BIAS * force_bias(contacts, NORMAL_BIAS, robot.weight / contacts.n_points)

    def __call__(self, q: Array, v: Array, t: float = 0.0) -> TorqueCommand:
        """Return the torques for configuration q and velocity v, and the planned contact forces."""
        eom = equations_of_motion(fb.State(self.robot, q, v), self.contacts, t)
        wish = self.wrench_goal(eom.state)
        cost = (
            wrench_objective(eom.state, self.contacts, *wish, moment_weight=self.moment_weight)
            + self._bias
        )
        forces = constrained_minimizer(cost, self._rows)
        return TorqueCommand(torques_from_forces(eom).torque(forces), forces)

    def wrench_goal(self, now: fb.State) -> tuple[Array, Array]:
        """Return the wrench (f̃_c, τ̃_c) [N, N·m] that brings back centre of mass and base."""
        a = -STIFFNESS * (now.com - self.state.com) - DAMPING * now.com_velocity
        R, R_desired = (state.frame_pose("base").rotation for state in (now, self.state))
        turn = -STIFFNESS * pin.log3(R @ R_desired.T) - DAMPING * now.frame_velocity("base")[3:]
        return desired_wrench(now, a, centroidal_inertia(now) @ turn)


def constrained_minimizer(cost: fb.Quadratic, G: npt.ArrayLike, h: npt.ArrayLike = 0.0) -> Array:
    """Minimize a cost subject to G x ≤ h.

    Parameters
    ----------
    cost : Quadratic
        The cost.
    G : array_like, shape (m, n)
        Matrix of the inequality constraints.
    h : array_like, shape (m,), or float, optional
        Right-hand side of the inequality constraints; one number is for all of them.

    Returns
    -------
    ndarray, shape (n,)
        The minimizer.
    """
    matrix = np.asarray(G)
    bounds = np.broadcast_to(np.asarray(h, dtype=np.float64), len(matrix))
    none = np.zeros((0, cost.n)), np.zeros(0)
    return fb.solve(fb.QP(cost.H, cost.g, *none, matrix, bounds)).x


def accelerate(
    acceleration: npt.ArrayLike,
    mu: float = 0.7,
    start: fb.State | None = None,
    duration: float = 0.1,
    floor: float | None = None,
    **polyhedra: Any,
) -> fb.Rollout:
    """Run go2 with a controller that requests an acceleration of the centre of mass.

    Orientation and posture are further objectives of the controller.

    Parameters
    ----------
    acceleration : array_like, shape (3,)
        Desired acceleration of the centre of mass in the world frame [m/s²].
    mu : float, optional
        Friction coefficient that the controller assumes [-].
    start : State, optional
        State at the start, by default standing.
    duration : float, optional
        Duration of the run [s].
    floor : float, optional
        Actual friction coefficient of the floor [-], by default `mu`.
    **polyhedra
        Options of the friction polyhedra: `facets`, `inner_approximation` and `facet_rotation`.

    Returns
    -------
    Rollout
        The record.
    """
    robot = fb.load("go2")
    start = robot.standing() if start is None else start
    # no stiffness and no damping: nothing draws the centre of mass back to where it was
    com = fb.CoMTask(start.com, acceleration=acceleration, kp=0, kd=0)
    tasks = [com, *fb.standing_tasks(start)[1:]]
    stance = fb.Contacts.points(robot, mu=mu)
    # the crouching robot is near its joint limits; this lesson is about friction
    controller = fb.WholeBodyController(robot, stance, tasks, joint_limits=None, **polyhedra)
    sim = fb.Simulation(robot, ground=mu if floor is None else floor)
    sim.reset(start)
    return fb.rollout(sim, controller, duration)


def make_controller() -> ConeController:
    """Return the controller of the lesson's push-recovery map."""
    robot = fb.load("go2")
    return ConeController(robot, fb.Contacts.points(robot), robot.standing())


def state_with_feet_at(
    robot: fb.Robot, base: npt.ArrayLike, centres: Mapping[str, npt.ArrayLike]
) -> fb.State:
    """Return the state with a level base at one place and the feet at given places."""
    q = robot.standing().q.copy()
    q[:3], q[3:7] = base, [0.0, 0.0, 0.0, 1.0]
    for _ in range(_MAX_STEPS):
        state = fb.State(robot, q)
        error = np.concatenate(
            [state.frame_pose(name).translation - centre for name, centre in centres.items()]
        )
        if np.max(np.abs(error)) < _FOOT_TOLERANCE:
            return state
        J = np.vstack([state.frame_jacobian(name)[:3, 6:] for name in centres])
        q[7:] -= np.clip(np.linalg.pinv(J) @ error, -_LARGEST_STEP, _LARGEST_STEP)
    raise InputError(
        f"{robot.name} cannot put its feet there: an error of {np.max(np.abs(error)):.2g} m "
        f"remains. Choose places within reach of the legs."
    )


def com_beside_feet(robot: fb.Robot, mu: float = 1.0) -> tuple[fb.State, fb.Contacts, fb.Ground]:
    """Return a robot in a steep valley whose centre of mass is not above its feet.

    The valley runs along x. The right feet are low on one side, the left feet are high on the
    other, and the body is beyond the left feet.

    Parameters
    ----------
    robot : Robot
        The robot.
    mu : float, optional
        Friction coefficient of the ground and of the contacts [-].

    Returns
    -------
    State
        The state.
    Contacts
        The contacts.
    Ground
        The ground.
    """
    angle, slope = np.deg2rad(VALLEY_SLOPE), np.tan(np.deg2rad(VALLEY_SLOPE))
    sides = {
        "L": np.array([0.0, -np.sin(angle), np.cos(angle)]),
        "R": np.array([0.0, np.sin(angle), np.cos(angle)]),
    }
    places, normals = {}, {}
    for foot in robot.feet:
        normals[foot.frame] = sides[foot.frame[1]]
        y = LEFT_FEET_Y if foot.frame[1] == "L" else RIGHT_FEET_Y
        at = np.array([robot.standing().frame_pose(foot.frame).translation[0], y, slope * abs(y)])
        places[foot.frame] = at + foot.radius * normals[foot.frame]
    state = state_with_feet_at(robot, [0.0, LEFT_FEET_Y + 0.03, slope * LEFT_FEET_Y + 0.2], places)
    return (
        state,
        fb.Contacts.points(robot, mu, normals=normals),
        fb.Ground(mu, normal=np.array([sides["L"], sides["R"]])),
    )
