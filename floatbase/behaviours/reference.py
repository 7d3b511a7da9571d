"""What the tasks of a `Walk` follow: the body's path, the plan of the centre of mass, the swings,
the ramps of the loads.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import cos, inf, sin
from typing import TypeAlias

import numpy as np

from floatbase._geometry import rotation_z
from floatbase._validation import Array, frozen
from floatbase.affine import Affine
from floatbase.behaviours.gait import TIME_TOLERANCE, Gait
from floatbase.behaviours.lipm import LIPM
from floatbase.behaviours.swing import Swing
from floatbase.robots import State

Motion: TypeAlias = tuple[Array, Array, Array]  # position, velocity, acceleration
UNBOUNDED = 1e6  # N: a bound that no robot of the catalogue reaches
_MAX_ACCELERATION = 1.0  # m/s² and rad/s²: a jump of the desired velocity makes robots fall
_ZERO = frozen(np.zeros(3))
_RANK_TOLERANCE = 1e-3  # part of the feet's extent: what is thinner shows no slope


@dataclass
class SwingState:
    """A foot in the air: its path now, (3,) m where it was planned to land at first, and its yaw,
    rad, at both ends.
    """

    path: Swing
    planned_end: Array
    yaws: tuple[float, float]


@dataclass
class Reference:
    """All that a `Walk` remembers from one tick to the next, and what it makes of that.

    nominal_state: the robot's posture.
    nominal_feet: (3,) m, where each foot's frame is in it, from the middle of the feet on the
        ground.
    requested_gait, gait: the gait that was asked for, and what is walked by: that without the
        lift-offs that were over; no gait is asked for any more while feet come down for another.
    start_time, time: s, of the first and of the last tick.
    position, yaw: (2,) m, world, and rad, where the body is to be then.
    velocity: (3,) of the path: forwards, to the left, m/s, and yaw, rad/s, on their way to the
        desired ones.
    feet: (3,) m, world, of each foot's frame, where it stands or stood.
    touchdown_times: s, when each foot landed last.
    swinging: the feet in the air.
    footholds: (3,) m, world, where those that are in the air, or lift next, are to land.
    stance, stance_interval: the feet that stand, and from when until when, s; inf where no end was
        in sight.
    replan_time: s, when to plan anew though the stance stays.
    step_offset: (2,) m, by which the last step was moved.
    ground_height: (2,) m, world, to the height of the ground there, (1,) m; 0 is that below the
        posture.
    plan: of the centre of mass.
    """

    nominal_state: State
    nominal_feet: dict[str, Array]
    requested_gait: Gait | None
    gait: Gait
    start_time: float
    time: float
    position: Array
    yaw: float
    feet: dict[str, Array]
    velocity: Array = field(default_factory=lambda: np.zeros(3))
    touchdown_times: dict[str, float] = field(default_factory=dict)
    swinging: dict[str, SwingState] = field(default_factory=dict)
    footholds: dict[str, Array] = field(default_factory=dict)
    stance: tuple[str, ...] = ()
    stance_interval: tuple[float, float] = (0.0, 0.0)
    replan_time: float = inf
    step_offset: Array = field(default_factory=lambda: np.zeros(2))
    ground_height: Affine = field(default_factory=lambda: Affine.linear(np.zeros((1, 2))))
    plan: LIPM | None = None

    def predict(self, desired: Array, begin: float, t: float) -> tuple[Array, float, Array]:
        """Place, (2,) m, yaw and velocity, (3,), of the path at t in s, with a desired velocity
        (3,) from `begin` on.
        """
        time = max(0.0, t - max(self.time, begin))
        change = desired - self.velocity
        ramp_time = np.minimum(time, np.abs(change) / _MAX_ACCELERATION)  # s, of each part
        velocity = self.velocity + np.sign(change) * _MAX_ACCELERATION * ramp_time
        displacement = (self.velocity + velocity) / 2.0 * ramp_time + velocity * (time - ramp_time)
        return (
            self.position + rotated_by_yaw(displacement[:2], self.yaw + displacement[2] / 2.0),
            self.yaw + float(displacement[2]),
            velocity,
        )

    def fit_ground(self) -> None:
        """Lay the ground as a plane through the feet; a slope that they do not show, as across a
        line, counts as none.
        """
        heights = np.array(
            [self.feet[foot][2] - nominal[2] for foot, nominal in self.nominal_feet.items()]
        )
        positions = np.array([self.feet[foot][:2] for foot in self.nominal_feet])
        centroid = positions.mean(axis=0)
        slope = np.linalg.lstsq(
            positions - centroid, heights - heights.mean(), rcond=_RANK_TOLERANCE
        )[0]
        self.ground_height = Affine(slope[None], [heights.mean() - slope @ centroid])

    def on_ground(self, foot: str, xy: Array) -> Array:
        """Where a foot's frame is when it stands at (2,) m; (3,) m, world."""
        return np.array([*xy, self.nominal_feet[foot][2] + self._ground_height(xy)])

    def _ground_height(self, xy: Array) -> float:
        """Of the ground at (2,) m: `ground_height`, without its checks, as it is asked several
        times a tick.
        """
        return float(self.ground_height.A[0] @ xy + self.ground_height.b[0])

    def com_target(self, t: float) -> Motion:
        """Target of the centre of mass at t in s: the plan, at the posture's height above the
        ground.
        """
        assert self.plan is not None
        x, v, a = self.plan(t)
        slope = self.ground_height.A[0]
        height = self.nominal_state.com[2] + self._ground_height(x)
        return (
            frozen(np.array([*x, height])),
            frozen(np.array([*v, slope @ v])),
            frozen(np.array([*a, slope @ a])),
        )

    def base_target(self, t: float) -> Motion:
        """Target of the base's rotation at t in s: as in the posture, turned by the path's yaw."""
        yaw = self.yaw + self.velocity[2] * (t - self.time)
        rotation = frozen(rotation_z(yaw) @ self.nominal_state.frame_pose("base").rotation)
        return rotation, frozen(np.array([0.0, 0.0, self.velocity[2]])), _ZERO

    def foot_target(self, foot: str, t: float) -> Motion:
        """Target of a foot in the air at t in s; where it stands otherwise."""
        if foot in self.swinging:
            return self.swinging[foot].path(t)
        return self.feet[foot], np.zeros(3), np.zeros(3)

    def foot_rotation_target(self, foot: str, t: float) -> Motion:
        """Target rotation of a flat foot in the air at t [s]: flat, and turning with the path."""
        flat, each = self.nominal_state.frame_pose(foot).rotation, self.swinging.get(foot)
        if each is None:
            return rotation_z(self.yaw) @ flat, np.zeros(3), np.zeros(3)
        (first, last), up = each.yaws, np.array([0.0, 0.0, 1.0])
        part, rate, acceleration = Swing(
            np.zeros(3), (last - first) * up, each.path.lift_off, each.path.touchdown, 0.0
        )(t)
        return rotation_z(first + part[2]) @ flat, rate, acceleration

    def normal_force_bound(self, foot: str, t: float, ramp: float, full_load: float) -> float:
        """Bound of a normal force, N, at t in s: it falls from `full_load` to 0 in `ramp` s before
        the foot lifts, and rises after.

        All feet stand; the time that they do is long enough for both, or each takes half of it.
        """
        begin, end = self.stance_interval
        ramp = min(ramp, (end - begin) / 2.0)
        lifts = (
            foot in self.gait.feet
            and end < inf
            and self.gait.swing_at(foot, end + TIME_TOLERANCE) is not None
        )
        landed = self.touchdown_times.get(foot, -np.inf) >= begin - TIME_TOLERANCE
        fraction = min(
            (end - t) / ramp if lifts else np.inf, (t - begin) / ramp if landed else np.inf
        )
        return full_load * max(fraction, 0.0) if fraction < 1.0 else UNBOUNDED


def rotated_by_yaw(vector: Array, yaw: float) -> Array:
    """A horizontal vector, (2,), turned to the left by yaw, rad."""
    c, s = cos(yaw), sin(yaw)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])


def yaw_of(rotation: Array) -> float:
    """How far a rotation, (3, 3), turns to the left, rad."""
    return float(np.arctan2(rotation[1, 0], rotation[0, 0]))
