"""QP back ends: each maps a `QP` to a `Solution`, or None if infeasible."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from functools import cache
from importlib.util import find_spec

import numpy as np

from floatbase._arrays import Array
from floatbase.errors import SolverError
from floatbase.qp.active_set import active_set as run_active_set
from floatbase.qp.conflicts import not_convex, unbounded
from floatbase.qp.problem import FEASIBILITY_TOLERANCE, QP, ReducedQP
from floatbase.qp.solution import Solution, with_equality_multipliers

BackEnd = Callable[[QP], Solution | None]

_DAQP_INFINITY, _PROXQP_INFINITY = 1e30, 1e20  # what these solvers take for no bound
_CLARABEL = (1e-12, 1e-10, 1e-8)  # tolerances to ask Clarabel for; now and then it makes no progress on the way to the first
_CONVEX = 1e-10  # part of the largest |H| that a curvature may be negative by: rounding of the pullback
_POLISHABLE = 1e-4  # part of the largest variable that polishing may move any: beyond it, it mends no last digits


def daqp(qp: QP) -> Solution | None:
    """Eliminate the equalities, then DAQP's dual active set on what remains; what controllers use.

    Where weights are so far apart that DAQP does not converge, or ends where polishing fails, `active_set` answers, in
    4 to 40 ms, and `Solution.solver` says so.
    """
    import daqp

    inner, size, rows = qp.reduced, qp.row_lengths, len(qp.G)
    if inner.n == 0:
        return _single_point(qp)
    scale = _objective_size(inner)
    y, _, flag, info = daqp.solve(
        inner.H / scale,
        inner.g / scale,
        inner.G / size[:, None],
        inner.h / size,
        np.full(rows, -_DAQP_INFINITY),
        np.zeros(rows, dtype=np.int32),
        primal_tol=FEASIBILITY_TOLERANCE,
        eps_prox=-1.0,
    )
    if flag == -1:
        return None
    if flag == -3:
        raise unbounded(qp)
    if flag == -5:
        raise not_convex(qp, _least_curvature(qp))
    if flag not in (1, 2):  # it cycles, or takes too many iterations
        return active_set(qp)
    mu: Array = np.maximum(np.asarray(info["lam"], dtype=np.float64)[:rows] * scale, 0.0) / size
    polished = _polished(qp, np.asarray(y), mu)
    if polished is None:
        return active_set(qp)
    return with_equality_multipliers(qp, qp.equality_space(polished[0]), polished[1], "daqp", int(info["iterations"]))


def active_set(qp: QP) -> Solution | None:
    """The primal active-set method of `active_set.py` from a cold start, its answer polished; written to be read."""
    found = run_active_set(qp).solution
    space = qp.equality_space
    polished = _polished(qp, space.A.T @ (found.x - space.b), found.inequality_multipliers)
    if polished is None or np.any(qp.G @ space(polished[0]) - qp.h > FEASIBILITY_TOLERANCE * qp.row_lengths):
        return found  # an optimum that is not unique: the steps may lead past rows that are not active
    return with_equality_multipliers(qp, space(polished[0]), polished[1], found.solver, found.iterations)


def cvxpy(qp: QP) -> Solution | None:
    """The whole problem, equalities included, by cvxpy and Clarabel at tight tolerances: slow and independent."""
    import cvxpy as cp

    _check_convex(qp)
    # written around the optimum without inequalities: Clarabel's gap is relative to an objective that is then small,
    # which is what lets it see weights of 1e-6 beside weights of 10
    origin = _without_inequalities(qp)
    scale = min(_objective_size(qp), 1.0)  # a small objective is blown up, or Clarabel's absolute tolerance hides it
    H, slope = qp.H / scale, (qp.H @ origin + qp.g) / scale
    step = cp.Variable(qp.n)
    constraints = []
    if len(qp.A):
        constraints.append(qp.A @ step == qp.b - qp.A @ origin)
    if len(qp.G):
        constraints.append(qp.G @ step <= qp.h - qp.G @ origin)
    problem = cp.Problem(cp.Minimize(0.5 * cp.quad_form(step, cp.psd_wrap(H)) + slope @ step), constraints)
    for tolerance in _CLARABEL:
        try:
            with warnings.catch_warnings():
                # at its last digits Clarabel calls itself inaccurate; how accurate it was, Solution.residuals says
                warnings.filterwarnings("ignore", message="Solution may be inaccurate")
                tolerances = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), tolerance)
                problem.solve(solver=cp.CLARABEL, max_iter=200, **tolerances)
            break
        except cp.error.SolverError as error:
            if tolerance == _CLARABEL[-1]:
                raise SolverError(f"Clarabel did not converge on {qp!r}: {error}") from None
    if problem.status in (cp.INFEASIBLE, cp.INFEASIBLE_INACCURATE):
        return None
    if problem.status in (cp.UNBOUNDED, cp.UNBOUNDED_INACCURATE):
        raise unbounded(qp)
    if step.value is None:
        raise SolverError(f"Clarabel did not converge on {qp!r}: it ended with status {problem.status!r}.")
    mu = np.maximum(np.atleast_1d(constraints[-1].dual_value) * scale, 0.0) if len(qp.G) else np.zeros(0)
    iterations = int(problem.solver_stats.num_iters or 0)
    return with_equality_multipliers(qp, origin + np.asarray(step.value), mu, "cvxpy", iterations)


def proxsuite(qp: QP) -> Solution | None:
    """Eliminate the equalities, then ProxQP's augmented Lagrangian on what remains.

    Only where the package `proxsuite` is installed. Its torques agree with DAQP's to about 1e-4 N·m.
    """
    from proxsuite import proxqp

    _check_convex(qp)
    inner = qp.reduced
    if inner.n == 0:
        return _single_point(qp)
    scale = _objective_size(inner)
    problem = proxqp.dense.QP(inner.n, 0, len(qp.G))
    problem.settings.eps_abs, problem.settings.eps_rel = FEASIBILITY_TOLERANCE, 0.0
    problem.settings.check_duality_gap = True  # without it ProxQP stops beside the active rows
    problem.settings.eps_duality_gap_abs, problem.settings.eps_duality_gap_rel = FEASIBILITY_TOLERANCE, 0.0
    problem.settings.eps_primal_inf = 1e-8  # at its own 1e-4 it calls standing robots infeasible
    problem.init(inner.H / scale, inner.g / scale, None, None, inner.G, np.full(len(qp.G), -_PROXQP_INFINITY), inner.h)
    problem.solve()
    found = problem.results
    if found.info.status == proxqp.PROXQP_PRIMAL_INFEASIBLE:
        return None
    if found.info.status == proxqp.PROXQP_DUAL_INFEASIBLE:
        raise unbounded(qp)
    if found.info.status != proxqp.PROXQP_SOLVED:
        active_set(qp)  # where there is no optimum, this raises the error that says so
        raise SolverError(
            f"ProxQP did not converge on {qp!r}: status {found.info.status.name}. Are its weights too far apart? "
            'solver="active_set" copes with it.'
        )
    mu = np.maximum(found.z * scale, 0.0)
    return with_equality_multipliers(qp, qp.equality_space(found.x), mu, "proxsuite", int(found.info.iter))


ALWAYS: dict[str, BackEnd] = {"daqp": daqp, "cvxpy": cvxpy, "active_set": active_set}
OPTIONAL: dict[str, BackEnd] = {"proxsuite": proxsuite}  # name of the back end = name of its package


@cache
def installed() -> Mapping[str, BackEnd]:
    """The back ends that can be used here, by name."""
    return ALWAYS | {name: back_end for name, back_end in OPTIONAL.items() if find_spec(name)}


def _polished(qp: QP, y: Array, mu: Array) -> tuple[Array, Array] | None:
    """Two steps of Newton's method on the optimality conditions of the active rows, for the last digits of y and μ.

    With weights from 1e-8 to 1 the reduced H has few digits to spare for the slope; here it is summed in extended precision,
    where the processor has it, from the problem as it was written. None where a step would do more than that.

    qp: the problem.
    y: (p,), the minimiser of `qp.reduced`.
    mu: (l,), the multipliers of the inequalities.
    """
    inner, space, n = qp.reduced, qp.equality_space, len(y)
    active = np.flatnonzero(mu > 0.0)
    G = inner.G[active]
    K = np.block([[inner.H, G.T], [G, np.zeros((len(G), len(G)))]])
    Z, H, rows = (np.asarray(part, dtype=np.longdouble) for part in (space.A, qp.H, qp.G[active]))
    found = np.concatenate([y, mu[active]]).astype(np.longdouble)
    for _ in range(2):
        x = Z @ found[:n] + space.b
        slope = Z.T @ (H @ x + qp.g + rows.T @ found[n:])
        residual = np.concatenate([slope, rows @ x - qp.h[active]]).astype(np.float64)
        try:
            step = np.linalg.solve(K, residual)
        except np.linalg.LinAlgError:  # an optimum that is not unique
            return y, mu
        if not np.max(np.abs(step[:n]), initial=0.0) < _POLISHABLE * (1.0 + np.max(np.abs(y), initial=0.0)):
            return None
        found -= step
    polished = np.array(mu)
    polished[active] = np.maximum(found[n:].astype(np.float64), 0.0)
    return found[:n].astype(np.float64), polished


def _check_convex(qp: QP) -> None:
    """For solvers that take convexity on trust."""
    H = qp.reduced.H
    if len(H) and _least_curvature(qp) < -_CONVEX * np.max(np.abs(H)):
        raise not_convex(qp, _least_curvature(qp))


def _least_curvature(qp: QP) -> float:
    """The smallest curvature of the objective where the equalities hold."""
    return float(np.linalg.eigvalsh(qp.reduced.H)[0])


def _single_point(qp: QP) -> Solution | None:
    """The equalities leave one point: it is the answer if it satisfies the inequalities."""
    x = qp.equality_space.b
    if np.any(qp.G @ x - qp.h > FEASIBILITY_TOLERANCE * qp.row_lengths):
        return None
    return with_equality_multipliers(qp, x, np.zeros(len(qp.G)), "the equalities", 0)


def _objective_size(qp: QP | ReducedQP) -> float:
    """What to divide the objective by so that tolerances mean the same for every problem."""
    return float(np.max(np.abs(qp.H), initial=0.0) or np.max(np.abs(qp.g), initial=0.0) or 1.0)


def _without_inequalities(qp: QP) -> Array:
    """A stationary point of the problem without its inequalities, shape (n,), or the nearest thing to one."""
    inner = qp.reduced
    return qp.equality_space(np.linalg.lstsq(inner.H, -inner.g, rcond=None)[0])
