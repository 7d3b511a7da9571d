"""A primal active-set method for convex QPs, written to be read (Appendix C).

    min ½ xᵀ H x + gᵀ x   subject to   A x = b,   G x ≤ h

A row of G x ≤ h is a table top: at the optimum we either rest on it, and it may as well be an
equality, or we do not touch it, and it may as well not be there. Knowing which is which, one linear
system gives the answer. So guess, look at what the guess gives, and correct it by one row at a
time. Every point on the way satisfies all rows.

Symbols
    β  coordinates in which the equalities always hold, x = x0 + Z β (13); x without equalities
    W  working set: rows of G held with equality for now, linearly independent
    p  direction from the point to the minimiser on the rows of W
    α  length of the step along p, 1 to arrive at that minimiser
    μ  multipliers of the rows of W, from H x + g + Gᵀ μ = 0

Algorithm
    0. `_feasible_start`: a point that satisfies all rows (phase 1: the same method, on the problem
       "least violation").
    1. `_direction`: p, in the null space of the rows of W.
    2. `_longest_step`: α = 1, unless a row outside W forbids it. Go there.
    3. Forbidden: that row blocks, it joins W; back to 1.
    4. Arrived: `_multipliers`. All ≥ 0: this is the optimum.
       Otherwise a multiplier is wrong-signed (μ < 0): its row, `_row_to_drop`, leaves W; back to 1.

At a degenerate point (more rows meet than there are coordinates) steps of length 0 can follow one
another. As long as they do, both choices fall on the row with the least index (Bland's rule), which
keeps a working set from coming back. A direction without curvature, along which the objective
falls, has no minimiser: p then is the way down and α may be as long as it likes; if no row blocks,
the objective has no minimum.

Source: [FBR], Appendix C; Nocedal and Wright, Numerical Optimization (2006), ch. 16.5; for Bland's
rule on quadratic programs Chang and Cottle, Math. Programming 18 (1980).
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
from floatbase.errors import SolverError, unknown_name
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

# part of a sum's largest terms that may be rounding: 450 units in the last place, for sums of 60
# terms
_ROUNDING = 1e-13
_SIGNIFICANT = 1e3  # times rounding: a slope or a negative curvature beyond it is not rounding
_UNLIMITED = 10**6  # iterations, beyond any count that the method would take
_SLACK_CONSTRAINT = "violation s ≥ 0"  # the row that ends phase 1 when it blocks


@dataclass(frozen=True, eq=False)
class Iteration(Value):
    """One round of the method, for a lesson to draw: from x along direction, as far as step_length.

    working_set: names of the rows in W.
    x: (n,), the point it starts from.
    direction: (n,), p.
    step_length: α.
    blocking: name of the row that forbade a longer step and joins W, or None.
    multipliers: μ of the rows of W, by name, where the step arrived; empty when a row blocked.
    dropped: name of the row that leaves W, or None.
    objective: ½ xᵀ H x + gᵀ x at x; in phase 1 the largest violation at x, in units of the rows'
        length.
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
        """The point that the step leads to, shape (n,)."""
        return read_only(self.x + self.step_length * self.direction)


@dataclass(frozen=True, eq=False)
class ActiveSetRun(Value):
    """The answer of `active_set` and the way to it.

    solution: the optimum, with its multipliers; where the run was stopped, the point it had come
        to, all multipliers 0.
    iterations: from a feasible point to the optimum, objective never rising.
    phase_one: from the start to that feasible point, violation never rising; empty when the start
        was feasible.
    working_set: names of the rows in W at the end, which the next problem can start from.
    converged: whether the end is the optimum. A run that was stopped has a point that satisfies all
        rows once `iterations` holds any; before, in phase 1, it may violate some.
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
    """App. C: solve a convex QP by the active-set method of this module, keeping a record of every
    iteration.

    qp: the problem.
    start: (n,), a guess of x, such as the last problem's; it need not satisfy any row. By default
        the minimiser on the rows of `working_set`, as if there were no others.
    working_set: names of inequality rows to start with in W, such as the last run's `working_set`;
        those that depend on earlier ones are left out.
    max_iterations: iterations after which to stop, those of phase 1 included, as a program in real
        time must; None does not stop. A run that is stopped raises no error:
        `ActiveSetRun.converged` says so.

    Raises `InfeasibleError` with a smallest set of conflicting rows, `SolverError` when the
    objective has no minimum, is not convex or does not let the method end on its rows,
    `UnknownNameError` for a row that does not exist, `InputError` for a start of another shape or a
    `max_iterations` below 1.
    """
    space, problem = as_instance("qp", qp, QP).equality_space, qp.reduced
    rows = _independent_rows(
        problem, [_index(qp, name) for name in as_strings("working_set", working_set)]
    )
    initial = None if start is None else space.A.T @ (as_array("start", start, (qp.n,)) - space.b)
    budget = (
        _UNLIMITED
        if max_iterations is None
        else as_integer("max_iterations", max_iterations, 1, _UNLIMITED)
    )
    phase_one = _feasible_start(problem, _starting_point(problem, initial, rows), rows, budget)
    result = (
        _iterate(problem, phase_one.x, phase_one.rows, budget - len(phase_one.iterations))
        if phase_one.converged
        else replace(phase_one, iterations=[])
    )
    if result.converged and np.any(
        _violated(problem, result.x)
    ):  # rows so nearly parallel that the method takes them for one
        raise SolverError(
            f"active_set ends beyond rows of {qp!r} that nearly repeat each other. Check their "
            f"scaling."
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
    """Where a walk ended: point, rows of W and their multipliers, the iterations that led there,
    and whether it was done.
    """

    x: Array
    rows: list[int]
    multipliers: Array
    iterations: list[Iteration]
    converged: bool = True


def _iterate(
    problem: QP, x: Array, rows: list[int], max_iterations: int, last: int | None = None
) -> _Result:
    """Steps 1 to 4, from a point x that satisfies all rows and lies on those of W, at most so
    often; row `last` ends it.
    """
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
        f"active_set did not converge: its rows still change after {len(iterations)} iterations on "
        f"{problem!r}. "
        "Check the scaling of the problem."
    )


def _starting_point(problem: QP, y: Array | None, rows: list[int]) -> Array:
    """The point on the rows of W that is nearest to y, or without y the minimiser there."""
    W = problem.G[rows]
    origin = np.zeros(problem.n) if y is None else y
    point = origin + np.linalg.pinv(W) @ (problem.h[rows] - W @ origin)
    p, max_length = _direction(problem, point, rows)
    return point + p if y is None and np.isfinite(max_length) else point


def _feasible_start(problem: QP, y: Array, rows: list[int], max_iterations: int) -> _Result:
    """Phase 1: a point that satisfies all rows, with rows of W that it lies on, in at most so many
    iterations.

    Minimises s ≥ 0 subject to G y - s size ≤ h on the rows that the start violates, and G y ≤ h on
    the others, by the same method. s = 0 is reached exactly if all rows can hold; otherwise the
    rows that stop s above 0 are in conflict.
    """
    n, norms = problem.n, problem.row_norms
    violation = (problem.G @ y - problem.h) / norms
    violation[rows] = 0.0
    violated = violation > violation_tolerance(problem.h / norms, y)
    if not np.any(violated):
        return _Result(y, rows, np.zeros(0), [])
    s_row = len(problem.G)
    relaxed = InequalityQP(
        H=np.zeros((n + 1, n + 1)),
        g=np.eye(n + 1)[-1],
        A=np.zeros((0, n + 1)),
        b=np.zeros(0),
        G=np.block(
            [[problem.G, -(norms * violated)[:, None]], [np.zeros((1, n)), -np.ones((1, 1))]]
        ),
        h=np.append(problem.h, 0.0),
        row_norms=np.append(norms, 1.0),
        inequality_names=(*problem.inequality_names, ConstraintLabel(_SLACK_CONSTRAINT)),
    )
    worst = int(np.argmax(violation))
    result = _iterate(
        relaxed, np.append(y, violation[worst]), [*rows, worst], max_iterations, last=s_row
    )
    if result.converged and result.rows[-1] != s_row and np.any(_violated(problem, result.x[:-1])):
        share = (
            result.multipliers * relaxed.row_norms[result.rows]
        )  # those of the violated rows add up to 1
        raise infeasible(
            problem.inequality_names[i]
            for i in sorted(np.array(result.rows)[share > MULTIPLIER_TOLERANCE])
        )
    working = _independent_rows(problem, [i for i in result.rows if i != s_row])
    return _Result(
        result.x[:-1], working, np.zeros(len(working)), result.iterations, result.converged
    )


def _violated(problem: QP, x: Array) -> npt.NDArray[np.bool_]:
    """Which rows a point does not satisfy, shape (l,)."""
    norms = problem.row_norms
    return (problem.G @ x - problem.h) / norms > violation_tolerance(problem.h / norms, x)


def _direction(problem: QP, x: Array, rows: list[int]) -> tuple[Array, float]:
    """The direction p to the minimiser on the rows of W, and how far along it to go: 1, or inf
    where there is none.

    With the columns of Z spanning the null space of W's rows, p = Z u and u minimises ½ uᵀ (Zᵀ H Z)
    u + (Zᵀ slope)ᵀ u, whose curvatures are the eigenvalues of Zᵀ H Z.
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
    """How far from x along p, at most `max_length`, all rows hold: the length α, and the (first)
    row that forbids more.
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
    """μ of the rows of W at the minimiser on them, shape (len(rows),): solves Gᵀ μ = -(H x + g) in
    least squares.
    """
    return np.linalg.lstsq(problem.G[rows].T, -(problem.H @ x + problem.g), rcond=None)[0]


def _row_to_drop(problem: QP, x: Array, rows: list[int], mu: Array, degenerate: bool) -> int | None:
    """The row of W with the most negative multiplier, rows at equal size, or None; when stuck, the
    first of wrong sign.
    """
    force = mu * problem.row_norms[rows]
    negative = [row for row, f in zip(rows, force, strict=True) if f < -_slope_rounding(problem, x)]
    if not negative:
        return None
    return min(negative) if degenerate else rows[int(np.argmin(force))]


def _independent_rows(problem: QP, rows: Sequence[int]) -> list[int]:
    """`rows` without those that depend on the ones before them."""
    independent: list[int] = []
    basis = np.zeros((0, problem.n))
    for row in rows:
        residual = problem.G[row] / problem.row_norms[row]
        for _ in range(2):  # twice: the first pass leaves rounding
            residual = residual - basis.T @ (basis @ residual)
        length = float(np.linalg.norm(residual))
        if length > RANK_TOLERANCE:
            independent.append(row)
            basis = np.vstack([basis, residual / length])
    return independent


def _slope_rounding(problem: QP, x: Array) -> float:
    """How large an entry of H x + g may come out when it is zero."""
    H, g = np.abs(problem.H), np.abs(problem.g)
    return _ROUNDING * float(np.max(g, initial=0.0) + np.max(H @ np.abs(x), initial=0.0))


def _index(qp: QP, name: str) -> int:
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
    """The same iteration in the problem's own variables, objective raised by `offset`; phase 1's s
    falls away.
    """
    n = space.n_in
    return replace(
        step,
        x=read_only(space(step.x[:n])),
        direction=read_only(space.A @ step.direction[:n]),
        objective=step.objective + offset,
    )
