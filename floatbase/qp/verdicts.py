"""The errors for problems without an optimum: infeasible, unbounded, not convex."""

from __future__ import annotations

from collections.abc import Iterable

from floatbase.errors import InfeasibleError, SolverError
from floatbase.qp.labels import RowLabel

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


def _grouped(labels: tuple[RowLabel, ...]) -> list[str]:
    """One line for each kind of row: how many, and whose; a row that its owner has several of by its full name."""
    kinds: dict[str, list[str]] = {}
    for label in labels:
        kinds.setdefault(label.kind, []).append(label.owner if label.index is None else str(label))
    return [f"  {len(owners)} × {kind}: {', '.join(owners)}" for kind, owners in kinds.items()]
