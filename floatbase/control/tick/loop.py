"""Ticks of many states in one compiled loop, so that a thread needs Python's lock once for all."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from numba import types

from floatbase.control.tick.jit import jit


def run_ticks(
    tick, Q, V, starts, stops, results, codes, inputs, sizes, int_tables, float_tables,
    float_workspace, int_workspace, result, stages,
):  # fmt: skip
    """Run one tick for each row of Q and V, and store its (q̈, τ, λ) and its code.

    tick: the compiled function, to which the other arguments go. starts, stops: the entries of
    each row in `inputs`. results, codes: one row and one number for each state, which are written.
    """
    for i in range(Q.shape[0]):
        codes[i] = tick(
            Q[i], V[i], inputs[starts[i] : stops[i]], sizes, int_tables, float_tables,
            float_workspace, int_workspace, result, stages,
        )  # fmt: skip
        for j in range(results.shape[1]):
            results[i, j] = result[j]


@lru_cache
def compiled_loop(tick: Any) -> Any:
    """Compile `run_ticks` for a compiled tick.

    The loop calls the tick through its address, so the tick is not compiled again, and the answers
    are those of single ticks to the bit. Compiling the loop takes some tenths of a second.
    """
    arguments = tick.nopython_signatures[0].args
    matrix, integers = types.float64[:, ::1], types.int64[::1]
    function = types.FunctionType(tick.nopython_signatures[0])
    loop = types.void(
        function, matrix, matrix, integers, integers, matrix, integers, *arguments[2:]
    )
    return jit(loop, nogil=True)(run_ticks)
