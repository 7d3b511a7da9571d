"""Gauss-Jordan elimination: q̈, λ and τ as functions of the free entries β, eqs. (13), (16), (17).

The reference backend uses an SVD for the space of motions (13). Here variables are eliminated one
by one, and each β is an entry of (q̈, λ) that the elimination left free. Shapes: m motion rows, nv,
d, k as everywhere, n = nv + k entries of (q̈, λ), nb of β.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from floatbase.control.problem import INCONSISTENCY_TOLERANCE
from floatbase.control.tick.jit import jit, jit_allocating, jit_forceinline
from floatbase.control.tick.workspace import clear, take_vector
from floatbase.dynamics import CONSTRAINT_NOISE, CONSTRAINT_RANK_TOLERANCE

# a motion row with a smaller fraction left may nearly depend on the others: an SVD must decide
DEPENDENT_ROW = 2e-2
ZERO_ROW = 1e-11  # less than this fraction of a row is rounding
ZERO_PIVOT = 1e-14  # relative to the row: below this, no variable is left to solve for


class Parametrisation(NamedTuple):
    """All (q̈, λ, τ) that satisfy the equalities, as functions of β."""

    V: Any  # (n, nb + 1), (q̈, λ) = V (β, 1)
    beta_index: Any  # (n,), which β an entry of (q̈, λ) is, -1 if it is none
    T: Any  # (d, nb + 1), τ = T (β, 1)


@jit
def gauss_jordan(B, first, last, first_cleared, columns, weights, lengths, pivots):
    """Reduce rows first:last of B in place, each to one pivot equal to 1.

    Returns the smallest fraction of a row that remained when its turn came. B: (·, n + 1),
    right-hand side in the last column; rows first:last have other entries in the first `columns`
    only. first_cleared: the pivots are cleared from all rows from there on. weights: (n,), each row
    takes the pivot of the largest weight × |entry|. lengths: norms of the rows of B before the
    elimination. pivots: receives the column of each row's pivot.
    """
    right, smallest_pivot = B.shape[1] - 1, 1.0
    for row in range(first, last):
        largest, pivot = 0.0, -1
        for c in range(columns):
            size = weights[c] * abs(B[row, c])
            if size > largest:
                largest, pivot = size, c
        if pivot < 0 or abs(B[row, pivot]) <= ZERO_PIVOT * lengths[row]:
            return 0.0
        smallest_pivot = min(smallest_pivot, abs(B[row, pivot]) / lengths[row])
        pivots[row] = pivot
        scale = 1.0 / B[row, pivot]
        for c in range(columns):
            B[row, c] *= scale
        B[row, right] *= scale
        for other in range(first_cleared, B.shape[0]):
            factor = B[other, pivot]
            if other != row and factor != 0.0:
                for c in range(columns):
                    B[other, c] -= factor * B[row, c]
                B[other, right] -= factor * B[row, right]
                B[other, pivot] = 0.0
    return smallest_pivot


@jit
def equalities(A, b, M, h, J, base, lengths, B):
    """Write B = [A 0 | b] above [M_b -J_bᵀ | -h_b], which is (7) without its joint rows.

    lengths: receives the norms of the rows of B, without the right-hand side.
    """
    m, nv, k = A.shape[0], A.shape[1], J.shape[0]
    for i in range(m):
        for c in range(nv):
            B[i, c] = A[i, c]
        for c in range(nv, nv + k):
            B[i, c] = 0.0
        B[i, nv + k] = b[i]
    for i in range(base):
        for c in range(nv):
            B[m + i, c] = M[i, c]
        for c in range(k):
            B[m + i, nv + c] = -J[c, i]
        B[m + i, nv + k] = -h[i]
    for row in range(m + base):
        square = 0.0
        for c in range(nv + k):
            square += B[row, c] * B[row, c]
        lengths[row] = np.sqrt(square)


@jit_allocating
def independent_rows(A, b, v, rows, rhs):
    """Write orthonormal rows (r, nv) equivalent to A q̈ = b along the directions that A resolves.

    The rule is that of `build_qp`. Returns r, or -1 if rows of A q̈ = b disagree by more than the
    contacts' motion A v explains. rows, rhs: (m, nv), (m,), whose first r entries receive the rows
    and their right-hand sides.
    """
    U, s, Vt = np.linalg.svd(A, False)
    r = 0
    while r < s.size and s[r] > CONSTRAINT_RANK_TOLERANCE * s[0]:
        r += 1
    U = np.ascontiguousarray(U[:, :r])
    rows[:r], rhs[:r] = Vt[:r], np.dot(U.T, b) / s[:r]
    gap, motion = b - np.dot(U, np.dot(U.T, b)), np.dot(A, v)
    tolerance = INCONSISTENCY_TOLERANCE + CONSTRAINT_NOISE * np.max(np.abs(motion))
    return -1 if np.max(np.abs(gap)) > tolerance else r


@jit
def eliminate(A, b, M, h, J, base, workspace, B, pivots):
    """Solve the equalities for as many entries of (q̈, λ) as possible: eqs. (13), (17).

    Returns the smallest fraction of a motion row, and of any row, that remained when its turn came.
    A, b: (m, nv), (m,), motion rows (5). M, h, J: (nv, nv), (nv,), (k, nv), of (7). base: number of
    rows of (7) without a motor, 6 or 0. B: (m + base, n + 1), receives the reduced rows. pivots: (m
    + base,), receives the entry of (q̈, λ) that each row is solved for.

    Motion rows are solved for joints if possible, and for the base if knees are straight. Base rows
    are solved for the base, and for λ if the contacts already constrain the base.
    """
    m, nv, n = A.shape[0], A.shape[1], B.shape[1] - 1
    lengths, motion_weights = take_vector(workspace, m + base), take_vector(workspace, n)
    base_weights = take_vector(workspace, n)
    for c in range(n):
        motion_weights[c], base_weights[c] = (
            (0.05, 1.0) if c < base else (1.0, 0.1 if c < nv else 0.01)
        )
    equalities(A, b, M, h, J, base, lengths, B)
    smallest_pivot = gauss_jordan(B, 0, m, 0, nv, motion_weights, lengths, pivots)
    if smallest_pivot <= ZERO_ROW:
        return smallest_pivot, smallest_pivot
    return smallest_pivot, min(
        smallest_pivot, gauss_jordan(B, m, m + base, m, n, base_weights, lengths, pivots)
    )


@jit
def parametrise(B, pivots, m, free_columns, V, beta_index):
    """Write V and beta_index of `Parametrisation` from the reduced rows of `eliminate`.

    The first m reduced rows are motion rows. These rows still contain the pivots of the later rows,
    which are substituted here. free_columns: (nb,), memory.
    """
    n, nb = V.shape[0], V.shape[1] - 1
    for c in range(n):
        beta_index[c] = 0
    for row in range(pivots.size):
        beta_index[pivots[row]] = -1
    clear(V)
    j = 0
    for c in range(n):
        if beta_index[c] == 0:
            beta_index[c], free_columns[j], V[c, j] = j, c, 1.0
            j += 1
    for row in range(pivots.size):
        pivot = pivots[row]
        for j in range(nb):
            V[pivot, j] = -B[row, free_columns[j]]
        V[pivot, nb] = B[row, n]
    for row in range(m):
        pivot = pivots[row]
        for base_row in range(m, pivots.size):
            source = pivots[base_row]
            factor = B[row, source]
            if factor != 0.0:
                for j in range(nb + 1):
                    V[pivot, j] -= factor * V[source, j]


@jit_forceinline
def add_entry(factor, V, beta_index, entry, out, row):
    """Add factor × row `entry` of V to a row of out (·, nb + 1); one number for an entry of β."""
    if beta_index[entry] >= 0:
        out[row, beta_index[entry]] += factor
    else:
        for c in range(V.shape[1]):
            out[row, c] += factor * V[entry, c]


@jit
def add_product(rows, V, beta_index, out, first):
    """Add rows (m, nv) times the q̈ of V to rows first:first + m of out (·, nb + 1).

    Most entries of `rows` are zero.
    """
    for i in range(rows.shape[0]):
        for j in range(rows.shape[1]):
            if rows[i, j] != 0.0:
                add_entry(rows[i, j], V, beta_index, j, out, first + i)


@jit
def torques(V, beta_index, M, h, J, base, T):
    """Write T of `Parametrisation` from τ = M_j q̈ + h_j - J_jᵀ λ, eq. (16).

    These are the rows of (7) after the first `base`. V, beta_index: of `Parametrisation`.
    """
    nv, k, nb = M.shape[0], J.shape[0], V.shape[1] - 1
    clear(T)
    add_product(M[base:], V, beta_index, T, 0)
    for c in range(k):
        for j in range(nv - base):
            if J[c, base + j] != 0.0:
                add_entry(-J[c, base + j], V, beta_index, nv + c, T, j)
    for j in range(nv - base):
        T[j, nb] += h[base + j]
