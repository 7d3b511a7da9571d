"""Memory of the tick, which allocates nothing: arrays are carved out of a workspace.

workspace: one array of real numbers or of integers; its first entry counts how many are in use.
"""

from __future__ import annotations

import numpy as np

from floatbase.control.tick.jit import jit, jit_inline


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
    return take_vector(workspace, rows * columns).reshape(rows, columns)


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
    return read_vector(table, counter, rows * columns).reshape(rows, columns)


@jit
def clear(array):
    """Set all entries of a C-contiguous array to zero."""
    flat = array.reshape(array.size)
    for i in range(flat.size):
        flat[i] = 0.0


@jit
def all_finite(vector):
    """Return whether all entries of a vector (n,) are finite."""
    for i in range(vector.size):
        if not np.isfinite(vector[i]):
            return False
    return True


@jit
def largest(vector):
    """Return the largest absolute value in a vector (n,)."""
    size = 0.0
    for i in range(vector.size):
        size = max(size, abs(vector[i]))
    return size
