"""The document's β space as the tick without a compiler goes through it, and the rows that bound it: room laid out once.

Space   q̈ and λ as maps of β by one LU factorisation of the equalities, and the objective in β   (13)(17)(18)
Limits  G (λ, 1, τ) ≤ 0                                                                          (27)(28)
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.linalg import lapack

from floatbase._arrays import Array

_TINY = 2.0**-40  # makes a column too small to be a pivot, and costs no digit
_FAR = 1e30  # a bound that DAQP takes for none

Indices = npt.NDArray[np.intp]
_NO_ORDER = np.zeros(0, np.intp)


class Space:
    """(13)(17) β -> (q̈, λ, 1, τ, motions of tasks) as E (n + 1 + d + t, nb + 1), whose last column is the point at β = 0.

    Equalities are rows (m + base, n + 1) over (q̈, λ), with *minus* their right-hand side in the last column. inner, R:
    (base + …, nb + 1), the rows of E that objectives look at, and of ½ ‖R (β, 1)‖². roots: of R's rows. beta1: (β, 1).
    """

    def __init__(self, m: int, base: int, nv: int, k: int, below: int, roots: Array):
        rows, n, d = m + base, nv + k, nv - base
        nb = n - rows
        self._n, self._rows = n, rows
        self._work, self._scales = np.zeros((rows, n + 1)), np.ones((rows, n + 1))
        self._scales[:, n] = _TINY
        self._factors = self._work.T  # as LAPACK lays matrices out
        self._diagonal, self._free = np.einsum("ii->i", self._factors[:rows]), self._factors[rows:]
        self._room = np.zeros(rows * (nb + 1) + 2)
        self._room[-1] = -1.0
        self._solved = self._room[:-2].reshape(rows, nb + 1, order="F")
        self._transposed, self._point = self._solved.T, self._solved[:, nb]
        self.E = np.zeros((n + 1 + below, nb + 1))
        self.E[n, nb] = 1.0
        self.V, self.V1, self.low = self.E[:n], self.E[: n + 1], self.E[n + 1 :]
        self.shown, self.limited = self.E[: n + 1 + d], self.E[nv : n + 1 + d]
        if not rows:
            self.V[:, :nb] = -np.eye(n)
        self._orders: dict[bytes, Indices | None] = {}
        # objective
        self.inner = self.E[base:]
        self.roots = np.repeat(roots[:, None], nb + 1, axis=1)
        self.R = np.zeros((len(roots), nb + 1))
        self.R_T, self.R_last = self.R.T, self.R[:, nb]
        self._both = np.zeros((nb + 1, nb + 1))
        self.H, self.g = self._both[:nb, :nb], self._both[nb, :nb]
        self.beta1 = np.ones(nb + 1)
        self.beta, self.nb = self.beta1[:nb], nb

    def solve(self, equalities: Array, least: Array) -> bool:
        """Fill V; False where a row has less than `least` (m + base,) left when its turn comes.

        The factorisation chooses for each row the unknown to solve for. The right-hand side is carried along as one more
        unknown, too small to be chosen.
        """
        if not self._rows:
            return True
        np.multiply(equalities, self._scales, self._work)
        _, pivots, _ = lapack.dgetrf(self._factors, overwrite_a=1)
        left = abs(self._diagonal)
        left -= least
        if not left[left.argmin()] > 0.0:
            return False
        np.copyto(self._transposed, self._free)
        lapack.dtrtrs(self._factors, self._solved, 1, 1, 1, overwrite_b=1)
        self._point *= -1.0 / _TINY
        key = pivots.tobytes()
        order = self._orders.get(key, _NO_ORDER)
        if order is _NO_ORDER:
            order = self._remember(key, pivots.tolist())
        if order is None:
            return False
        self._room.take(order, None, self.V, "clip")
        return True

    def normal_equations(self) -> None:
        """H = Rᵀ R and g as in ½ βᵀ H β + gᵀ β."""
        self.R_T.dot(self.R, self._both)

    def slope(self) -> Array:
        """H β + g, residual by residual, which keeps the digits that H lost."""
        slope: Array = self.R_T.dot(self.R.dot(self.beta1))
        return slope[: self.nb]

    def _remember(self, key: bytes, pivots: list[int]) -> Indices | None:
        """Where each entry of V stands in the room of the solution, of which the last entries are 0 and -1; None if nowhere."""
        order = list(range(self._n + 1))
        for i, j in enumerate(pivots):
            order[i], order[j] = order[j], order[i]
        if len(self._orders) > 1000:
            self._orders.clear()
        self._orders[key] = self._places(order[:-1]) if order[-1] == self._n else None
        return self._orders[key]

    def _places(self, order: list[int]) -> Indices:
        places = np.full(self.V.shape, len(self._room) - 2)
        chosen = np.arange(self._rows)
        places[order[: self._rows]] = chosen[:, None] + self._rows * np.arange(self.nb + 1)
        places[order[self._rows :], np.arange(self.nb)] = len(self._room) - 1
        return places


class Limits:
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
