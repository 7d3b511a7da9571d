"""Quadratic programs: named rows, optimality, back ends, and rows in conflict (§4, App. C of the document)."""

from floatbase.qp.active_set import (
    ActiveSetRun,
    Iteration,
    active_set,
    aim,
    feasible_start,
    independent_rows,
    longest_step,
    multipliers,
    row_to_drop,
    starting_point,
    table_top,
)
from floatbase.qp.conflicts import conflicting_rows, contradicting_equalities, contradiction
from floatbase.qp.linear_programs import INFEASIBLE, UNBOUNDED, linear_program
from floatbase.qp.problem import (
    FEASIBILITY_TOLERANCE,
    QP,
    Residuals,
    Solution,
    check_solver,
    finished,
    not_convex,
    solve,
    solvers,
    unbounded,
)

__all__ = [
    "FEASIBILITY_TOLERANCE",
    "INFEASIBLE",
    "QP",
    "UNBOUNDED",
    "ActiveSetRun",
    "Iteration",
    "Residuals",
    "Solution",
    "active_set",
    "aim",
    "check_solver",
    "conflicting_rows",
    "contradicting_equalities",
    "contradiction",
    "feasible_start",
    "finished",
    "independent_rows",
    "linear_program",
    "longest_step",
    "multipliers",
    "not_convex",
    "row_to_drop",
    "solve",
    "solvers",
    "starting_point",
    "table_top",
    "unbounded",
]
