"""Problems without an optimum: the errors that say why, and which rows of an infeasible problem are in conflict.

The rows named are a smallest set: infeasible as they are, feasible without any one of them. In optimisation that is called
an irreducible infeasible subsystem (IIS).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from floatbase._arrays import Array
from floatbase.errors import InfeasibleError, SolverError
from floatbase.qp.labels import RowLabel
from floatbase.qp.linear_programs import OPTIMAL, linear_program

_TOLERANCE = 1e-9  # a violation of a row of unit length below this counts as none, as in `FEASIBILITY_TOLERANCE`
_ROUNDING = 1e-12  # part of the largest |h| that a linear program may leave as a violation
_HIGHS = 1e-10  # the smallest tolerance that HiGHS can be asked for
SHARE = 1e-9  # of the multipliers of a conflict, which add up to 1: a row with less has no part in it
_FEW = 4  # rows that are listed in one line


def infeasible(rows: Iterable[str]) -> InfeasibleError:
    """The error that names the inequality rows in conflict; more than a few are grouped by kind and counted."""
    labels = tuple(row if isinstance(row, RowLabel) else RowLabel(row) for row in rows)
    text = f" {', '.join(labels)}. " if len(labels) <= _FEW else "\n" + "\n".join(_grouped(labels)) + "\n"
    return InfeasibleError(
        f"no point satisfies all rows. Given the equalities, these are in conflict:{text}"
        "Loosen or drop any one of them: at least one has to go.",
        labels,
    )


def unbounded(problem: object) -> SolverError:
    """The error for a problem, told by its repr, whose objective falls for ever."""
    return SolverError(
        f"the objective of {problem!r} has no minimum: it falls for ever along a direction without curvature or row. "
        "Add a task of small weight for every variable (force or torque regularisation), or bounds."
    )


def not_convex(problem: object, curvature: float) -> SolverError:
    """The error for a problem, told by its repr, whose objective curves downwards; curvature: the smallest, < 0."""
    return SolverError(
        f"{problem!r} is not convex: along one direction its curvature is {curvature:.3g}. "
        "H must be positive semidefinite where the equalities hold; weights must be ≥ 0."
    )


def conflicting_rows(G: Array, h: Array) -> tuple[int, ...]:
    """Indices of rows of G y ≤ h that cannot hold together, while any of them dropped leaves the others satisfiable.

    G: (l, n), h: (l,), in units that make violations of different rows comparable. Empty when a point satisfies all
    rows. A linear program finds the least common violation; the rows with a multiplier there are in conflict (Farkas), and
    a second pass leaves out row by row what the conflict does not need. Raises `SolverError` when the linear program fails.
    """
    tolerance = _TOLERANCE + _ROUNDING * float(np.max(np.abs(h), initial=0.0))
    violation, conflict = _least_violation(G, h)
    if violation <= tolerance:
        return ()
    for row in tuple(conflict):
        rest = [i for i in conflict if i != row]
        if _least_violation(G[rest], h[rest])[0] > tolerance:
            conflict = rest
    return tuple(sorted(conflict))


def inconsistent_equalities(A: Array, b: Array, tolerance: float) -> tuple[int, ...]:
    """Indices of rows of A x = b that cannot hold together, while any of them dropped leaves the others satisfiable.

    A: (m, n) with rows of unit length, b: (m,), known to be inconsistent by more than `tolerance`.
    """
    conflict = list(range(len(A)))
    for row in range(len(A)):
        rest = [i for i in conflict if i != row]
        x = np.linalg.lstsq(A[rest], b[rest], rcond=None)[0]
        if np.max(np.abs(A[rest] @ x - b[rest]), initial=0.0) > tolerance:
            conflict = rest
    return tuple(conflict)


def _least_violation(G: Array, h: Array) -> tuple[float, list[int]]:
    """The least s ≥ 0 with G y ≤ h + s, and the rows that do not let it be less."""
    n = G.shape[1]
    found = linear_program(
        np.append(np.zeros(n), 1.0),
        inequalities=(np.hstack([G, -np.ones((len(G), 1))]), h),
        bounds=[(None, None)] * n + [(0.0, None)],
        tolerance=_HIGHS,
    )
    if found.status != OPTIMAL:
        raise SolverError(f"the linear program that looks for conflicting rows ended with: {found.message}")
    violation = float(np.max(G @ found.x[:n] - h, initial=0.0))
    return violation, [int(i) for i in np.flatnonzero(np.abs(found.ineqlin.marginals) > SHARE)]


def _grouped(labels: tuple[RowLabel, ...]) -> list[str]:
    """One line for each kind of row: how many, and whose; a row that its owner has several of by its full name."""
    kinds: dict[str, list[str]] = {}
    for label in labels:
        kinds.setdefault(label.kind, []).append(label.owner if label.index is None else str(label))
    return [f"  {len(owners)} × {kind}: {', '.join(owners)}" for kind, owners in kinds.items()]
