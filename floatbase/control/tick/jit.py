"""How the tick is compiled: numba's options, and one cached entry point for all files of this folder.

numba caches a compiled function on disk and compiles it anew when its own file changes, but not when the file of a function
that it calls does. So one function alone is cached, the entry point `tick`. It carries a digest of this folder in its closure,
which is part of numba's cache key: an edit in any file compiles anew.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

import numba

from floatbase.control.problem import INCONSISTENT
from floatbase.control.tick.cache import Cache, cannot_keep
from floatbase.dynamics import MOTION_NOISE, MOTION_TOLERANCE
from floatbase.qp import FEASIBILITY_TOLERANCE
from floatbase.robots import UNIT_LENGTH_TOLERANCE

# Without numba's run time, which counts references to every array that is made, sliced or passed on: that took a quarter of the
# tick. What is compiled so can neither make an array nor return one.
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract", "reassoc", "nsz", "arcp"}, "_nrt": False}

jit: Callable[..., Any] = partial(numba.njit, **_OPTIONS)
jit_inline: Callable[..., Any] = partial(numba.njit, inline="always", **_OPTIONS)  # part of its caller, so it may return arrays
jit_forced: Callable[..., Any] = partial(numba.njit, forceinline=True, **_OPTIONS)  # small and called often
jit_allocating: Callable[..., Any] = partial(numba.njit, **_OPTIONS | {"_nrt": True})

compiles = hasattr(jit(lambda: None), "py_func")  # False where numba was told to leave functions as they are: NUMBA_DISABLE_JIT


def digest(folder: Path = Path(__file__).parent) -> int:
    """A number for the text of this folder and for the constants of other rooms that numba compiles in."""
    text = repr((INCONSISTENT, MOTION_TOLERANCE, MOTION_NOISE, FEASIBILITY_TOLERANCE, UNIT_LENGTH_TOLERANCE)).encode()
    for file in sorted(folder.glob("*.py")):
        text += file.name.encode() + file.read_bytes()
    return int.from_bytes(sha256(text).digest()[:7], "big")


def jit_cached(make: Callable[[int], Callable[..., Any]]) -> Any:
    """Compile make(digest()), cached on disk where that is possible. The function made must use its digest."""
    function = jit(make(digest()))
    if compiles:
        try:
            function._cache = Cache(function.py_func)
        except Exception as error:  # a RuntimeError where numba finds no folder for its cache
            cannot_keep(error)
    return function
