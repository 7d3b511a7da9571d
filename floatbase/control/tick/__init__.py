"""The compiled tick: the quadratic program of (26)(27) solved by numba over plain arrays."""

from floatbase.control.tick.compiled import Compiled, announce_if_slow, cache_warning, obstacle
from floatbase.control.tick.own import Given

__all__ = ["Compiled", "Given", "announce_if_slow", "cache_warning", "obstacle"]
