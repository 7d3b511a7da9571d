"""Rank, null space and row lengths: the few decisions of linear algebra that every package must
take alike.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array, read_only

RANK_TOLERANCE = 1e-9  # singular values below this part of the largest count as zero


def rank(A: npt.ArrayLike, absolute: bool = False) -> int:
    """Number of singular values of A above `RANK_TOLERANCE` times the largest.

    absolute: above `RANK_TOLERANCE` itself, for parts of orthonormal columns, which may be rounding
        altogether.
    """
    return svd_with_rank(A, absolute)[3]


def svd_with_rank(A: npt.ArrayLike, absolute: bool = False) -> tuple[Array, Array, Array, int]:
    """The singular value decomposition A = U diag(s) Vᵀ and the rank r of A: (U, s, Vᵀ, r);
    absolute as for `rank`.

    A: (m, n). U: (m, m), its first r columns span the range of A, the others what A does not reach.
        s: falling. Vᵀ: (n, n),
    its last n - r rows span the null space of A.
    """
    U, s, Vt = np.linalg.svd(np.asarray(A, dtype=np.float64))
    largest = 1.0 if absolute else float(s.max(initial=0.0))
    return U, s, Vt, int(np.sum(s > RANK_TOLERANCE * largest))


def null_space(A: npt.ArrayLike, absolute: bool = False) -> Array:
    """Orthonormal columns that span {x : A x = 0}, shape (n, n - rank); absolute as for `rank`."""
    _, _, Vt, r = svd_with_rank(A, absolute)
    return read_only(Vt[r:].T)


def row_norms(A: Array) -> Array:
    """Euclidean length of each row, shape (m,), 1 for a row of zeros: the unit to compare
    violations of rows in.
    """
    norms = np.linalg.norm(A, axis=1)
    return np.where(norms > 0.0, norms, 1.0)
