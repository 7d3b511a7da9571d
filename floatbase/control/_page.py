"""What a web page needs to know of the control step: its problem as arrays."""

from floatbase.control.limits import force_rows
from floatbase.control.tick.problem_arrays import pack_problem

__all__ = ["force_rows", "pack_problem"]
