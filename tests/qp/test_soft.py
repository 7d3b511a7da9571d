"""Soft inequalities: exact penalties against cvxpy, least violations against linear programs."""

from dataclasses import replace

import cvxpy as cp
import numpy as np
import pytest
from messages import raises
from scipy.optimize import linprog

from floatbase.errors import InfeasibleError, InputError
from floatbase.qp import QP, active_set, solve, solvers


def random_problem(rng, n=8, rows=12, soft=6):
    """Return a problem whose hard rows hold at 0 and whose soft rows exclude each other."""
    L = rng.normal(size=(n, n))
    G, h = rng.normal(size=(rows, n)), rng.uniform(0.1, 1.0, rows)
    h[:soft] -= rng.uniform(0.0, 3.0, soft)
    penalties = np.full(rows, np.inf)
    penalties[:soft] = rng.uniform(0.1, 10.0, soft)
    A = rng.normal(size=(2, n))
    return QP(
        L @ L.T, rng.normal(size=n), A, np.zeros(2), G, h,
        inequality_names=[f"row {i}" for i in range(rows)], penalties=penalties,
    )  # fmt: skip


@pytest.mark.parametrize("solver", solvers())
def test_the_minimizer_is_that_of_the_objective_with_penalties(solver):
    rng, n_violated = np.random.default_rng(0), 0
    for _ in range(15):
        qp = random_problem(rng)
        soft = np.isfinite(qp.penalties)
        x = cp.Variable(qp.n)
        penalty = qp.penalties[soft] @ cp.pos(qp.G[soft] @ x - qp.h[soft])
        cost = 0.5 * cp.quad_form(x, cp.psd_wrap(qp.H)) + qp.g @ x + penalty
        rows = [qp.A @ x == qp.b, qp.G[~soft] @ x <= qp.h[~soft]]
        cp.Problem(cp.Minimize(cost), rows).solve(solver=cp.CLARABEL)
        found = solve(qp, solver)
        assert np.allclose(found.x, x.value, atol=1e-5)
        excess = qp.G @ found.x - qp.h
        assert set(found.violations) == {f"row {i}" for i in np.flatnonzero(soft & (excess > 1e-6))}
        for name, amount in found.violations.items():
            assert amount == pytest.approx(excess[int(name.split()[1])])
        r = found.residuals
        assert max(r.stationarity, r.equality, r.inequality, r.complementarity, r.dual) < 1e-6
        n_violated += bool(found.violations)
    assert n_violated > 3


def test_a_penalty_is_exact():
    """min ½ x² - 3 x with x ≤ 1 has the multiplier 2: the row holds for w > 2, and not below."""
    hard = QP(np.eye(1), [-3.0], np.zeros((0, 1)), [], [[1.0]], [1.0], inequality_names=["wall"])
    for weight, x in ((10.0, 1.0), (2.5, 1.0), (1.5, 1.5), (1e-3, 2.999)):
        found = solve(replace(hard, penalties=[weight]))
        assert found.x == pytest.approx([x])
        assert found.multipliers["wall"] == pytest.approx(min(weight, 2.0))
        assert found.violations == ({} if x == 1.0 else {"wall": pytest.approx(x - 1.0)})
        soft = replace(hard, penalties=[weight])
        slack = active_set(soft.with_slacks()).solution["slacks"]
        assert slack == pytest.approx([x - 1.0], abs=1e-9)
        with raises(InputError, "1", "with_slacks"):
            active_set(soft)


def test_a_large_weight_leaves_the_least_weighted_violation():
    rng = np.random.default_rng(1)
    for _ in range(10):
        qp = random_problem(rng)
        soft = np.flatnonzero(np.isfinite(qp.penalties))
        shares = qp.penalties[soft]
        penalties = np.array(qp.penalties)
        penalties[soft] = 1e6 * shares
        found = solve(replace(qp, penalties=penalties))
        n, s = qp.n, len(soft)  # min Σ w s with G x - s ≤ h, s ≥ 0
        G = np.hstack([qp.G, np.zeros((len(qp.G), s))])
        G[soft, n + np.arange(s)] = -1.0
        least = linprog(
            np.r_[np.zeros(n), shares], G, qp.h, np.hstack([qp.A, np.zeros((2, s))]), qp.b,
            [(None, None)] * n + [(0.0, None)] * s,
        )  # fmt: skip
        excess = np.maximum(qp.G[soft] @ found.x - qp.h[soft], 0.0)
        assert shares @ excess == pytest.approx(least.fun, abs=1e-6)


@pytest.mark.parametrize("solver", ["daqp", "active_set"])  # Clarabel's tolerances are larger
def test_weights_far_apart_cost_no_digits_of_the_minimizer(solver):
    """Weights of 1e8 and 1 beside curvatures of 1e-5: a slope of 1e-9 moves x by 1e-4."""
    rng, n_violated = np.random.default_rng(2), 0
    for _ in range(10):
        qp = random_problem(rng, n=16)
        L = np.hstack([rng.normal(size=(16, 4)), np.zeros((16, 12))])
        H, G, h = L @ L.T + 1e-5 * np.eye(16), np.array(qp.G), np.array(qp.h)
        G[3:6], h[:3], h[3:6] = -G[:3], 0.1, -0.6  # each light row contradicts a heavy one
        penalties = [1e8] * 3 + [1.0] * 3 + [np.inf] * 6
        found = solve(replace(qp, H=H, g=H @ qp.g, G=G, h=h, penalties=penalties), solver)
        assert found.residuals.stationarity < 1e-9
        n_violated += bool(found.violations)
    assert n_violated > 3


def test_only_hard_rows_can_be_in_conflict():
    rows = np.array([[1.0], [-1.0], [-1.0]])
    names = ["at most 0", "at least 1", "at least 2"]
    qp = QP(np.eye(1), [0.0], np.zeros((0, 1)), [], rows, [0.0, -1.0, -2.0], inequality_names=names)
    found = solve(replace(qp, penalties=[np.inf, 1.0, 5.0]))
    assert found.violations == {"at least 1": pytest.approx(1.0), "at least 2": pytest.approx(2.0)}
    with raises(InfeasibleError, "at most 0") as caught:
        solve(replace(qp, penalties=[np.inf, np.inf, 5.0]))
    assert set(caught.value.constraints) == {"at most 0", "at least 1"}


@pytest.mark.parametrize("penalties", [[1.0], [0.0, 1.0, 1.0], [-1.0] * 3, [np.nan] * 3, "abc", 5])
def test_penalties_are_positive_numbers_one_for_each_row(penalties):
    rows = np.ones((3, 1))
    with raises(InputError, "penalties"):
        QP(np.eye(1), [0.0], np.zeros((0, 1)), [], rows, np.zeros(3), penalties=penalties)
