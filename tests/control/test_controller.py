"""The whole-body controller (26)(27) against cvxpy, forward dynamics and closed forms."""

import copy
import pickle
import re
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from time import process_time

import judges
import numpy as np
import pytest
from messages import raises

import floatbase as fb
from floatbase.control import JointLimits
from floatbase.dynamics import fixed_frame, moving_frame
from floatbase.errors import InfeasibleError, SolverError, UnknownNameError

# of the weight, N or N·m: the torque regularization lets a robot begin to sag; 1.5e-3 on
# anymal_kinova
SAG = 2e-3
# of the friction coefficient 0.3: a force at its limit may deviate slightly from the desired one
ASIDE = 5e-3


def cases(name: str, n: int) -> list[fb.State]:
    """Return states, half of them near standing, half far away with many active inequalities."""
    return judges.states(name, n - n // 2, 0.08) + judges.states(name, n // 2, 0.3)


@pytest.mark.parametrize("name", judges.ROBOTS)
def test_daqp_finds_the_optimum_that_cvxpy_finds(name):
    controller, n_active, n = judges.controller_of(name), 0, 40 if name == "go2" else 20
    for state in cases(name, n):
        qp = controller.qp(state)
        found, judge = fb.solve(qp), fb.solve(qp, "cvxpy")
        prices = np.sum(judge.inequality_multipliers) + np.sum(np.abs(judge.equality_multipliers))
        r, gap = judge.residuals, abs(found.objective - judge.objective)
        worth = max(r.inequality, r.equality) * prices + r.complementarity * len(qp.G)
        # Clarabel's gap is relative to the objective
        assert gap < 1e-8 * (1.0 + abs(judge.objective)) + 2.0 * worth
        n_active += bool(found.active)
        for solution in (found, judge):
            r = solution.residuals
            assert r.equality < 1e-9 and r.dual == 0.0
            assert max(r.inequality, r.stationarity) < 1e-6
            gap = 1e-8 * abs(judge.objective) if solution is judge else 0.0
            assert r.complementarity < max(1e-6, gap)
    # with no row active, these states would try nothing
    assert n_active > n / 4 or not judges.load(name).is_floating


@pytest.mark.parametrize("name", judges.ROBOTS)
def test_the_planned_acceleration_is_what_torques_and_forces_bring_about(name):
    controller = judges.controller_of(name)
    for state in cases(name, 10):
        command = controller(state.q, state.v)
        eom = fb.equations_of_motion(state, controller.contacts)
        assert judges.relative(command.qdd, judges.aba(eom, command.tau, command.forces)) < 1e-6


@pytest.mark.parametrize("name", judges.FLOATING)
def test_forces_stay_in_the_exact_cone_and_torques_within_their_limits(name):
    controller, robot = judges.controller_of(name), judges.load(name)
    for state in cases(name, 20):
        command = controller(state.q, state.v)
        forces, normals = command.forces.reshape(-1, 3), controller.contacts.normals
        pressing = np.sum(forces * normals, axis=1)
        sliding = np.linalg.norm(forces - pressing[:, None] * normals, axis=1)
        assert np.all(sliding <= controller.contacts.mus * pressing + 1e-6)
        assert np.all(pressing >= -1e-6)
        assert np.all(np.abs(command.tau) <= robot.torque_limits + 1e-6)


@pytest.mark.parametrize("name", judges.FLOATING)
def test_an_active_row_is_met_exactly_and_named_for_what_it_limits(name):
    controller, robot = judges.controller_of(name, min_normal_force=1.0), judges.load(name)
    seen = set()
    for state in cases(name, 20):
        command = controller(state.q, state.v)
        assert tuple(command.multipliers) == command.active
        points = controller.contacts.point_names
        forces = dict(zip(points, command.forces.reshape(-1, 3), strict=True))
        torques = dict(zip(robot.joint_names, command.tau, strict=True))
        limits = dict(zip(robot.joint_names, robot.torque_limits, strict=True))
        for row in command.active:
            assert command.multipliers[row] > 0
            if row.startswith("torque limit "):
                joint, side = row.removeprefix("torque limit ").split()
                expected = limits[joint] * {"upper": 1, "lower": -1}[side]
                assert torques[joint] == pytest.approx(expected, abs=1e-6)
                seen.add("torque")
            elif row.endswith(" normal force"):
                assert forces[row.removesuffix(" normal force")][2] == pytest.approx(1.0, abs=1e-6)
                seen.add("normal")
            elif row.owner in robot.joint_names:
                _, kind, side = row.split()
                assert row.kind == f"{side} {kind} limit"  # bounds: tests/control/test_joint_limits
            else:
                point, facet = row.split(" facet ")
                angle = 2 * np.pi * int(facet) / 4
                along = forces[point] @ [np.cos(angle), np.sin(angle), 0.0]
                assert along == pytest.approx(0.7 * np.cos(np.pi / 4) * forces[point][2], abs=1e-6)
                seen.add("facet")
    assert {"normal", "facet"} <= seen


@pytest.mark.parametrize("name", judges.FLOATING)
def test_a_robot_at_rest_is_carried_by_forces_that_sum_to_its_weight(name):
    state = judges.load(name).standing()
    command = judges.controller_of(name)(state.q, state.v)
    forces = command.forces.reshape(-1, 3)
    expected = [0.0, 0.0, state.robot.weight]
    assert np.allclose(forces.sum(axis=0), expected, atol=SAG * state.robot.weight)
    moment = np.cross(judges.stance(state.robot).positions(state) - state.com, forces).sum(axis=0)
    assert np.allclose(moment, 0.0, atol=SAG * state.robot.weight)
    assert np.allclose(command.qdd[:6], 0.0, atol=0.05)
    # 0.5 rad/s² where anymal_kinova's arm begins
    assert np.allclose(command.qdd[6:], 0.0, atol=0.6)
    # grippers of talos rest at their limits
    assert all("position" in row for row in command.active)


def test_an_arm_bolted_to_the_ground_gets_computed_torque():
    """Without active limits, (1) gives τ = M (-kp e - kd ė) + h in closed form."""
    robot = judges.load("ur5")
    target = robot.standing().q
    task = fb.PostureTask(target, kp=30.0, kd=4.0, weight=1e6)
    controller = fb.WholeBodyController(robot, fb.Contacts.none(), [task], torque_limits=np.inf)
    for state in judges.states("ur5", 5):
        judge = judges.mujoco_of("ur5").move_to(state)
        expected = judge.M @ (-30.0 * (state.q - target) - 4.0 * state.v) + judge.h
        assert np.allclose(controller(state.q, state.v).tau, expected, atol=1e-5)


def test_turned_by_half_a_facet_the_strong_and_the_weak_direction_change_places(backend, go2):
    """An inner pyramid gives μ along its edges and μ cos 45° in the middle of its sides.

    Without rotation, one of the sides faces forwards.
    """
    state, contacts = go2.standing(), fb.Contacts.points(go2, mu=0.3)
    others = fb.standing_tasks(state)[1:]

    def reached(direction: float, rotation: float) -> float:
        towards = np.array([np.cos(direction), np.sin(direction), 0.0])
        wish = fb.CoMTask(state.com, acceleration=4.0 * towards)
        options = {"facet_rotation": rotation, "backend": backend}
        controller = fb.WholeBodyController(go2, contacts, [wish, *others], **options)
        f = controller(state.q, state.v).forces.reshape(-1, 3).sum(axis=0)
        return float(f @ towards / f[2])

    quarter = np.pi / 4
    for rotation in (0.0, quarter):
        assert reached(rotation, rotation) == pytest.approx(0.3 * np.cos(quarter), abs=ASIDE)
        assert reached(rotation + quarter, rotation) == pytest.approx(0.3, abs=ASIDE)


def test_outer_facets_allow_more_than_inner_ones_and_less_when_doubled():
    """Every second one of 2 n outer facets is one of n facets.

    Inner polyhedra of n and 2 n facets have different edges, so neither contains the other.
    """

    def cost(state: fb.State, n: int, **options: object) -> float:
        return fb.solve(judges.controller_of("go2", facets=n, **options).qp(state)).objective

    for state in judges.states("go2", 5, 0.3):
        outside = [cost(state, n, inner_approximation=False) for n in (4, 8, 16, 32)]
        slack = 1e-9 * abs(outside[0])
        assert all(coarse <= fine + slack for coarse, fine in pairwise(outside))
        inside = [cost(state, n) for n in (4, 8, 16, 32)]
        assert max(outside) <= min(inside) + slack
        assert inside[-1] - outside[-1] <= 0.1 * (inside[0] - outside[0]) + slack


def test_normal_forces_are_along_the_normals_of_tilted_ground(go2):
    normals = judges.random_normals(4, 1)
    contacts = fb.Contacts.points(go2, mu=0.4, normals=normals)
    controller = judges.pair(go2, contacts, min_normal_force=2.0)[0]
    for state in judges.states("go2", 5, 0.2):
        forces = controller(state.q, state.v).forces.reshape(4, 3)
        pressing = np.sum(forces * normals, axis=1)
        assert np.all(pressing >= 2.0 - 1e-6)
        sliding = np.linalg.norm(forces - pressing[:, None] * normals, axis=1)
        assert np.all(sliding <= 0.4 * pressing + 1e-6)


def test_torque_limits_are_the_robots_or_those_given_or_none():
    state = judges.states("go2", 1, 0.1)[0]
    robot = state.robot
    assert np.array_equal(judges.controller_of("go2").limits.torque_limits, robot.torque_limits)
    free = judges.controller_of("go2", torque_limits=np.inf)
    assert not any(name.startswith("torque") for name in free.qp(state).inequality_names)
    less = 0.9 * float(np.max(np.abs(free(state.q, state.v).tau)))
    limited = judges.controller_of("go2", torque_limits=less)(state.q, state.v)
    assert np.max(np.abs(limited.tau)) <= less * (1.0 + 1e-9)
    some = np.full(12, np.inf)
    some[3] = 1.0
    one = judges.controller_of("go2", torque_limits=some)
    names = [name for name in one.qp(state).inequality_names if name.startswith("torque")]
    assert names == [f"torque limit {robot.joint_names[3]} {side}" for side in ("upper", "lower")]


def test_regularization_is_added_where_it_is_missing_and_shown(go2):
    contacts, tasks = fb.Contacts.points(go2), fb.standing_tasks(go2.standing())
    added = fb.WholeBodyController(go2, contacts, tasks).tasks[len(tasks) :]
    assert {type(task) for task in added} == {fb.ForceTask, fb.TorqueTask}
    own = [*tasks, fb.ForceTask(weight=1e-3), fb.TorqueTask(weight=1e-3)]
    assert fb.WholeBodyController(go2, contacts, own).tasks == tuple(own)


def test_a_controller_is_replaced_rather_than_changed(go2):
    limits = {"facets": 8, "inner_approximation": False, "min_normal_force": 3.0}
    controller = judges.controller_of("go2", torque_limits=20.0, solver="cvxpy", **limits)
    three = controller.replace(contacts=controller.contacts.without("FL_foot"))
    assert three.contacts.names == ("FR_foot", "RL_foot", "RR_foot")
    assert controller.contacts.names == tuple(foot.frame for foot in go2.feet)
    assert three.tasks == controller.tasks
    for field in ("facets", "inner_approximation", "min_normal_force"):
        assert getattr(three.limits, field) == getattr(controller.limits, field)
    assert np.array_equal(three.limits.torque_limits, controller.limits.torque_limits)
    assert three.solver == "cvxpy"
    other = controller.replace(tasks=[fb.PostureTask(go2.standing().q)])
    assert [type(task) for task in other.tasks] == [fb.PostureTask, fb.ForceTask, fb.TorqueTask]


@pytest.mark.parametrize("name", judges.FLOATING)
def test_feet_whose_rows_are_inconsistent_with_a_velocity_are_kept_as_nearly_as_possible(name):
    """J of solo8 loses rank: A q̈ = b holds in the least-squares sense, exactly where possible."""
    controller = judges.controller_of(name)
    for state in judges.states(name, 5, 0.3):
        eom = fb.equations_of_motion(state, controller.contacts)
        qdd = controller(state.q, state.v).qdd
        nearest = eom.A @ np.linalg.pinv(eom.A, rcond=1e-10) @ eom.b
        assert np.allclose(eom.A @ qdd, nearest, atol=1e-7)
        if np.linalg.matrix_rank(eom.A, tol=1e-9) == len(eom.A):
            assert np.allclose(eom.A @ qdd, eom.b, atol=1e-7)


# infeasible ---------------------------------------------------------------------------------------


def test_an_impossible_demand_names_a_smallest_set_of_rows_in_conflict(standing):
    controller = judges.controller_of("go2", min_normal_force=500.0)
    with pytest.raises(InfeasibleError) as caught:
        controller(standing.q, standing.v)
    assert any(row.endswith("normal force") for row in caught.value.constraints)
    assert any(row.startswith("torque limit") for row in caught.value.constraints)
    for row in caught.value.constraints:  # each by its owner, in the line of its kind
        assert row.owner in row and row.owner in str(caught.value)
    assert judges.is_smallest_conflict(controller.qp(standing), caught.value.constraints)


# arguments ----------------------------------------------------------------------------------------


def test_friction_rows_lie_on_the_forces_of_their_points_wherever_a_constraint_stands(go2):
    feet = fb.Contacts.points(go2, frames=["FL_foot", "RR_foot"])
    bolts = fb.Contacts([fixed_frame("base")])
    tasks = fb.standing_tasks(go2.standing())
    state = go2.random_state(3, 0.05)
    first = fb.WholeBodyController(go2, bolts + feet, tasks)(state.q, state.v)
    last = fb.WholeBodyController(go2, feet + bolts, tasks)(state.q, state.v)
    assert np.allclose(first.tau, last.tau, atol=1e-6)
    assert np.allclose(first.forces, np.roll(last.forces, 6), atol=1e-5)


def test_inconsistent_motions_are_named_and_not_averaged(go2, standing):
    drive = moving_frame("FL_foot", lambda t: np.array([0.0, 0.0, 5.0 * t]))
    controller = judges.pair(go2, fb.Contacts.points(go2) + fb.Contacts([drive]))[0]
    with raises(InfeasibleError, "motion FL_foot z", "motion drive of FL_foot row 2") as e:
        controller(standing.q, standing.v, 1.0)
    assert e.value.constraints == ("motion FL_foot z", "motion drive of FL_foot row 2")


def test_a_command_gives_the_force_of_a_foot_and_prints_in_one_line(backend, talos):
    controller = judges.controller_of("talos", backend=backend)
    command = controller(talos.standing().q, np.zeros(talos.nv))
    left, right = (command.force(name) for name in controller.contacts.names)
    assert np.allclose(left + right, [0.0, 0.0, talos.weight], atol=SAG * talos.weight)
    assert np.allclose(left, command.forces[:12].reshape(4, 3).sum(axis=0))
    with raises(UnknownNameError, "left_sole_lnk", "left_sole_link"):
        command.force("left_sole_lnk")
    assert repr(command).startswith("Command(|tau|=") and "\n" not in repr(command)
    assert backend in repr(command)


def test_an_infeasible_tick_is_answered_with_soft_constraints_on_request(backend, talos):
    contacts, tasks = judges.stance(talos), fb.standing_tasks(talos.standing())
    weak = {"torque_limits": 0.2 * talos.torque_limits, "min_normal_force": 200.0}
    weak["backend"] = backend
    moving = talos.standing().replace(v=np.r_[0.0, 3.0, 0.0, 3.0, np.zeros(talos.nv - 4)])
    soft = fb.WholeBodyController(talos, contacts, tasks, normal_force_weight=1e4, **weak)
    expected = soft(moving.q, moving.v)
    assert not expected.softened
    made = fb.WholeBodyController(talos, contacts, tasks, on_infeasible="soften", **weak)
    for each in (made, copy.deepcopy(made), made.replace(tasks=tasks)):
        command = each(moving.q, moving.v)
        assert command.softened and np.array_equal(command.tau, expected.tau)
    with pytest.raises(InfeasibleError):
        fb.WholeBodyController(talos, contacts, tasks, **weak)(moving.q, moving.v)
    with raises(UnknownNameError, "on_infeasible", "soft", "soften"):
        fb.WholeBodyController(talos, contacts, tasks, on_infeasible="soft")


@pytest.mark.parametrize("robot", ["go2", "talos"], indirect=True)
def test_a_robot_of_any_mass_plans_forces_that_carry_it_and_withstands_a_push(robot):
    """With weights that do not follow the robot's, 480 kg planned 0.946 of it, and 5 t fell."""
    for mass in (0.01, 80.0, 5000.0):
        factor = mass / robot.mass
        scaled = robot.with_scaled_mass(factor)
        scaled = replace(
            scaled,
            torque_limits=factor * robot.torque_limits,
            # MuJoCo reads them, too
            urdf=re.sub('effort="[^"]*"', f'effort="{factor * 1e4}"', scaled.urdf),
        )
        state, contacts = scaled.standing(), judges.stance(scaled)
        controller = fb.WholeBodyController(scaled, contacts, fb.standing_tasks(state))
        planned = controller(state.q, state.v).forces.reshape(-1, 3)[:, 2].sum()
        assert planned == pytest.approx(scaled.weight, rel=1e-3)
        push = fb.Push([0.0, 0.2 * scaled.weight, 0.0], start=0.1)
        record = fb.rollout(fb.Simulation(scaled), controller, 0.8, [push], 4e-3)
        assert record.outcome == "completed"
        assert np.linalg.norm(record.final.com - state.com) < 0.02


def test_a_soft_problem_far_from_any_state_that_can_be_controlled_is_solved_quickly():
    """Weights far apart made DAQP cycle: each of these steps took 0.5 s, and others 15 s."""
    rolls = ["left_ankle_roll_joint", "right_ankle_roll_joint"]
    robot = fb.load("g1", locked=rolls)
    contacts, tasks = fb.Contacts.feet(robot), fb.standing_tasks(robot.standing())
    controller = fb.WholeBodyController(
        robot, contacts.only(contacts.names[0]), tasks, contact_weight=1e4,
        joint_limits=JointLimits.of(robot, weight=10.0), backend="reference",
    )  # fmt: skip
    seconds = []
    for seed in (0, 1, 2, 7, 8, 10):
        state = robot.random_state(seed, spread=0.5)
        start = process_time()
        command = controller(state.q, 60.0 * state.v)
        seconds.append(process_time() - start)
        assert command.solution.residuals.equality < 1e-5
    assert min(seconds) < 0.25


@pytest.mark.parametrize("backend", ["auto", "reference"])
def test_a_control_step_in_a_wild_state_ends_soon_and_names_what_answered(backend):
    """Levels whose soft joint limits are violated took 30 ms, and infeasible ones 0.3 s."""
    robot = judges.load("g1")
    state, contacts = robot.standing(), judges.stance(robot)
    levels = [[fb.CoMTask(state.com)], [fb.OrientationTask("base")], [fb.PostureTask(state.q)]]
    controller = fb.WholeBodyController(robot, contacts, levels, backend=backend)
    seconds, answered = [], set()
    for seed in range(6):
        wild = robot.random_state(seed, spread=0.5)
        start = process_time()
        with suppress(SolverError):
            command = controller.attempt(wild.q, 5.0 * wild.v)
            answered.add(command and command.solver)
        seconds.append(process_time() - start)
    assert answered and "active_set" not in answered
    assert np.median(seconds) < 0.1


def test_a_conflict_that_is_read_later_survives_a_pickle(go2):
    controller = judges.controller_of("go2", min_normal_force=500.0)
    with pytest.raises(InfeasibleError) as caught:
        controller(go2.standing().q, np.zeros(go2.nv))
    caught.value.add_note("at state 3")
    copied = pickle.loads(pickle.dumps(caught.value))
    assert copied.__notes__ == ["at state 3"]
    assert copied.constraints == caught.value.constraints != ()
    assert str(copied) == str(caught.value) and repr(copied) == repr(caught.value)
