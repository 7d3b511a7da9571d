"""Primal active-set method for convex QPs, written for readability.

    min ½ xᵀ H x + gᵀ x   subject to   A x = b,   G x ≤ h

Each row of G x ≤ h is like a table top. At the optimum, either we rest on it, and it might as well
be an equality, or we do not touch it, and it might as well be absent. If we know which rows are
which, one linear system gives the answer. So the method guesses, solves for the guess, and corrects
it by one row at a time. Every iterate satisfies all rows.

Symbols
    β  coordinates in which the equalities always hold, x = x0 + Z β, eq. (13); x if there are none
    W  working set: linearly independent rows of G that are treated as equalities for now
    p  direction from the current point to the minimizer on the rows of W
    α  step length along p; α = 1 reaches that minimizer
    μ  multipliers of the rows of W, from H x + g + Gᵀ μ = 0

Algorithm
    0. `_feasible_start`: find a point that satisfies all rows (phase 1: the same method, applied to
       the problem "minimize the violation").
    1. `_direction`: compute p in the null space of the rows of W.
    2. `_longest_step`: α = 1, unless a row outside W blocks. Take the step.
    3. If a row blocks, it joins W; return to 1.
    4. Otherwise compute the multipliers (`_multipliers`). If all are ≥ 0, this is the optimum. If
       one is negative, a row with a negative multiplier (`_row_to_drop`) leaves W; return to 1.

At a degenerate point, where more rows meet than there are coordinates, several steps of length 0
can follow each other. During these steps, both choices select the row with the smallest index
(Bland's rule), so that no working set occurs twice. If the objective decreases along a direction
without curvature, there is no minimizer: p is then this descent direction and α is not limited. If
no row blocks, the objective has no minimum.

[FBR]_, App. C. [NocedalWright2006]_, section 16.5. For Bland's rule in quadratic programs: Chang
and Cottle, Math. Programming 18 (1980).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_instance,
    as_integer,
    as_strings,
    read_only,
)
from floatbase.affine import Affine
from floatbase.errors import InputError, SolverError, unknown_name
from floatbase.linear_algebra import RANK_TOLERANCE, null_space
from floatbase.qp.conflicts import (
    MULTIPLIER_TOLERANCE,
    infeasible,
    not_convex,
    unbounded,
    violation_tolerance,
)
from floatbase.qp.labels import ConstraintLabel
from floatbase.qp.problem import QP, InequalityQP
from floatbase.qp.solution import Solution

# fraction of the largest terms of a sum that may be rounding: 450 units in the last place, for
# sums of 60 terms
_ROUNDING = 1e-13
_SIGNIFICANT = 1e3  # multiple of rounding: a larger slope or negative curvature is significant
_UNLIMITED = 10**6  # iterations, more than the method ever needs
_SLACK_CONSTRAINT = "violation s ≥ 0"  # the row that ends phase 1 when it blocks


@dataclass(frozen=True, eq=False)
class Iteration(Value):
    """One iteration of the active-set method: a step from x along a direction.

    Parameters
    ----------
    working_set : tuple of str
        Names of the rows in W.
    x : ndarray, shape (n,)
        Point at which the step starts.
    direction : ndarray, shape (n,)
        Direction p of the step.
    step_length : float
        Step length α, dimensionless.
    blocking : str or None
        Name of the row that blocked a longer step and joins W; None if no row blocked.
    multipliers : mapping of str to float
        Multipliers μ of the rows of W at the end of the step, by name; empty if a row blocked.
    dropped : str or None
        Name of the row that leaves W; None if no row leaves.
    objective : float
        Value of ½ xᵀ H x + gᵀ x at x [units of the objective]. In phase 1 it is the largest
        violation at x, for rows scaled to unit length.
    """

    working_set: tuple[str, ...]
    x: Array
    direction: Array
    step_length: float
    blocking: str | None
    multipliers: Mapping[str, float]
    dropped: str | None
    objective: float

    @property
    def x_next(self) -> Array:
        """Point at the end of the step, shape (n,)."""
        return read_only(self.x + self.step_length * self.direction)


@dataclass(frozen=True, eq=False)
class ActiveSetRun(Value):
    """Result of `active_set` with all its iterations.

    Parameters
    ----------
    solution : Solution
        Optimum with its multipliers. If the run was stopped, it is the last point, with all
        multipliers zero.
    iterations : tuple of Iteration
        Iterations from a feasible point to the optimum; the objective never increases.
    phase_one : tuple of Iteration
        Iterations from the start to that feasible point; the violation never increases. Empty if
        the start was feasible.
    working_set : tuple of str
        Names of the rows in W at the end, from which the next problem can start.
    converged : bool
        Whether the last point is the optimum. The point of a stopped run satisfies all rows if
        `iterations` is not empty. A run stopped in phase 1 may violate some rows.
    """

    solution: Solution
    iterations: tuple[Iteration, ...]
    phase_one: tuple[Iteration, ...]
    working_set: tuple[str, ...]
    converged: bool = True


def active_set(
    qp: QP,
    start: npt.ArrayLike | None = None,
    working_set: Sequence[str] = (),
    max_iterations: int | None = None,
) -> ActiveSetRun:
    """Solve a convex QP by the active-set method and record every iteration.

    Parameters
    ----------
    qp : QP
        Problem to solve.
    start : array_like, shape (n,), optional
        Initial guess of x, such as the solution of a previous problem. It need not satisfy any row.
        By default the minimizer on the rows of `working_set`, ignoring all other rows.
    working_set : sequence of str, optional
        Names of the inequality rows that are initially in W, such as the `working_set` of the last
        run. Rows that depend on earlier ones are left out.
    max_iterations : int, optional
        Largest number of iterations, including those of phase 1; None means no limit. Real-time
        programs need a limit. Reaching the limit raises no error; check `ActiveSetRun.converged`.

    Returns
    -------
    ActiveSetRun
        The solution and all iterations.

    Raises
    ------
    InfeasibleError
        If the constraints are in conflict; the error names a minimal set of conflicting rows.
    SolverError
        If the objective is not convex or has no minimum, or if the method does not converge.
    UnknownNameError
        If `working_set` contains an unknown row.
    InputError
        If `start` has the wrong shape, if `max_iterations` is less than 1, or if inequalities are
        soft without slack variables.

    Notes
    -----
    [FBR]_, App. C. [NocedalWright2006]_
    """
    if len(as_instance("qp", qp, QP).soft):
        raise InputError(
            f"{len(qp.soft)} inequalities of the QP are soft, but active_set treats all as hard. "
            f"Pass qp.with_slacks(), or dataclasses.replace(qp, penalties=None) to make them hard."
        )
    space, problem = qp.equality_space, qp.reduced
    given = [_index(qp, name) for name in as_strings("working_set", working_set)]
    rows = _independent_rows(problem, given)
    initial = None if start is None else space.A.T @ (as_array("start", start, (qp.n,)) - space.b)
    limit = _UNLIMITED if max_iterations is None else max_iterations
    budget = as_integer("max_iterations", limit, 1, _UNLIMITED)
    phase_one = _feasible_start(problem, _starting_point(problem, initial, rows), rows, budget)
    result = replace(phase_one, iterations=[])
    if phase_one.converged:
        budget -= len(phase_one.iterations)
        result = _iterate(problem, phase_one.x, phase_one.rows, budget)
    if result.converged and np.any(_violated(problem, result.x)):
        # rows so nearly parallel that the method treats them as one
        raise SolverError(
            f"The result of active_set violates nearly equal rows of {qp!r}. Check their scaling."
        )
    mu = np.zeros(len(qp.G))
    mu[result.rows] = np.maximum(result.multipliers, 0.0)
    count = len(phase_one.iterations) + len(result.iterations)
    return ActiveSetRun(
        solution=Solution(qp, space(result.x), mu, "active_set", count),
        iterations=tuple(
            _in_original_variables(step, space, qp.objective(space.b)) for step in result.iterations
        ),
        phase_one=tuple(_in_original_variables(step, space, 0.0) for step in phase_one.iterations),
        working_set=tuple(qp.inequality_names[i] for i in result.rows),
        converged=result.converged,
    )


@dataclass(frozen=True, eq=False)
class _Result:
    """Result of a run: point, rows of W, their multipliers, iterations and convergence."""

    x: Array
    rows: list[int]
    multipliers: Array
    iterations: list[Iteration]
    converged: bool = True


def _iterate(
    problem: QP, x: Array, rows: list[int], max_iterations: int, last: int | None = None
) -> _Result:
    """Run steps 1 to 4 from a feasible point x on the rows of W; stop if row `last` blocks."""
    rows, degenerate = list(rows), False
    iterations: list[Iteration] = []
    iteration_limit = 100 + 20 * (problem.n + len(problem.G))
    for _ in range(min(iteration_limit, max_iterations)):
        p, max_length = _direction(problem, x, rows)
        length, blocking = _longest_step(problem, x, p, max_length, rows)
        x_next = x + length * p
        mu = _multipliers(problem, x_next, rows) if blocking is None else np.zeros(0)
        drop = _row_to_drop(problem, x_next, rows, mu, degenerate) if blocking is None else None
        iterations.append(_iteration_record(problem, x, rows, p, length, blocking, mu, drop))
        if blocking is not None:
            rows.append(blocking)
        if drop is None and blocking in (None, last):
            return _Result(x_next, rows, mu, iterations)
        if drop is not None:
            rows.remove(drop)
        degenerate = length * np.linalg.norm(p) <= _ROUNDING * (1.0 + np.linalg.norm(x))
        x = x_next
    if max_iterations <= iteration_limit:
        return _Result(x, rows, np.zeros(len(rows)), iterations, converged=False)
    raise SolverError(
        f"active_set did not converge: its working set still changes after {len(iterations)} "
        f"iterations on {problem!r}. Check the scaling of the problem."
    )


def _starting_point(problem: QP, y: Array | None, rows: list[int]) -> Array:
    """Return the point on the rows of W nearest to y, or the minimizer there if y is None."""
    W = problem.G[rows]
    origin = np.zeros(problem.n) if y is None else y
    point = origin + np.linalg.pinv(W) @ (problem.h[rows] - W @ origin)
    p, max_length = _direction(problem, point, rows)
    return point + p if y is None and np.isfinite(max_length) else point


def _feasible_start(problem: QP, y: Array, rows: list[int], max_iterations: int) -> _Result:
    """Find a point that satisfies all rows, and the rows of W that it lies on (phase 1).

    The search minimizes s ≥ 0 subject to G y - s size ≤ h on the rows that the start violates, and
    G y ≤ h on the others, by the same method. s = 0 is reached exactly if all rows can be
    satisfied. Otherwise, the rows that keep s above 0 are in conflict.
    """
    n, norms = problem.n, problem.row_norms
    violation = (problem.G @ y - problem.h) / norms
    violation[rows] = 0.0
    violated = violation > violation_tolerance(problem.h / norms, y)
    if not np.any(violated):
        return _Result(y, rows, np.zeros(0), [])
    s_row = len(problem.G)
    H, g = np.zeros((n + 1, n + 1)), np.eye(n + 1)[-1]
    G = np.block([[problem.G, -(norms * violated)[:, None]], [-g]])
    names = (*problem.inequality_names, ConstraintLabel(_SLACK_CONSTRAINT))
    relaxed = InequalityQP(
        H, g, H[:0], g[:0], G, np.append(problem.h, 0.0),
        row_norms=np.append(norms, 1.0), inequality_names=names,
    )  # fmt: skip
    worst = int(np.argmax(violation))
    result = _iterate(
        relaxed, np.append(y, violation[worst]), [*rows, worst], max_iterations, last=s_row
    )
    if result.converged and result.rows[-1] != s_row and np.any(_violated(problem, result.x[:-1])):
        # the shares of the violated rows add up to 1
        share = result.multipliers * relaxed.row_norms[result.rows]
        conflict = sorted(np.array(result.rows)[share > MULTIPLIER_TOLERANCE])
        raise infeasible(problem.inequality_names[i] for i in conflict)
    working = _independent_rows(problem, [i for i in result.rows if i != s_row])
    return _Result(
        result.x[:-1], working, np.zeros(len(working)), result.iterations, result.converged
    )


def _violated(problem: QP, x: Array) -> npt.NDArray[np.bool_]:
    """Return which rows a point violates, shape (l,)."""
    norms = problem.row_norms
    return (problem.G @ x - problem.h) / norms > violation_tolerance(problem.h / norms, x)


def _direction(problem: QP, x: Array, rows: list[int]) -> tuple[Array, float]:
    """Return the direction p to the minimizer on the rows of W, and the largest step length.

    The largest step length is 1, or inf if there is no minimizer. If the columns of Z span the null
    space of the rows of W, then p = Z u, where u minimizes ½ uᵀ (Zᵀ H Z) u + (Zᵀ slope)ᵀ u. The
    curvatures are the eigenvalues of Zᵀ H Z.
    """
    Z = null_space(problem.G[rows] / problem.row_norms[rows, None])
    curvature, modes = np.linalg.eigh(Z.T @ problem.H @ Z)
    curvature_rounding = _ROUNDING * float(np.max(np.abs(problem.H), initial=0.0))
    if np.any(curvature < -_SIGNIFICANT * curvature_rounding):
        raise not_convex(problem, problem.H)
    modes, curved = Z @ modes, curvature > curvature_rounding
    slope = modes.T @ (problem.H @ x + problem.g)
    unbounded_modes = ~curved & (np.abs(slope) > _SIGNIFICANT * _slope_rounding(problem, x))
    if np.any(unbounded_modes):
        return -modes[:, unbounded_modes] @ slope[unbounded_modes], np.inf
    return -modes[:, curved] @ (slope[curved] / curvature[curved]), 1.0


def _longest_step(
    problem: QP, x: Array, p: Array, max_length: float, rows: list[int]
) -> tuple[float, int | None]:
    """Return the length α of the longest feasible step from x along p, and the row that blocks.

    The length is at most `max_length`. The row is None if no row blocks, and the first if several
    do.
    """
    norms = problem.row_norms
    rate, slack = problem.G @ p, problem.h - problem.G @ x
    approaching = rate > _ROUNDING * norms * np.linalg.norm(p)
    approaching[rows] = False
    if np.isfinite(max_length):
        approaching &= _violated(problem, x + max_length * p)
    blocking = np.flatnonzero(approaching)
    if not blocking.size:
        if max_length == np.inf:
            raise unbounded(problem)
        return max_length, None
    touching = slack < _ROUNDING * norms * (1.0 + np.linalg.norm(x))
    lengths = np.where(touching, 0.0, slack)[blocking] / rate[blocking]
    first = int(np.argmin(lengths))
    return float(lengths[first]), int(blocking[first])


def _multipliers(problem: QP, x: Array, rows: list[int]) -> Array:
    """Return the multipliers μ of the rows of W at their minimizer, shape (len(rows),).

    The multipliers solve Gᵀ μ = -(H x + g) in the least-squares sense.
    """
    return np.linalg.lstsq(problem.G[rows].T, -(problem.H @ x + problem.g), rcond=None)[0]


def _row_to_drop(problem: QP, x: Array, rows: list[int], mu: Array, degenerate: bool) -> int | None:
    """Return the row of W with the most negative multiplier, or None if no multiplier is negative.

    Multipliers are compared for rows scaled to equal length. At a degenerate point, it is the first
    row with a negative multiplier.
    """
    force = mu * problem.row_norms[rows]
    negative = [row for row, f in zip(rows, force, strict=True) if f < -_slope_rounding(problem, x)]
    if not negative:
        return None
    return min(negative) if degenerate else rows[int(np.argmin(force))]


def _independent_rows(problem: QP, rows: Sequence[int]) -> list[int]:
    """Return `rows` without those that depend linearly on earlier ones."""
    independent: list[int] = []
    basis = np.zeros((0, problem.n))
    for row in rows:
        residual = problem.G[row] / problem.row_norms[row]
        for _ in range(2):  # twice, since the first pass leaves rounding errors
            residual = residual - basis.T @ (basis @ residual)
        length = float(np.linalg.norm(residual))
        if length > RANK_TOLERANCE:
            independent.append(row)
            basis = np.vstack([basis, residual / length])
    return independent


def _slope_rounding(problem: QP, x: Array) -> float:
    """Return how large rounding can make an entry of H x + g that is zero."""
    H, g = np.abs(problem.H), np.abs(problem.g)
    return _ROUNDING * float(np.max(g, initial=0.0) + np.max(H @ np.abs(x), initial=0.0))


def _index(qp: QP, name: str) -> int:
    """Return the index of a named inequality row."""
    if name not in qp.inequality_names:
        raise unknown_name("inequality constraint", name, qp.inequality_names)
    return qp.inequality_names.index(name)


def _iteration_record(
    problem: QP,
    x: Array,
    rows: list[int],
    p: Array,
    length: float,
    blocking: int | None,
    mu: Array,
    drop: int | None,
) -> Iteration:
    """Return the record of one iteration."""
    names = problem.inequality_names
    return Iteration(
        working_set=tuple(names[i] for i in rows),
        x=read_only(x),
        direction=read_only(p),
        step_length=length,
        blocking=None if blocking is None else names[blocking],
        multipliers=MappingProxyType({names[i]: float(m) for i, m in zip(rows, mu, strict=False)}),
        dropped=None if drop is None else names[drop],
        objective=problem.objective(x),
    )


def _in_original_variables(step: Iteration, space: Affine, offset: float) -> Iteration:
    """Return an iteration in the variables of the QP, without s and with an objective offset."""
    n = space.n_in
    return replace(
        step,
        x=read_only(space(step.x[:n])),
        direction=read_only(space.A @ step.direction[:n]),
        objective=step.objective + offset,
    )
