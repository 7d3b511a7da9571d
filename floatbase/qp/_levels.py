"""The QP of a priority level in coordinates in which it is well scaled."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from floatbase._validation import Array
from floatbase.affine import Affine
from floatbase.qp.problem import QP, in_coordinates

# fraction of a matrix by which its product with orthonormal columns may differ from zero
_RANK_TOLERANCE = 1e-12
_ROW_TOLERANCE = 1e-9  # fraction of a constraint's length: it depends less on what is still free


def in_residuals(
    level: QP, costs: Sequence[tuple[str, float, Affine]], free: Array, x: Array
) -> tuple[QP, Array, int]:
    """Return the QP in y of a level at x + T y, the matrix T, and the number of y that cost.

    The columns of T span those of `free`, which are orthonormal. The first y are coordinates of the
    weighted residuals. All their curvatures are equal, whatever the weights are, and no column is
    longer than 1. The other y change no residual.
    """
    parts, size = [np.zeros((0, free.shape[1] + 1))], 0.0
    for block, weight, residual in costs:
        part = level.blocks[block]
        rows = np.column_stack([residual.A @ free[part], residual(x[part])])
        parts.append(np.sqrt(weight) * rows)
        size = max(size, float(np.sqrt(weight) * np.linalg.norm(residual.A)))
    weighted = np.vstack(parts)
    U, s, Vt = np.linalg.svd(weighted[:, :-1])
    rank, n = int(np.sum(s > _RANK_TOLERANCE * size)), free.shape[1]
    unit = s[rank - 1] if rank else 1.0
    columns = np.hstack([Vt[:rank].T * (unit / s[:rank]), Vt[rank:].T])
    g, G = np.zeros(n), level.G @ free
    g[:rank] = unit * (U[:, :rank].T @ weighted[:, -1])
    G[np.linalg.norm(G, axis=1) <= _ROW_TOLERANCE * level.row_norms] = 0.0
    H = np.diag(np.where(np.arange(n) < rank, unit**2, 0.0))
    change = in_coordinates(level, H, g, G @ columns, level.h - level.G @ x)
    return change, free @ columns, rank
