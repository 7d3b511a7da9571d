"""The compiled tick: the quadratic program of (26)(27) solved by numba over plain arrays."""

from typing import TYPE_CHECKING

from floatbase.control.tick.compiled import Compiled, announce_if_slow, cache_warning, obstacle

if TYPE_CHECKING:  # they load numba
    from floatbase.control.tick import jit, tick

__all__ = ["Compiled", "announce_if_slow", "cache_warning", "jit", "obstacle", "tick"]
