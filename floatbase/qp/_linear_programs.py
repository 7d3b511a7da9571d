"""Linear programs, in one place: geometry of cones, wrenches of a stance."""

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
    """min cᵀ x subject to A x = b, G x ≤ h; `.status` is `OPTIMAL`, `INFEASIBLE` or `UNBOUNDED`,
    never anything else.

    cost: c, (n,).
    equalities, inequalities: (A, b) and (G, h), none by default.
    bounds: (lowest, highest) of every variable, or a list with a pair for each; None where there is
        none.

    Raises `SolverError` when HiGHS does not converge.
    """
    from scipy.optimize import linprog  # slow to load, and never needed while all goes well

    (A, b), (G, h) = equalities or (None, None), inequalities or (None, None)
    for presolve in (
        True,
        False,
    ):  # presolve may stop at "infeasible or unbounded"; the simplex method then decides
        result = linprog(
            cost, G, h, A, b, bounds, method="highs-ds", options={"presolve": presolve}
        )
        if result.status in (OPTIMAL, INFEASIBLE, UNBOUNDED):
            return result
    raise SolverError(
        f"HiGHS did not converge on a linear program of {cost.size} variables: {result.message}"
    )
