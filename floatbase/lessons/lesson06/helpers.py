"""Lesson 06, Friction cones: the controller that keeps forces in their cones, legs that reach given
places, a steep valley.
"""

from __future__ import annotations

from collections.abc import Mapping

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

STIFFNESS, DAMPING = (
    100.0,
    20.0,
)  # 1/s² and 1/s of the centre of mass and of the base's rotation, as in lesson 05
FACETS = 4  # of each foot's polyhedron, inside its cone
BIAS, NORMAL_BIAS = 1e-3, 0.1  # weight of (23) beside (22), and its α, as in lesson 05
# degrees: each side of the valley in which the centre of mass stands beside the feet
VALLEY_SLOPE = 40.0
LEFT_FEET_Y, RIGHT_FEET_Y = (
    0.16,
    -0.06,
)  # m: where the left and the right feet stand on its sides, y
_MAX_STEPS, _FOOT_TOLERANCE, _LARGEST_STEP = (
    50,
    1e-9,
    0.2,
)  # of Newton's method for the legs; m; rad


class ConeController:
    """Forces in their cones: of all λ that the polyhedra allow, the one of least cost, and the
    torques that give it by (25).

    The cost is lesson 05's, (22) for the wrench that brings centre of mass and base back, with a
    little of (23). New are the rows. Nothing limits the torques, and nothing asks how the joints
    move.

    robot: the robot to control.
    contacts: its contacts with the ground, each with a polyhedron of 4 facets inside its cone.
    state: where to stand.
    moment_weight: 1/m², what (N·m)² cost in (22) beside N².
    """

    def __init__(
        self, robot: fb.Robot, contacts: fb.Contacts, state: fb.State, moment_weight: float = 1.0
    ):
        self.robot, self.contacts, self.state = (
            robot,
            contacts,
            as_instance("state", state, fb.State),
        )
        self.moment_weight = moment_weight
        cones = zip(contacts.normals, contacts.mus, strict=True)
        self._rows = block_diag(*(FrictionPolyhedron(n, mu, FACETS).face_matrix for n, mu in cones))
        self._bias = BIAS * force_bias(contacts, NORMAL_BIAS, robot.weight / contacts.n_points)

    def __call__(self, q: Array, v: Array, t: float = 0.0) -> TorqueCommand:
        """The torques for configuration q and velocity v, with the forces that they are to bring
        about.
        """
        eom = equations_of_motion(fb.State(self.robot, q, v), self.contacts, t)
        wish = self.wrench_goal(eom.state)
        cost = (
            wrench_objective(eom.state, self.contacts, *wish, moment_weight=self.moment_weight)
            + self._bias
        )
        forces = constrained_minimiser(cost, self._rows)
        return TorqueCommand(torques_from_forces(eom).torque(forces), forces)

    def wrench_goal(self, now: fb.State) -> tuple[Array, Array]:
        """(f̃_c, τ̃_c) that brings centre of mass and base back, N and N·m."""
        a = -STIFFNESS * (now.com - self.state.com) - DAMPING * now.com_velocity
        R, R_desired = (state.frame_pose("base").rotation for state in (now, self.state))
        turn = -STIFFNESS * pin.log3(R @ R_desired.T) - DAMPING * now.frame_velocity("base")[3:]
        return desired_wrench(now, a, centroidal_inertia(now) @ turn)


def constrained_minimiser(cost: fb.Quadratic, G: npt.ArrayLike) -> Array:
    """The x of least cost among those with rows @ x ≤ 0, shape (n,)."""
    matrix = np.asarray(G)
    return fb.solve(
        fb.QP(cost.H, cost.g, np.zeros((0, cost.n)), np.zeros(0), matrix, np.zeros(len(matrix)))
    ).x


def make_controller() -> ConeController:
    """The controller whose push rose ends the lesson."""
    robot = fb.load("go2")
    return ConeController(robot, fb.Contacts.points(robot), robot.standing())


def state_with_feet_at(
    robot: fb.Robot, base: npt.ArrayLike, centres: Mapping[str, npt.ArrayLike]
) -> fb.State:
    """The state with a level base there, shape (3,), m, and each foot's centre at its place, shape
    (3,), m, by Newton's method.

    For legs with three joints. Raises `InputError` for places that they do not reach.
    """
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
        f"{robot.name} cannot put its feet there: {np.max(np.abs(error)):.2g} m remain."
    )


def com_beside_feet(robot: fb.Robot, mu: float = 1.0) -> tuple[fb.State, fb.Contacts, fb.Ground]:
    """A robot in a steep valley along x, right feet low on one side, left feet high on the other,
    and the body beyond these.

    mu: friction of the ground, and what the contacts count on.
    """
    angle, slope = np.deg2rad(VALLEY_SLOPE), np.tan(np.deg2rad(VALLEY_SLOPE))
    sides = {
        "L": np.array([0.0, -np.sin(angle), np.cos(angle)]),
        "R": np.array([0.0, np.sin(angle), np.cos(angle)]),
    }
    places, normals = {}, {}
    for foot in robot.feet:
        normals[foot.frame], y = (
            sides[foot.frame[1]],
            LEFT_FEET_Y if foot.frame[1] == "L" else RIGHT_FEET_Y,
        )
        at = np.array([robot.standing().frame_pose(foot.frame).translation[0], y, slope * abs(y)])
        places[foot.frame] = at + foot.radius * normals[foot.frame]
    state = state_with_feet_at(robot, [0.0, LEFT_FEET_Y + 0.03, slope * LEFT_FEET_Y + 0.2], places)
    return (
        state,
        fb.Contacts.points(robot, mu, normals=normals),
        fb.Ground(mu, normal=np.array([sides["L"], sides["R"]])),
    )
