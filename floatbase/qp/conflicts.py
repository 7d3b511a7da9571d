"""Which rows of an infeasible problem contradict each other: a smallest such set.

In optimisation such a set is an irreducible infeasible subsystem (IIS): infeasible as it is, feasible without any one row.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np

from floatbase._arrays import Array
from floatbase.errors import InfeasibleError, SolverError
from floatbase.qp.linear_programs import OPTIMAL, linear_program

_TOLERANCE = 1e-9  # a violation below this counts as none
_ROUNDING = 1e-12  # part of the largest |h| that a linear program may leave as a violation
_HIGHS = 1e-10  # the most exact that HiGHS can be asked to be
_FEW = 4  # rows that are listed in one line
# rows by the names that the controller gives them; whose they are is in the group
_KINDS = {
    "normal force": re.compile("(.+) normal force"),
    "friction": re.compile(r"(.+ facet \d+)"),
    "upper torque limit": re.compile("torque limit (.+) upper"),
    "lower torque limit": re.compile("torque limit (.+) lower"),
}


def contradiction(rows: Iterable[str]) -> InfeasibleError:
    """The error that names the inequality rows in conflict; more than a few are grouped by kind and counted."""
    rows = tuple(rows)
    text = f" {', '.join(rows)}. " if len(rows) <= _FEW else "\n" + "\n".join(_grouped(rows)) + "\n"
    return InfeasibleError(
        f"no point satisfies all rows. Given the equalities, these contradict each other:{text}"
        "Loosen or drop any one of them: at least one has to go.",
        rows,
    )


def _grouped(rows: tuple[str, ...]) -> list[str]:
    """One line for each kind of row: how many, and whose."""
    kinds: dict[str, list[str]] = {}
    for row in rows:
        for kind, pattern in _KINDS.items():
            owner = pattern.fullmatch(row)
            if owner:
                kinds.setdefault(kind, []).append(owner[1])
                break
        else:
            kinds.setdefault("other rows", []).append(row)
    return [f"  {len(owners)} × {kind}: {', '.join(owners)}" for kind, owners in kinds.items()]


def conflicting_rows(G: Array, h: Array) -> tuple[int, ...]:
    """Indices of rows of G y ≤ h that cannot hold together, while any of them dropped leaves the others satisfiable.

    G: (l, n), h: (l,), in units that make violations of different rows comparable. Empty when a point satisfies all
    rows. A linear program finds the least common violation; the rows with a multiplier there form a contradiction
    (Farkas), which a second pass thins out row by row. Raises `SolverError` when the linear program fails.
    """
    tolerance = _TOLERANCE + _ROUNDING * float(np.max(np.abs(h), initial=0.0))
    violation, kept = _least_violation(G, h)
    if violation <= tolerance:
        return ()
    for row in tuple(kept):
        rest = [i for i in kept if i != row]
        if _least_violation(G[rest], h[rest])[0] > tolerance:
            kept = rest
    return tuple(sorted(kept))


def contradicting_equalities(A: Array, b: Array, tolerance: float) -> tuple[int, ...]:
    """Indices of rows of A x = b that cannot hold together, while any of them dropped leaves the others satisfiable.

    A: (m, n) with rows of unit length, b: (m,), known to contradict each other by more than `tolerance`.
    """
    kept = list(range(len(A)))
    for row in range(len(A)):
        rest = [i for i in kept if i != row]
        x = np.linalg.lstsq(A[rest], b[rest], rcond=None)[0]
        if np.max(np.abs(A[rest] @ x - b[rest]), initial=0.0) > tolerance:
            kept = rest
    return tuple(kept)


def _least_violation(G: Array, h: Array) -> tuple[float, list[int]]:
    """The least s ≥ 0 with G y ≤ h + s, and the rows that hold it there."""
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
    return violation, [int(i) for i in np.flatnonzero(np.abs(found.ineqlin.marginals) > 1e-9)]
