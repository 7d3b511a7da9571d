"""What the tasks of a `Walk` follow: the body's path, the plan of the centre of mass, the swings, the ramps of the loads."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import cos, inf, sin
from typing import TypeAlias

import numpy as np

from floatbase._validation import Array, frozen
from floatbase.affine import Affine
from floatbase.behaviours.gait import SAME_TIME, Gait
from floatbase.behaviours.lipm import LIPM
from floatbase.behaviours.swing import Swing
from floatbase.robots import State

Motion: TypeAlias = tuple[Array, Array, Array]  # position, velocity, acceleration
FREE = 1e6  # N: a bound that no robot of the catalogue reaches
_SPEEDING = 1.0  # m/s² and rad/s²: a jump of the desired velocity makes robots fall
_NO_VECTOR = frozen(np.zeros(3))
_THIN = 1e-3  # part of the feet's extent: what is thinner shows no slope


@dataclass
class Swinging:
    """A foot in the air: its path now, (3,) m where it was planned to land at first, and its yaw, rad, at both ends."""

    path: Swing
    planned: Array
    yaws: tuple[float, float]


@dataclass
class Reference:
    """All that a `Walk` remembers from one tick to the next, and what it makes of that.

    standing: the robot's posture.
    nominal: (3,) m, where each foot's frame is in it, from the middle of the feet on the ground.
    asked, gait: the gait that was asked for, and what is walked by: that without the lift-offs that were over; no gait is
        asked for any more while feet come down for another.
    began, time: s, of the first and of the last tick.
    place, yaw: (2,) m, world, and rad, where the body is to be then.
    velocity: (3,) of the path: forwards, to the left, m/s, and yaw, rad/s, on their way to the desired ones.
    feet: (3,) m, world, of each foot's frame, where it stands or stood.
    landed: s, when each foot landed last.
    swinging: the feet in the air.
    footholds: (3,) m, world, where those that are in the air, or lift next, are to land.
    stance, phase: the feet that stand, and from when until when, s; inf where no end was in sight.
    renew: s, when to plan anew though the stance stays.
    aside: (2,) m, by which the last step was moved.
    ground: (2,) m, world, to the height of the ground there, (1,) m; 0 is that below the posture.
    plan: of the centre of mass.
    """

    standing: State
    nominal: dict[str, Array]
    asked: Gait | None
    gait: Gait
    began: float
    time: float
    place: Array
    yaw: float
    feet: dict[str, Array]
    velocity: Array = field(default_factory=lambda: np.zeros(3))
    landed: dict[str, float] = field(default_factory=dict)
    swinging: dict[str, Swinging] = field(default_factory=dict)
    footholds: dict[str, Array] = field(default_factory=dict)
    stance: tuple[str, ...] = ()
    phase: tuple[float, float] = (0.0, 0.0)
    renew: float = inf
    aside: Array = field(default_factory=lambda: np.zeros(2))
    ground: Affine = field(default_factory=lambda: Affine.linear(np.zeros((1, 2))))
    plan: LIPM | None = None

    def moved(self, desired: Array, begin: float, t: float) -> tuple[Array, float, Array]:
        """Place, (2,) m, yaw and velocity, (3,), of the path at t in s, with a desired velocity (3,) from `begin` on."""
        time = max(0.0, t - max(self.time, begin))
        change = desired - self.velocity
        rising = np.minimum(time, np.abs(change) / _SPEEDING)  # s, of each part
        velocity = self.velocity + np.sign(change) * _SPEEDING * rising
        way = (self.velocity + velocity) / 2.0 * rising + velocity * (time - rising)
        return self.place + turned(way[:2], self.yaw + way[2] / 2.0), self.yaw + float(way[2]), velocity

    def find_ground(self) -> None:
        """Lay the ground as a plane through the feet; a slope that they do not show, as across a line, counts as none."""
        heights = np.array([self.feet[foot][2] - nominal[2] for foot, nominal in self.nominal.items()])
        places = np.array([self.feet[foot][:2] for foot in self.nominal])
        middle = places.mean(axis=0)
        slope = np.linalg.lstsq(places - middle, heights - heights.mean(), rcond=_THIN)[0]
        self.ground = Affine(slope[None], [heights.mean() - slope @ middle])

    def on_ground(self, foot: str, xy: Array) -> Array:
        """Where a foot's frame is when it stands at (2,) m; (3,) m, world."""
        return np.array([*xy, self.nominal[foot][2] + self._height(xy)])

    def _height(self, xy: Array) -> float:
        """Of the ground at (2,) m: `ground`, without its checks, as it is asked several times a tick."""
        return float(self.ground.A[0] @ xy + self.ground.b[0])

    def com(self, t: float) -> Motion:
        """Target of the centre of mass at t in s: the plan, at the posture's height above the ground."""
        assert self.plan is not None
        x, v, a = self.plan(t)
        slope = self.ground.A[0]
        height = self.standing.com[2] + self._height(x)
        return frozen(np.array([*x, height])), frozen(np.array([*v, slope @ v])), frozen(np.array([*a, slope @ a]))

    def base(self, t: float) -> Motion:
        """Target of the base's rotation at t in s: as in the posture, turned by the path's yaw."""
        yaw = self.yaw + self.velocity[2] * (t - self.time)
        rotation = frozen(about_z(yaw) @ self.standing.frame_pose("base").rotation)
        return rotation, frozen(np.array([0.0, 0.0, self.velocity[2]])), _NO_VECTOR

    def foot(self, foot: str, t: float) -> Motion:
        """Target of a foot in the air at t in s; where it stands otherwise."""
        if foot in self.swinging:
            return self.swinging[foot].path(t)
        return self.feet[foot], np.zeros(3), np.zeros(3)

    def foot_rotation(self, foot: str, t: float) -> Motion:
        """Target of a flat foot's rotation in the air at t in s: flat, and turning with the path."""
        flat, each = self.standing.frame_pose(foot).rotation, self.swinging.get(foot)
        if each is None:
            return about_z(self.yaw) @ flat, np.zeros(3), np.zeros(3)
        (first, last), up = each.yaws, np.array([0.0, 0.0, 1.0])
        part, rate, acceleration = Swing(np.zeros(3), (last - first) * up, each.path.lift, each.path.land, 0.0)(t)
        return about_z(first + part[2]) @ flat, rate, acceleration

    def load(self, foot: str, t: float, ramp: float, most: float) -> float:
        """Bound of a normal force, N, at t in s: it falls from `most` to 0 in `ramp` s before the foot lifts, and rises after.

        All feet stand; the time that they do is long enough for both, or each takes half of it.
        """
        begin, end = self.phase
        ramp = min(ramp, (end - begin) / 2.0)
        lifts = foot in self.gait.feet and end < inf and self.gait.swing_of(foot, end + SAME_TIME) is not None
        landed = self.landed.get(foot, -np.inf) >= begin - SAME_TIME
        part = min((end - t) / ramp if lifts else np.inf, (t - begin) / ramp if landed else np.inf)
        return most * max(part, 0.0) if part < 1.0 else FREE


def turned(vector: Array, yaw: float) -> Array:
    """A horizontal vector, (2,), turned to the left by yaw, rad."""
    c, s = cos(yaw), sin(yaw)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])


def about_z(yaw: float) -> Array:
    """The rotation to the left by yaw, rad, shape (3, 3)."""
    c, s = cos(yaw), sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def yaw_of(rotation: Array) -> float:
    """How far a rotation, (3, 3), turns to the left, rad."""
    return float(np.arctan2(rotation[1, 0], rotation[0, 0]))
