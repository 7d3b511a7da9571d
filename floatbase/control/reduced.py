"""The tick without a compiler: (26)(27) in the document's β space by numpy, in few calls over arrays laid out once.

The same problem as `controller.build_qp`, for machines without numba. `reduced_rows.py` measures; here the answer is found:

    Space      q̈ and λ as maps of β: an LU factorisation of the equalities       (13)(17)
               and R with Σ (weight / 2) ‖residual‖² = ½ ‖R (β, 1)‖²             (16)(18)(26)
    Limits     G (λ, 1, τ) ≤ 0                                                   (27)(28)
    Reduced    the tick: the optimum without rows, and where it breaks one, DAQP

Symbols: nv, d, k as everywhere, n = nv + k, m motion rows, base 6 or 0, β of length nb = n - m - base, of which each entry is
minus one entry of (q̈, λ). A tick that cannot be answered to its last digits is left to the readable path.
"""

from __future__ import annotations

from math import isfinite
from typing import Any

import daqp
import numpy as np
import numpy.typing as npt
from scipy.linalg import lapack

from floatbase._arrays import Array
from floatbase.control.compiled import COM, FLAT, FRAME, ORIENTATION, POSTURE, Answer, Program
from floatbase.control.qp import FEASIBILITY_TOLERANCE
from floatbase.control.reduced_rows import Measured, Residuals, Rows, Triple
from floatbase.dynamics.subspace import MOTION_TOLERANCE

_DEPENDENT = 2e-2  # a motion row of which elimination leaves less than this part may nearly depend on the others
_LOST = 1e-6  # part of a row of (7) that must be left
_TINY = 2.0**-40  # makes a column too small to be a pivot, and costs no digit
_POLISHED = 3  # steps of Newton's method at most
_SETTLED = 1e-12  # part of β, squared: what is left after a step so small is rounding
_PULLING = 1e-9  # part of the largest multiplier by which one may be negative
_FAR = 1e30  # a bound that DAQP takes for none
_NOISE = 100.0  # as MOTION_NOISE of the readable path

Indices = npt.NDArray[np.intp]
_NO_ORDER = np.zeros(0, np.intp)


class Space:
    """(13)(17) β -> (q̈, λ, 1, τ, motions of tasks) as E (n + 1 + d + t, nb + 1), whose last column is the point at β = 0.

    It solves equalities (m + base, n + 1): rows over (q̈, λ), then *minus* their right-hand side. beta1: (β, 1).
    """

    def __init__(self, m: int, base: int, nv: int, k: int, below: int, roots: Array):
        rows, n, d = m + base, nv + k, nv - base
        nb = n - rows
        self.m, self._n, self._rows = m, n, rows
        self.equalities = np.zeros((rows, n + 1))
        self.motion, self.right, self.base_rows = self.equalities[:m, :nv], self.equalities[:m, n], self.equalities[m:]
        self._beside, self._last = self.equalities[:m, nv:n], self.equalities[:, n]
        self._factors = self.equalities.T  # as LAPACK lays matrices out
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
        self.H, self.g = self._both[:nb, :nb], self._both[:nb, nb]
        self.beta1 = np.ones(nb + 1)
        self.beta, self.nb = self.beta1[:nb], nb

    def solve(self, least: Array) -> bool:
        """Fill V; False where a row has less than `least` (m + base,) left when its turn comes.

        The factorisation chooses for each row the unknown to solve for. The right-hand side is carried along as one more
        unknown, too small to be chosen.
        """
        if not self._rows:
            return True
        self._beside[:] = 0.0
        self._last *= _TINY
        _, pivots, _ = lapack.dgetrf(self._factors, overwrite_a=1)
        left = abs(self._diagonal)
        left -= least
        if left.size and not left[left.argmin()] > 0.0:
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

    def normal_equations(self) -> Any:
        """H = Rᵀ R and g as in ½ βᵀ H β + gᵀ β, and the Cholesky factor of H, H⁻¹ g, and 0 where H is positive definite."""
        self.R_T.dot(self.R, self._both)
        return lapack.dposv(self.H, self.g)

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


class Reduced(Program):
    """The tick by numpy."""

    path = "reduced"

    def _prepare(self, contact_tables: tuple[Any, ...], task_tables: tuple[Any, ...], bounds: tuple[Array, float]) -> None:
        contacts, frames, points, cones, lengths = contact_tables
        dynamics, nv, d, k = self.dynamics, self.nv, self.d, 3 * len(points)
        self._base = base = nv - d
        motion, pushing = _contact_triples(contacts, frames, points)
        tasks = _task_triples(*task_tables)
        triples = (motion + pushing if np.any(contacts[:, 1] == FLAT) else motion) + tasks
        kinds, r = task_tables[0][:, 0], 3 * len(triples)
        loose = np.sum(dynamics.tree[1:, 4] == 2) * np.sum(kinds == POSTURE)
        self._measured = measured = Measured(
            q=self.q_shape[0], v=nv, places=2 * r + 2, moving=2 * r, curved=r, push=3,
            errors=3 * np.sum(kinds == ORIENTATION), loose=loose,
        )  # fmt: skip
        self._q, self._v = measured["q"], measured["v"]
        # what must have length 1: the base's quaternion, (cos, sin) of joints without limits
        ends = [
            (place + (3 if size == 7 else 0), place + size) for _, _, moves, place, size in dynamics.tree[1:] if size > moves
        ]
        self._turns = [self._q[first:end] for first, end in ends]
        self._state = measured.z[: self.q_shape[0] + nv]
        self._m, t = 3 * len(motion), 3 * len(tasks)
        self._rows = Rows(dynamics, triples, measured)
        self._residuals = Residuals(dynamics, measured, k, task_tables, r - t, self.targets)
        self._limits = Limits(cones, lengths, *bounds)
        self._units = self._residuals.unit / self._limits.lengths  # of multipliers
        self._equations = np.zeros((nv + t, nv + k + 1))  # [M -Jᵀ h] above the rows of the tasks
        self._views(k, r, t)
        self._spaces: dict[int, Space] = {}
        self._full = self._space(self._m)
        self._order = np.concatenate([np.arange(nv), nv + k + 1 + np.arange(d), nv + np.arange(k)])
        self._least = np.zeros(self._m + base)
        with dynamics.lock:
            self._update(np.array(self.robot.posture), np.zeros(nv))
        sizes = np.linalg.norm(self._motion, axis=1), np.linalg.norm(self._equations[:base], axis=1)
        self._least = np.concatenate([_DEPENDENT * sizes[0], _LOST * sizes[1]])

    def _views(self, k: int, r: int, t: int) -> None:
        """Parts of arrays that are filled or read in every tick."""
        M, h, *_ = self.dynamics.views
        nv, n, m, jacobian, measured = self.nv, self.nv + k, self._m, self._rows.jacobian, self._measured
        first = r - t - k
        self._motion, self._drift, self._curved = jacobian[:m], measured["moving"][1 : 2 * m : 2], measured["curved"][:m]
        self._copies = (
            (self._equations[:nv, :nv], M),
            (self._equations[:nv, nv:n], jacobian[first : first + k].T),
            (self._equations[:nv, n], h),
            (self._equations[nv:, :nv], jacobian[r - t :]),
        )
        self._base_equations, self._other_equations = self._equations[: self._base], self._equations[self._base :]

    def _update(self, q: Array, v: Array) -> None:
        """(1)(4)(5) Measure."""
        self.dynamics.update(q, v)
        self.dynamics.update_rates(q, v)
        self._rows.update(v)
        for room, view in self._copies:
            room[:] = view

    def _space(self, m: int) -> Space:
        """Room for m motion rows."""
        if m not in self._spaces:
            k = self._equations.shape[1] - 1 - self.nv
            below = len(self._equations) - self._base
            self._spaces[m] = Space(m, self._base, self.nv, k, below, self._residuals.roots)
        return self._spaces[m]

    def _reduced(self) -> Space | None:
        """(13)(17) β -> (q̈, λ)."""
        space = self._full
        space.motion[:] = self._motion
        np.add(self._drift, self._curved, space.right)
        space.base_rows[:] = self._base_equations
        return space if space.solve(self._least) else self._resolved()

    def _resolved(self) -> Space | None:
        """The same from motion rows that stand for the directions which the contacts resolve, as in `build_qp`."""
        right = self._drift + self._curved
        U, s, Vt = np.linalg.svd(self._motion, full_matrices=False)
        r = int(np.sum(s > MOTION_TOLERANCE * s.max(initial=0.0)))
        gap, motion = right - U[:, :r] @ (U[:, :r].T @ right), self._motion @ self._v
        if not np.max(np.abs(gap), initial=0.0) <= 1e-6 + _NOISE * np.max(np.abs(motion), initial=0.0):
            return None
        space = self._space(r)
        space.motion[:] = Vt[:r]
        space.right[:] = U[:, :r].T @ right / s[:r]
        space.base_rows[:] = self._base_equations
        return space if space.solve(np.concatenate([np.full(r, _LOST), self._least[self._m :]])) else None

    def _answer(self, q: Array, v: Array, targets: Array) -> Answer | None:
        with self.dynamics.lock:
            self._q[:] = q
            self._v[:] = v
            if not isfinite(self._state.dot(self._state)):
                return None
            for turn in self._turns:
                if not abs(turn.dot(turn) - 1.0) < 1e-6:
                    return None
            self._update(q, v)
            space = self._reduced()
            if space is None or not self._objective(space, q, v, targets):
                return None
            return self._optimum(space)

    def _objective(self, space: Space, q: Array, v: Array, targets: Array) -> bool:
        """(16)(18)(26) τ and the residuals of all tasks over (β, 1); False where a target cannot be read."""
        shift = self._residuals.shift(q, v, targets)
        if shift is None:
            return False
        np.dot(self._other_equations, space.V1, space.low)
        np.multiply(space.inner, space.roots, space.R)
        space.R_last += shift
        return True

    def _optimum(self, space: Space) -> Answer | None:
        """(26)(27) The optimum without rows, or where it breaks one, `_search`."""
        factor, minus, info = space.normal_equations()
        if info:
            return None
        beta = space.beta
        np.negative(minus, beta)
        x, broken = self._look(space)
        if broken >= 0:
            return self._search(space, factor)
        if not _polished(space, factor):
            return None
        x, broken = self._look(space)
        return (x.take(self._order), 0) if broken < 0 else self._search(space, factor)

    def _look(self, space: Space) -> tuple[Array, int]:
        """(q̈, λ, 1, τ) at β, and the row of (27)(28) that it breaks most, -1 for none."""
        x = space.shown.dot(space.beta1)
        over = self._limits.G.dot(x[self.nv :])
        worst = over.argmax()
        return x, int(worst) if over[worst] > FEASIBILITY_TOLERANCE else -1

    def _search(self, space: Space, factor: Array) -> Answer | None:
        """The optimum by DAQP, then Newton's method on the rows that push for its last digits, with others where that fails."""
        limits, nb = self._limits, space.nb
        rows = limits.two_sided.dot(space.limited)
        upper = -rows[:, nb]
        beta, _, flag, info = daqp.solve(
            space.H.copy(),
            space.g.copy(),
            rows[:, :nb].copy(),
            upper,
            upper - limits.widths,
            limits.senses,
            primal_tol=FEASIBILITY_TOLERANCE,
            eps_prox=-1.0,
        )
        if flag != 1:
            return None
        space.beta[:] = beta
        lam: Array = info["lam"]
        active = lam.nonzero()[0]
        mu, rows = lam.take(active), rows.take(active, 0)
        if mu.size and mu[mu.argmin()] < 0.0:
            active += limits.d * (mu < 0.0)  # lower limits
            rows, mu = limits.G.take(active, 0).dot(space.limited), np.abs(mu)
        return self._settled(space, factor, active, rows, mu)

    def _settled(self, space: Space, factor: Array, active: Indices, rows: Array, mu: Array) -> Answer | None:
        """The optimum, started from rows (·, nb + 1) of G over (β, 1) that push there, or nearly all of them."""
        for _ in range(space.nb):
            if not (_newton(space, factor, rows, mu) if mu.size else _polished(space, factor)):
                return None
            x, broken = self._look(space)
            pulling = mu.argmin() if mu.size else -1
            if pulling >= 0 and mu[pulling] < -_PULLING * mu[mu.argmax()]:
                active, mu = np.delete(active, pulling), np.delete(mu, pulling)
            elif broken >= 0:
                active, mu = np.append(active, broken), np.append(mu, 0.0)
            else:
                return self._held(x, active, mu), len(active)
            rows = self._limits.G.take(active, 0).dot(space.limited)
        return None

    def _held(self, x: Array, active: Indices, mu: Array) -> Array:
        """The answer with its multipliers and rows, laid out as `Program` says."""
        answer, mu_at = np.empty(self.size + 2 * self.entries), self.size
        x.take(self._order, None, answer[:mu_at], "clip")
        np.multiply(mu, self._units.take(active), answer[mu_at : mu_at + len(active)])
        answer[mu_at + self.entries : mu_at + self.entries + len(active)] = active
        return answer


def _polished(space: Space, factor: Array) -> bool:
    """Newton's method without rows: H δβ = -slope. Changes β; False where steps do not shrink."""
    beta = space.beta
    for _ in range(_POLISHED):
        step, _ = lapack.dpotrs(factor, space.slope())
        beta -= step
        if step.dot(step) < _SETTLED * (1.0 + beta.dot(beta)):
            return True
    return False


def _newton(space: Space, factor: Array, rows: Array, mu: Array) -> bool:
    """App. C: H δβ + Gᵀ δμ = -slope, G δβ = h - G β for the active rows, by G H⁻¹ Gᵀ; changes β and μ.

    False where steps do not shrink.
    """
    beta, nb = space.beta, space.nb
    G = rows[:, :nb]
    pushed, _ = lapack.dpotrs(factor, G.T)
    inner, info = lapack.dpotrf(G.dot(pushed))
    if info:
        return False
    for _ in range(_POLISHED):
        step, _ = lapack.dpotrs(factor, space.slope() + mu.dot(G))
        push, _ = lapack.dpotrs(inner, rows.dot(space.beta1) - G.dot(step))
        mu += push
        step += pushed.dot(push)
        beta -= step
        if step.dot(step) < _SETTLED * (1.0 + beta.dot(beta)):
            return True
    return False


def _contact_triples(contacts: Array, frames: Array, points: Array) -> tuple[list[Triple], list[Triple]]:
    """Rows of the contacts' motion, and of the points that carry forces; with a minus, as (7) has them."""
    motion, pushing = [], []
    for (joint, kind, first, count), frame in zip(contacts, frames, strict=True):
        turned, at, ball = frame[:9].reshape(3, 3).T, frame[9:12], frame[15] * frame[12:15]
        here = [Triple(joint, turned @ point + at, ball, -1.0) for point in points[first : first + count]]
        motion += [Triple(joint, at, ball, -1.0), Triple(joint, sign=-1.0)] if kind == FLAT else here
        pushing += here
    return motion, pushing


def _task_triples(tasks: Array, gains: Array, frames: Array) -> list[Triple]:
    """Rows of the tasks on motions."""
    found = []
    for (kind, joint, _), frame in zip(tasks, frames, strict=True):
        if kind <= FRAME:
            at = None if kind == ORIENTATION else frame[9:12]
            found.append(Triple(-1 if kind == COM else joint, at))
    return found
