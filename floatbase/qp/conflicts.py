"""Problems without an optimum: the errors that say why, and which rows of an infeasible problem are
in conflict.

The rows named are a smallest set: infeasible as they are, feasible without any one of them. In
optimisation that is called an irreducible infeasible subsystem (IIS).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from floatbase._validation import Array
from floatbase.errors import InfeasibleError, SolverError
from floatbase.qp.labels import ConstraintLabel

# how far a solver may violate an inequality of unit length: N, N·m; well above rounding
FEASIBILITY_TOLERANCE = 1e-9
# of the multipliers of a conflict, which add up to 1: a row with less has no part in it
MULTIPLIER_TOLERANCE = 1e-9
_ROUNDING = 1e-12  # part of a row, of its |h| and of the largest |x| that may be rounding
# for each row, before the search for a conflict gives up; it takes about one
_STEPS_PER_CONSTRAINT = 100
_MAX_LISTED = 4  # rows that are listed in one line


def infeasible(constraints: Iterable[str]) -> InfeasibleError:
    """The error that names the inequality rows in conflict.

    More than a few are grouped by kind and counted, each by its owner, or by its whole name where
    its owner has several.
    """
    labels = [
        row if isinstance(row, ConstraintLabel) else ConstraintLabel(row) for row in constraints
    ]
    text = f" {', '.join(labels)}. "
    if len(labels) > _MAX_LISTED:
        kinds: dict[str, list[str]] = {}
        for label in labels:
            kinds.setdefault(label.kind, []).append(label.owner if label.number is None else label)
        text = (
            "".join(
                f"\n  {len(owners)} × {kind}: {', '.join(owners)}" for kind, owners in kinds.items()
            )
            + "\n"
        )
    return InfeasibleError(
        f"no point satisfies all constraints. Given the equalities, these are in conflict:{text}"
        "At least one of these constraints has to be loosened or dropped; others may be in "
        "conflict too.",
        labels,
    )


def unbounded(problem: object) -> SolverError:
    """The error for a problem, told by its repr, whose objective falls for ever."""
    return SolverError(
        f"the objective of {problem!r} has no minimum: it falls for ever along a direction without "
        f"curvature or row. "
        "Add a task of small weight for every variable (force or torque regularisation), or bounds."
    )


def not_convex(problem: object, H: Array) -> SolverError:
    """The error for a problem, told by its repr, whose objective curves downwards; H: where the
    equalities hold.
    """
    return SolverError(
        f"{problem!r} is not convex: along one direction its curvature is "
        f"{np.linalg.eigvalsh(H)[0]:.3g}. "
        "H must be positive semidefinite where the equalities hold; weights must be ≥ 0."
    )


def violation_tolerance(h: Array, x: Array | None = None) -> Array:
    """How far rows of unit length may be violated, shape (l,): `FEASIBILITY_TOLERANCE`, and
    rounding.

    h: (l,), their right-hand sides. x: (n,), the point that is tried, or None where there is none.
    """
    magnitude = 0.0 if x is None else float(np.max(np.abs(x), initial=0.0))
    return FEASIBILITY_TOLERANCE + _ROUNDING * (np.abs(h) + magnitude)


def conflicting_constraints(G: Array, h: Array) -> tuple[int, ...]:
    """Indices of rows of G y ≤ h that cannot hold together, while any of them dropped leaves the
    others satisfiable.

    G: (l, n), h: (l,), in units that make violations of different rows comparable. Empty when a
        point satisfies all rows
    but for `violation_tolerance`. Otherwise, by Farkas' lemma, multipliers m ≥ 0 of the rows prove
    that there is none: Gᵀ m = 0 and hᵀ m < 0. They minimise ‖Gᵀ m‖² + (hᵀ m + 1)²; the active-set
    method for m ≥ 0 ends with columns (G, h) of independent rows, so that no row of the proof can
    be spared. Source: Lawson and Hanson, Solving Least Squares Problems (1974), ch. 23.
    """
    from scipy.optimize import nnls  # slow to load, and never needed while all goes well

    if not len(G):
        return ()
    norm_G, norm_h = float(np.max(np.abs(G), initial=0.0)) or 1.0, float(np.max(np.abs(h))) or 1.0
    relaxed = h + violation_tolerance(h)
    target = np.append(np.zeros(G.shape[1]), -1.0)
    try:
        m, _ = nnls(
            np.vstack([G.T / norm_G, relaxed / norm_h]),
            target,
            maxiter=_STEPS_PER_CONSTRAINT * len(G),
        )
    except RuntimeError as error:
        raise SolverError(
            f"the search for conflicting rows among {len(G)} did not end: {error}"
        ) from None
    m /= np.sum(m) or 1.0
    infeasible_certificate = (
        np.max(np.abs(G.T @ m), initial=0.0) <= _ROUNDING * norm_G and relaxed @ m < 0.0
    )
    return (
        tuple(int(row) for row in np.flatnonzero(m > MULTIPLIER_TOLERANCE))
        if infeasible_certificate
        else ()
    )
