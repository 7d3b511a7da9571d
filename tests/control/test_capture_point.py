"""The capture-point inequality, against a QP with rows from Pinocchio and qhull, and in physics."""

from __future__ import annotations

import cvxpy
import judges
import numpy as np
import pinocchio as pin
import pytest
from messages import refused
from scipy.spatial import ConvexHull

import floatbase as fb
from floatbase.control import capture_point_inequality
from floatbase.errors import InfeasibleError, InputError

NAMES = ("go2", "solo12", "anymal_kinova", "talos", "hyq")


def polygon(state: fb.State, contacts: fb.Contacts) -> np.ndarray:
    """Return the half-planes n · x + d ≤ 0 of the support polygon, shape (e, 3)."""
    return ConvexHull(contacts.positions(state)[:, :2]).equations


def position_after(state, contacts, horizon):
    """Return A and b of the capture point after the horizon, A q̈ + b."""
    model, data = state.robot.model, state.robot.model.createData()
    J = pin.jacobianCenterOfMass(model, data, state.q)[:2]
    pin.centerOfMass(model, data, state.q, state.v, np.zeros(model.nv))
    com, velocity, drift = data.com[0], data.vcom[0][:2], data.acom[0][:2]
    omega = np.sqrt(9.81 / (com[2] - contacts.positions(state)[:, 2].mean()))
    # the motion for c̈ = 0, and what each unit of c̈ adds
    still = com[:2] + horizon * velocity + velocity / omega
    gain = 0.5 * horizon**2 + horizon / omega
    return gain * J, still + gain * drift


@pytest.mark.parametrize("name", NAMES)
def test_the_solution_is_that_of_a_qp_with_rows_from_pinocchio_and_qhull(name):
    robot, active = judges.load(name), 0
    contacts, standing = judges.stance(robot), robot.standing()
    for seed in range(4):
        rng = np.random.default_rng(seed)
        horizon = rng.uniform(0.01, 0.1)
        at, v = robot.random_state(seed, 0.03), np.zeros(robot.nv)
        v[:2] = rng.normal(0.0, 0.05, 2)
        state = at.replace(v=v)
        far = fb.CoMTask(standing.com + [*rng.normal(0.0, 0.5, 2), 0.0])
        tasks = [far, *fb.standing_tasks(standing)[1:], fb.ForceTask(weight=1e-4)]
        (A, b), edges = position_after(state, contacts, horizon), polygon(state, contacts)
        depth = -np.max(edges[:, :2] @ b + edges[:, 2])
        margin = rng.uniform(0.8, 1.0) * max(depth, 0.0)
        inequality = capture_point_inequality(margin, horizon)
        both = judges.pair(robot, contacts, tasks, inequalities=[inequality])
        assert judges.difference(*both, state) < judges.agreement(robot)

        qp = fb.WholeBodyController(robot, contacts, tasks).qp(state)
        x = cvxpy.Variable(qp.n)
        cost = 0.5 * cvxpy.quad_form(x, cvxpy.psd_wrap(qp.H)) + qp.g @ x
        rows = [qp.A @ x == qp.b, qp.G @ x <= qp.h]
        rows += [edges[:, :2] @ (A @ x[qp.blocks["qdd"]] + b) + edges[:, 2] + margin <= 0.0]
        problem = cvxpy.Problem(cvxpy.Minimize(cost), rows)
        # weights differ by orders of magnitude, so the torques need a tight gap
        tight = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), 1e-11)
        problem.solve(solver="CLARABEL", **tight)
        try:
            command = both[0](state.q, state.v)
        except InfeasibleError:
            assert problem.status.startswith("infeasible")
            continue
        assert problem.status.startswith("optimal")
        limit = np.max(robot.torque_limits[np.isfinite(robot.torque_limits)])
        assert np.max(np.abs(command.tau - x.value[qp.blocks["tau"]])) < 1e-3 * limit
        reached = edges[:, :2] @ (A @ command.qdd + b) + edges[:, 2]
        assert np.max(reached) < -margin + 1e-9
        active += any(row.owner == "capture point" for row in command.active)
    assert active, "the inequality was never active: these states try nothing"


def simulate(tasks: list, inequalities: list, duration: float, *pushes: fb.Push) -> fb.Rollout:
    """Simulate go2 with these tasks and inequalities."""
    robot = judges.load("go2")
    contacts = judges.stance(robot)
    controller = fb.WholeBodyController(robot, contacts, tasks, inequalities=inequalities)
    return fb.rollout(fb.Simulation(robot), controller, duration, pushes, control_period=2e-3)


def test_a_target_outside_the_support_polygon_makes_the_robot_fall_only_without_it():
    robot = judges.load("go2")
    contacts, standing = judges.stance(robot), robot.standing()
    tasks = [fb.CoMTask(standing.com + [0.0, 0.2, 0.0]), *fb.standing_tasks(standing)[1:]]
    runs = [simulate(tasks, rows, 1.5) for rows in ([], [capture_point_inequality(0.03)])]
    assert runs[0].outcome != "completed" and runs[1].outcome == "completed"
    edges, end = polygon(runs[1].final, contacts), runs[1].final.com
    inside = -np.max(edges[:, :2] @ end[:2] + edges[:, 2])
    assert 0.0 < inside < 0.06 and end[1] > standing.com[1] + 0.05  # it leans towards the target


def test_a_push_that_topples_a_soft_controller_does_not_topple_it_with_the_inequality():
    robot = judges.load("go2")
    standing = robot.standing()
    tasks = [fb.CoMTask(standing.com, kp=10.0), *fb.standing_tasks(standing)[1:]]
    push = fb.Push([0.0, 180.0, 0.0], start=0.1, duration=0.1)
    inequality = capture_point_inequality(0.02, horizon=0.02)
    runs = [simulate(tasks, rows, 1.2, push) for rows in ([], [inequality])]
    assert runs[0].outcome != "completed" and runs[1].outcome == "completed"


def test_without_a_support_polygon_or_above_the_centre_of_mass_there_are_no_rows():
    robot = judges.load("go2")
    state, inequality = robot.standing(), capture_point_inequality()
    two = fb.Contacts.points(robot, frames=["FL_foot", "RR_foot"])
    for contacts, number in ((two, 2), (fb.Contacts.none(), 0)):
        eom = fb.equations_of_motion(state, contacts)
        refused(lambda eom=eom: inequality.at(eom), InputError, number, 3)
    q = state.q.copy()
    q[3:7] = [1.0, 0.0, 0.0, 0.0]  # on its back
    upside_down = fb.equations_of_motion(state.replace(q=q), fb.Contacts.points(robot))
    refused(lambda: inequality.at(upside_down), InputError, "height")
    refused(lambda: capture_point_inequality(-0.1), InputError, "margin", -0.1)
    refused(lambda: capture_point_inequality(horizon=0.0), InputError, "horizon", 0)
