"""How the tick is compiled: numba's options, and one cached entry point for this folder.

numba caches a compiled function on disk and recompiles it when its own file changes, but not when
the file of a function that it calls changes. So only one function is cached, the entry point
`tick`. The closure of `tick` contains a digest of this folder, which is part of numba's cache key.
An edit in any file therefore triggers recompilation.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

import numba
from numba.core import caching

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

from floatbase import _geometry
from floatbase.control.problem import INCONSISTENCY_TOLERANCE
from floatbase.dynamics import CONSTRAINT_NOISE, CONSTRAINT_RANK_TOLERANCE
from floatbase.dynamics._compiled import MIN_TILT
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

COMPILED = Path(__file__).parents[2] / "_compiled"  # what a wheel brings (.ci/compile_for_wheel)
_LOCK_FILE = "compiling.lock"  # beside the compiled code
_compiles_ahead = False  # whether this process holds the lock alone
waiting = False  # whether this process waits for another one that compiles ahead

jit_enabled = hasattr(jit(lambda: None), "py_func")  # False if NUMBA_DISABLE_JIT is set
cache_error = ""  # why compiled code cannot be kept on disk


def source_digest(folder: Path = Path(__file__).parent) -> int:
    """Return a digest of this folder's text, and of all that is imported and compiled in."""
    text = f"{INCONSISTENCY_TOLERANCE} {CONSTRAINT_RANK_TOLERANCE} {CONSTRAINT_NOISE}"
    text += f" {FEASIBILITY_TOLERANCE} {MIN_TILT} {UNIT_NORM_TOLERANCE}"
    for file in (Path(_geometry.__file__), *sorted(folder.glob("*.py"))):
        text += file.name + file.read_text(encoding="utf-8")
    return int.from_bytes(sha256(text.encode()).digest()[:7], "big")


def jit_cached(make: Callable[[int], Callable[..., Any]], **options: bool) -> Any:
    """Compile make(source_digest()) with more options of numba, cached on disk if possible.

    The function that `make` returns must use its digest. Code that was compiled beside the source
    is loaded even if no folder is writable.
    """
    global cache_error
    function = make(source_digest())
    compiled = jit(function, **options)
    if jit_enabled:
        try:
            compiled._cache = _Cache(function)
        except RuntimeError:  # numba finds no folder that it can write to
            if any(next(folder.glob("*.nbi"), None) for folder in _installed_code(function)):
                compiled._cache = _ReadOnlyCache(function)
            else:
                cache_error = "no folder is writable"
    return compiled


def _installed_code(function: Callable[..., Any]) -> Iterator[Path]:
    """Return the folders of code that was compiled with the installation."""
    yield Path(function.__code__.co_filename).parent / "__pycache__"
    yield from COMPILED.glob("*")


class _Cache(caching.FunctionCache):
    """numba's cache, which also finds code that was compiled with the installation.

    This code is beside the source in a container, and in `COMPILED` in a wheel. Code for the
    generic processor runs on every processor of its architecture.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Load code for these types, or return None."""
        found = super().load_overload(sig, target_context)
        if found is not None:
            return found
        own_key = self._index_key(sig, target_context.codegen())
        _, (platform, *_), code = own_key
        name, stamp = self._impl.filename_base, self._impl.locator.get_source_stamp()
        for folder in _installed_code(self._py_func):
            files = caching.IndexDataCacheFile(str(folder), name, stamp)
            for key in (own_key, (sig, (platform, "generic", ""), code)):
                data = files.load(key)
                if data is not None:
                    return self._impl.rebuild(target_context, data)
        return None


# the name before numba 0.62 has an underscore
_LOCATOR_NAME = next(name for name in dir(caching) if name.lstrip("_") == "InTreeCacheLocator")


class _ReadOnlyLocator(getattr(caching, _LOCATOR_NAME)):  # type: ignore[misc]
    """Place of the code beside the source, which need not be writable."""

    def ensure_cache_path(self) -> None:
        """Accept any folder; numba would refuse one that it cannot write to."""


class _ReadOnlyCache(_Cache):
    """The same cache if no folder is writable."""

    class _impl_class(caching.CompileResultCacheImpl):
        _locator_classes = [_ReadOnlyLocator]  # noqa: RUF012  a list in numba, too


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
            try:
                waiting = True
                fcntl.flock(file, fcntl.LOCK_EX if ahead else fcntl.LOCK_SH)
            finally:  # also if the user interrupts
                waiting = False
        try:
            _compiles_ahead = ahead
            yield
        finally:
            _compiles_ahead = False


def without_cache(function: Any) -> Any:
    """Compile in memory a function whose compiled code could not be loaded or kept."""
    return function if function.signatures else jit(function.py_func, nogil=True)
