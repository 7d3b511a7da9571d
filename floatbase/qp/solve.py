"""`solve` and its back ends: the `Solution` of a `QP`, or the error that says why there is none."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from contextlib import suppress

import numpy as np

from floatbase._arrays import Array, of_kind
from floatbase.errors import SolverError, unknown_name
from floatbase.qp.active_set import active_set
from floatbase.qp.conflicts import (
    FEASIBILITY_TOLERANCE,
    conflicting_rows,
    infeasible,
    not_convex,
    unbounded,
    violation_allowed,
)
from floatbase.qp.problem import QP
from floatbase.qp.solution import Solution

_CLARABEL = (1e-12, 1e-10, 1e-8)  # tolerances to ask Clarabel for; now and then it makes no progress on the way to the first
_CONVEX = 1e-10  # part of the largest |H| that a curvature may be negative by: rounding of the pullback
_POLISHABLE = 1e-4  # part of the largest variable that polishing may move any: beyond it, it mends no last digits


def solve(qp: QP, solver: str = "daqp") -> Solution:
    """Solve a QP.

    solver: one of `solvers()`. "daqp" is what controllers use; "cvxpy" (Clarabel at tight tolerances) is the judge,
    slow and independent; "active_set" is the method of `active_set.py`, written to be read. Where the first two find no
    point although no rows are in conflict, or end where polishing fails, as with weights too far apart, "active_set" answers,
    in 4 to 40 ms, and `Solution.solver` says so. Raises `InfeasibleError` with a smallest set of conflicting rows,
    `SolverError` when the objective has no minimum or the solver did not converge, `UnknownNameError` for a solver that does
    not exist.
    """
    check_solver(solver)
    of_kind("qp", qp, QP)
    found = _BACK_ENDS[solver](qp)
    if found is not None:
        return found
    rows = conflicting_rows(qp.reduced.G / qp.row_lengths[:, None], qp.reduced.h / qp.row_lengths)
    if rows:
        raise infeasible(qp.inequality_names[i] for i in rows)
    return _active_set(qp)


def solvers() -> tuple[str, ...]:
    """Names that `solve` takes."""
    return tuple(_BACK_ENDS)


def check_solver(solver: str) -> None:
    """Raises `UnknownNameError` for a solver that `solve` does not take."""
    if not isinstance(solver, str) or solver not in _BACK_ENDS:
        raise unknown_name("solver", solver, _BACK_ENDS)


def _daqp(qp: QP) -> Solution | None:
    """Eliminate the equalities, then DAQP's dual active set on what remains; what controllers use.

    None where weights are so far apart that DAQP does not converge or ends where polishing fails, and where it sees no point:
    little curvature may look like that to it.
    """
    import daqp

    inner, size, rows = qp.reduced, qp.row_lengths, len(qp.G)
    if inner.n == 0:
        return None
    scale = _objective_size(inner)
    y, _, flag, info = daqp.solve(
        inner.H / scale,
        inner.g / scale,
        inner.G / size[:, None],
        inner.h / size,
        np.full(rows, -1e30),  # what DAQP takes for no bound
        np.zeros(rows, dtype=np.int32),
        primal_tol=FEASIBILITY_TOLERANCE,
        eps_prox=-1.0,
    )
    if flag == -3:
        raise unbounded(qp)
    if flag == -5:
        raise not_convex(qp, inner.H)
    if flag not in (1, 2):  # infeasible, it says, or it cycled or took too many iterations; its numbers may be of any size
        return None
    polished = _polished(qp, np.asarray(y), np.maximum(np.asarray(info["lam"])[:rows] * scale, 0.0) / size)
    return None if polished is None else Solution(qp, *polished, "daqp", int(info["iterations"]))


def _active_set(qp: QP) -> Solution:
    """The method of `active_set.py` from a cold start, its answer polished."""
    found, space = active_set(qp).solution, qp.equality_space
    polished = _polished(qp, space.A.T @ (found.x - space.b), found.inequality_multipliers)
    return found if polished is None else Solution(qp, *polished, found.solver, found.iterations)


def _cvxpy(qp: QP) -> Solution | None:
    """The whole problem, equalities included, by cvxpy and Clarabel at tight tolerances: slow and independent."""
    import cvxpy as cp

    inner = qp.reduced
    if np.any(np.linalg.eigvalsh(inner.H) < -_CONVEX * np.max(np.abs(inner.H), initial=0.0)):  # Clarabel does not check
        raise not_convex(qp, inner.H)
    # written around the optimum without inequalities: Clarabel's gap is relative to an objective that is then small,
    # which is what lets it see weights of 1e-6 beside weights of 10
    origin = qp.equality_space(np.linalg.lstsq(inner.H, -inner.g, rcond=None)[0])
    scale = min(_objective_size(qp), 1.0)  # a small objective is blown up, or Clarabel's absolute tolerance hides it
    H, slope = qp.H / scale, (qp.H @ origin + qp.g) / scale
    step = cp.Variable(qp.n)
    equalities = [qp.A @ step == qp.b - qp.A @ origin] if len(qp.A) else []
    inequalities = [qp.G @ step <= qp.h - qp.G @ origin] if len(qp.G) else []
    objective = 0.5 * cp.quad_form(step, cp.psd_wrap(H)) + slope @ step
    problem = cp.Problem(cp.Minimize(objective), equalities + inequalities)
    for tolerance in _CLARABEL:
        with suppress(cp.error.SolverError), warnings.catch_warnings():
            # at its last digits Clarabel calls itself inaccurate; how accurate it was, Solution.residuals says
            warnings.filterwarnings("ignore", message="Solution may be inaccurate")
            tolerances = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), tolerance)
            problem.solve(solver=cp.CLARABEL, max_iter=200, **tolerances)
            break
    if problem.status in (cp.INFEASIBLE, cp.INFEASIBLE_INACCURATE):
        return None
    if problem.status in (cp.UNBOUNDED, cp.UNBOUNDED_INACCURATE):
        raise unbounded(qp)
    if step.value is None:
        raise SolverError(f"Clarabel did not converge on {qp!r}: it ended with status {problem.status!r}.")
    mu = np.maximum(np.atleast_1d(inequalities[0].dual_value) * scale, 0.0) if inequalities else np.zeros(0)
    return Solution(qp, origin + step.value, mu, "cvxpy", int(problem.solver_stats.num_iters or 0))


_BACK_ENDS: dict[str, Callable[[QP], Solution | None]] = {"daqp": _daqp, "cvxpy": _cvxpy, "active_set": _active_set}


def _polished(qp: QP, y: Array, mu: Array) -> tuple[Array, Array] | None:
    """Two steps of Newton's method on the optimality conditions of the active rows, for the last digits: x and μ.

    With weights from 1e-8 to 1 the reduced H has few digits to spare for the slope; here it is summed in extended precision,
    where the processor has it, from the problem as it was written. None where a step would do more than that, or leads past a
    row that is not active, as it may where the optimum is not unique.

    y: (p,), the minimiser of `qp.reduced`; mu: (l,), the multipliers of the inequalities.
    """
    inner, space, n = qp.reduced, qp.equality_space, len(y)
    active = np.flatnonzero(mu > 0.0)
    G = inner.G[active]
    K = np.zeros((n + len(G), n + len(G)))
    K[:n, :n], K[:n, n:], K[n:, :n] = inner.H, G.T, G
    Z, H, rows = (np.asarray(part, dtype=np.longdouble) for part in (space.A, qp.H, qp.G[active]))
    found = np.concatenate([y, mu[active]]).astype(np.longdouble)
    for _ in range(2):
        x = Z @ found[:n] + space.b
        slope = Z.T @ (H @ x + qp.g + rows.T @ found[n:])
        residual = np.concatenate([slope, rows @ x - qp.h[active]]).astype(np.float64)
        try:
            step = np.linalg.solve(K, residual)
        except np.linalg.LinAlgError:  # an optimum that is not unique
            return space(y), mu
        if not np.max(np.abs(step[:n]), initial=0.0) < _POLISHABLE * (1.0 + np.max(np.abs(y), initial=0.0)):
            return None
        found -= step
    polished = np.zeros_like(mu)
    polished[active] = np.maximum(found[n:].astype(np.float64), 0.0)
    point, size = space(found[:n].astype(np.float64)), qp.row_lengths
    if np.any((qp.G @ point - qp.h) / size > violation_allowed(qp.h / size, point)):
        return None
    return point, polished


def _objective_size(qp: QP) -> float:
    """What to divide the objective by so that tolerances mean the same for every problem."""
    return float(np.max(np.abs(qp.H), initial=0.0) or np.max(np.abs(qp.g), initial=0.0) or 1.0)
