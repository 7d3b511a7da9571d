"""The compiled path of `WholeBodyController`: whether the kernel can be had, and the tick by it.

`kernel_obstacle` says in words why nothing can be compiled. `kernel.py` is loaded when it is needed: numba takes a while.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pickle import UnpicklingError
from threading import Timer
from typing import Any

import numpy as np

from floatbase._arrays import Array
from floatbase.control.tick.tables import Answer, Dynamics, Program


@contextmanager
def told_when_slow(text: str, after: float = 6.0) -> Iterator[None]:
    """Say on the error stream why it takes so long when the work inside takes more than `after` s."""
    timer = Timer(after, lambda: print(text, file=sys.stderr, flush=True))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def kernel_obstacle() -> str:
    """Why the kernel cannot be had at all: numba is not there, or does not fit the packages beside it."""
    if find_spec("numba") is None:
        return "numba is not installed (pip install numba)"
    try:
        import floatbase.control.tick.kernel  # noqa: F401
    except (ImportError, OSError, AttributeError) as error:
        return f"numba is installed and cannot be loaded ({error})"
    return ""


def unkept() -> str:
    """What to do where nothing that is compiled can be kept, or ""."""
    from floatbase.control.tick import kernel

    if kernel.kept:
        return ""
    return "what is compiled cannot be kept here: set NUMBA_CACHE_DIR to a folder that can be written to"


class Compiled(Program):
    """The tick by the kernel."""

    path = "compiled"

    def _prepare(self, contact_tables: tuple[Any, ...], task_tables: tuple[Any, ...], bounds: tuple[Array, float]) -> None:
        from floatbase.control.tick import kernel

        self.kernel, self.parts = kernel.tick, kernel.PARTS
        tables = packed(self.dynamics, contact_tables, task_tables, bounds)
        real, whole = kernel.room_sizes(tables[0], self.motion_rows)
        room = np.empty(real), np.empty(whole, np.int64)  # of one tick at a time: the dynamics' lock sees to it
        self.arrays = *self.dynamics.views, *tables, *room

    def warm_up(self) -> None:
        try:
            super().warm_up()
        except (EOFError, UnpicklingError):  # the file that numba kept ends too early
            from floatbase.control.tick import kernel

            kernel.compile_anew()
            super().warm_up()

    def _answer(self, q: Array, v: Array, targets: Array) -> Answer | None:
        dynamics, answer = self.dynamics, np.empty(self.size + 2 * self.entries)
        with dynamics.lock:
            dynamics.update(q, v)
            held = self.kernel(q, v, targets, *self.arrays, answer, self.parts)
        return (answer, held) if held >= 0 else None


def packed(
    dynamics: Dynamics, contact_tables: tuple[Any, ...], task_tables: tuple[Any, ...], bounds: tuple[Array, float]
) -> tuple[Any, Any, Array]:
    """sizes, indices, numbers: all tables in three arrays, as `kernel.unpacked` takes them apart."""
    contacts, frames, points, cones, lengths = contact_tables
    tasks, gains, poses = task_tables
    sizes = (len(dynamics.tree), len(contacts), len(points), cones.shape[1], len(tasks), len(bounds[0]))
    indices = np.concatenate([np.ravel(table) for table in (dynamics.tree, contacts, tasks)])
    real = (dynamics.links, frames, points, cones, lengths, gains, poses, *bounds)
    return np.array(sizes, np.int64), indices, np.concatenate([np.ravel(table) for table in real])
