"""What the tick without a compiler measures: rows of bodies, and residuals of tasks, each of one kind all at once.

A numpy call costs the same for three numbers as for three hundred. So what one tick measures lies in one vector z, in which
places and residuals are linear: what a robot, its contacts and its tasks make of z is a matrix that is made once.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from floatbase._arrays import Array
from floatbase.control.programs import COM, FORCE, FRAME, ORIENTATION, POSTURE, Dynamics

_XYZ, _NO_BALL = np.arange(3), np.zeros(3)


class Measured:
    """The vector z of all that one tick measures, with a slice for each kind of number."""

    def __init__(self, **sizes: int):
        ends = np.cumsum([0, *sizes.values()])
        self.z = np.zeros(ends[-1])
        self.first = dict(zip(sizes, ends[:-1].tolist(), strict=True))
        self._ends = dict(zip(sizes, ends[1:].tolist(), strict=True))

    def __getitem__(self, name: str) -> Array:
        """A live view of one kind."""
        return self.z[self.first[name] : self._ends[name]]


class Triple(NamedTuple):
    """Three rows: of the velocity of a body's point, of its turning where `at` is None, or of all momentum where joint is -1.

    at: (3,) m, in the joint's frame. ball: (3,) m, world, radius × normal: the point itself is that much below `at`, and stays
    there as the body turns. sign: of the rows.
    """

    joint: int
    at: Array | None = None
    ball: Array = _NO_BALL
    sign: float = 1.0


@lru_cache(maxsize=64)
def _carriers(dynamics: Dynamics) -> Array:
    """Which columns of J carry each joint, shape (n, nv): 1 or 0."""
    found = np.zeros((len(dynamics.tree), dynamics.robot.nv))
    for i, (parent, first, count, *_) in enumerate(dynamics.tree):
        if i:
            found[i] = found[parent]
            found[i, first : first + count] = 1.0
    return found


class Rows:
    """World-aligned Jacobians of all triples, shape (r, nv) with r = 3 × their number, their velocities and drifts.

    The rows of a point p on a joint are [1 -p×] J on the columns that carry the joint (J: Pinocchio's, about the world's
    origin), its velocity is ṗ = rows v and its drift [1 -p×] J̇ v + ω × ṗ. In z stand places (p, -p, 0, 1), moving (for each
    row its velocity, and its drift without ω × ṗ) and curved (ω × ṗ).
    """

    def __init__(self, dynamics: Dynamics, triples: Sequence[Triple], measured: Measured):
        nv, r, self._dynamics = dynamics.robot.nv, 3 * len(triples), dynamics
        _, _, self._J, Ag, oMi = dynamics.views
        self._poses, self._momentum = oMi.reshape(-1), Ag[:3]
        self._dJ, self._twists = dynamics.rates
        self._places, self._moving, self._curved = (measured[name] for name in ("places", "moving", "curved"))
        self._place_map = np.zeros((2 * r + 2, self._poses.size))
        self._pick = np.full((r, 6), 2 * r)  # which of the places stand in [1 -p×]
        self._mask = np.zeros((r, 2 * nv))
        # ω × ṗ = turns × speeds, those of the first r less those of the last r; a ball's centre is faster by roll ω
        self._turns, self._speeds = np.zeros(2 * r, np.intp), np.zeros(2 * r, np.intp)
        self._roll = np.zeros((2 * r, self._twists.size))
        for i, triple in enumerate(triples):
            if triple.joint < 0:
                self._follow_mass(3 * i)
                continue
            self._mask[3 * i : 3 * i + 3] = triple.sign * np.tile(_carriers(dynamics)[triple.joint], 2)
            if triple.at is None:
                self._pick[3 * i + _XYZ, 3 + _XYZ] = 2 * r + 1
            else:
                self._follow_point(3 * i, triple, triple.at)
        self._place_map[r : 2 * r] = -self._place_map[:r]
        self._place_map[-1, 0] = 1.0  # the world's own pose begins with a 1
        self._rolls = bool(self._roll.any())
        self._X, self._both, self._out = np.empty((r, 6)), np.empty((6, 2 * nv)), np.empty((r, 2 * nv))
        self._left, self._right, self._flat = self._both[:, :nv], self._both[:, nv:], self._out.reshape(-1, nv)
        self._half = r
        self.jacobian = self._out[:, :nv]
        self._masses = [self.jacobian[3 * i : 3 * i + 3] for i, triple in enumerate(triples) if triple.joint < 0]

    def _add_places(self, row: int, joint: int | slice, at: Array, share: Array | float) -> None:
        """The place in `row` follows points (…, 3) of joints by share: columns of their rotations, then their own places."""
        terms = share * np.concatenate([at, np.ones((*at.shape[:-1], 1))], axis=-1)
        for axis in range(3):
            self._place_map[row + axis].reshape(-1, 4, 3)[joint, :, axis] += terms

    def _follow_mass(self, row: int) -> None:
        links = self._dynamics.links[1:]
        self._add_places(row, slice(1, None), links[:, 1:], links[:, :1] / self._dynamics.mass)

    def _follow_point(self, row: int, triple: Triple, at: Array) -> None:
        """[1 -p×] and ω × ṗ, with ṗ that of the ball's centre."""
        one, below, twist = len(self._place_map) - 1, len(self._pick), 6 * triple.joint
        self._add_places(row, triple.joint, at, 1.0)
        self._place_map[row + _XYZ, 0] -= triple.ball
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            self._pick[row + a, [a, 3 + b, 3 + c]] = one, row + c, below + row + b
            for at_row, turn, speed in ((row + a, b, c), (below + row + a, c, b)):
                f, g = (speed + 1) % 3, (speed + 2) % 3
                self._turns[at_row], self._speeds[at_row] = twist + 3 + turn, 2 * (row + speed)
                self._roll[at_row, twist + 3 + np.array([f, g])] = triple.sign * triple.ball[g], -triple.sign * triple.ball[f]

    def update(self, v: Array) -> None:
        """Fill `jacobian` and the slices of z, after the dynamics were updated."""
        places, out, half = self._places, self._out, self._half
        self._place_map.dot(self._poses, places)
        places.take(self._pick, None, self._X, "clip")
        self._left[:] = self._J
        self._right[:] = self._dJ
        self._X.dot(self._both, out)
        np.multiply(out, self._mask, out)
        for rows in self._masses:
            rows[:] = self._momentum
        self._flat.dot(v, self._moving)
        speeds = self._moving.take(self._speeds)
        if self._rolls:
            speeds += self._roll.dot(self._twists)
        speeds *= self._twists.take(self._turns)
        np.subtract(speeds[:half], speeds[half:], self._curved)


class Residuals:
    """Residuals of all tasks, rows of the objective: joints (d), forces (k), one for nothing, torques (d), motions (t).

    A row of R is roots × the row of its quantity over (β, 1), and `shift(…)` on the last entry. Weights count in parts of the
    largest, `unit`. roots: (rows,), √weight, for momentum per mass.
    """

    def __init__(self, dynamics: Dynamics, measured: Measured, k: int, tables: tuple[Any, ...], first_row: int, targets: Array):
        self._tasks, gains, self._frames = tables
        self.unit = float(gains[:, 0].max(initial=0.0)) or 1.0
        self._gains = gains / (self.unit, 1.0, 1.0)
        self._dynamics, self._measured, self._k, self._first_row = dynamics, measured, k, first_row
        self._d, self._base = dynamics.robot.d, dynamics.robot.nv - dynamics.robot.d
        self._motions = [i for i in range(len(self._tasks)) if self._tasks[i, 0] <= FRAME]
        rows = 2 * self._d + k + 1 + 3 * len(self._motions)
        weights = np.zeros(rows)
        self._of_z, self._of_targets = np.zeros((rows, measured.z.size)), np.zeros((rows, targets.size))
        self._constant = np.zeros(rows)
        self._turning: list[tuple[Array, Array, Array, int]] = []
        self._loose: list[tuple[int, int, int]] = []
        for i, kind in enumerate(self._tasks[:, 0]):
            add = self._motion if kind <= FRAME else self._posture if kind == POSTURE else self._single
            add(i, weights)
        self.roots = np.sqrt(weights)
        per_root = np.divide(1.0, self.roots, out=np.zeros(rows), where=weights > 0.0)
        for number, i in enumerate(self._motions):
            first = rows - 3 * (len(self._motions) - number)
            self.roots[first : first + 3] /= dynamics.mass if self._tasks[i, 0] == COM else 1.0
        self._of_z *= per_root[:, None]
        self._of_targets *= per_root[:, None]
        self._constant *= per_root
        self._push, self._z = measured["push"], measured.z
        self._base_push = dynamics.views[1][:3]
        self._base_turn = dynamics.views[-1][1, :9].reshape(3, 3).T if self._base else None
        self._falls = any(self._tasks[:, 0] == COM) and not self._base
        self._given, self._still = targets, self._of_z[:, measured.first["places"] + len(measured["places"]) - 1]  # over the 1
        self._still[:] = self._constant + self._of_targets @ targets
        self._goals = [self._goal(targets, turn) for turn in self._turning]

    def _motion(self, i: int, weights: Array) -> None:
        """weight (J q̈ + J̇ q̇ - a_ff + kp e + kd ė) on the three rows of a task on the CoM, an orientation or a frame."""
        (kind, joint, at), (weight, kp, kd), number = self._tasks[i], self._gains[i], self._motions.index(i)
        rows, item = len(weights) - 3 * len(self._motions) + 3 * number + _XYZ, self._first_row + 3 * number + _XYZ
        first, z, goal = self._measured.first, self._of_z, self._of_targets
        weights[rows] = weight
        z[rows, first["moving"] + 2 * item] = weight * kd / (self._dynamics.mass if kind == COM else 1.0)
        if kind == COM and self._base:  # its drift is what gravity and the base's push leave
            z[rows, first["push"] + _XYZ] = weight / self._dynamics.mass
            self._constant[rows] = weight * self._dynamics.robot.model.gravity.linear
        elif kind == COM:
            z[rows, first["push"] + _XYZ] = weight
        else:
            z[rows, first["moving"] + 2 * item + 1] = weight
            z[rows, first["curved"] + item] = weight
        if kind == ORIENTATION:
            slot, after = 3 * len(self._turning), at + 9
            z[rows, first["errors"] + slot + _XYZ] = weight * kp
            turned, error = self._dynamics.views[-1][joint, :9].reshape(3, 3).T, self._measured["errors"][slot : slot + 3]
            self._turning.append((error, turned, self._frames[i, :9].reshape(3, 3), at))
        else:
            z[rows, first["places"] + item], after = weight * kp, at + 3
            goal[rows, at + _XYZ] = -weight * kp
        goal[rows, after + _XYZ], goal[rows, after + 3 + _XYZ] = -weight * kd, -weight

    def _posture(self, i: int, weights: Array) -> None:
        """weight (q̈_j + kp e + kd q̇) on each joint; e of joints without limits, (cos, sin) in q, is measured."""
        at, (weight, kp, kd), first = self._tasks[i, 2], self._gains[i], self._measured.first
        weights[: self._d] += weight
        for joint, (_, column, _, place, length) in enumerate(self._dynamics.tree):
            row = column - self._base
            if joint == 0 or row < 0:
                continue
            self._of_z[row, first["v"] + column] += weight * kd
            if length == 1:
                self._of_z[row, first["q"] + place] += weight * kp
                self._of_targets[row, at + place] -= weight * kp
            else:
                self._of_z[row, first["loose"] + len(self._loose)] += weight * kp
                self._loose.append((first["loose"] + len(self._loose), place, at + place))

    def _single(self, i: int, weights: Array) -> None:
        """weight (x - target) on each force or torque."""
        kind, _, at = self._tasks[i]
        first, size = (self._d, self._k) if kind == FORCE else (self._d + self._k + 1, self._d)
        rows = np.arange(size)
        weights[first + rows] += self._gains[i, 0]
        self._of_targets[first + rows, at + rows] -= self._gains[i, 0]

    @staticmethod
    def _goal(targets: Array, turn: tuple[Array, Array, Array, int]) -> Array:
        """R_frame_joint R_desiredᵀ: what the joint's rotation is multiplied by for R R_desiredᵀ."""
        _, _, frame, at = turn
        return frame.T @ targets[at : at + 9].reshape(3, 3).T

    def shift(self, q: Array, v: Array, targets: Array) -> Array | None:
        """√weight × what the residuals hold beside q̈, λ and τ, shape (rows,); None where a target is no number."""
        goals = self._goals
        if targets is not self._given:
            if not np.all(np.isfinite(targets)):
                return None
            np.add(self._constant, self._of_targets @ targets, self._still)
            goals = [self._goal(targets, turn) for turn in self._turning]
        for (error, turned, _, _), goal in zip(self._turning, goals, strict=True):
            error[:] = pin.log3(turned.dot(goal))
        for slot, a, b in self._loose:
            self._z[slot] = np.arctan2(
                q[a + 1] * targets[b] - q[a] * targets[b + 1], q[a] * targets[b] + q[a + 1] * targets[b + 1]
            )
        if self._base_turn is not None:
            self._base_turn.dot(self._base_push, self._push)
        elif self._falls:
            pin.centerOfMass(self._dynamics.robot.model, self._dynamics.data, q, v, np.zeros(v.size))
            self._push[:] = self._dynamics.data.acom[0]
        shift: Array = self._of_z.dot(self._z)
        return shift
