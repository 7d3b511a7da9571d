"""The compiled tick: the quadratic program of (26)(27) solved by numba over plain arrays."""

from floatbase.control.tick.compiled import Compiled, kernel_obstacle, told_when_slow, unkept
from floatbase.control.tick.tables import Program, obstacle

__all__ = [
    "Compiled",
    "Program",
    "kernel_obstacle",
    "obstacle",
    "told_when_slow",
    "unkept",
]
