"""Quadratic programs: labelled constraints, optimality, solvers and conflicting constraints.

[FBR]_, §4 and App. C.
"""

from floatbase.errors import explain_arguments
from floatbase.qp.active_set import ActiveSetRun, Iteration, active_set
from floatbase.qp.conflicts import FEASIBILITY_TOLERANCE, conflicting_constraints
from floatbase.qp.labels import ConstraintLabel
from floatbase.qp.problem import QP
from floatbase.qp.solution import Residuals, Solution
from floatbase.qp.solve import check_solver, solve, solvers

__all__ = [
    "FEASIBILITY_TOLERANCE", "QP", "ActiveSetRun",
    "ConstraintLabel", "Iteration",
    "Residuals", "Solution", "active_set", "check_solver", "conflicting_constraints",
    "solve", "solvers",
]  # fmt: skip

explain_arguments(globals())
