"""The tick without a compiler: (26)(27) in the document's β space by numpy, in few calls over arrays laid out once.

The same problem as `controller.build_qp`, for machines without numba, in the order of the document:

    Rows          of all contacts and tasks, their velocities and drifts    (4)(5)              reduced_rows.py
    Residuals     of all tasks                                              (26)                reduced_rows.py
    Space         q̈, λ and τ as maps of β, the objective in β               (13)(16)(17)(18)    reduced_space.py
    Inequalities  limits of forces and torques                              (27)(28)            reduced_space.py
    Reduced       the tick: the optimum without limits, and where it breaks one, DAQP's

Symbols: nv, d, k as everywhere, n = nv + k, m motion rows, base 6 or 0, β of length nb = n - m - base, of which each entry is
minus one entry of (q̈, λ). A tick that cannot be answered to its last digits is left to the readable path.
"""

from __future__ import annotations

from typing import Any

import daqp
import numpy as np
import numpy.typing as npt
from scipy.linalg import blas, lapack

from floatbase._arrays import Array
from floatbase.control.programs import COM, FLAT, FRAME, ORIENTATION, POSTURE, Answer, Program
from floatbase.control.qp import FEASIBILITY_TOLERANCE
from floatbase.control.reduced_rows import Measured, Residuals, Rows, Triple
from floatbase.control.reduced_space import Inequalities, Space
from floatbase.dynamics.subspace import MOTION_NOISE, MOTION_TOLERANCE

_DEPENDENT = 2e-2  # motion rows of which so small a part is left in some direction may nearly depend on each other
_WILD = 1e4  # length of (q, v) from which on digits are lost
_FAR = 1e16  # the square of an answer, (m/s²)², (N·m)² and N² together, from which on digits are lost
_POLISHED = 3  # steps of Newton's method at most
_SETTLED = 1e-12  # part of β, squared: what is left after a step so small is rounding
_PULLING = 1e-9  # part of the largest multiplier by which one may be negative

Indices = npt.NDArray[np.intp]


class Reduced(Program):
    """The tick by numpy."""

    path = "reduced"

    def _prepare(self, contact_tables: tuple[Any, ...], task_tables: tuple[Any, ...], bounds: tuple[Array, float]) -> None:
        contacts, frames, points, cones, lengths = contact_tables
        dynamics, nv, d, k = self.dynamics, self.nv, self.d, 3 * len(points)
        self._base = nv - d
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
        self._limits = Inequalities(cones, lengths, *bounds)
        self._views(k, r, t)
        self._spaces: dict[int, Space] = {}
        self._held_before = False
        self._full = self._space(self._m)
        # (q̈, λ, 1, τ) to (q̈, τ, λ), and room for multipliers and rows
        order = [np.arange(nv), nv + k + 1 + np.arange(d), nv + np.arange(k), np.zeros(2 * self.entries, np.intp)]
        self._order = np.concatenate(order)
        with dynamics.lock:
            self._update(np.array(self.robot.posture), np.zeros(nv))
        sizes = np.linalg.norm(self._equalities[: self._m], axis=1)
        self._most = float((_DEPENDENT * sizes.max(initial=1e-9)) ** -2)

    def _views(self, k: int, r: int, t: int) -> None:
        """Parts of arrays that are filled or read in every tick."""
        M, h, *_ = self.dynamics.views
        nv, n, m, jacobian, measured = self.nv, self.nv + k, self._m, self._rows.jacobian, self._measured
        first, known = r - t - k, m + self._base
        # motion rows (5), above [M -Jᵀ h] (7), above the rows of the tasks
        equations = np.zeros((m + nv + t, n + 1))
        self._copies = (
            (equations[:m, :nv], jacobian[:m]),
            (equations[m : m + nv, :nv], M.T),  # symmetric, and quicker to copy
            (equations[m : m + nv, nv:n], jacobian[first : first + k].T),
            (equations[m : m + nv, n], h),
            (equations[m + nv :, :nv], jacobian[r - t :]),
        )
        self._drifts = measured["moving"][1 : 2 * m : 2], measured["curved"][:m], equations[:m, n]
        self._equalities, self._others = equations[:known], equations[known:]

    def _update(self, q: Array, v: Array) -> None:
        """(1)(4)(5) Measure."""
        self.dynamics.update(q, v)
        self.dynamics.update_rates(q, v)
        self._rows.update(v)
        for room, view in self._copies:
            room[:] = view
        np.add(*self._drifts)

    def _space(self, m: int) -> Space:
        """Room for m motion rows."""
        if m not in self._spaces:
            k = self._equalities.shape[1] - 1 - self.nv
            self._spaces[m] = Space(m, self._base, self.nv, k, len(self._others), self._residuals.roots)
        return self._spaces[m]

    def _reduced(self) -> Space | None:
        """(13)(17) β -> (q̈, λ)."""
        return self._full if self._full.solve(self._equalities, self._most) else self._resolved()

    def _resolved(self) -> Space | None:
        """The same from motion rows that stand for the directions which the contacts resolve, as in `build_qp`."""
        nv, m = self.nv, self._m
        A, right = self._equalities[:m, :nv], self._equalities[:m, -1]
        U, s, Vt = np.linalg.svd(A, full_matrices=False)
        r = int(np.sum(s > MOTION_TOLERANCE * s.max(initial=0.0)))
        gap, motion = right - U[:, :r] @ (U[:, :r].T @ right), A @ self._v
        if not np.max(np.abs(gap), initial=0.0) <= 1e-6 + MOTION_NOISE * np.max(np.abs(motion), initial=0.0):
            return None
        space, equalities = self._space(r), self._equalities[m - r :].copy()
        equalities[:r] = 0.0
        equalities[:r, :nv], equalities[:r, -1] = Vt[:r], U[:, :r].T @ right / s[:r]
        return space if space.solve(equalities, np.inf) else None

    def _answer(self, q: Array, v: Array, targets: Array) -> Answer | None:
        with self.dynamics.lock:
            self._q[:] = q
            self._v[:] = v
            if not blas.dnrm2(self._state) < _WILD:
                return None
            for turn in self._turns:
                if not abs(turn.dot(turn) - 1.0) < 1e-6:
                    return None
            self._update(q, v)
            space = self._reduced()
            if space is None or not self._objective(space, q, v, targets):
                return None
            answer = self._optimum(space)
            if answer is not None and not answer[0][: self.size].dot(answer[0][: self.size]) < _FAR:
                answer = None
            self._held_before = answer is not None and answer[1] > 0
            return answer

    def _objective(self, space: Space, q: Array, v: Array, targets: Array) -> bool:
        """(16)(18)(26) τ and the residuals of all tasks over (β, 1); False where a target cannot be read."""
        shift = self._residuals.shift(q, v, targets)
        if shift is None:
            return False
        np.dot(self._others, space.V1, space.low)
        np.multiply(space.inner, space.roots, space.R)
        space.R_last += shift
        return True

    def _optimum(self, space: Space) -> Answer | None:
        """(26)(27) The optimum without rows, or where it breaks one, `_search`.

        Where rows held the last answer they will mostly hold this one, and the search comes first. The answer is the same.
        """
        space.normal_equations()
        if self._held_before:
            factor, info = lapack.dpotrf(space.H)
            answer = None if info else self._search(space, factor)
            if answer is not None and answer[1]:
                return answer
        factor, minus, info = lapack.dposv(space.H, space.g)
        if info:
            return None
        np.negative(minus, space.beta)
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
            space.g,
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
            least = mu[pulling] if mu.size else 0.0
            if least < 0.0 and least < -_PULLING * mu.max():
                active, mu = np.delete(active, pulling), np.delete(mu, pulling)
            elif broken >= 0:
                active, mu = np.append(active, broken), np.append(mu, 0.0)
            else:
                return self._held(x, active, mu), len(active)
            rows = self._limits.G.take(active, 0).dot(space.limited)
        return None

    def _held(self, x: Array, active: Indices, mu: Array) -> Array:
        """The answer with its multipliers and rows, laid out as `Program` says."""
        first, second, held = self.size, self.size + self.entries, len(active)
        answer = x.take(self._order)
        answer[first : first + held] = mu
        answer[second : second + held] = active
        return answer

    def multipliers(self, answer: Array, held: int, rows: int) -> Array:
        """As `Program.multipliers`; the tick's own are those of rows of unit length and of weights in parts of the largest."""
        first, second = self.size, self.size + self.entries
        scaled = answer.copy()
        active = scaled[second : second + held].astype(np.intp)
        scaled[first : first + held] *= self._residuals.unit / self._limits.lengths[active]
        return super().multipliers(scaled, held, rows)


def _polished(space: Space, factor: Array) -> bool:
    """Newton's method without rows: H δβ = -slope. Changes β; False where steps do not shrink."""
    beta = space.beta
    for _ in range(_POLISHED):
        step, _ = lapack.dpotrs(factor, space.slope())
        blas.daxpy(step, beta, a=-1.0)
        if _is_rounding(step, beta):
            return True
    return False


def _newton(space: Space, factor: Array, rows: Array, mu: Array) -> bool:
    """App. C: H δβ + Gᵀ δμ = -slope, G δβ = h - G β for the active rows, by G H⁻¹ Gᵀ; changes β and μ.

    False where steps do not shrink. daxpy(x, y, a=1) adds a x to y, in half of numpy's time.
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
        blas.daxpy(push, mu)
        blas.daxpy(pushed.dot(push), step)
        blas.daxpy(step, beta, a=-1.0)
        if _is_rounding(step, beta):
            return True
    return False


def _is_rounding(step: Array, beta: Array) -> bool:
    """Whether a step is so small beside β that the next one would be rounding."""
    return bool(blas.ddot(step, step) < _SETTLED * (1.0 + blas.ddot(beta, beta)))


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
