"""Vectors in space as tuples of three numbers, which need no memory.

A rotation is the tuple of its three columns.
"""

from __future__ import annotations

from floatbase.control.tick.jit import jit


@jit
def row_part(array, i, first):
    """Return three numbers of row i of an array (n, m), from column `first` on."""
    return array[i, first], array[i, first + 1], array[i, first + 2]


@jit
def write_row(array, i, first, a):
    """Write a into row i of an array (n, m), from column `first` on."""
    array[i, first], array[i, first + 1], array[i, first + 2] = a


@jit
def column_part(array, first, c):
    """Return three numbers of column c of an array (n, m), from row `first` on."""
    return array[first, c], array[first + 1, c], array[first + 2, c]


@jit
def plus(a, b):
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@jit
def minus(a, b):
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@jit
def times(s, a):
    """Return s a."""
    return s * a[0], s * a[1], s * a[2]


@jit
def dot(a, b):
    """Return aᵀ b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@jit
def cross(a, b):
    """Return a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@jit
def across(n, x):
    """Return x - n (n · x), the part of x across a unit vector n."""
    return minus(x, times(dot(n, x), n))


@jit
def rotate(R, a):
    """Return R a."""
    return plus(plus(times(a[0], R[0]), times(a[1], R[1])), times(a[2], R[2]))


@jit
def transpose(R):
    """Return the rows of R as columns."""
    x, y, z = R
    return (x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2])


@jit
def rotation_in(poses, i):
    """Return the rotation of pose i.

    poses: (n, 12 or more), the rotation column by column, then the position.
    """
    return row_part(poses, i, 0), row_part(poses, i, 3), row_part(poses, i, 6)
