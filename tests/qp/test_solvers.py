"""The back ends behind `solve`: one answer and one set of errors, whatever the units."""

import sys
from fractions import Fraction

import judges
import numpy as np
import pytest
from messages import missing, raises, refused

import floatbase as fb
from floatbase.errors import InfeasibleError, MissingDependencyError, SolverError
from floatbase.qp import FEASIBILITY_TOLERANCE, QP, solve, solvers

NONE = np.zeros((0, 2)), np.zeros(0)
# N·m: a rounding of 1e-16 divided by a part of 1e-12 in curvature is 1e-4; polished answers leave
# some 1e-9
LAST_DIGITS = 1e-7
EXACT = ("daqp", "active_set")  # solvers that end at a vertex of rows rather than near it


def corner(scale=1.0, row_scale=1.0, equality_scale=1.0):
    """min ½ x² + ½ y² + ½ z² - 3 x, x ≤ 1, y ≥ 0.5, x + z = 2, in other units: (1, 0.5, 1), μ = (3,
    0.5), ν = -1.
    """
    return QP(
        scale * np.eye(3),
        scale * np.array([-3.0, 0.0, 0.0]),
        equality_scale * np.array([[1.0, 0.0, 1.0]]),
        equality_scale * np.array([2.0]),
        row_scale * np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]),
        row_scale * np.array([1.0, -0.5]),
        inequality_names=("wall", "step"),
    )


@pytest.mark.parametrize("solver", solvers())
@pytest.mark.parametrize("scale", [1e-9, 1e-4, 1.0, 1e4, 1e9])
def test_the_unit_of_the_objective_changes_multipliers_only(solver, scale):
    found = solve(corner(scale=scale), solver)
    assert np.allclose(found.x, [1.0, 0.5, 1.0], atol=1e-6)
    assert np.allclose(found.inequality_multipliers, scale * np.array([3.0, 0.5]), rtol=1e-5)
    assert np.allclose(found.equality_multipliers, [-scale], atol=1e-5 * scale)
    assert found.active == ("wall", "step")


@pytest.mark.parametrize("solver", EXACT)
@pytest.mark.parametrize("row_scale", [1e-6, 1e-3, 1e3, 1e6])
def test_the_unit_of_a_row_changes_its_multiplier_only(solver, row_scale):
    found = solve(corner(row_scale=row_scale), solver)
    assert np.allclose(found.x, [1.0, 0.5, 1.0])
    assert np.allclose(found.inequality_multipliers * row_scale, [3.0, 0.5])
    assert found.active == ("wall", "step")


@pytest.mark.parametrize("solver", solvers())
@pytest.mark.parametrize("equality_scale", [1e-12, 1e12])
def test_the_unit_of_an_equation_does_not_make_it_disappear(solver, equality_scale):
    """An equation in units of 1e-12 beside one in units of 1 must not count as one of rank 0."""
    small = corner(equality_scale=equality_scale)
    A, b = np.vstack([small.A, [0.0, 1.0, 0.0]]), np.append(small.b, 0.75)
    qp = QP(small.H, small.g, A, b, small.G, small.h)
    assert qp.equality_space.n_in == 1
    found = solve(qp, solver)
    assert np.allclose(found.x, [1.0, 0.75, 1.0], atol=1e-6)
    assert found.residuals.stationarity < 1e-5


def test_the_reduced_problem_is_the_problem_on_the_space_of_its_equalities():
    qp = judges_qp("go2", 1)
    space, inner = qp.equality_space, qp.reduced
    assert inner.n == space.n_in and inner.inequality_names == qp.inequality_names
    offset = qp.objective(space.b)
    for beta in np.random.default_rng(0).normal(size=(5, inner.n)):
        assert inner.objective(beta) + offset == pytest.approx(qp.objective(space(beta)), rel=1e-9)
        assert np.allclose(inner.G @ beta - inner.h, qp.G @ space(beta) - qp.h, atol=1e-9)
    alone = QP(inner.H, inner.g, np.zeros((0, inner.n)), np.zeros(0), inner.G, inner.h)
    assert np.allclose(space(solve(alone).x), solve(qp).x, atol=1e-9)


def test_what_vanishes_on_the_equalities_comes_out_as_zero_and_not_as_rounding():
    # H, g and the row all look along the direction that the equality fixes
    u = np.array([2.0, -1.0, 1.0])
    qp = QP(
        1e4 * np.outer(u, u), 3.0 * u, u[None], np.array([-3.0]), 7.0 * u[None], np.array([-21.0])
    )
    assert not np.any(qp.reduced.H) and not np.any(qp.reduced.g)
    assert not np.any(qp.reduced.G) and not np.any(qp.reduced.h)
    for solver in solvers():
        assert np.allclose(u @ solve(qp, solver).x, -3.0)


def judges_qp(name, seed):
    robot = judges.load(name)
    limits = 0.4 * robot.torque_limits
    tasks = fb.standing_tasks(robot.standing())
    options = {"torque_limits": limits, "backend": "reference"}
    controller = fb.WholeBodyController(robot, judges.stance(robot, 0.5), tasks, **options)
    return controller.qp(robot.random_state(seed, 0.1), slacks=False)


@pytest.mark.parametrize("name", judges.KINDS[:3])
def test_every_solver_gives_the_controller_the_same_torques(name):
    for seed in range(3):
        qp = judges_qp(name, seed)
        reference = solve(qp, "active_set")
        for solver in solvers():
            found = solve(qp, solver)
            atol = 1e-8 if solver == "daqp" else 1e-3
            assert np.allclose(found["tau"], reference["tau"], atol=atol), solver
            assert found.residuals.inequality < 10 * FEASIBILITY_TOLERANCE or solver not in EXACT


# what has no answer -------------------------------------------------------------------------------


@pytest.mark.parametrize("solver", solvers())
@pytest.mark.parametrize(
    "qp",
    [
        QP(np.zeros((2, 2)), [1.0, -2.0], *NONE, np.eye(2), [1.0, 1.0]),
        QP(np.diag([1.0, 0.0]), [1.0, -2.0], *NONE, *NONE),
        QP(np.diag([1.0, 0.0]), [1.0, -2.0], *NONE, [[1.0, 0.0]], [0.0]),
        QP(1e-6 * np.diag([1.0, 0.0]), [0.0, -2.0], *NONE, [[1.0, -3.0]], [0.0]),
        QP(np.ones((2, 2)), [0.0, -2.0], [[1.0, 1.0]], [2.0], *NONE),
        QP(np.diag([1.0, 0.0]), [0.0, -1.0], *NONE, [[1.0, -1.0], [-1.0, -1.0]], [0.0, 0.0]),
    ],
)
def test_every_solver_refuses_an_unbounded_objective(solver, qp):
    refused(lambda: solve(qp, solver), SolverError)


@pytest.mark.parametrize("solver", solvers())
def test_every_solver_calls_an_objective_that_curves_downwards_not_convex(solver):
    box = np.vstack([np.eye(2), -np.eye(2)])
    with raises(SolverError, "H", -1):
        solve(QP(np.diag([1.0, -1.0]), [1.0, 0.0], *NONE, box, np.ones(4)), solver)


@pytest.mark.parametrize("solver", EXACT)
@pytest.mark.parametrize("gap", [1e-8, 1e-6, 1e-2, 1e4])
def test_rows_that_miss_each_other_by_a_little_are_named_as_well(solver, gap):
    G, h = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0]], [1.0, -1.0 - gap, 9.0]
    qp = QP(np.eye(2), [1.0, 2.0], *NONE, G, h)
    with pytest.raises(InfeasibleError) as caught:
        solve(qp, solver)
    assert caught.value.constraints == ("inequality 0", "inequality 1")


@pytest.mark.parametrize("solver", EXACT)
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e6, 1e10])
def test_rows_through_one_point_leave_it_whatever_its_unit(solver, scale):
    """One row is minus a sum of others that it meets at a point: feasible in real numbers, and but
    for rounding in these.
    """
    for seed in range(20):
        rng = np.random.default_rng(seed)
        n = int(rng.integers(2, 8))
        point = scale * rng.normal(size=n)
        meeting = int(rng.integers(1, n))
        G = rng.normal(size=(2 * n, n))
        h = G @ point + scale * np.where(np.arange(2 * n) < meeting, 0.0, rng.uniform(size=2 * n))
        G = np.vstack([G, -rng.uniform(0.1, 1.0, meeting) @ G[:meeting]])
        h = np.append(h, G[-1] @ point)
        qp = QP(np.eye(n), scale * rng.normal(size=n), np.zeros((0, n)), [], G, h)
        broken = solve(qp, solver).residuals.inequality
        assert broken <= 10.0 * (FEASIBILITY_TOLERANCE + 1e-12 * scale), seed


@pytest.mark.parametrize("solver", EXACT)
@pytest.mark.parametrize("slope", 10.0 ** -np.arange(2.0, 16.0))
def test_rows_that_meet_far_away_only_are_met_there_or_refused(solver, slope):
    """x ≤ -1 and slope y ≤ x: nearly parallel rows, which meet at y = -1 / slope."""
    try:
        qp = QP(np.eye(2), np.zeros(2), *NONE, [[1.0, 0.0], [-1.0, slope]], [-1.0, 0.0])
        found = solve(qp, solver)
    except (InfeasibleError, SolverError):
        assert slope < 1e-4
    else:
        assert found.residuals.inequality <= FEASIBILITY_TOLERANCE + 1e-12 / slope


@pytest.mark.parametrize("slope", [1e-11, 1e-13])
def test_equalities_that_nearly_repeat_each_other_are_named(slope):
    with pytest.raises(InfeasibleError) as caught:
        solve(QP(np.eye(2), np.zeros(2), [[1.0, 0.0], [1.0, slope]], [0.0, 1.0], *NONE))
    assert caught.value.constraints == ("equality 0", "equality 1")


@pytest.mark.parametrize("solver", solvers())
def test_inconsistent_equalities_are_named_by_a_smallest_set(solver):
    A = np.array([[1.0, 0.0], [1.0, 1.0], [2.0, 0.0], [0.0, 1.0], [0.0, 3.0]])
    names = ("x is 1", "sum is 3", "x is 1.5", "y is 2", "y is 2 again")
    qp = QP(np.eye(2), np.zeros(2), A, [1.0, 3.0, 3.0, 2.0, 6.0], *NONE, equality_names=names)
    with pytest.raises(InfeasibleError) as caught:
        solve(qp, solver)
    assert not missing(str(caught.value), *caught.value.constraints)
    kept = [names.index(row) for row in caught.value.constraints]
    assert set(caught.value.constraints) in (
        {"x is 1", "x is 1.5"},
        {"sum is 3", "x is 1.5", "y is 2"},
        {"sum is 3", "x is 1.5", "y is 2 again"},
    )
    for row in kept:
        rest = [i for i in kept if i != row]
        assert QP(np.eye(2), np.zeros(2), A[rest], qp.b[rest], *NONE).equality_space.n_in >= 0


def residual_torque(solution):
    """How far, N·m, one Newton step on the optimality conditions of the active rows would still
    move a torque.

    The residuals are summed in whole fractions, without rounding: what is small along a direction
    of little curvature would not show in numbers of 16 digits. Then equations in these digits say
    what step they need.
    """
    qp = solution.qp
    active = np.flatnonzero(solution.inequality_multipliers > 0.0)
    rows = np.vstack([qp.A, qp.G[active]])
    multipliers = np.concatenate(
        [solution.equality_multipliers, solution.inequality_multipliers[active]]
    )
    # stationarity along all directions that the rows leave: ν and μ of rows that depend on others
    # are not unique
    slope = exact_sum(np.hstack([qp.H, rows.T]), np.concatenate([solution.x, multipliers]), qp.g)
    offset = exact_sum(rows, solution.x, -np.concatenate([qp.b, qp.h[active]]))
    K = np.block([[qp.H, rows.T], [rows, np.zeros((len(rows), len(rows)))]])
    step = np.linalg.lstsq(K, np.concatenate([slope, offset]), rcond=1e-15)[0]
    return float(np.max(np.abs(step[qp.blocks["tau"]])))


def exact_sum(A, x, b):
    """A x + b, rounded once."""
    fractions = [Fraction(float(value)) for value in x]
    rows = [
        [(Fraction(float(a)), v) for a, v in zip(row, fractions, strict=True) if a] for row in A
    ]
    offsets = [Fraction(float(c)) for c in b]
    sums = [sum((a * v for a, v in row), c) for row, c in zip(rows, offsets, strict=True)]
    return np.array(sums, dtype=float)


@pytest.mark.front_end
def test_weights_too_far_apart_for_daqp_are_answered_by_the_active_set_method(talos):
    """DAQP does not converge here, or ends 0.03 N·m off without a word; curvatures of the reduced H
    run from 1e-11 to 20.
    """
    at = talos.standing()
    tasks = [fb.CoMTask(at.com, weight=100.0), fb.OrientationTask("base", weight=100.0)]
    controller = fb.WholeBodyController(talos, fb.Contacts.feet(talos), tasks, backend="reference")
    answered = set()
    for state in (at, talos.random_state(1, 0.1), talos.random_state(2, 0.1)):
        found = controller(state.q, state.v).solution
        answered.add(found.solver)
        assert found.residuals.inequality < FEASIBILITY_TOLERANCE
        assert residual_torque(found) < LAST_DIGITS
    assert "active_set" in answered, "DAQP managed: these states no longer try what this tests"


def test_small_force_weights_do_not_make_a_problem_infeasible():
    """DAQP calls these problems infeasible: weights from 1e-9 to 100, feet that must press. The
    truth is a linear program's.
    """
    robot = judges.load("solo12")
    at = robot.standing()
    tasks = [fb.CoMTask(at.com, weight=100.0), fb.PostureTask(at.q)]
    tasks += [fb.ForceTask(weight=1e-9), fb.TorqueTask(weight=1e-9)]
    answered = set()
    # ten states for each share, and more until DAQP has failed once
    for seed, share in ((seed, share) for seed in range(60) for share in (0.4, 1.3)):
        if seed >= 10 and "active_set" in answered:
            break
        press = share * robot.weight  # at every foot
        options = {"min_normal_force": press, "backend": "reference", "joint_limits": None}
        controller = fb.WholeBodyController(robot, judges.stance(robot), tasks, **options)
        qp = controller.qp(robot.random_state(seed, 0.3), slacks=False)
        try:
            found = solve(qp)
        except InfeasibleError as error:
            assert judges.is_smallest_conflict(qp, error.constraints)
            continue
        answered.add(found.solver)
        assert judges.is_feasible(qp, list(range(len(qp.G))))
        assert found.residuals.inequality < FEASIBILITY_TOLERANCE
        slopes = (qp.H @ found.x, qp.g, qp.A.T @ found.equality_multipliers)
        steepest = max(np.max(np.abs(slope)) for slope in slopes)
        flattest = np.linalg.eigvalsh(qp.reduced.H)[0]
        assert residual_torque(found) < np.finfo(float).eps * steepest / flattest
    assert "active_set" in answered, "DAQP managed: these states no longer try what this tests"


def test_a_solver_that_is_not_installed_is_not_listed_and_its_extra_is_named(monkeypatch, go2):
    monkeypatch.setitem(sys.modules, "cvxpy", None)  # as if it were not installed
    assert "cvxpy" not in solvers()
    refused(lambda: solve(corner(), "cvxpy"), MissingDependencyError, "cvxpy", "floatbase[cvxpy]")
    with raises(MissingDependencyError, "floatbase[cvxpy]"):
        fb.WholeBodyController(go2, judges.stance(go2), [], solver="cvxpy")
