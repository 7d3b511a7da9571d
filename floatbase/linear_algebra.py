"""Shared rank, null-space and row-norm functions."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array, read_only

RANK_TOLERANCE = 1e-9  # singular values below this fraction of the largest count as zero


def rank(A: npt.ArrayLike, absolute: bool = False) -> int:
    """Compute the rank, the number of singular values above `RANK_TOLERANCE` times the largest.

    Parameters
    ----------
    A : array_like, shape (m, n)
        Matrix.
    absolute : bool, optional
        Count singular values above `RANK_TOLERANCE` itself. Use this for parts of orthonormal
        columns, which may consist of rounding errors only.

    Returns
    -------
    int
        Rank of A.
    """
    return svd_with_rank(A, absolute)[3]


def svd_with_rank(A: npt.ArrayLike, absolute: bool = False) -> tuple[Array, Array, Array, int]:
    """Compute the singular value decomposition A = U diag(s) Vᵀ and the rank of A.

    Parameters
    ----------
    A : array_like, shape (m, n)
        Matrix.
    absolute : bool, optional
        Whether the rank tolerance is absolute, as for `rank`.

    Returns
    -------
    U : ndarray, shape (m, m)
        Orthogonal matrix whose first r columns span the range of A. The other columns span its
        orthogonal complement.
    s : ndarray, shape (min(m, n),)
        Singular values in descending order.
    Vt : ndarray, shape (n, n)
        Orthogonal matrix Vᵀ whose last n - r rows span the null space of A.
    r : int
        Rank of A.
    """
    U, s, Vt = np.linalg.svd(np.asarray(A, dtype=np.float64))
    largest = 1.0 if absolute else float(s.max(initial=0.0))
    return U, s, Vt, int(np.sum(s > RANK_TOLERANCE * largest))


def null_space(A: npt.ArrayLike, absolute: bool = False) -> Array:
    """Compute an orthonormal basis of the null space {x : A x = 0}.

    Parameters
    ----------
    A : array_like, shape (m, n)
        Matrix.
    absolute : bool, optional
        Whether the rank tolerance is absolute, as for `rank`.

    Returns
    -------
    ndarray, shape (n, n - rank)
        Orthonormal columns.
    """
    _, _, Vt, r = svd_with_rank(A, absolute)
    return read_only(Vt[r:].T)


def row_norms(A: Array) -> Array:
    """Compute the Euclidean length of each row, the scale for comparing violations of rows.

    Parameters
    ----------
    A : ndarray, shape (m, n)
        Matrix.

    Returns
    -------
    ndarray, shape (m,)
        Lengths of the rows, with 1 for a row of zeros.
    """
    norms = np.linalg.norm(A, axis=1)
    return np.where(norms > 0.0, norms, 1.0)
