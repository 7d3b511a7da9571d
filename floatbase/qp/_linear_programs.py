"""Linear programs, used for cones and for the wrenches of a stance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from floatbase._validation import Array
from floatbase.errors import SolverError

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

OPTIMAL, INFEASIBLE, UNBOUNDED = 0, 2, 3


def linear_program(
    cost: Array,
    equalities: tuple[Array, Array] | None = None,
    inequalities: tuple[Array, Array] | None = None,
    bounds: Sequence[tuple[float | None, float | None]] | tuple[float | None, float | None] = (
        0.0,
        None,
    ),
) -> OptimizeResult:
    """Solve the linear program min cᵀ x subject to A x = b and G x ≤ h."""
    from scipy.optimize import linprog  # slow to import, and rarely needed

    (A, b), (G, h) = equalities or (None, None), inequalities or (None, None)
    # presolve may stop at "infeasible or unbounded"; without it, the simplex method decides
    for presolve in (True, False):
        result = linprog(
            cost, G, h, A, b, bounds, method="highs-ds", options={"presolve": presolve}
        )
        if result.status in (OPTIMAL, INFEASIBLE, UNBOUNDED):
            return result
    raise SolverError(
        f"HiGHS did not converge on a linear program of {cost.size} variables: {result.message}"
    )
