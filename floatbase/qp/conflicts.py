"""Problems without an optimum: their errors, and minimal sets of conflicting constraints.

A minimal set is infeasible as it is, and feasible without any one of its rows. In optimization it
is called an irreducible infeasible subsystem (IIS).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from floatbase._validation import Array
from floatbase.errors import InfeasibleError, SolverError
from floatbase.qp.labels import ConstraintLabel

# how far a solver may violate an inequality of unit length (N, N·m); well above rounding
FEASIBILITY_TOLERANCE = 1e-9
# multipliers of a conflict add up to 1; a row with a smaller one is not part of the conflict
MULTIPLIER_TOLERANCE = 1e-9
_ROUNDING = 1e-12  # fraction of a row, of its |h| and of the largest |x| that may be rounding
# steps per row before the search for a conflict gives up; it needs about one
_STEPS_PER_CONSTRAINT = 100
_MAX_LISTED = 4  # largest number of constraints listed on one line


def infeasible(constraints: Iterable[str]) -> InfeasibleError:
    """Return the error that names the conflicting inequality constraints.

    More than a few constraints are grouped by kind and counted. Each is then named by its owner, or
    by its full name if its owner has several constraints of that kind.
    """
    labels = [
        row if isinstance(row, ConstraintLabel) else ConstraintLabel(row) for row in constraints
    ]
    text = f" {', '.join(labels)}. "
    if len(labels) > _MAX_LISTED:
        kinds: dict[str, list[str]] = {}
        for label in labels:
            kinds.setdefault(label.kind, []).append(label.owner if label.number is None else label)
        groups = [f"  {len(each)} × {kind}: {', '.join(each)}\n" for kind, each in kinds.items()]
        text = "\n" + "".join(groups)
    return InfeasibleError(
        f"No point satisfies all constraints. Given the equalities, these are in conflict:{text}"
        "Relax or remove at least one of them. Other constraints may be in conflict, too.",
        labels,
    )


def unbounded(problem: object) -> SolverError:
    """Return the error for a problem whose objective decreases without limit."""
    return SolverError(
        f"The objective of {problem!r} has no minimum: it decreases without limit along a "
        f"direction that has no curvature and meets no constraint. "
        "Add a task of small weight for every variable (force or torque regularization), or bounds."
    )


def not_convex(problem: object, H: Array) -> SolverError:
    """Return the error for a problem whose objective has negative curvature."""
    return SolverError(
        f"{problem!r} is not convex: along one direction its curvature is "
        f"{np.linalg.eigvalsh(H)[0]:.3g}. "
        "H must be positive semidefinite where the equalities hold. Make all weights ≥ 0."
    )


def violation_tolerance(h: Array, x: Array | None = None) -> Array:
    """Return how far rows of unit length may be violated: `FEASIBILITY_TOLERANCE` plus rounding."""
    magnitude = 0.0 if x is None else float(np.max(np.abs(x), initial=0.0))
    return FEASIBILITY_TOLERANCE + _ROUNDING * (np.abs(h) + magnitude)


def conflicting_constraints(G: Array, h: Array) -> tuple[int, ...]:
    """Find a minimal set of rows of G y ≤ h that cannot be satisfied together.

    Without any one of these rows, the others can be satisfied.

    Parameters
    ----------
    G : ndarray, shape (l, n)
        Matrix of the inequalities, scaled so that violations of different rows are comparable.
    h : ndarray, shape (l,)
        Right-hand sides, scaled in the same way.

    Returns
    -------
    tuple of int
        Indices of the rows. Empty if some point satisfies all rows within `violation_tolerance`.

    Raises
    ------
    SolverError
        If the search does not end.

    Notes
    -----
    By Farkas' lemma, infeasibility is proved by multipliers m ≥ 0 with Gᵀ m = 0 and hᵀ m < 0. These
    multipliers minimize ‖Gᵀ m‖² + (hᵀ m + 1)². The active-set method for m ≥ 0 ends with linearly
    independent columns (G, h), so the proof needs every row it uses. Source: Lawson and Hanson,
    Solving Least Squares Problems (1974), ch. 23.
    """
    from scipy.optimize import nnls  # slow to import, and rarely needed

    if not len(G):
        return ()
    norm_G, norm_h = float(np.max(np.abs(G), initial=0.0)) or 1.0, float(np.max(np.abs(h))) or 1.0
    relaxed = h + violation_tolerance(h)
    columns = np.vstack([G.T / norm_G, relaxed / norm_h])
    target = np.append(np.zeros(G.shape[1]), -1.0)
    try:
        m, _ = nnls(columns, target, maxiter=_STEPS_PER_CONSTRAINT * len(G))
    except RuntimeError as error:
        raise SolverError(
            f"The search for conflicting constraints among {len(G)} rows did not end: {error}. "
            f"Check the scaling of the problem."
        ) from None
    m /= np.sum(m) or 1.0
    gap = np.max(np.abs(G.T @ m), initial=0.0)
    if gap > _ROUNDING * norm_G or relaxed @ m >= 0.0:  # no proof of infeasibility
        return ()
    return tuple(np.flatnonzero(m > MULTIPLIER_TOLERANCE).tolist())
