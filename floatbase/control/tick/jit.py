"""How the tick is compiled: numba's options, and one cached entry point for this folder.

numba caches a compiled function on disk and recompiles it when its own file changes, but not when
the file of a function that it calls changes. So only one function is cached, the entry point
`tick`. The closure of `tick` contains a digest of this folder, which is part of numba's cache key.
An edit in any file therefore triggers recompilation.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache, InTreeCacheLocator

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

from floatbase.control.problem import INCONSISTENCY_TOLERANCE
from floatbase.dynamics import CONSTRAINT_NOISE, CONSTRAINT_RANK_TOLERANCE
from floatbase.qp import FEASIBILITY_TOLERANCE
from floatbase.robots import UNIT_NORM_TOLERANCE

# Without numba's runtime, which counts references to every array that is made, sliced or passed
# on. That took a quarter of the tick. Such functions can neither create nor return arrays.
_OPTIONS: dict[str, Any] = {
    "error_model": "numpy",
    "fastmath": {"contract", "reassoc", "nsz", "arcp"},
    "_nrt": False,
}

jit: Callable[..., Any] = partial(numba.njit, **_OPTIONS)
# becomes part of its caller, so it may return arrays
jit_inline: Callable[..., Any] = partial(numba.njit, inline="always", **_OPTIONS)
# small and called often
jit_forceinline: Callable[..., Any] = partial(numba.njit, forceinline=True, **_OPTIONS)
jit_allocating: Callable[..., Any] = partial(numba.njit, **_OPTIONS | {"_nrt": True})

_LOCK_FILE = "compiling.lock"  # beside the compiled code
_compiles_ahead = False  # whether this process holds the lock alone
waiting = False  # whether this process waits for another one that compiles ahead

jit_enabled = hasattr(jit(lambda: None), "py_func")  # False if NUMBA_DISABLE_JIT is set
cache_error = ""  # why compiled code cannot be kept on disk


def source_digest(folder: Path = Path(__file__).parent) -> int:
    """Return a digest of this folder's text and of the imported constants that are compiled in."""
    text = repr(
        (
            INCONSISTENCY_TOLERANCE,
            CONSTRAINT_RANK_TOLERANCE,
            CONSTRAINT_NOISE,
            FEASIBILITY_TOLERANCE,
            UNIT_NORM_TOLERANCE,
        )
    ).encode()
    for file in sorted(folder.glob("*.py")):
        text += file.name.encode() + file.read_bytes()
    return int.from_bytes(sha256(text).digest()[:7], "big")


def jit_cached(make: Callable[[int], Callable[..., Any]]) -> Any:
    """Compile make(source_digest()), cached on disk if possible.

    The function that `make` returns must use its digest. Code that was compiled beside the source
    is loaded even if no folder is writable.
    """
    global cache_error
    function = make(source_digest())
    try:
        cached = jit(cache=True)(function)
    except RuntimeError:  # numba finds no folder that it can write to
        cached = jit(function)
        if any(_installed_code(Path(function.__code__.co_filename))):
            cached._cache = _InstalledCache(function)
        else:
            cache_error = "no folder is writable"
        return cached
    if jit_enabled:
        with suppress(OSError):  # a full disk: numba compiles again
            _copy_installed_code(Path(function.__code__.co_filename), Path(cached.stats.cache_path))
    return cached


@contextmanager
def compile_lock(function: Any, *, ahead: bool = False) -> Iterator[None]:
    """Let `floatbase compile` (`ahead`) work alone; other processes wait, then load its code."""
    global _compiles_ahead, waiting
    folder = getattr(getattr(function, "stats", None), "cache_path", None)
    if fcntl is None or folder is None or _compiles_ahead:
        yield
        return
    with ExitStack() as stack:
        with suppress(OSError):  # without a lock, both compile
            os.makedirs(folder, exist_ok=True)
            file = stack.enter_context(open(Path(folder) / _LOCK_FILE, "a"))
            waiting = True
            fcntl.flock(file, fcntl.LOCK_EX if ahead else fcntl.LOCK_SH)
        waiting, _compiles_ahead = False, ahead
        try:
            yield
        finally:
            _compiles_ahead = False


def _copy_installed_code(source: Path, cache: Path) -> None:
    """Copy code compiled beside the source into the cache of a user who cannot write there."""
    cache.mkdir(parents=True, exist_ok=True)
    # data files sort before the index that lists them
    for file in sorted(_installed_code(source)):
        copy = cache / file.name
        if not copy.exists() or copy.stat().st_mtime < file.stat().st_mtime:
            partial_copy = shutil.copy2(file, cache / f"{file.name}.tmp{os.getpid()}")
            os.replace(partial_copy, copy)


def _installed_code(source: Path) -> Iterator[Path]:
    """Return the files compiled beside the source."""
    return (source.parent / "__pycache__").glob(f"{source.stem}.*.nb[ci]")


class _InstalledLocator(InTreeCacheLocator):
    """Place of the code beside the source, which need not be writable."""

    def ensure_cache_path(self) -> None:
        """Accept any folder; numba would refuse one that it cannot write to."""


class _InstalledImpl(CompileResultCacheImpl):
    _locator_classes = [_InstalledLocator]  # noqa: RUF012  a list in numba, too


class _InstalledCache(FunctionCache):
    """numba's cache for code beside a read-only source."""

    _impl_class = _InstalledImpl


def without_cache(function: Any) -> Any:
    """Compile in memory a function whose compiled code could not be loaded or kept."""
    return function if function.signatures else jit(function.py_func)
