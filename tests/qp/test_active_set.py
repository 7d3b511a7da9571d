"""The active-set solver: right answers, a true record of the iterations, termination."""

from dataclasses import replace
from itertools import pairwise

import judges
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from scipy.optimize import linprog

import floatbase as fb
from floatbase.errors import InfeasibleError, SolverError
from floatbase.lessons.lessonC import table_top
from floatbase.qp import FEASIBILITY_TOLERANCE, QP, active_set, solve

BOX = np.vstack([np.eye(2), -np.eye(2)])


def problem(H, g, G=(), h=(), A=(), b=()):
    """A QP of small arrays; rows that are not given are none."""
    n = len(np.asarray(g))
    rows = [np.asarray(M, dtype=np.float64).reshape(-1, n) for M in (A, G)]
    return QP(np.asarray(H), np.asarray(g), rows[0], np.asarray(b), rows[1], np.asarray(h))


def check_optimum(run, tolerance=1e-7):
    """Karush, Kuhn and Tucker: sufficient for a convex problem, whoever solved it."""
    qp, r = run.solution.qp, run.solution.residuals
    scale = 1.0 + float(np.max(np.abs(qp.H) @ np.abs(run.solution.x) + np.abs(qp.g)))
    assert r.stationarity < tolerance * scale and r.equality < tolerance
    assert r.inequality < 10 * FEASIBILITY_TOLERANCE * float(np.max(qp.row_norms, initial=1.0))
    assert r.complementarity < tolerance * scale and r.dual == 0.0


def check_record(run):
    """Each iteration starts where the last arrived, satisfies all rows, raises no objective and
    says what it did.
    """
    qp = run.solution.qp
    scale = 1.0 + abs(run.iterations[0].objective)
    for now, after in pairwise(run.iterations):
        assert np.allclose(now.x_next, after.x)
        assert after.objective <= now.objective + 1e-9 * scale
        if now.blocking is not None:
            assert now.multipliers == {} and now.dropped is None
            assert after.working_set == (*now.working_set, now.blocking)
        else:
            assert now.dropped is not None and now.multipliers[now.dropped] < 0
            assert after.working_set == tuple(row for row in now.working_set if row != now.dropped)
    for step in run.iterations:
        assert np.all(qp.G @ step.x - qp.h <= 10 * FEASIBILITY_TOLERANCE * qp.row_norms)
        assert np.allclose(qp.A @ step.x, qp.b, atol=1e-7)
        held = [qp.inequality_names.index(row) for row in step.working_set]
        assert np.allclose((qp.G @ step.x - qp.h)[held], 0.0, atol=1e-7)
        assert not held or np.linalg.matrix_rank(qp.G[held] @ qp.equality_space.A) == len(held)
        assert step.objective == pytest.approx(qp.objective(step.x), rel=1e-9, abs=1e-9)
    last = run.iterations[-1]
    assert last.step_length == 1.0 and last.blocking is None and last.dropped is None
    assert last.working_set == run.working_set
    assert np.allclose(last.x_next, run.solution.x)
    for now, after in pairwise(run.phase_one):
        assert after.objective <= now.objective + 1e-12


# the course text's table --------------------------------------------------------------------------


def test_a_minimum_above_the_table_makes_the_row_inactive_and_it_might_not_be_there():
    run = active_set(table_top(minimum=(0.5, 1.0)))
    assert np.allclose(run.solution.x, [0.5, 1.0])
    assert run.solution.active == () == run.working_set


def test_a_minimum_below_the_table_makes_the_row_active_and_it_might_be_an_equality():
    qp = table_top(minimum=(0.5, -1.0))
    found = active_set(qp).solution
    equality = solve(QP(qp.H, qp.g, qp.G, qp.h, np.zeros((0, 2)), np.zeros(0)))
    assert found.active == ("table",)
    assert np.allclose(found.x, [0.5, 0.0])
    assert np.allclose(found.x, equality.x)
    # the minimum lies 1 m below, at curvature 1
    assert found.multipliers["table"] == pytest.approx(1.0)


def test_the_way_to_a_minimum_below_the_table_is_down_to_it_and_along_it():
    first, second = active_set(table_top((0.5, -1.0)), start=(0.0, 1.0)).iterations
    assert (first.working_set, first.blocking, first.step_length) == ((), "table", 0.5)
    assert np.allclose(first.direction, [0.5, -2.0])
    assert np.allclose(first.x_next, [0.25, 0.0])
    assert (second.working_set, second.blocking, second.step_length) == (("table",), None, 1.0)
    assert np.allclose(second.direction, [0.25, 0.0])
    assert second.multipliers == {"table": pytest.approx(1.0)} and second.dropped is None


def test_a_row_that_would_have_to_pull_is_dropped():
    run = active_set(table_top((0.5, 1.0)), start=(0.0, 0.0), working_set=["table"])
    first, second = run.iterations
    assert first.multipliers == {"table": pytest.approx(-1.0)} and first.dropped == "table"
    assert second.working_set == ()
    assert np.allclose(second.x_next, [0.5, 1.0])


def test_a_start_below_the_table_is_lifted_onto_it_before_anything_is_minimized():
    run = active_set(table_top((0.5, -1.0)), start=(0.0, -3.0))
    assert run.phase_one[0].objective == pytest.approx(3.0)  # the largest violation, m
    assert np.allclose(run.iterations[0].x, [0.0, 0.0])
    assert run.solution.iterations == len(run.phase_one) + len(run.iterations)
    check_record(run)


# stopped before the end ---------------------------------------------------------------------------


def test_a_stopped_run_equals_the_beginning_of_the_whole_run_and_has_not_converged():
    for qp in [*controller_qps("go2", 4, torque=0.3), table_top()]:
        whole = active_set(qp)
        rounds = [*whole.phase_one, *whole.iterations]
        for most in range(1, len(rounds) + 2):
            run = active_set(qp, max_iterations=most)
            kept = rounds[:most]
            assert run.solution.iterations == len(kept) == len(run.phase_one) + len(run.iterations)
            assert run.converged == (most >= len(rounds))
            assert np.allclose(run.solution.x, kept[-1].x_next, atol=1e-9)
            assert run.converged or not np.any(run.solution.inequality_multipliers)


def test_a_stopped_run_can_be_taken_up_again_where_it_ended():
    for qp in controller_qps("go2", 6, torque=0.3):
        run = active_set(qp, max_iterations=1)
        for _ in range(60):
            x, working = run.solution.x, run.working_set
            run = active_set(qp, x, working, max_iterations=1)
        assert run.converged
        assert np.allclose(run.solution.x, solve(qp).x, atol=1e-7)


# the controller's problems ------------------------------------------------------------------------


def controller_qps(name, n, torque, mu=0.5):
    """n problems of random states near standing, half of them calm, half far off; motors with part
    of their torque.
    """
    robot = judges.load(name)
    limits = torque * robot.torque_limits
    controller = fb.WholeBodyController(
        robot,
        judges.stance(robot, mu),
        fb.standing_tasks(robot.standing()),
        torque_limits=limits,
        backend="reference",
    )
    states = [robot.random_state(seed, (0.05, 0.15)[seed % 2]) for seed in range(n)]
    return [replace(controller.qp(state, slacks=False), penalties=None) for state in states]


@pytest.mark.parametrize("name", judges.KINDS)
def test_the_solver_agrees_with_daqp_on_20_problems_of_a_robot_and_records_its_iterations(name):
    active, infeasible = "", 0
    for qp in controller_qps(name, 20, torque=0.3):
        try:
            solution = solve(qp)
        except InfeasibleError:  # weak motors cannot hold each state; both must say so
            infeasible += 1
            with pytest.raises(InfeasibleError):
                active_set(qp)
            continue
        run = active_set(qp)
        assert np.max(np.abs(run.solution.x - solution.x)) < 1e-7
        check_optimum(run)
        check_record(run)
        active += " ".join(run.solution.active)
    assert infeasible <= 5
    assert "torque" in active
    assert "facet" in active or not judges.load(name).feet


def swaying_qps(name, ticks, dt=0.002):
    """The problems of consecutive ticks while the centre of mass has a target that sways more than
    a slippery floor allows.
    """
    robot = judges.load(name)
    state = robot.standing()
    com = fb.CoMTask(lambda t: state.com + np.array([0.0, 0.1 * np.sin(6.0 * t), 0.0]), kp=300.0)
    tasks = [com, *fb.standing_tasks(state)[1:]]
    contacts = judges.stance(robot, mu=0.25)
    limits = 0.6 * robot.torque_limits
    options = {"torque_limits": limits, "backend": "reference"}
    controller = fb.WholeBodyController(robot, contacts, tasks, **options)
    qps = []
    for tick in range(ticks):
        qps.append(replace(controller.qp(state, 0.2 + tick * dt, slacks=False), penalties=None))
        v = state.v + dt * solve(qps[-1])["qdd"]
        state = state.replace(pin.integrate(robot.model, state.q, dt * v), v)
    return qps


@pytest.mark.parametrize(("name", "ticks"), [("go2", 50), ("talos", 8)])
def test_a_warm_start_from_the_last_tick_needs_fewer_iterations(name, ticks):
    cold, warm, last = [], [], None
    for qp in swaying_qps(name, ticks):
        run = active_set(qp)
        if last is not None:
            again = active_set(qp, start=last.solution.x, working_set=last.working_set)
            assert np.allclose(again.solution.x, run.solution.x, atol=1e-7)
            cold.append(run.solution.iterations)
            warm.append(again.solution.iterations)
        last = run
    print(f"{name}: {np.mean(cold):.2f} iterations cold, {np.mean(warm):.2f} warm")
    assert sum(warm) < 0.7 * sum(cold)
    assert np.median(warm) == 1  # most ticks keep the active set of the last one


# degenerate, infeasible, unbounded ----------------------------------------------------------------


CORNER = [[1, 0], [0, 1], [1, 1], [2, 1], [1, 2], [1, 0]]  # six rows through one point of the plane

TURN = np.linspace(0, 2 * np.pi, 64, endpoint=False)
CONE = np.column_stack([np.cos(TURN), np.sin(TURN), np.full(64, -0.7)])
WALLS, REPEATED = [[-1, 0], [0, -1], [1, 1]], [[1, 1], [1, 1], [2, 2]]
DEGENERATE = {
    "duplicate rows": problem(np.eye(2), [-3, -1], [[1, 0], [1, 0], [2, 0], [1, 0]], [1, 1, 2, 1]),
    "dependent rows": problem(np.eye(2), [-3, -3], [[1, 0], [0, 1], [1, 1]], [1, 1, 2]),
    "a vertex of more rows than variables": problem(np.eye(2), [-5, -4], CORNER, np.zeros(6)),
    "a cone of 64 facets, pushed into its tip": problem(np.eye(3), [0, 0, 1], CONE, np.zeros(64)),
    "a single point": problem(np.eye(2), [1, 2], BOX, [1, 1, -1, -1]),
    "a single point between three walls": problem(np.eye(2), [1, 2], WALLS, [-1, -1, 2]),
    "a point of two equalities": problem(np.eye(2), [1, 2], [[1, 0]], [1], np.eye(2), [1, 1]),
    "an equality written as two rows": problem(np.eye(2), [-3, -1], [[1, 1], [-1, -1]], [1, -1]),
    "repeated equalities": problem(np.eye(2), [1, 2], -np.eye(2), [0, 0], REPEATED, [1, 1, 2]),
    "a row that is an equality": problem(np.eye(2), [1, 2], [[1, 1]], [1], [[1, 1]], [1]),
    "a row of zeros": problem(np.eye(2), [1, 2], [[0, 0], [1, 0]], [0, -2]),
    "a table in other units": problem(np.eye(2), [-3, -1], [[1e6, 0], [1e-6, 0]], [1e6, 1e-6]),
    "a weakly active row": problem(np.eye(2), [-1, 0], [[1, 0], [0, -1]], [1, 0]),
    "no curvature, a box": problem(np.zeros((2, 2)), [1, -2], BOX, np.ones(4)),
    "no curvature along one axis": problem(np.diag([1.0, 0.0]), [1, -2], [[1, 1]], [3]),
    "a flat valley": problem(np.diag([1.0, 0.0]), [1, 0], [[1, 1]], [3]),
    "no objective at all": problem(np.zeros((2, 2)), [0, 0], BOX, [1, 1, -1, -0.5]),
}


@pytest.mark.parametrize("name", DEGENERATE)
@pytest.mark.parametrize("start", [None, (0.0, 0.0, 0.0), (7.0, -5.0, 3.0)])
def test_degenerate_problems_end_at_the_optimum(name, start):
    qp = DEGENERATE[name]
    run = active_set(qp, None if start is None else start[: qp.n])
    check_optimum(run)
    check_record(run)
    assert run.solution.objective == pytest.approx(solve(qp, "cvxpy").objective, abs=1e-6)
    # every row at once: dependent ones are left out
    again = active_set(qp, run.solution.x, qp.inequality_names)
    assert np.allclose(again.solution.objective, run.solution.objective)


def test_beales_cycling_example_terminates():
    """Beale (1955): by the steepest multiplier and no rule for ties the simplex method comes back
    to its start.
    """
    rows = [[0.25, -60.0, -1 / 25, 9.0], [0.5, -90.0, -1 / 50, 3.0], [0.0, 0.0, 1.0, 0.0]]
    rows += [*-np.eye(4)]
    qp = problem(np.zeros((4, 4)), [-0.75, 150.0, -1 / 50, 6.0], rows, [0, 0, 1, 0, 0, 0, 0])
    run = active_set(qp, np.zeros(4), [f"inequality {i}" for i in range(3, 7)])
    assert run.solution.objective == pytest.approx(-1 / 20)
    assert any(step.step_length == 0.0 for step in run.iterations)  # it does stand still on the way
    check_optimum(run)
    check_record(run)


@pytest.mark.parametrize(
    "qp",
    [
        problem(np.eye(2), [1, 2], [[1, 0], [-1, 0]], [-1, -1]),
        problem(np.eye(2), [1, 2], [[1, 0], [1, 0], [-1, 0], [0, 1], [1, 1]], [1, 1, -2, 5, 9]),
        problem(np.eye(2), [1, 2], [[-1, 0], [0, -1], [1, 1], [1, 0]], [-1, -1, 1.9, 7]),
        problem(np.eye(2), [1, 2], [[1, 0]], [0.5], [[1, 0]], [1]),
        problem(np.eye(2), [1, 2], [[1, 0]], [0.5], np.eye(2), [1, 1]),
        problem(np.eye(2), [1, 2], [[0, 0]], [-1]),
        problem(np.zeros((2, 2)), [1, 2], [[1, 0], [-1, 0]], [-1, -1]),
        problem(np.eye(2), [1, 2], [[1, 0], [-1, 0]], [1, -1 - 1e-6]),
    ],
)
def test_infeasible_problems_end_with_a_smallest_set_of_rows_in_conflict(qp):
    for start in (None, (0.0, 0.0), (50.0, -20.0)):
        with pytest.raises(InfeasibleError) as caught:
            active_set(qp, start)
        assert judges.is_smallest_conflict(qp, caught.value.constraints)
    with pytest.raises(InfeasibleError):
        solve(qp, "active_set")


def test_curvature_only_counts_where_the_equalities_hold():
    found = active_set(problem(np.diag([1.0, -1.0]), [-2, 0], (), (), [[0, 1]], [3])).solution
    assert np.allclose(found.x, [2.0, 3.0])


# random problems ----------------------------------------------------------------------------------


def random_qp(seed):
    """Whole numbers, so that rows repeat, depend and meet; H of any rank; feasible or not, bounded
    or not.
    """
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 7))
    rows, equalities = int(rng.integers(0, 4 * n + 1)), int(rng.integers(0, min(3, n) + 1))

    def whole(*shape):
        return rng.integers(-2, 3, shape).astype(np.float64)

    root = whole(int(rng.integers(0, n + 1)), n)
    G = whole(rows, n)
    A = whole(equalities, n)
    inside = whole(n)
    h = whole(rows) if rng.random() < 0.3 else G @ inside + rng.integers(0, 2, rows)
    return QP(root.T @ root, whole(n), A, A @ inside, G, h)


def verdict(qp):
    """By linear programs: is there a point, and a direction without curvature or row where the
    objective falls?
    """
    if not judges.is_feasible(qp, list(range(len(qp.G)))):
        return "infeasible"
    flat = np.vstack([qp.H, qp.A])
    none, still = np.zeros(len(qp.G)), np.zeros(len(flat))
    falls = linprog(qp.g, qp.G, none, flat, still, bounds=(-1.0, 1.0), method="highs")
    return "unbounded" if falls.fun < -1e-9 else "optimal"


@given(st.integers(0, 10**9))
@hypothesis_settings(max_examples=60)
def test_random_problems_end_with_the_verdict_that_linear_programs_give(seed):
    qp, expected = random_qp(seed), verdict(random_qp(seed))
    try:
        run = active_set(qp)
    except InfeasibleError as error:
        assert expected == "infeasible"
        assert judges.is_smallest_conflict(qp, error.constraints)
    except SolverError as error:
        assert expected == "unbounded", error
    else:
        assert expected == "optimal"
        check_optimum(run)
        check_record(run)


@given(st.integers(0, 10**9), st.integers(0, 10**9))
@hypothesis_settings(max_examples=40)
def test_any_start_and_any_working_rows_lead_to_the_same_optimum(seed, other):
    qp, rng = random_qp(seed), np.random.default_rng(other)
    if verdict(qp) != "optimal":
        return
    working = [name for name in qp.inequality_names if rng.random() < 0.4]
    run = active_set(qp, 3.0 * rng.normal(size=qp.n), working)
    check_optimum(run)
    check_record(run)
    expected = active_set(qp).solution.objective
    assert run.solution.objective == pytest.approx(expected, rel=1e-8, abs=1e-8)
