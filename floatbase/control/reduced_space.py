"""The document's β space as the tick without a compiler goes through it, and the rows that bound it: room laid out once.

Space         q̈ and λ as maps of β by one LU factorisation of the equalities, and the objective in β   (13)(17)(18)
Inequalities  G (λ, 1, τ) ≤ 0                                                                          (27)(28)
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import lapack

from floatbase._arrays import Array

_TINY = 2.0**-60  # makes a column too small to be a pivot, and costs no digit
_FAR = 1e30  # a bound that DAQP takes for none


class Space:
    """(13)(17) β -> (q̈, λ, 1, τ, motions of tasks) as E (n + 1 + d + t, nb + 1), whose last column is the point at β = 0.

    Equalities are rows (m + base, n + 1) over (q̈, λ), with *minus* their right-hand side in the last column. inner, R:
    (base + …, nb + 1), the rows of E that objectives look at, and of ½ ‖R (β, 1)‖². roots: of R's rows. beta1: (β, 1).
    """

    def __init__(self, m: int, base: int, nv: int, k: int, below: int, roots: Array):
        rows, n, d = m + base, nv + k, nv - base
        nb = n - rows
        self._rows = rows
        self._work, self._scales = np.zeros((rows, n + 1)), np.ones((rows, n + 1))
        self._scales[:, n] = _TINY
        self._factors = self._work.T  # as LAPACK lays matrices out
        self._motion, self._free = self._factors[:m, :m], self._factors[rows:]
        # -I below what is solved for: each β is minus one of the unknowns that are left
        self._room = np.asfortranarray(np.eye(n, nb + 1, -rows) * -1.0)
        self._solved, self._point = self._room[:rows].T, self._room[:rows, nb]
        self.E = np.zeros((n + 1 + below, nb + 1))
        self.E[n, nb] = 1.0
        self.V, self.V1, self.low = self.E[:n], self.E[: n + 1], self.E[n + 1 :]
        self.shown, self.limited = self.E[: n + 1 + d], self.E[nv : n + 1 + d]
        self.V[:] = self._room
        # objective
        self.inner = self.E[base:]
        self.roots = np.repeat(roots[:, None], nb + 1, axis=1)
        self.R = np.zeros((len(roots), nb + 1))
        self.R_T, self.R_last = self.R.T, self.R[:, nb]
        self._both = np.zeros((nb + 1, nb + 1))
        self.H, self.g = self._both[:nb, :nb], self._both[nb, :nb]
        self.beta1 = np.ones(nb + 1)
        self.beta, self.nb = self.beta1[:nb], nb

    def solve(self, equalities: Array, most: float) -> bool:
        """Fill V; False where rows depend on each other, or motion rows (5) nearly do.

        The factorisation B^T = P L U chooses for each row the unknown to solve for. The right-hand side is carried along as one
        more unknown, too small to be chosen. The singular values of A are hardly smaller than 1 / ‖U⁻¹‖, with U's part of the
        motion rows; `most` is the largest ‖U⁻¹‖² that passes.
        """
        if not self._rows:
            return True
        np.multiply(equalities, self._scales, self._work)
        _, pivots, info = lapack.dgetrf(self._factors, overwrite_a=1)
        if info:
            return False
        if self._motion.size:
            inverse = lapack.dtrtri(self._motion)[0].T.reshape(-1)  # L still stands below U⁻¹, and adds little
            if not inverse.dot(inverse) <= most:
                return False
        np.copyto(self._solved, self._free)
        lapack.dtrtrs(self._factors, self._room, 1, 1, 1, overwrite_b=1)
        self._point *= -1.0 / _TINY
        self.V[:] = lapack.dlaswp(self._room, pivots, 0, self._rows - 1, 0, -1)
        return True

    def normal_equations(self) -> None:
        """H = Rᵀ R and g as in ½ βᵀ H β + gᵀ β."""
        self.R_T.dot(self.R, self._both)

    def slope(self) -> Array:
        """H β + g, residual by residual, which keeps the digits that H lost."""
        slope: Array = self.R_T.dot(self.R.dot(self.beta1))
        return slope[: self.nb]


class Inequalities:
    """(27)(28) G (λ, 1, τ) ≤ 0: rows of unit length, P (F + 1) for forces, d upper and d lower torque limits."""

    def __init__(self, cones: Array, lengths: Array, limits: Array, least: float):
        points, per_point, _ = cones.shape
        k, d, self.force_rows = 3 * points, len(limits), points * per_point
        self.d = d
        forces, torques = np.zeros((points, per_point, points, 3)), np.eye(d)
        forces[np.arange(points), :, np.arange(points)] = cones / lengths[:, :, None]
        bound = np.zeros((points, per_point))
        bound[:, -1] = least
        reach = -np.minimum(limits, _FAR)
        self.G = np.zeros((self.force_rows + 2 * d, k + 1 + d))
        self.G[: self.force_rows, :k] = forces.reshape(self.force_rows, k)
        self.G[:, k] = np.concatenate([(bound / lengths).ravel(), reach, reach])
        self.G[self.force_rows :, k + 1 :] = np.vstack([torques, -torques])
        self.lengths = np.concatenate([lengths.ravel(), np.ones(2 * d)])
        # what DAQP sees: torques between two bounds
        self.two_sided = np.ascontiguousarray(self.G[: self.force_rows + d])
        self.widths = np.concatenate([np.full(self.force_rows, 2.0 * _FAR), -2.0 * reach])
        self.senses = np.zeros(len(self.two_sided), np.int32)
