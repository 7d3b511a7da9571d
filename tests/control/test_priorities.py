"""Strict priorities: no level of random problems can be improved, and what levels may contain."""

from dataclasses import replace
from itertools import pairwise

import judges
import numpy as np
import pytest
from messages import raises
from scipy.linalg import null_space
from scipy.optimize import linprog, lsq_linear, nnls

import floatbase as fb
from floatbase.control import JointLimits, _priorities, build_qp
from floatbase.errors import InfeasibleError, InputError, SolverError
from floatbase.objectives import AngularMomentumTask, AxisTask
from floatbase.qp.solve import Budget


def levels_of(robot: fb.Robot, state: fb.State) -> list[list[object]]:
    """Return three levels: base orientation and height, a far centre of mass, and posture."""
    com = state.com + [0.3, 0.1, -0.05]
    return [
        [fb.OrientationTask("base", np.eye(3), kp=100.0)],
        [fb.CoMTask(com, kp=100.0)],
        [fb.PostureTask(state.q, kp=50.0), fb.ForceTask(weight=1e-4), fb.TorqueTask(weight=1e-4)],
    ]


def test_levels_are_answered_by_the_reference_backend(go2):
    contacts, state = judges.stance(go2), go2.standing()
    levels = levels_of(go2, state)
    controller = fb.WholeBodyController(go2, contacts, levels)
    assert controller.backend == "reference" and "priorit" in controller.backend_reason
    assert controller.problem.level_sizes == (1, 1, 3)
    command = controller(state.q, state.v)
    assert np.array_equal(command.solution.qp.b, controller.qp(state).b)
    flat = controller.replace(tasks=fb.standing_tasks(state))
    assert flat.backend == "compiled" and flat.problem.level_sizes == ()
    assert [len(level) for level in controller.tasks] == [1, 1, 3]
    longer = controller.replace(tasks=[*controller.tasks, [fb.TorqueTask(weight=1e-3)]])
    assert longer.problem.level_sizes == (1, 1, 3, 1)
    with raises(InputError, "level"):
        controller.replace(tasks=[*controller.tasks, fb.TorqueTask()])
    lifted = controller.replace(contacts=contacts.only(*contacts.names[1:]))
    assert lifted.problem.level_sizes == (1, 1, 3)
    lifted(state.q, state.v)
    with raises(InputError, "backend"):
        fb.WholeBodyController(go2, contacts, levels, backend="compiled")
    for wrong in ([levels[0], levels[1][0]], [[], levels[0]]):
        with raises(InputError, "level"):
            fb.WholeBodyController(go2, contacts, wrong)
    with raises(InputError, "modify_qp"):
        fb.WholeBodyController(go2, contacts, levels, modify_qp=lambda qp, eom: qp)


def test_levels_with_soft_contacts_and_soft_limits(go2):
    contacts, state = judges.stance(go2), go2.standing()
    levels, options = levels_of(go2, state), {"on_infeasible": "soften"}
    controller = fb.WholeBodyController(go2, contacts, levels, min_normal_force=500.0, **options)
    command = controller(state.q, state.v)
    assert command.softened and command.violations
    soft = fb.WholeBodyController(go2, contacts, levels_of(go2, state), contact_weight=1e4)
    assert soft.problem.level_sizes == (2, 1, 3)
    eom = fb.equations_of_motion(state, contacts)
    qdd = soft(state.q, state.v).qdd
    assert np.allclose(eom.A @ qdd, eom.b, atol=0.1)


@pytest.mark.parametrize("robot", ["go2", "solo12"], indirect=True)
def test_active_inequalities_of_a_level_are_exact_in_the_levels_after_it(robot, monkeypatch):
    """A hundred times larger tolerance of rounding used to move torques by 1e-5 N·m."""
    limits = JointLimits.of(robot, weight=None)
    tasks = levels_of(robot, robot.standing())
    controller = fb.WholeBodyController(robot, judges.stance(robot), tasks, joint_limits=limits)
    for state in judges.states(robot.name, 2, 0.05):
        levels = controller.problem.solve_levels(state)
        with monkeypatch.context() as patch:
            patch.setattr(_priorities, "FEASIBILITY_TOLERANCE", 1e-7)
            coarse = controller.problem.solve_levels(state)[-1]
        assert np.allclose(coarse["tau"], levels[-1]["tau"], rtol=0.0, atol=1e-7)
        assert levels[1].active and set(levels[1].active) <= set(levels[-1].active)
        assert levels[1].multipliers.items() <= levels[-1].multipliers.items()


def random_problem(name: str, seed: int) -> tuple[fb.State, fb.WholeBodyController]:
    """Return a state and a controller with random tasks in two to four levels."""
    robot, rng = judges.load(name), np.random.default_rng([seed, len(name), ord(name[0])])
    standing, contacts = robot.standing(), judges.stance(robot, rng.uniform(0.2, 1.2))
    state = robot.random_state(seed, rng.choice([0.0, 0.02, 0.1, 0.3]))
    frame, kp = str(rng.choice(robot.frames)), rng.uniform(1.0, 100.0)
    away, axis, momentum = rng.normal(0.0, 0.2, 3), rng.normal(size=3), rng.normal(size=3)
    weights = [*10.0 ** rng.uniform(-2.0, 2.0, 6), *10.0 ** rng.uniform(-6.0, -1.0, 2)]
    tasks = [
        fb.CoMTask(standing.com + away, weight=weights[0]),
        fb.OrientationTask("base", np.eye(3), kp=kp, weight=weights[1]),
        fb.FrameTask(frame, state.point(frame) - away, kp=kp, weight=weights[2]),
        AxisTask(frame, [0.0, 0.0, 1.0], axis, weight=weights[3]),
        AngularMomentumTask(momentum, weight=weights[4]),
        fb.PostureTask(standing.q, kp=kp, weight=weights[5]),
        fb.ForceTask(weight=weights[6]),
        fb.TorqueTask(weight=weights[7]),
    ]
    chosen = [tasks[i] for i in rng.permutation(len(tasks))[: rng.integers(4, 9)]]
    cuts = [0, *np.sort(rng.choice(np.arange(1, 4), rng.integers(1, 4), replace=False)), None]
    options = {
        "contact_weight": rng.choice([None, 10.0 ** rng.uniform(1.0, 4.0)]),
        "joint_limits": rng.choice(
            [None, JointLimits.of(robot, weight=None), JointLimits.of(robot, weight=30.0)]
        ),
        "facets": int(rng.integers(3, 9)),
        "min_normal_force": rng.choice([0.0, 5.0]),
        "normal_force_weight": rng.choice([None, 10.0 ** rng.uniform(0.0, 3.0)]),
    }
    levels = [chosen[begin:end] for begin, end in pairwise(cuts)]
    return state, fb.WholeBodyController(robot, contacts, levels, **options)


def possible_gain(
    H: np.ndarray, slope: np.ndarray, held: np.ndarray, G: np.ndarray, slack: np.ndarray,
    most: np.ndarray,
) -> float:  # fmt: skip
    """Return by how much a step that keeps `held` and G x ≤ h lowers a cost, at least.

    The step is along the steepest feasible descent: what is left of the slope if the active rows
    balance it as well as they can, by nonnegative or bounded least squares.
    """
    Z = null_space(held, rcond=1e-9)
    near = slack < 1e-7
    fixed = np.where(slack[near] < -1e-7, most[near], 0.0)  # violated soft rows push fully
    rows, left = (G[near] @ Z).T, -Z.T @ slope
    left = left - rows @ fixed
    if rows.size:
        balance = nnls(rows, left, maxiter=10_000)[0]
        if np.any(balance > most[near] - fixed):
            bounds = (0.0, np.maximum(most[near] - fixed, 1e-12))
            balance = lsq_linear(rows, left, bounds, "bvls", max_iter=2000).x
        left = left - rows @ balance
    step = Z @ left
    rates, curvature = G @ step, step @ H @ step
    blocking = ~near & (rates > 0.0)
    length = np.min(slack[blocking] / rates[blocking], initial=(left @ left) / (curvature or 1.0))
    return float(length * (left @ left) - length**2 * curvature / 2.0)


def check_levels(state: fb.State, controller: fb.WholeBodyController) -> bool:
    """Check that no level can be improved; return whether there is a solution."""
    problem = controller.problem
    eom = fb.equations_of_motion(state, controller.contacts)
    qp = build_qp(eom, problem.tasks, problem.limits, slacks=False)
    G, h = qp.G / qp.row_norms[:, None], qp.h / qp.row_norms
    most = np.full(len(h), np.inf) if qp.penalties is None else qp.penalties * qp.row_norms
    try:
        solutions = problem.solve_levels(state)
    except InfeasibleError:
        hard = ~np.isfinite(most)
        least = linprog(np.zeros(qp.n), G[hard], h[hard], qp.A, qp.b, bounds=(None, None))
        assert least.status == 2
        return False
    held, right = qp.A, qp.b
    for level, solution in zip(problem.levels, solutions, strict=True):
        x, slope, cost, parts = solution.x, np.zeros(qp.n), 0.0, []
        for task in level:
            A, b = task.residual(eom)
            parts.append(np.zeros((len(b), qp.n)))
            parts[-1][:, qp.blocks[task.block]] = np.sqrt(task.weight) * A
            values = np.sqrt(task.weight) * (A @ solution[task.block] + b)
            slope, cost = slope + parts[-1].T @ values, cost + values @ values / 2.0
        J = np.vstack(parts)
        assert np.allclose(held @ x, right, rtol=1e-7, atol=1e-6)
        if solution is solutions[0]:
            violated = G @ x - h
            assert np.all(violated[~np.isfinite(most)] < 1e-6)
        else:
            h, most = np.maximum(h, G @ solutions[0].x), np.full(len(h), np.inf)
            assert np.all(G @ x - h < 1e-6)
        gain = possible_gain(J.T @ J, slope, held, G, h - G @ x, most)
        assert gain < 1e-5 * (1.0 + cost), [task.name for task in level]
        lengths = np.linalg.norm(J, axis=1)
        held = np.vstack([held, J / np.maximum(lengths, 1e-6 * lengths.max())[:, None]])
        right = held @ x
    return True


@pytest.mark.parametrize(
    ("name", "n"),
    [("go2", 20), ("talos", 35), ("g1", 25)]
    + [
        pytest.param(name, n, marks=pytest.mark.front_end)
        for name, n in (("solo12", 130), ("hyq", 130), ("anymal_kinova", 130), ("talos", 130))
    ],
)
def test_no_level_of_random_problems_can_be_improved(name, n):
    solved = sum(check_levels(*random_problem(name, seed)) for seed in range(n))
    assert solved > n / 3


@pytest.mark.parametrize("factor", [1e-16, 1e16])
def test_a_factor_of_all_weights_changes_no_answer(factor, go2):
    """Only the ratios of the weights in a level count, also for which rows are zero."""
    contacts, limits = judges.stance(go2), JointLimits.of(go2, weight=None)
    levels = levels_of(go2, go2.standing())
    scaled = [[replace(task, weight=factor * task.weight) for task in level] for level in levels]
    for state in judges.states("go2", 3, 0.05):
        x, y = (
            fb.WholeBodyController(go2, contacts, each, joint_limits=limits)(state.q, state.v)
            for each in (levels, scaled)
        )
        assert np.allclose(x.tau, y.tau, rtol=0.0, atol=1e-6 * np.max(np.abs(x.tau)))


def test_tasks_of_one_name_can_be_in_several_levels(go2):
    contacts, state = judges.stance(go2), go2.random_state(1, 0.05)
    first, second = (fb.OrientationTask("base", kp=kp) for kp in (100.0, 20.0))
    tasks = [[first, first], [second], [fb.PostureTask(go2.standing().q)]]
    controller = fb.WholeBodyController(go2, contacts, tasks)
    alone = controller.replace(tasks=[[first], tasks[-1]])
    assert np.allclose(
        controller(state.q, state.v).tau, alone(state.q, state.v).tau, rtol=0.0, atol=1e-6
    )
    names = controller.qp(state).equality_names
    rows = [name for name in names if "orientation of base 0" in name]
    assert len(rows) == 3 and {label.owner for label in rows} == {first.name}


@pytest.mark.parametrize("robot", ["g1", "talos"], indirect=True)
def test_levels_of_a_pushed_humanoid_need_no_fallback(robot):
    """Levels with small slopes, and rows that meet in one point, used to need `active_set`."""
    state, contacts = robot.standing(), judges.stance(robot)
    first = [fb.CoMTask(state.com)], [fb.OrientationTask("base")], [fb.PostureTask(state.q)]
    for levels in (first, ([*first[0], *first[1]], first[2])):
        for stance in (contacts, contacts.only(contacts.names[0])):
            controller = fb.WholeBodyController(robot, stance, list(levels))
            pushed = [np.random.default_rng(seed).normal(0.0, 0.5, 3) for seed in range(4)]
            solved = [
                controller(state.q, np.append(push, np.zeros(robot.nv - 3))).solution.solver
                for push in [np.zeros(3), *pushed]
            ]
            assert solved.count("daqp") >= len(solved) - 1


def test_a_fallback_in_the_first_level_is_reported_by_the_last(monkeypatch, go2):
    state, solve = go2.standing(), _priorities.solve_in_step
    used = iter(["active_set", "daqp", "daqp"])
    monkeypatch.setattr(_priorities, "solve_in_step", lambda qp, _, b: solve(qp, next(used), b))
    controller = fb.WholeBodyController(go2, judges.stance(go2), levels_of(go2, state))
    assert controller(state.q, state.v).solver == "active_set"


def test_a_level_without_an_answer_in_time_leaves_the_answer_of_the_levels_before(monkeypatch, go2):
    state, solve, left = go2.standing(), _priorities.solve_in_step, [1]

    def fail_after_one_level(qp, solver, budget):
        budget = budget if left.pop() else Budget(work=0.0)
        left.append(0)
        return solve(qp, solver, budget)

    levels = levels_of(go2, state)
    controller = fb.WholeBodyController(go2, judges.stance(go2), levels)
    first = controller.problem.solve_levels(state)[0]
    monkeypatch.setattr(_priorities, "solve_in_step", fail_after_one_level)
    command = controller(state.q, state.v)
    assert command.solver == "level 1 of 3" and np.allclose(command.tau, first["tau"], atol=1e-6)
    with pytest.raises(SolverError):  # without a level before
        controller(state.q, state.v)
