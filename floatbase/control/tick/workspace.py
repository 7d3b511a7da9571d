"""Memory of the tick, which allocates nothing: arrays are carved out of a workspace.

workspace: one array of real numbers or of integers; its first entry counts how many are in use.
"""

from __future__ import annotations

from typing import Any

from numba import types
from numba.core.cgutils import create_struct_proxy
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array

from floatbase.control.tick.jit import jit, jit_inline


def _as_matrix(_, array, rows, columns):
    """Return the numbers of a C-contiguous array as a matrix (rows, columns).

    `reshape` calls a function of numba for this, and takes a twentieth of a tick.
    """
    matrix = types.Array(array.dtype, 2, "C")

    def build(context, builder, _, arguments):
        source = create_struct_proxy(array)(context, builder, arguments[0])
        result = create_struct_proxy(matrix)(context, builder)
        populate_array(
            result, source.data, shape=arguments[1:], itemsize=source.itemsize, meminfo=None,
            strides=(builder.mul(arguments[2], source.itemsize), source.itemsize),
        )  # fmt: skip
        return result._getvalue()

    return matrix(array, types.intp, types.intp), build


as_matrix: Any = intrinsic(_as_matrix)


@jit_inline
def take_vector(workspace, n):
    """Return the next n unused numbers of a workspace, uninitialized.

    Raises `MemoryError` if there are fewer.
    """
    first = int(workspace[0])
    last = first + n
    if last > workspace.size:
        raise MemoryError("The workspace of the compiled controller is too small.")
    workspace[0] = last
    return workspace[first:last]


@jit_inline
def take_matrix(workspace, rows, columns):
    """Return the next unused numbers of a workspace as an uninitialized array (rows, columns)."""
    return as_matrix(take_vector(workspace, rows * columns), rows, columns)


@jit_inline
def read_vector(table, counter, n):
    """Return the next n numbers of a table; counter: (1,), how many were read before.

    Unlike a workspace, a table is only read, so that several threads may share it.
    """
    first = counter[0]
    counter[0] = first + n
    return table[first : counter[0]]


@jit_inline
def read_matrix(table, counter, rows, columns):
    """Return the next numbers of a table as an array (rows, columns)."""
    return as_matrix(read_vector(table, counter, rows * columns), rows, columns)


@jit
def clear(array):
    """Set all entries of a C-contiguous array to zero."""
    flat = as_matrix(array, 1, array.size)
    for i in range(array.size):
        flat[0, i] = 0.0


@jit
def all_finite(vector):
    """Return whether all entries of a vector (n,) are finite."""
    total = 0.0  # and NaN as soon as 0 is multiplied by NaN or infinity
    for i in range(vector.size):
        total += 0.0 * vector[i]
    return total == 0.0


@jit
def largest(vector):
    """Return the largest absolute value in a vector (n,)."""
    size = 0.0
    for i in range(vector.size):
        size = max(size, abs(vector[i]))
    return size
