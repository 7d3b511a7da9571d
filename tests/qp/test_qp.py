"""Quadratic programs: solvers agree, answers prove themselves, infeasible problems say why."""

import copy
import pickle
from dataclasses import dataclass, field, replace
from itertools import combinations

import judges
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from messages import missing, raises, refused

import floatbase as fb
from floatbase.errors import InfeasibleError, InputError, UnknownNameError
from floatbase.lessons.lessonC import table_top
from floatbase.qp import (
    QP,
    ConstraintLabel,
    Solution,
    active_set,
    check_solver,
    conflicting_constraints,
    solve,
    solvers,
)
from floatbase.qp._linear_programs import INFEASIBLE, OPTIMAL, UNBOUNDED, linear_program

seeds = st.integers(0, 100_000)


def random_qp(rng, n, m, inequalities):
    """A strictly convex problem that has feasible points, some rows of which are active at the
    optimum.
    """
    root, inside = rng.normal(size=(n, n)), rng.normal(size=n)
    A, G = rng.normal(size=(m, n)), rng.normal(size=(inequalities, n))
    h = G @ inside + rng.uniform(0.0, 0.3, inequalities)
    return QP(root @ root.T + 0.1 * np.eye(n), 3.0 * rng.normal(size=n), A, A @ inside, G, h)


def empty(n):
    return np.zeros((0, n)), np.zeros(0)


NONE = empty(2)


@settings(max_examples=60)
@given(seeds, st.integers(2, 8), st.integers(0, 3), st.integers(0, 12))
def test_every_solver_gives_the_same_optimum_and_proves_it(seed, n, m, inequalities):
    qp = random_qp(np.random.default_rng(seed), n, min(m, n - 1), inequalities)
    found = {solver: solve(qp, solver) for solver in solvers()}
    for solution in found.values():
        r = solution.residuals
        assert r.stationarity < 1e-5 and r.equality < 1e-8
        assert r.inequality < 1e-7 and r.complementarity < 1e-5
        assert r.dual == 0.0
        assert np.allclose(solution.x, found["cvxpy"].x, atol=1e-5)
        assert solution.objective <= found["cvxpy"].objective + 1e-6


def test_multipliers_of_active_rows_are_the_slopes_of_the_objective():
    """min ½‖x - (3, 1)‖² with x0 ≤ 1, x1 ≤ 5: the first row is active with the multiplier 2, the
    second is not.
    """
    names = ("left wall", "roof")
    qp = QP(np.eye(2), [-3.0, -1.0], *NONE, np.eye(2), [1.0, 5.0], inequality_names=names)
    for solver in solvers():
        solution = solve(qp, solver)
        assert np.allclose(solution.x, [1.0, 1.0], atol=1e-7)
        assert solution.active == ("left wall",)
        assert solution.multipliers["left wall"] == pytest.approx(2.0, abs=1e-5)
        step = 1e-4
        wider = QP(qp.H, qp.g, qp.A, qp.b, qp.G, qp.h + [step, 0.0])
        assert (solution.objective - solve(wider, solver).objective) / step == pytest.approx(
            2.0, abs=1e-2
        )


@given(seeds, st.integers(3, 8), st.integers(1, 3), st.integers(0, 2))
def test_the_equality_space_holds_all_solutions_and_nothing_else(seed, n, rank, repeated):
    rng = np.random.default_rng(seed)
    rank = min(rank, n - 1)
    A = rng.normal(size=(rank, n))
    A = np.vstack([A, rng.normal(size=(repeated, rank)) @ A])  # rows that repeat others
    x = rng.normal(size=n)
    space = QP(np.eye(n), np.zeros(n), A, A @ x, *empty(n)).equality_space
    assert space.n_in == n - rank
    assert np.allclose(A @ space(rng.normal(size=n - rank)), A @ x, atol=1e-9)
    beta = np.linalg.lstsq(space.A, x - space.b)[0]
    assert np.allclose(space(beta), x, atol=1e-9)
    assert np.allclose(space.A.T @ space.A, np.eye(n - rank), atol=1e-12)
    assert np.allclose(space.b, np.linalg.pinv(A) @ A @ x, atol=1e-9)


@pytest.mark.parametrize("solver", solvers())
def test_equalities_that_leave_one_point_leave_nothing_to_choose(solver):
    names = {"inequality_names": ("wall",)}
    qp = QP(np.eye(2), [-3.0, 0.0], np.eye(2), [1.0, 2.0], [[1.0, 0.0]], [5.0], **names)
    for right in (5.0, 1.0):
        found = solve(replace(qp, h=[right]), solver)
        assert np.allclose(found.x, [1.0, 2.0], atol=1e-8)
        assert found.residuals.stationarity < 1e-6
    with raises(InfeasibleError, "wall") as caught:
        solve(replace(qp, h=[0.5]), solver)
    assert caught.value.constraints == ("wall",)


# residuals ----------------------------------------------------------------------------------------

SQUARE = QP(np.eye(2), [-3.0, 0.0], [[0.0, 1.0]], [1.0], [[1.0, 0.0], [-1.0, 0.0]], [1.0, 4.0])


@dataclass(frozen=True, eq=False)
class ByHand(Solution):
    """An answer whose ν is given too."""

    equality_multipliers: np.ndarray = field(kw_only=True)


def answer(x, nu, mu):
    return ByHand(
        SQUARE, np.array(x), np.array(mu), "by hand", equality_multipliers=np.array([nu])
    ).residuals


@pytest.mark.parametrize(
    ("residuals", "fields"),
    [
        (answer([1.0, 1.0], -1.0, [2.0, 0.0]), {}),  # the optimum
        (answer([1.0, 1.0], 0.0, [2.0, 0.0]), {"stationarity": 1.0}),
        (answer([1.0, 1.5], -1.5, [2.0, 0.0]), {"equality": 0.5}),
        (answer([1.5, 1.0], -1.0, [1.5, 0.0]), {"inequality": 0.5, "complementarity": 0.75}),
        (answer([0.0, 1.0], -1.0, [3.0, 0.0]), {"complementarity": 3.0}),
        (answer([1.0, 1.0], -1.0, [1.0, -1.0]), {"dual": 1.0, "complementarity": 5.0}),
    ],
)
def test_each_residual_measures_its_own_mistake(residuals, fields):
    for name in ("stationarity", "equality", "inequality", "complementarity", "dual"):
        assert getattr(residuals, name) == pytest.approx(fields.get(name, 0.0), abs=1e-12), name


# infeasible problems ------------------------------------------------------------------------------


@settings(max_examples=20)
@given(seeds, st.integers(1, 3), st.integers(2, 8))
def test_conflicting_rows_are_a_smallest_set_as_brute_force_finds_them(seed, n, rows):
    rng = np.random.default_rng(seed)
    G, h = rng.normal(size=(rows, n)), rng.normal(size=rows) - 0.5
    qp, found = QP(np.eye(n), np.zeros(n), *empty(n), G, h), conflicting_constraints(G, h)
    if judges.is_feasible(qp, list(range(rows))):
        assert found == ()
        return
    names = qp.inequality_names
    some = (some for size in range(1, n + 2) for some in combinations(range(rows), size))
    assert found in [
        rows for rows in some if judges.is_smallest_conflict(qp, [names[i] for i in rows])
    ]


@pytest.mark.parametrize(
    ("G", "h", "conflict"),
    [
        *(
            (scale * np.array([[1.0], [-1.0], [1.0]]), scale * np.array([1.0, -2.0, 3.0]), (0, 1))
            for scale in (1e-6, 1.0, 1e6)
        ),
        (
            np.array([[0.0, 0.0], [1.0, 0.0]]),
            np.array([-1.0, 0.0]),
            (0,),
        ),  # one row alone is impossible
        (np.array([[1.0], [-1.0]]), np.array([1.0, -1.0]), ()),  # they only just meet
        (np.zeros((0, 3)), np.zeros(0), ()),
    ],
)
def test_conflicting_rows_are_found(G, h, conflict):
    assert conflicting_constraints(G, h) == conflict


@pytest.mark.parametrize("solver", solvers())
def test_the_error_of_an_infeasible_problem_names_its_rows(solver):
    G, h = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0]]), np.array([1.0, -2.0, 3.0])
    qp = QP(np.eye(2), np.zeros(2), *NONE, G, h, inequality_names=("x ≤ 1", "x ≥ 2", "y ≤ 3"))
    with raises(InfeasibleError, "x ≤ 1", "x ≥ 2") as caught:
        solve(qp, solver)
    assert caught.value.constraints == ("x ≤ 1", "x ≥ 2")


def test_labels_are_texts_that_know_their_kind_owner_and_number():
    label = ConstraintLabel("FL_foot facet 2", "friction", "FL_foot", 2)
    assert label == "FL_foot facet 2" and label in {"FL_foot facet 2": 1}
    for same in (label, copy.deepcopy(label), pickle.loads(pickle.dumps(label))):
        expected = ("FL_foot facet 2", "friction", "FL_foot", 2)
        assert (same, same.kind, same.owner, same.number) == expected
    qp = QP(np.eye(2), np.zeros(2), *NONE, np.eye(2), np.ones(2), inequality_names=(label, "roof"))
    assert [name.kind for name in qp.inequality_names] == ["friction", "other constraints"]
    assert [name.owner for name in qp.inequality_names] == ["FL_foot", "roof"]


def test_rows_can_be_left_out_by_kind():
    """Facets say already that no foot pulls, for their rows add up to -n μ' nᵀ f ≤ 0; without both
    kinds a foot does pull.
    """
    controller = judges.controller_of("go2")
    state = controller.robot.standing()
    pushed = fb.CoMTask(state.com, acceleration=[0.0, 12.0, 0.0])
    qp = controller.replace(tasks=[pushed, *controller.tasks[1:]]).qp(state)
    smaller = qp.without("normal force")
    assert len(qp.G) - len(smaller.G) == 4
    assert "FL_foot normal force" not in smaller.inequality_names
    assert str(smaller.inequality_names[4]).startswith("FR_foot facet")
    assert np.array_equal(smaller.A, qp.A)

    def least(*kinds):
        return float(solve(qp.without(*kinds))["forces"][2::3].min())

    assert least("normal force") == pytest.approx(least(), abs=1e-6)
    assert least("friction", "normal force") < -20.0
    assert least("friction") == pytest.approx(0.0, abs=1e-6)


def test_many_rows_in_conflict_are_counted_by_kind_and_listed_by_owner_or_by_name():
    """Six variables, each at least 1, whose sum is at most 5."""
    normal = [
        ConstraintLabel(f"{foot} normal force", "normal force", foot) for foot in ("FL", "FR", "RL")
    ]
    facets = [ConstraintLabel(f"FL facet {i}", "friction", "FL", i) for i in (2, 3)]
    G, h = np.vstack([-np.eye(6), np.ones(6)]), np.append(-np.ones(6), 5.0)
    with pytest.raises(InfeasibleError) as caught:
        names = (*normal, *facets, "sixth", "sum")
        solve(QP(np.eye(6), np.zeros(6), *empty(6), G, h, inequality_names=names))
    friction = (2, "friction", "FL facet 2", "FL facet 3")
    expected = ((3, "normal force", "FL", "FR", "RL"), friction, (2, "sixth", "sum"))
    for line, named in zip(str(caught.value).splitlines()[1:-1], expected, strict=True):
        assert not missing(line, *named)


# bad input ----------------------------------------------------------------------------------------


def two(g=(0.0, 0.0), A=NONE, G=NONE, **more):
    """A problem of two variables with rows (matrix, right side)."""
    return QP(np.eye(2), g, *A, *G, **more)


@pytest.mark.parametrize(
    "case",
    [
        (lambda: QP(np.eye(3), np.zeros(2), *NONE, *NONE), "H", 3, 2),
        (lambda: two(A=empty(3)), "A", 3, 2),
        (lambda: two(A=(np.eye(2), [1.0])), "b", 1, 2),
        (lambda: two(G=(np.eye(2), [1.0])), "h", 1, 2),
        (lambda: two(g=[0.0, np.nan]), "g", np.nan),
        (lambda: two(G=(np.eye(2), [np.inf, 0.0])), "h", np.inf),
        (lambda: two(G=(np.eye(2), np.ones(2)), inequality_names=("a",)), 1, 2),
        (lambda: two(G=(np.eye(2), np.ones(2)), inequality_names=("a", "a")), "a"),
        (lambda: solve(SQUARE)["torques"], "torques"),
        (lambda: active_set(table_top(), max_iterations=0), "max_iterations", 0),
        (lambda: active_set(table_top(), max_iterations=1.5), "max_iterations", 1.5),
    ],
)
def test_problems_that_do_not_fit_together_are_refused(case):
    call, *named = case
    refused(call, InputError, *named)


def test_unknown_names_are_refused_with_similar_names():
    with raises(UnknownNameError, "solver", "activeset", "active_set"):
        check_solver("activeset")
    with raises(UnknownNameError, "tabel", "table"):
        active_set(table_top(), working_set=["tabel"])


def test_a_linear_program_is_optimal_infeasible_or_unbounded():
    one = np.ones(1)
    assert linear_program(one, (np.eye(1), one)).status == OPTIMAL
    assert linear_program(one, (np.eye(1), -one)).status == INFEASIBLE
    assert linear_program(-one).status == UNBOUNDED
    found = linear_program(-one, inequalities=(-np.eye(1), -one), bounds=(None, None))
    assert found.status == UNBOUNDED
