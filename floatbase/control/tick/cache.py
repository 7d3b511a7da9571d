"""numba's cache on disk for the tick: whatever is wrong there, the tick is compiled, and a controller can be made."""

from __future__ import annotations

import pickle
from hashlib import sha256
from typing import Any

from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.serialize import dumps

trouble = ""  # why what is compiled cannot be kept, in words


def cannot_keep(error: Exception) -> None:
    """Remember why what is compiled cannot be kept."""
    global trouble
    # numba's word for folders that cannot be written to is a RuntimeError
    trouble = "no folder can be written to" if isinstance(error, RuntimeError) else f"{type(error).__name__}: {error}"


class _Sealed(CompileResultCacheImpl):
    """What numba keeps, with a checksum: machine code with a wrong byte would end the process, or answer wrongly."""

    def reduce(self, compiled: Any) -> tuple[bytes, bytes]:
        code = dumps(super().reduce(compiled))
        return sha256(code).digest(), code

    def rebuild(self, context: Any, kept: tuple[bytes, bytes]) -> Any:
        checksum, code = kept
        if sha256(code).digest() != checksum:
            raise ValueError("the compiled code on disk is damaged")
        return super().rebuild(context, pickle.loads(code))


class Cache(FunctionCache):
    """numba's cache of one function."""

    _impl_class = _Sealed

    def load_overload(self, signature: Any, context: Any) -> Any:
        """What is kept for a signature, or None, at which numba compiles: files that are damaged count as missing."""
        try:
            return super().load_overload(signature, context)
        except Exception:  # a damaged pickle may raise anything
            return None

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Keep what was compiled, in place of damaged files. Where that fails, as on a full disk, `trouble` says why."""
        try:
            try:
                super().save_overload(signature, compiled)
            except Exception:  # the list of what is kept may be damaged: start it over
                self.flush()
                super().save_overload(signature, compiled)
        except Exception as error:
            cannot_keep(error)
