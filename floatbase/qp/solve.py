"""Solvers of QPs, and the errors that explain why a QP has no solution."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array, as_instance
from floatbase.errors import InfeasibleError, SolverError, require, unknown_name
from floatbase.qp._changed import changed
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

# requested from Clarabel in turn, since it occasionally fails to reach the first
_CLARABEL_TOLERANCES = (1e-12, 1e-10, 1e-8)
# fraction of the largest |H| by which a curvature may be negative: rounding of the pullback
_CONVEXITY_TOLERANCE = 1e-10
# fraction of 1 + the largest variable by which the last step of polishing may change a variable:
# after a larger one, the next would be more than a correction of the last digits
_MAX_POLISHING_STEP = 1e-4
_RANK_TOLERANCE = 1e-12  # of a singular system of optimality conditions, relative
_ROUNDING = 1e-14  # fraction of the terms of a slope that may be rounding
_STATIONARITY = 1e-12  # fraction of its largest term that the slope at an optimum may have
# of the distance from the last point, which DAQP adds to the objective, relative to the largest
# curvature. The negative ones are for an objective without curvature in some direction: with the
# second, humanoids need two to four times the iterations, but it is nearer to the objective. The
# others are for problems in which DAQP cycles or finds other active rows than the optimum has
_PROXIMAL_WEIGHTS = -1e-2, -1e-6, 1e-5, 1e-4
# DAQP's take some 20 ms for a humanoid, where it would otherwise cycle; the fallback's take 1.5 to
# 4 s on a loaded machine, and it was never seen to need more than 155
_DAQP_ITERATIONS, _FALLBACK_ITERATIONS = 1000, 300
UNREFINED = "daqp unrefined"  # DAQP's result if Newton steps do not confirm the optimum
_WORK_PER_STEP = 1.6e7  # multiplications, some 3.5 ms


class Budget:
    """Work that DAQP may do in one control step; iterations are counted, so it is deterministic."""

    def __init__(self, work: float = _WORK_PER_STEP) -> None:
        self._work = work

    def iterations(self, n: int, rows: int) -> int:
        """Return how many iterations are left on a problem of this size."""
        return min(_DAQP_ITERATIONS, int(self._work / (n * (n + rows))))

    def spend(self, iterations: int, n: int, rows: int) -> None:
        """Count iterations."""
        self._work -= iterations * n * (n + rows)


def solve(qp: QP, solver: str = "daqp") -> Solution:
    """Solve a QP.

    Parameters
    ----------
    qp : QP
        Problem to solve.
    solver : {"daqp", "cvxpy", "active_set"}, optional
        Solver to use, one of `solvers()`. "daqp" is what controllers use. "cvxpy" (Clarabel with
        tight tolerances) is slow, but independent, and serves as a reference. "active_set" is the
        readable method of `active_set`.

    Returns
    -------
    Solution
        The minimizer and its multipliers.

    Raises
    ------
    InfeasibleError
        If the constraints are in conflict; the error names a minimal set of conflicting rows.
    SolverError
        If the objective has no minimum or is not convex, or if the solver does not converge.
    UnknownNameError
        If there is no such solver.
    MissingDependencyError
        If `solver` is "cvxpy" and cvxpy is not installed.

    Notes
    -----
    "daqp" is the dual active-set method of [Arnstrom2022]_.

    "daqp" and "cvxpy" fall back to "active_set" if they find no point although no constraints are
    in conflict. "daqp" also does so if polishing its result fails, as with weights that are too far
    apart. The fallback takes 4 to 40 ms, and `Solution.solver` names it. It ends with `SolverError`
    after 300 iterations, which take a few seconds for a humanoid. Control loops do not fall back to
    it: see the notes of `WholeBodyController`.
    """
    check_solver(solver)
    if len(as_instance("qp", qp, QP).soft):
        return _solve_soft(qp, solver)
    solution = _BACK_ENDS[solver](qp)
    if solution is None:
        conflict = _conflict(qp)
        if conflict:
            raise infeasible(conflict)
        return _active_set(qp, max_iterations=_FALLBACK_ITERATIONS)
    if solution.solver == UNREFINED:
        space, mu = qp.equality_space, solution.inequality_multipliers
        guess = [qp.inequality_names[i] for i in np.flatnonzero(mu)]
        start = space.A.T @ (solution.x - space.b)
        return _active_set(qp, start, guess, _FALLBACK_ITERATIONS)
    return solution


def solve_in_step(qp: QP, solver: str, budget: Budget) -> Solution:
    """Solve a QP as `solve` does, but within the budget of a control step.

    There is no fallback to `active_set`: a result of DAQP that cannot be polished is the solution.
    The message of an `InfeasibleError` is found when it is read. Solvers other than "daqp", which
    users have to request, have no budget.
    """
    if solver != "daqp":
        return solve(qp, solver)
    if len(qp.soft):
        exact = _solve_with_known_violations(qp, np.zeros(len(qp.G), dtype=bool), solver, budget)
        if exact is not None:
            return exact
    found = _daqp(qp, budget)
    if found is None:
        raise InfeasibleError(lambda: _explanation(qp.with_slacks()))
    if not len(qp.soft):
        return found
    return _solve_with_known_violations(qp, _violations(qp, found), solver, budget) or found


def _explanation(qp: QP) -> InfeasibleError:
    """Return the error of a problem in which DAQP found no point."""
    with suppress(SolverError):
        conflict = _conflict(qp)
        if conflict:
            return infeasible(conflict)
    return InfeasibleError(
        f"DAQP found no point that satisfies the constraints of {qp!r}, but no conflict was found, "
        f"either. The weights are probably too far apart. floatbase.qp.solve searches longer."
    )


def _conflict(qp: QP) -> list[str]:
    """Return the names of a minimal set of conflicting inequalities, or an empty list."""
    rows, norms = qp.reduced.G, qp.row_norms
    conflict = conflicting_constraints(rows / norms[:, None], qp.reduced.h / norms)
    return [qp.inequality_names[i] for i in conflict]


def _solve_soft(qp: QP, solver: str) -> Solution:
    """Solve a problem with soft inequalities.

    The penalties are exact: if the problem with hard inequalities only has a solution whose
    multipliers are below the penalties, it is the solution. Otherwise, variables for the violations
    show which inequalities are violated. These variables cost accuracy: a penalty of 1e8 leaves few
    digits for a curvature of 1e-5. The problem is therefore solved again without them.
    """
    assert qp.penalties is not None
    exact = _solve_with_known_violations(qp, np.zeros(len(qp.G), dtype=bool), solver)
    if exact is not None:
        return exact
    rough = _daqp(qp) if solver == "daqp" else None
    if rough is not None:
        exact = _solve_with_known_violations(qp, _violations(qp, rough), solver)
        if exact is not None:
            return exact
    found = solve(qp.with_slacks(), solver)
    exact = _solve_with_known_violations(qp, _violations(qp, found), solver)
    if exact is not None:  # a fallback that found the violations took its time
        return exact if found.solver == solver else replace(exact, solver=found.solver)
    multipliers = found.inequality_multipliers[: len(qp.G)]
    return Solution(qp, found.x[: qp.n], multipliers, found.solver, found.iterations)


def _violations(qp: QP, found: Solution) -> npt.NDArray[np.bool_]:
    """Return which soft inequalities a solution violates, which may be that with slacks."""
    G, h, norms, x = qp.G[qp.soft], qp.h[qp.soft], qp.row_norms[qp.soft], found.x[: qp.n]
    violated = np.zeros(len(qp.G), dtype=bool)
    violated[qp.soft] = (G @ x - h) / norms > violation_tolerance(h / norms, x)
    return violated


def _solve_with_known_violations(
    qp: QP, violated: npt.NDArray[np.bool_], solver: str, budget: Budget | None = None
) -> Solution | None:
    """Solve a problem with soft inequalities if these are the violated ones; otherwise return None.

    The penalties of the violated inequalities are part of the cost, and their rows have the
    opposite sign. All other inequalities are hard.
    """
    assert qp.penalties is not None
    sign = np.where(violated, -1.0, 1.0)
    penalties = np.where(violated, qp.penalties, 0.0)
    g, G, h = qp.g + qp.G.T @ penalties, sign[:, None] * qp.G, sign * qp.h
    space = qp.equality_space  # the same, and computing it takes a third of the time of a step
    hard = changed(qp, g=g, G=G, h=h, penalties=None, equality_space=space)
    with suppress(InfeasibleError, SolverError):  # rows that nearly contradict each other
        # without a search for the names of a conflict, which soft rows may resolve
        found = _daqp(hard, budget) if solver == "daqp" else _BACK_ENDS[solver](hard)
        if found is None or found.solver == UNREFINED:
            return None
        if np.all(found.inequality_multipliers <= qp.penalties):
            multipliers = penalties + sign * found.inequality_multipliers
            return Solution(qp, found.x, multipliers, found.solver, found.iterations)
    return None


def solvers() -> tuple[str, ...]:
    """List the solvers that `solve` accepts on this machine.

    Returns
    -------
    tuple of str
        Names of the solvers; "cvxpy" only if it is installed.
    """
    return tuple(name for name in _BACK_ENDS if name != "cvxpy" or find_spec("cvxpy"))


def check_solver(solver: str) -> None:
    """Check that a solver exists and is installed.

    Parameters
    ----------
    solver : str
        Name of the solver.

    Raises
    ------
    UnknownNameError
        If there is no such solver.
    MissingDependencyError
        If the package of the solver is not installed.
    """
    if not isinstance(solver, str) or solver not in _BACK_ENDS:
        raise unknown_name("solver", solver, _BACK_ENDS)
    if solver == "cvxpy":
        require("cvxpy", extra="cvxpy")


def _daqp(qp: QP, budget: Budget | None = None) -> Solution | None:
    """Eliminate the equalities and solve the rest with DAQP, the solver that controllers use.

    If polishing fails for all proximal weights, the solution is DAQP's first result, and its solver
    is `UNREFINED`. With soft inequalities, it always is: the first variables are their violations
    s ≥ 0, as bounds, which take DAQP less time than rows. Return None if DAQP reports
    infeasibility, since it may mistake small curvature for it. Also return None if weights are so
    far apart that DAQP does not converge; with a budget, this raises `SolverError`.
    """
    import daqp

    reduced, norms, rows, soft = qp.reduced, qp.row_norms, len(qp.G), qp.soft
    slacks, n = len(soft), len(soft) + reduced.n
    if n == 0:  # the equalities determine x
        only = _polished(qp, np.zeros(0), np.zeros(rows))
        return None if only is None else Solution(qp, *only, "daqp")
    scale = _objective_scale(reduced)
    H, g, G = np.zeros((n, n)), np.zeros(n), np.zeros((rows, n))
    H[slacks:, slacks:], g[slacks:], G[:, slacks:] = reduced.H, reduced.g, reduced.G
    if qp.penalties is not None:
        g[:slacks], G[soft, np.arange(slacks)] = qp.penalties[soft], -1.0
    upper = np.concatenate([np.full(slacks, 1e30), reduced.h / norms])  # 1e30 is no bound
    lower = np.concatenate([np.zeros(slacks), np.full(rows, -1e30)])
    first: Solution | None = None
    limit = _DAQP_ITERATIONS
    for proximal_weight in _PROXIMAL_WEIGHTS:  # a negative one: only if curvature is missing
        if budget is not None and (limit := budget.iterations(n, rows)) == 0:
            break
        y, _, exit_flag, info = daqp.solve(
            H / scale,
            g / scale,
            G / norms[:, None],
            upper,
            lower,
            np.zeros(slacks + rows, dtype=np.int32),
            primal_tol=FEASIBILITY_TOLERANCE,
            eps_prox=proximal_weight,
            iter_limit=limit,
        )
        count = int(info["iterations"])
        if budget is not None:
            budget.spend(count, n, rows)
        if exit_flag in (-2, -4):  # cycling, too many iterations
            continue
        if exit_flag not in (1, 2):
            break
        y, mu = np.asarray(y)[slacks:], np.asarray(info["lam"])[slacks:]
        mu = np.maximum(mu * scale, 0.0) / norms
        polished = None if slacks else _polished(qp, y, mu)
        if polished is not None:
            return Solution(qp, *polished, "daqp", count)
        first = first or Solution(qp, qp.equality_space(y), mu, UNREFINED, count)
        if slacks:
            break
    if first is not None:
        return first
    if limit == 0 or exit_flag in (-2, -4):
        if budget is None:
            return None
        raise SolverError(
            f"DAQP found no optimum of {qp!r} within the iterations of one control step. Its "
            f"weights are probably too far apart, or the robot's state is far from any that it can "
            f"control."
        )
    if exit_flag == -3:
        raise unbounded(qp)
    if exit_flag == -5:
        raise not_convex(qp, reduced.H)
    return None


def _active_set(
    qp: QP,
    y: Array | None = None,
    working_set: Sequence[str] = (),
    max_iterations: int | None = None,
) -> Solution:
    """Solve with `active_set` from a guess in the coordinates of `qp.reduced`; polish the result.

    Without a guess, the search starts at y = 0 if this point satisfies all rows.
    """
    space = qp.equality_space
    if y is None and np.all(qp.reduced.h >= 0.0):
        y = np.zeros(qp.reduced.n)
    run = active_set(qp, None if y is None else space(y), working_set, max_iterations)
    if not run.converged:
        raise SolverError(
            f"No solver found the optimum of {qp!r} in {max_iterations} iterations. Its weights "
            f"are probably too far apart, or the robot's state is far from any that it can control."
        )
    solution = run.solution
    polished = _polished(qp, space.A.T @ (solution.x - space.b), solution.inequality_multipliers)
    return (
        solution
        if polished is None
        else Solution(qp, *polished, solution.solver, solution.iterations)
    )


def _cvxpy(qp: QP) -> Solution | None:
    """Solve the whole problem, equalities included, with Clarabel at tight tolerances."""
    cp = require("cvxpy", extra="cvxpy")
    if qp.n == 0:  # cvxpy refuses problems without variables
        return _daqp(qp)
    reduced = qp.reduced
    # Clarabel does not check convexity
    if np.any(
        np.linalg.eigvalsh(reduced.H)
        < -_CONVEXITY_TOLERANCE * np.max(np.abs(reduced.H), initial=0.0)
    ):
        raise not_convex(qp, reduced.H)
    # the variables are relative to the optimum without inequalities: Clarabel's gap is relative to
    # the objective, which is then small, so weights of 1e-6 still matter beside weights of 10
    origin = qp.equality_space(np.linalg.lstsq(reduced.H, -reduced.g, rcond=None)[0])
    # a small objective is enlarged, or Clarabel's absolute tolerance would hide it
    scale = min(_objective_scale(qp), 1.0)
    H, slope = qp.H / scale, (qp.H @ origin + qp.g) / scale
    step = cp.Variable(qp.n)
    equalities = [qp.A @ step == qp.b - qp.A @ origin] if len(qp.A) else []
    inequalities = [qp.G @ step <= qp.h - qp.G @ origin] if len(qp.G) else []
    objective = 0.5 * cp.quad_form(step, cp.psd_wrap(H)) + slope @ step
    problem = cp.Problem(cp.Minimize(objective), equalities + inequalities)
    for tolerance in _CLARABEL_TOLERANCES:
        with suppress(cp.error.SolverError), warnings.catch_warnings():
            # Clarabel reports inaccuracy near its last digits; Solution.residuals gives the actual
            # accuracy
            warnings.filterwarnings("ignore", message="Solution may be inaccurate")
            tolerances = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), tolerance)
            problem.solve(solver=cp.CLARABEL, max_iter=200, **tolerances)
            if problem.status != cp.USER_LIMIT:
                break
    if problem.status in (cp.INFEASIBLE, cp.INFEASIBLE_INACCURATE):
        return None
    if problem.status in (cp.UNBOUNDED, cp.UNBOUNDED_INACCURATE):
        raise unbounded(qp)
    if step.value is None or problem.status == cp.USER_LIMIT:
        raise SolverError(
            f"Clarabel did not converge on {qp!r}: it ended with status {problem.status!r}. Check "
            f"the scaling of the problem, or use another solver."
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
    """Improve the last digits of x and μ by Newton steps on the optimality conditions.

    Return None if the steps do not end at an optimum, because its active rows are others.
    """
    # without curvature in some direction, the equations nearly always leave something open
    for unique in (True, False) if np.all(np.diag(qp.reduced.H)) else (False,):
        with suppress(np.linalg.LinAlgError):
            polished = _after_newton_steps(qp, y, mu, unique)
            if polished is not None:
                return polished
    return None


def _after_newton_steps(qp: QP, y: Array, mu: Array, unique: bool) -> tuple[Array, Array] | None:
    """Return x and μ after two Newton steps, or None if they are not an optimum.

    If the optimum or its multipliers are not unique, the steps are the shortest ones. The first may
    be long, since DAQP's proximal weight can move its point along directions of little slope.
    The last step must be small enough for rounding. With weights from 1e-8 to 1, the reduced H
    leaves few digits for the slope. Here the slope is summed in extended precision, if the
    processor supports it, from the original problem.
    """
    reduced, space, n, size = qp.reduced, qp.equality_space, len(y), qp.row_norms
    active = np.flatnonzero(mu > 0.0)
    G = reduced.G[active]
    K = np.zeros((n + len(G), n + len(G)))
    K[:n, :n], K[:n, n:], K[n:, :n] = reduced.H, G.T, G
    scale = np.sqrt(_objective_scale(reduced))
    units = np.append(np.full(n, 1.0 / scale), scale / size[active])  # make K comparable with 1
    Z, H, rows = (np.asarray(array, dtype=np.longdouble) for array in (space.A, qp.H, qp.G[active]))
    values = np.concatenate([y, mu[active]]).astype(np.longdouble)
    if not unique:  # without directions of rounding size, a step is the shortest
        curvatures, directions = np.linalg.eigh(units[:, None] * K * units)
        resolved = np.abs(curvatures) > _RANK_TOLERANCE * np.max(np.abs(curvatures), initial=0.0)
        curvatures, directions = curvatures[resolved], units[:, None] * directions[:, resolved]
    for _ in range(2):
        x = Z @ values[:n] + space.b
        slope = Z.T @ (H @ x + qp.g + rows.T @ values[n:])
        residual = np.concatenate([slope, rows @ x - qp.h[active]]).astype(np.float64)
        if unique:
            step = np.linalg.solve(K, residual)
        else:
            step = directions @ (directions.T @ residual / curvatures)
        values -= step
    largest = 1.0 + np.max(np.abs(values[:n]), initial=0.0)
    if not np.max(np.abs(step[:n]), initial=0.0) < _MAX_POLISHING_STEP * largest:
        return None
    polished = np.zeros_like(mu)
    polished[active] = np.maximum(values[n:].astype(np.float64), 0.0)
    point = space(values[:n].astype(np.float64))
    parts = qp.H @ point, qp.g, qp.G.T @ polished
    # multipliers of nearly parallel rows are large, and their sum is not
    terms = np.abs(qp.H) @ (1.0 + np.abs(point)) + np.abs(qp.G).T @ polished
    rounding = _ROUNDING * np.max(terms, initial=0.0)
    is_steep = (
        np.abs(space.A.T @ sum(parts))
        > _STATIONARITY * np.max(np.abs(parts), initial=0.0) + rounding
    )
    excess = (qp.G @ point - qp.h) / size
    excess[polished > 0.0] = np.abs(excess[polished > 0.0])
    is_outside = excess > violation_tolerance(qp.h / size, point)
    return None if np.any(is_steep) or np.any(is_outside) else (point, polished)


def _objective_scale(qp: QP) -> float:
    """Return the divisor of the objective that makes tolerances comparable between problems."""
    return float(np.max(np.abs(qp.H), initial=0.0) or np.max(np.abs(qp.g), initial=0.0) or 1.0)
