"""The compiled tick: the quadratic program of (26)(27) solved by numba over plain arrays."""

from floatbase.control.tick.compiled import Compiled, announce_if_slow, cache_warning, obstacle

__all__ = ["Compiled", "announce_if_slow", "cache_warning", "obstacle"]
