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

FEASIBILITY_TOLERANCE = 1e-9  # how far a solver may violate an inequality of unit length: N, N·m; well above rounding
SHARE = 1e-9  # of the multipliers of a conflict, which add up to 1: a row with less has no part in it
_ROUNDING = 1e-12  # part of the largest |h| that a linear program may leave as a violation
_HIGHS = 1e-10  # the smallest tolerance that HiGHS takes
_FEW = 4  # rows that are listed in one line


def infeasible(rows: Iterable[str]) -> InfeasibleError:
    """The error that names the inequality rows in conflict.

    More than a few are grouped by kind and counted, each by its owner, or by its whole name where its owner has several.
    """
    labels = [row if isinstance(row, RowLabel) else RowLabel(row) for row in rows]
    text = f" {', '.join(labels)}. "
    if len(labels) > _FEW:
        kinds: dict[str, list[str]] = {}
        for label in labels:
            kinds.setdefault(label.kind, []).append(label.owner if label.number is None else label)
        text = "".join(f"\n  {len(owners)} × {kind}: {', '.join(owners)}" for kind, owners in kinds.items()) + "\n"
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


def not_convex(problem: object, H: Array) -> SolverError:
    """The error for a problem, told by its repr, whose objective curves downwards; H: where the equalities hold."""
    return SolverError(
        f"{problem!r} is not convex: along one direction its curvature is {np.linalg.eigvalsh(H)[0]:.3g}. "
        "H must be positive semidefinite where the equalities hold; weights must be ≥ 0."
    )


def conflicting_rows(G: Array, h: Array) -> tuple[int, ...]:
    """Indices of rows of G y ≤ h that cannot hold together, while any of them dropped leaves the others satisfiable.

    G: (l, n), h: (l,), in units that make violations of different rows comparable. Empty when a point satisfies all
    rows. A linear program finds the least common violation; the rows with a multiplier there are in conflict (Farkas), and
    a second pass leaves out row by row what the conflict does not need. Raises `SolverError` when the linear program fails.
    """
    tolerance = FEASIBILITY_TOLERANCE + _ROUNDING * float(np.max(np.abs(h), initial=0.0))
    violation, conflict = _least_violation(G, h)
    if violation <= tolerance:
        return ()
    for row in conflict:
        rest = [i for i in conflict if i != row]
        if _least_violation(G[rest], h[rest])[0] > tolerance:
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
