"""Which rows of an infeasible problem are in conflict: a smallest such set.

In optimisation it is called an irreducible infeasible subsystem (IIS): infeasible as it is, feasible without any one row.
"""

from __future__ import annotations

import numpy as np

from floatbase._arrays import Array
from floatbase.errors import SolverError
from floatbase.qp.linear_programs import OPTIMAL, linear_program

_TOLERANCE = 1e-9  # a violation of a row of unit length below this counts as none, as in `FEASIBILITY_TOLERANCE`
_ROUNDING = 1e-12  # part of the largest |h| that a linear program may leave as a violation
_HIGHS = 1e-10  # the smallest tolerance that HiGHS can be asked for
_MULTIPLIER = 1e-9  # below this a row has no part in the conflict: the multipliers add up to 1


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
    return violation, [int(i) for i in np.flatnonzero(np.abs(found.ineqlin.marginals) > _MULTIPLIER)]
