"""How the tick is compiled: numba's options, and one cached entry point for all files of this
folder.

numba caches a compiled function on disk and compiles it anew when its own file changes, but not
when the file of a function that it calls does. So one function alone is cached, the entry point
`tick`. It carries a digest of this folder in its closure, which is part of numba's cache key: an
edit in any file compiles anew. Whatever is wrong with the cache, the tick is compiled. What was
compiled beside the source is loaded also by those who may not write there, such as the students of
one installation.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache, InTreeCacheLocator
from numba.core.serialize import dumps

from floatbase.control.problem import INCONSISTENCY_TOLERANCE
from floatbase.dynamics import CONSTRAINT_NOISE, CONSTRAINT_RANK_TOLERANCE
from floatbase.qp import FEASIBILITY_TOLERANCE
from floatbase.robots import UNIT_NORM_TOLERANCE

# Without numba's run time, which counts references to every array that is made, sliced or passed
# on: that took a quarter of the tick. What is compiled so can neither make an array nor return one.
_OPTIONS: dict[str, Any] = {
    "error_model": "numpy",
    "fastmath": {"contract", "reassoc", "nsz", "arcp"},
    "_nrt": False,
}

jit: Callable[..., Any] = partial(numba.njit, **_OPTIONS)
jit_inline: Callable[..., Any] = partial(
    numba.njit, inline="always", **_OPTIONS
)  # part of its caller, so it may return arrays
jit_forceinline: Callable[..., Any] = partial(
    numba.njit, forceinline=True, **_OPTIONS
)  # small and called often
jit_allocating: Callable[..., Any] = partial(numba.njit, **_OPTIONS | {"_nrt": True})

jit_enabled = hasattr(
    jit(lambda: None), "py_func"
)  # False where numba was told to leave functions as they are: NUMBA_DISABLE_JIT
cache_error = ""  # why what is compiled cannot be kept on disk, in words


def source_digest(folder: Path = Path(__file__).parent) -> int:
    """A number for the text of this folder and for the constants of other packages that numba
    compiles in.
    """
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


def record_cache_error(error: Exception) -> None:
    """Remember why what is compiled cannot be kept."""
    global cache_error
    # numba's word for folders that cannot be written to is a RuntimeError
    cache_error = (
        "no folder can be written to"
        if isinstance(error, RuntimeError)
        else f"{type(error).__name__}: {error}"
    )


class _ChecksummedCacheImpl(CompileResultCacheImpl):
    """What numba keeps, with a checksum: machine code with a wrong byte would end the process, or
    answer wrongly.
    """

    def reduce(self, compiled: Any) -> tuple[bytes, bytes]:
        code = dumps(super().reduce(compiled))
        return sha256(code).digest(), code

    def rebuild(self, context: Any, stored: tuple[bytes, bytes]) -> Any:
        checksum, code = stored
        if sha256(code).digest() != checksum:
            raise ValueError("the compiled code on disk is damaged")
        return super().rebuild(context, pickle.loads(code))


class _PackageFolderLocator(InTreeCacheLocator):
    """The folder beside the source, to read from: numba itself takes only folders that it may write
    to.
    """

    def ensure_cache_path(self) -> None:
        pass


class _PackageCacheImpl(_ChecksummedCacheImpl):
    _locator_classes: Any = (_PackageFolderLocator,)


class PackageCache(FunctionCache):
    """What is kept beside the source of one function, only to read. error: why nothing else can be
    kept.
    """

    _impl_class: Any = _PackageCacheImpl

    def __init__(self, function: Callable[..., Any], error: Exception | None = None):
        super().__init__(function)
        self._error = error

    def load_overload(self, signature: Any, context: Any) -> Any:
        """What is kept for a signature, or None, at which numba compiles: files that are damaged
        count as missing.
        """
        try:
            return super().load_overload(signature, context)
        except Exception:  # a damaged pickle may raise anything
            return None

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Keep nothing, and remember why."""
        if self._error is not None:
            record_cache_error(self._error)


class WritableCache(PackageCache):
    """numba's cache of one function, and where that holds nothing, what is kept beside the source."""

    _impl_class = _ChecksummedCacheImpl

    def __init__(self, function: Callable[..., Any]):
        super().__init__(function)
        self._package_cache = PackageCache(function)

    def load_overload(self, signature: Any, context: Any) -> Any:
        """As for `PackageCache`."""
        found = super().load_overload(signature, context)
        return self._package_cache.load_overload(signature, context) if found is None else found

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Keep what was compiled, in place of damaged files. Where that fails, as on a full disk,
        `cache_error` says why.
        """
        try:
            try:
                FunctionCache.save_overload(self, signature, compiled)
            except Exception:  # the list of what is kept may be damaged: start it over
                self.flush()
                FunctionCache.save_overload(self, signature, compiled)
        except Exception as error:
            record_cache_error(error)


def jit_cached(make: Callable[[int], Callable[..., Any]]) -> Any:
    """Compile make(source_digest()), cached on disk where that is possible. The function made must
    use its digest.
    """
    function = jit(make(source_digest()))
    if jit_enabled:
        try:
            function._cache = WritableCache(function.py_func)
        except Exception as error:  # a RuntimeError where numba finds no folder for its cache
            function._cache = PackageCache(function.py_func, error)
    return function
