"""Strict priorities: one QP per level, in the freedom that earlier levels leave."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import cast

import numpy as np

from floatbase._validation import Array
from floatbase.affine import Affine
from floatbase.dynamics import Block
from floatbase.errors import InfeasibleError, InputError, SolverError
from floatbase.linear_algebra import null_space
from floatbase.objectives import Task
from floatbase.qp import FEASIBILITY_TOLERANCE, QP, ConstraintLabel, Solution, solve
from floatbase.qp._changed import changed
from floatbase.qp._levels import in_residuals
from floatbase.qp.solve import Budget, solve_in_step

# A smaller multiplier may be a rounding error. The bounds are a fraction of the largest slope that
# it balances, and a multiple of the slope that is left at the optimum.
_SIGNIFICANT_MULTIPLIER, _SIGNIFICANT_SLOPE = 1e-12, 1e6


def split_levels(tasks: Sequence[Task] | Sequence[Sequence[Task]]) -> tuple[list[Task], list[int]]:
    """Return tasks as one list, and the number of tasks in each level."""
    are_levels = [
        isinstance(part, list | tuple) and not hasattr(part, "residual") for part in tasks
    ]
    if not any(are_levels):
        return list(tasks), []  # type: ignore[arg-type]
    if not all(are_levels):
        raise InputError(
            "tasks mixes tasks and lists of tasks. Pass a list of tasks, or a list of lists, one "
            "for each priority level."
        )
    levels: list[Sequence[Task]] = list(tasks)  # type: ignore[arg-type]
    if not all(len(level) for level in levels):
        raise InputError("tasks has an empty priority level. Each level needs a task.")
    return [task for level in levels for task in level], [len(level) for level in levels]


def with_fixed_residuals(
    qp: QP, x: Array, tasks: Sequence[Task], costs: Sequence[tuple[Block, float, Affine]]
) -> tuple[Array, Array, list[ConstraintLabel]]:
    """Return equality constraints that keep the residuals of some tasks at those of x."""
    rows, right, names = [np.zeros((0, qp.n))], [np.zeros(0)], []
    for task, (block, weight, residual) in zip(tasks, costs, strict=True):
        if weight == 0.0:
            continue
        part = np.zeros((len(residual.b), qp.n))
        part[:, qp.blocks[block]] = residual.A
        rows.append(part)
        right.append(residual.A @ x[qp.blocks[block]])
        for i in range(len(residual.b)):
            names.append(ConstraintLabel(f"task {task.name} {i}", "task", task.name, i))
    return np.vstack(rows), np.concatenate(right), names


def solve_levels(
    qps: Sequence[QP],
    levels: Sequence[Sequence[Task]],
    costs: Sequence[Sequence[tuple[Block, float, Affine]]],
    solver: str,
    budget: Budget | None = None,
) -> list[Solution]:
    """Solve the QP of each priority level, subject to the optima of the levels before.

    `Solution.solver` names the fallback if the solver failed in this level or an earlier one. With
    a budget, a level after the first that has no answer ends the list. The solver of the last
    solution is then "level 1 of 3", for example.

    The optimum of a level has the same residuals wherever it is attained, because the cost is
    strictly convex in them. The next level therefore keeps the residuals, not the variables. An
    inequality with a positive multiplier is active at all these optima, so the next level keeps it
    as an equality. Soft inequalities are violated no more than in the first level.
    """
    solutions: list[Solution] = []
    A, b, names = qps[0].A, qps[0].b, qps[0].equality_names
    h, penalties, used = qps[0].h, qps[0].penalties, set(names)
    free, x = qps[0].equality_space
    kept: dict[str, float] = {}
    for qp, tasks, terms in zip(qps, levels, costs, strict=True):
        level = changed(qp, A=A, b=b, equality_names=names, h=h, penalties=penalties)
        change, T, rank = in_residuals(level, terms, free, x)
        try:
            found = solve_in_step(change, solver, budget) if budget else solve(change, solver)
        except (InfeasibleError, SolverError):
            if budget is None or not solutions:
                raise
            named = f"level {len(solutions)} of {len(levels)}"
            return [*solutions[:-1], replace(solutions[-1], solver=named)]
        x = x + T @ found.x
        before = solutions[-1].violations if solutions else {}
        # a fallback of an earlier level is reported in the later ones, too
        slowest = solutions[-1].solver if solutions and found.solver == solver else found.solver
        solution = Solution(
            level, x, found.inequality_multipliers, slowest, found.iterations, before, dict(kept)
        )
        solutions.append(solution)
        # soft rows keep their violation, and all rows the rounding of the solver: the optimum of
        # this level is a feasible point of the next
        h, penalties = np.maximum(h, qp.G @ x + FEASIBILITY_TOLERANCE * qp.row_norms), None
        rows, right, labels = with_fixed_residuals(level, x, tasks, terms)
        # relaxed like the others, these rows would let the torques change by far more than that
        scaled = found.inequality_multipliers * qp.row_norms
        slopes = np.concatenate([qp.g, qp.H @ x, scaled])
        rounding = _SIGNIFICANT_SLOPE * found.residuals.stationarity
        least = max(_SIGNIFICANT_MULTIPLIER * np.max(np.abs(slopes)), rounding)
        active = np.flatnonzero(scaled > least)
        active_names = [cast(ConstraintLabel, qp.inequality_names[i]) for i in active]
        kept.update(zip(active_names, found.inequality_multipliers[active].tolist(), strict=True))
        free = T[:, rank:]
        free = free @ null_space(qp.G[active] @ free / qp.row_norms[active, None], absolute=True)
        A = np.vstack([A, rows, qp.G[active]])
        b = np.concatenate([b, right, qp.G[active] @ x])
        unused = []
        for label in (*labels, *active_names):
            unused.append(_unused(label, used))
            used.add(unused[-1])
        names = (*names, *unused)
    return solutions


def _unused(label: ConstraintLabel, used: set[str]) -> ConstraintLabel:
    """Return a label, with a number if its text is in use, as that of a task of the same name."""
    text, n = str(label), 1
    while text in used:
        n += 1
        text = f"{label} ({n})"
    return ConstraintLabel(text, label.kind, label.owner, label.number)
