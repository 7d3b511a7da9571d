"""Keep numpy's matrix products on one thread, since small ones are slower on several."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec

from floatbase._locks import InterruptibleLock

# names of the same function in numpy's wheels and in OpenBLAS as packaged elsewhere
_SET_THREADS = (
    "scipy_openblas_set_num_threads64_", "openblas_set_num_threads64_", "openblas_set_num_threads",
)  # fmt: skip
_LINALG = find_spec("numpy.linalg._umath_linalg")
# finds the functions of its BLAS, too
LIBRARY = ctypes.CDLL(_LINALG.origin if _LINALG else None)
SETTER = next((name for name in _SET_THREADS if hasattr(LIBRARY, name)), None)
_lock = InterruptibleLock()
_inside, _outside = 0, 1  # threads that are in `one_blas_thread`; the number of before


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Use one thread for matrix products of numpy, if it uses OpenBLAS; then as many as before.

    The number belongs to the process. The first thread that enters stores it, and the last one that
    leaves restores it.
    """
    global _inside, _outside
    if SETTER is None:
        yield
        return
    set_threads = getattr(LIBRARY, SETTER)
    with _lock:
        if _inside == 0:
            _outside = getattr(LIBRARY, SETTER.replace("set", "get"))()
            set_threads(1)
        _inside += 1
    try:
        yield
    finally:
        with _lock:
            _inside = max(_inside - 1, 0)
            if _inside == 0:
                set_threads(_outside)


def _after_fork() -> None:
    """In a forked process, forget the other threads, which do not exist there."""
    global _inside
    if _inside and SETTER is not None:
        getattr(LIBRARY, SETTER)(_outside)
    _inside = 0
    _lock.release()


if hasattr(os, "register_at_fork"):  # no thread may hold the lock while the process is forked
    os.register_at_fork(
        before=_lock.acquire, after_in_parent=_lock.release, after_in_child=_after_fork
    )
