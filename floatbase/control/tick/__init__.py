"""The compiled controller: the QP (26)(27) solved by numba over plain arrays."""

from floatbase.control.tick.compiled import (
    CompiledTick,
    announce_if_slow,
    cache_warning,
    compiling_ahead,
    unsupported_reason,
)
from floatbase.control.tick.targets import TargetLayout

__all__ = [
    "CompiledTick", "TargetLayout", "announce_if_slow", "cache_warning", "compiling_ahead",
    "unsupported_reason",
]  # fmt: skip
