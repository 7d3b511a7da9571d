"""The one entry, above the back ends: `solve` returns the `Solution` of a `QP` or raises the error that says why not."""

from __future__ import annotations

from floatbase.errors import InfeasibleError, InputError, SolverError, unknown_name
from floatbase.qp.backends import ALWAYS, OPTIONAL, installed
from floatbase.qp.conflicts import conflicting_rows, infeasible
from floatbase.qp.problem import FEASIBILITY_TOLERANCE, QP
from floatbase.qp.solution import Solution


def solve(qp: QP, solver: str = "daqp") -> Solution:
    """Solve a QP.

    solver: one of `solvers()`. "daqp" is what controllers use; "cvxpy" (Clarabel at tight tolerances) is the judge,
    slow and independent; "active_set" is the method of `active_set.py`, written to be read; "proxsuite" (ProxQP) needs
    that package. Raises `InfeasibleError` with a smallest set of conflicting rows, `SolverError` when the objective has
    no minimum or the solver did not converge, `UnknownNameError` for a solver that does not exist, `InputError` for one
    that is not installed.
    """
    check_solver(solver)
    found = installed()[solver](qp)
    if found is None:
        raise _no_point(qp)
    return found


def solvers() -> tuple[str, ...]:
    """Names that `solve` takes here; "proxsuite" is among them where that package is installed."""
    return tuple(installed())


def check_solver(solver: str) -> None:
    """Raises for a solver that `solve` does not take: `UnknownNameError`, or `InputError` saying what to install."""
    if solver in OPTIONAL and solver not in solvers():
        raise InputError(
            f"solver {solver!r} needs a package that is not installed: pip install {solver}. "
            f"Here without it: {', '.join(solvers())}."
        )
    if solver not in solvers():
        raise unknown_name("solver", solver, [*ALWAYS, *OPTIONAL])


def _no_point(qp: QP) -> InfeasibleError | SolverError:
    """The error for a problem in which a solver found no feasible point, naming the rows in conflict."""
    size = qp.row_lengths
    rows = conflicting_rows(qp.reduced.G / size[:, None], qp.reduced.h / size)
    if rows:
        return infeasible(qp.inequality_names[i] for i in rows)
    return SolverError(
        f"the solver found no point that satisfies all rows of {qp!r}, but a linear program found one: the rows only "
        f"just meet. Loosen them by more than {FEASIBILITY_TOLERANCE:g}."
    )
