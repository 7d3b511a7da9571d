"""`solve` and its back ends: the `Solution` of a `QP`, or the error that says why there is none."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from contextlib import suppress

import numpy as np

from floatbase._validation import Array, as_instance
from floatbase.errors import SolverError, unknown_name
from floatbase.qp.active_set import active_set
from floatbase.qp.conflicts import (
    FEASIBILITY_TOLERANCE,
    conflicting_constraints,
    infeasible,
    not_convex,
    unbounded,
    violation_tolerance,
)
from floatbase.qp.problem import QP
from floatbase.qp.solution import Solution

# requested of Clarabel in turn: now and then it makes no progress on the way to the first
_CLARABEL_TOLERANCES = (1e-12, 1e-10, 1e-8)
# part of the largest |H| that a curvature may be negative by: rounding of the pullback
_CONVEXITY_TOLERANCE = 1e-10
# part of the largest variable that polishing may move any: beyond it, it mends no last digits
_MAX_POLISHING_STEP = 1e-4


def solve(qp: QP, solver: str = "daqp") -> Solution:
    """Solve a QP.

    solver: one of `solvers()`. "daqp" is what controllers use; "cvxpy" (Clarabel at tight
        tolerances) is the judge,
    slow and independent; "active_set" is the method of `active_set.py`, written to be read. Where
    the first two find no point although no rows are in conflict, or end where polishing fails, as
    with weights too far apart, "active_set" answers, in 4 to 40 ms, and `Solution.solver` says so.
    Raises `InfeasibleError` with a smallest set of conflicting rows, `SolverError` when the
    objective has no minimum or the solver did not converge, `UnknownNameError` for a solver that
    does not exist.
    """
    check_solver(solver)
    as_instance("qp", qp, QP)
    solution = _BACK_ENDS[solver](qp)
    if solution is not None:
        return solution
    conflict = conflicting_constraints(
        qp.reduced.G / qp.row_norms[:, None], qp.reduced.h / qp.row_norms
    )
    if conflict:
        raise infeasible(qp.inequality_names[i] for i in conflict)
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

    None where weights are so far apart that DAQP does not converge or ends where polishing fails,
    and where it sees no point: little curvature may look like that to it.
    """
    import daqp

    reduced, norms, rows = qp.reduced, qp.row_norms, len(qp.G)
    if reduced.n == 0:
        return None
    scale = _objective_scale(reduced)
    y, _, exit_flag, info = daqp.solve(
        reduced.H / scale,
        reduced.g / scale,
        reduced.G / norms[:, None],
        reduced.h / norms,
        np.full(rows, -1e30),  # what DAQP takes for no bound
        np.zeros(rows, dtype=np.int32),
        primal_tol=FEASIBILITY_TOLERANCE,
        eps_prox=-1.0,
    )
    if exit_flag == -3:
        raise unbounded(qp)
    if exit_flag == -5:
        raise not_convex(qp, reduced.H)
    if exit_flag not in (1, 2):
        # infeasible, it says, or it cycled or took too many iterations; its numbers may be of any
        # size
        return None
    polished = _polished(
        qp, np.asarray(y), np.maximum(np.asarray(info["lam"])[:rows] * scale, 0.0) / norms
    )
    return None if polished is None else Solution(qp, *polished, "daqp", int(info["iterations"]))


def _active_set(qp: QP) -> Solution:
    """The method of `active_set.py` from a cold start, its answer polished."""
    solution, space = active_set(qp).solution, qp.equality_space
    polished = _polished(qp, space.A.T @ (solution.x - space.b), solution.inequality_multipliers)
    return (
        solution
        if polished is None
        else Solution(qp, *polished, solution.solver, solution.iterations)
    )


def _cvxpy(qp: QP) -> Solution | None:
    """The whole problem, equalities included, by cvxpy and Clarabel at tight tolerances: slow and
    independent.
    """
    import cvxpy as cp

    reduced = qp.reduced
    # Clarabel does not check
    if np.any(
        np.linalg.eigvalsh(reduced.H)
        < -_CONVEXITY_TOLERANCE * np.max(np.abs(reduced.H), initial=0.0)
    ):
        raise not_convex(qp, reduced.H)
    # written around the optimum without inequalities: Clarabel's gap is relative to an objective
    # that is then small, which is what lets it see weights of 1e-6 beside weights of 10
    origin = qp.equality_space(np.linalg.lstsq(reduced.H, -reduced.g, rcond=None)[0])
    scale = min(
        _objective_scale(qp), 1.0
    )  # a small objective is blown up, or Clarabel's absolute tolerance hides it
    H, slope = qp.H / scale, (qp.H @ origin + qp.g) / scale
    step = cp.Variable(qp.n)
    equalities = [qp.A @ step == qp.b - qp.A @ origin] if len(qp.A) else []
    inequalities = [qp.G @ step <= qp.h - qp.G @ origin] if len(qp.G) else []
    objective = 0.5 * cp.quad_form(step, cp.psd_wrap(H)) + slope @ step
    problem = cp.Problem(cp.Minimize(objective), equalities + inequalities)
    for tolerance in _CLARABEL_TOLERANCES:
        with suppress(cp.error.SolverError), warnings.catch_warnings():
            # at its last digits Clarabel calls itself inaccurate; how accurate it was,
            # Solution.residuals says
            warnings.filterwarnings("ignore", message="Solution may be inaccurate")
            tolerances = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), tolerance)
            problem.solve(solver=cp.CLARABEL, max_iter=200, **tolerances)
            break
    if problem.status in (cp.INFEASIBLE, cp.INFEASIBLE_INACCURATE):
        return None
    if problem.status in (cp.UNBOUNDED, cp.UNBOUNDED_INACCURATE):
        raise unbounded(qp)
    if step.value is None:
        raise SolverError(
            f"Clarabel did not converge on {qp!r}: it ended with status {problem.status!r}."
        )
    mu = (
        np.maximum(np.atleast_1d(inequalities[0].dual_value) * scale, 0.0)
        if inequalities
        else np.zeros(0)
    )
    return Solution(qp, origin + step.value, mu, "cvxpy", int(problem.solver_stats.num_iters or 0))


_BACK_ENDS: dict[str, Callable[[QP], Solution | None]] = {
    "daqp": _daqp,
    "cvxpy": _cvxpy,
    "active_set": _active_set,
}


def _polished(qp: QP, y: Array, mu: Array) -> tuple[Array, Array] | None:
    """Two steps of Newton's method on the optimality conditions of the active rows, for the last
    digits: x and μ.

    With weights from 1e-8 to 1 the reduced H has few digits to spare for the slope; here it is
    summed in extended precision, where the processor has it, from the problem as it was written.
    None where a step would do more than that, or leads past a row that is not active, as it may
    where the optimum is not unique.

    y: (p,), the minimiser of `qp.reduced`; mu: (l,), the multipliers of the inequalities.
    """
    reduced, space, n = qp.reduced, qp.equality_space, len(y)
    active = np.flatnonzero(mu > 0.0)
    G = reduced.G[active]
    K = np.zeros((n + len(G), n + len(G)))
    K[:n, :n], K[:n, n:], K[n:, :n] = reduced.H, G.T, G
    Z, H, rows = (np.asarray(array, dtype=np.longdouble) for array in (space.A, qp.H, qp.G[active]))
    values = np.concatenate([y, mu[active]]).astype(np.longdouble)
    for _ in range(2):
        x = Z @ values[:n] + space.b
        slope = Z.T @ (H @ x + qp.g + rows.T @ values[n:])
        residual = np.concatenate([slope, rows @ x - qp.h[active]]).astype(np.float64)
        try:
            step = np.linalg.solve(K, residual)
        except np.linalg.LinAlgError:  # an optimum that is not unique
            return space(y), mu
        if not np.max(np.abs(step[:n]), initial=0.0) < _MAX_POLISHING_STEP * (
            1.0 + np.max(np.abs(y), initial=0.0)
        ):
            return None
        values -= step
    polished = np.zeros_like(mu)
    polished[active] = np.maximum(values[n:].astype(np.float64), 0.0)
    point, size = space(values[:n].astype(np.float64)), qp.row_norms
    if np.any((qp.G @ point - qp.h) / size > violation_tolerance(qp.h / size, point)):
        return None
    return point, polished


def _objective_scale(qp: QP) -> float:
    """What to divide the objective by so that tolerances mean the same for every problem."""
    return float(np.max(np.abs(qp.H), initial=0.0) or np.max(np.abs(qp.g), initial=0.0) or 1.0)
