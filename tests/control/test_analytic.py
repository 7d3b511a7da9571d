"""The analytic controller (§3.1): the robot stands, and the answer is optimal.

Lesson 05 has the push under which it falls.
"""

from functools import cache

import cvxpy as cp
import judges
import numpy as np
import pinocchio as pin
import pytest
from judges import Array

import floatbase as fb
from floatbase.control import AnalyticController
from floatbase.objectives import centroidal_inertia

PERIOD = 2e-3
KINDS = ("solo8", "go2", "anymal_kinova", "talos")
STANDING = judges.sampled(KINDS, "solo8")


@cache
def controller_of(name: str) -> AnalyticController:
    robot = judges.load(name)
    return AnalyticController(robot, judges.stance(robot), robot.standing())


@cache
def standing(name: str) -> fb.Rollout:
    simulation = fb.Simulation(judges.load(name))
    return fb.rollout(simulation, controller_of(name), 1.5, control_period=PERIOD)


def near(name: str, seed: int, far: float = 0.03, fast: float = 0.3) -> fb.State:
    """Return a moving state near standing, with a velocity that the contacts allow."""
    rng = np.random.default_rng(seed)
    state = judges.load(name).standing()
    state = judges.along(state, rng.normal(size=state.robot.nv), far)
    v = fast * rng.normal(size=state.robot.nv)
    A = judges.stance(state.robot).constraint(state)[0]
    return state.replace(v=v - np.linalg.pinv(A, rcond=1e-9) @ (A @ v))


def inertia_about_com(state: fb.State) -> Array:
    """Return Σ R I Rᵀ + m (‖r‖² 1 - r rᵀ) over MuJoCo's bodies about their centre of mass."""
    judge = judges.mujoco_of(state.robot.name).move_to(state)
    total, masses = np.zeros((3, 3)), judge.model.body_mass
    centre = masses @ judge.data.xipos / masses.sum()
    for i in range(1, judge.model.nbody):
        R, r = judge.data.ximat[i].reshape(3, 3), judge.data.xipos[i] - centre
        total += R @ np.diag(judge.model.body_inertia[i]) @ R.T
        total += masses[i] * (r @ r * np.eye(3) - np.outer(r, r))
    return total


def written_out(name: str, state: fb.State) -> tuple[Array, Array, Array, float]:
    """Return q̈, τ, λ and the controller's objective, minimized by cvxpy subject to (7).

    Every term is written from its formula: (22), (23), posture and torque with the default gains
    and weights.
    """
    robot, held = state.robot, judges.load(name).standing()
    contacts = judges.stance(robot)
    kp, kd, alpha = 100.0, 20.0, 0.1
    judge = judges.mujoco_of(name).move_to(state)
    mass, g = float(judge.model.body_mass.sum()), 9.81
    J = judges.jacobian_of(lambda s: s.com, state)
    force = mass * (-kp * (state.com - held.com) - kd * J @ state.v + np.array([0.0, 0.0, g]))
    R, R_held = (judges.quaternion_rotation(s.q[3:7]) for s in (state, held))
    turn = -kp * judges.turn_between(R, R_held) - kd * R @ state.v[3:6]
    moment = inertia_about_com(state) @ turn
    eom = fb.equations_of_motion(state, contacts)
    qdd, tau, f = cp.Variable(eom.nv), cp.Variable(eom.d), cp.Variable((contacts.n_points, 3))
    points = contacts.positions(state)
    centre = state.com
    tau_c = sum(pin.skew(p - centre) @ f[i] for i, p in enumerate(points))
    share = mass * g / contacts.n_points
    joints = -kp * (state.q[7:] - held.q[7:]) - kd * state.v[6:]
    cost = 0.5 * cp.sum_squares(cp.sum(f, axis=0) - force) + 0.5 * cp.sum_squares(tau_c - moment)
    bias = cp.sum_squares(f[:, :2]) + alpha * cp.sum_squares(f[:, 2] - share)
    cost += 0.5e-3 * (bias + cp.sum_squares(qdd[6:] - joints)) + 0.5e-6 * cp.sum_squares(tau)
    U, s, Vt = np.linalg.svd(eom.A)
    r = int(np.sum(s > 1e-9 * s[0]))
    rows = [judge.M @ qdd + judge.h == eom.S @ tau + eom.J.T @ cp.vec(f, order="C")]
    rows.append(Vt[:r] @ qdd == (U.T @ eom.b)[:r] / s[:r])
    problem = cp.Problem(cp.Minimize(cost), rows)
    tight = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), 1e-12)
    problem.solve(solver=cp.CLARABEL, max_iter=200, **tight)
    assert problem.status in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE)
    return qdd.value, tau.value, f.value.ravel(), float(problem.value)


# standing -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", STANDING)
def test_robots_of_every_kind_stand_on_objectives_alone(name):
    """1.5 s in MuJoCo with too few torques (solo8), enough (go2, solo12) and redundant ones.

    anymal_kinova has redundant torques, talos has flat feet.
    """
    run, start = standing(name), judges.load(name).standing()
    assert run.outcome == "completed"
    assert np.linalg.norm(run.com[-1] - start.com) < 1e-4
    assert np.max(np.abs(run.v[-1])) < 1e-5
    assert np.max(run.slip()) < 2e-3


@pytest.mark.parametrize("name", STANDING)
def test_standing_the_planned_forces_carry_the_weight_and_are_the_measured_ones(name):
    run, robot = standing(name), judges.load(name)
    total = run.planned[-1].reshape(-1, 3).sum(axis=0)
    assert np.allclose(total, [0.0, 0.0, robot.weight], atol=1e-3 * robot.weight)
    gap = run.planned[-1] - run.measured[-1]
    gaps = [run.contacts.force_of(gap, foot) for foot in run.contacts.names]
    assert np.max(np.abs(gaps)) < 1e-4 * robot.weight


def test_it_goes_where_its_centre_of_mass_is_to_be(go2, standing):
    target = standing.com + [0.02, -0.03, -0.02]
    controller = AnalyticController(go2, fb.Contacts.points(go2), standing, com=target)
    run = fb.rollout(fb.Simulation(go2), controller, 1.2, control_period=PERIOD)
    assert run.outcome == "completed"
    assert np.linalg.norm(run.com[-1] - target) < 2e-3


@pytest.mark.parametrize("exponent", [3, 4, 6, 8])
def test_velocity_noise_near_a_loss_of_rank_asks_for_no_torque_that_a_motor_lacks(exponent):
    """solo8 with joint angles off by 1e-6 rad and a velocity noise of 0.1 rad/s.

    Enforcing all rows exactly would need thousands of N·m.
    """
    robot = judges.load("solo8")
    rng = np.random.default_rng(0)
    away = np.append(np.zeros(6), rng.normal(size=8))
    state = judges.along(robot.standing(), away, 10.0**-exponent)
    command = controller_of("solo8")(state.q, 0.1 * rng.normal(size=robot.nv))
    assert np.max(np.abs(command.tau)) < 1.2  # N·m; 0.9 at the singular stance itself
    assert np.max(np.abs(command.forces)) < robot.weight


# the optimum --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", judges.BALLS)
@pytest.mark.parametrize("seed", [0, 1])
def test_its_answer_is_the_optimum_of_the_objective_written_out_in_cvxpy(name, seed):
    """The value agrees to 1e-6 everywhere.

    The answer itself agrees where weights of 1e-6 determine it beyond rounding.
    """
    state, controller = near(name, seed), controller_of(name)
    command = controller(state.q, state.v)
    eom = fb.equations_of_motion(state, controller.contacts)
    answer = (command.qdd, command.tau, command.forces)
    value = sum(cost(x) for cost, x in zip(controller.objective(eom), answer, strict=True))
    qdd, tau, forces, best = written_out(name, state)
    assert value == pytest.approx(best, rel=1e-5, abs=1e-6)
    scale = max(1.0, float(np.abs(forces).max()))
    assert np.max(np.abs(command.tau - tau)) < 1e-3 * scale
    assert np.max(np.abs(eom.J.T @ (command.forces - forces))) < 1e-3 * scale
    assert np.max(np.abs(command.qdd - qdd)) < 1e-2 * max(1.0, float(np.abs(qdd).max()))


@pytest.mark.parametrize("name", KINDS)
def test_its_answer_satisfies_the_equations_of_motion(name):
    for seed in range(3):
        state, controller = near(name, seed), controller_of(name)
        command = controller(state.q, state.v)
        eom = fb.equations_of_motion(state, controller.contacts)
        scale = max(1.0, float(np.abs(command.forces).max()))
        gap = judges.aba(eom, command.tau, command.forces) - command.qdd
        assert np.max(np.abs(gap)) < 1e-6 * scale
        held = eom.A @ np.linalg.lstsq(eom.A, eom.b, rcond=1e-9)[0]
        assert np.max(np.abs(eom.A @ command.qdd - held)) < 1e-7 * scale


@pytest.mark.parametrize("name", KINDS)
def test_the_inertia_about_the_centre_of_mass_is_the_sum_over_mujocos_bodies(name):
    for state in judges.states(name, 3):
        assert judges.relative(centroidal_inertia(state), inertia_about_com(state)) < 1e-9


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_robot_that_leans_is_turned_back(axis, standing):
    """The sign of τ̃_c: the planned change of angular momentum opposes the lean."""
    contacts = fb.Contacts.points(standing.robot)
    lean = np.zeros(18)
    lean[3 + axis] = 0.05
    leaning = judges.along(standing, lean, 1.0)
    expected = -100.0 * 0.05 * inertia_about_com(leaning)[axis, axis]
    q, v, model = leaning.q, leaning.v, standing.robot.model
    free = AnalyticController(standing.robot, contacts, standing, posture_weight=1e-7)
    # the default posture term takes its share
    for controller, share, rel in ((free, 1.0, 0.02), (controller_of("go2"), 0.65, 0.55)):
        qdd, data = controller(q, v).qdd, model.createData()
        rate = pin.computeCentroidalMomentumTimeVariation(model, data, q, v, qdd).angular
        assert rate[axis] == pytest.approx(share * expected, rel=rel)


def turned(state: fb.State, yaw: float) -> fb.State:
    """Return the same robot on the same ground, with another heading."""
    q = np.array(state.q)
    turn = pin.Quaternion(judges.rotation([0.0, 0.0, yaw]))
    q[:3] = turn.matrix() @ q[:3]
    q[3:7] = (turn * pin.Quaternion(q[6], q[3], q[4], q[5])).normalized().coeffs()
    return state.replace(q=q)


def test_the_torques_do_not_depend_on_the_way_the_robot_faces(go2):
    """Rotation errors are world vectors.

    Rotating the desired posture and the state together changes nothing.
    """
    contacts = fb.Contacts.points(go2)
    state = near("go2", 3, far=0.2)
    expected = controller_of("go2")(state.q, state.v).tau
    for yaw in (0.5, 1.6, 3.0):
        facing = AnalyticController(go2, contacts, turned(go2.standing(), yaw))
        there = turned(state, yaw)
        tau = facing(there.q, there.v).tau
        assert np.allclose(tau, expected, atol=1e-6 * np.abs(expected).max())
