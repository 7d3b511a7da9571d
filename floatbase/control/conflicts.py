"""Which rows of an infeasible problem contradict each other: a smallest such set."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linprog

from floatbase._arrays import Array

_TOLERANCE = 1e-8  # a violation below this part of the rows' size counts as none


def conflicting_rows(G: Array, h: Array) -> tuple[int, ...]:
    """Indices of rows of G y ≤ h that cannot hold together, while any of them dropped leaves the others satisfiable.

    G: (l, n), h: (l,). Empty when a point satisfies all rows. A linear program finds the least common violation; the rows
    with a multiplier there form a contradiction (Farkas), which a second pass thins out row by row.
    """
    size = np.maximum(np.linalg.norm(G, axis=1), 1e-12)
    G, h = G / size[:, None], h / size
    violation, rows = _least_violation(G, h)
    if violation <= _TOLERANCE * (1.0 + float(np.max(np.abs(h), initial=0.0))):
        return ()
    kept = list(rows)
    for row in rows:
        rest = [i for i in kept if i != row]
        if rest and _least_violation(G[rest], h[rest])[0] > 0.5 * _TOLERANCE:
            kept = rest
    return tuple(sorted(kept))


def _least_violation(G: Array, h: Array) -> tuple[float, list[int]]:
    """The least s ≥ 0 with G y ≤ h + s, and the rows that hold it there."""
    n = G.shape[1]
    found = linprog(
        np.append(np.zeros(n), 1.0),
        A_ub=np.hstack([G, -np.ones((len(G), 1))]),
        b_ub=h,
        bounds=[(None, None)] * n + [(0.0, None)],
        method="highs",
    )
    if found.status != 0:
        return np.inf, list(range(len(G)))
    return float(found.x[-1]), [int(i) for i in np.flatnonzero(np.abs(found.ineqlin.marginals) > 1e-9)]
