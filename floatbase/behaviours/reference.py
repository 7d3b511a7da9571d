"""Targets of a `Walk`'s tasks: body path, centre of mass, swings, and bounds of normal forces."""

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
_RANK_TOLERANCE = 1e-3  # fraction of the feet's extent: no slope is fitted along a smaller extent


@dataclass
class SwingState:
    """State of a foot in the air.

    Parameters
    ----------
    path : Swing
        Present path of the foot.
    planned_end : ndarray, shape (3,)
        Place where the foot was first planned to land, in the world frame [m].
    yaws : (float, float)
        Yaw of the foot at lift-off and at touchdown [rad].
    """

    path: Swing
    planned_end: Array
    yaws: tuple[float, float]


@dataclass
class Reference:
    """State of a `Walk` between control steps, and the targets that follow from it.

    Parameters
    ----------
    nominal_state : State
        State whose posture the robot keeps.
    nominal_feet : dict of str to ndarray, shape (3,)
        Position of each foot's frame in the standing posture, relative to the middle of the feet on
        the ground [m].
    requested_gait : Gait or None
        The requested gait; None while feet come down before the gait changes.
    gait : Gait
        The gait in use: the requested gait without the lift-offs that had passed.
    start_time : float
        Time of the first control step [s].
    time : float
        Time of the last control step [s].
    position : ndarray, shape (2,)
        Desired position of the body at the last control step, in the world frame [m].
    yaw : float
        Desired yaw of the body at the last control step [rad].
    feet : dict of str to ndarray, shape (3,)
        Position of each foot's frame, where it stands or last stood, in the world frame [m].
    velocity : ndarray, shape (3,)
        Velocity of the path, forwards and to the left [m/s], and yaw rate [rad/s]; it approaches
        the desired velocity.
    touchdown_times : dict of str to float
        Time of each foot's last touchdown [s].
    swinging : dict of str to SwingState
        The feet in the air.
    footholds : dict of str to ndarray, shape (3,)
        Planned foothold of each foot that is in the air or lifts off next, in the world frame [m].
    stance : tuple of str
        Feet that stand.
    stance_interval : (float, float)
        Beginning and end of the stance [s]; inf if no end is known.
    replan_time : float
        Time at which to plan anew even if the stance does not change [s].
    step_offset : ndarray, shape (2,)
        Shift of the last step, in the world frame [m].
    ground_height : Affine
        Map from a horizontal position, shape (2,), in the world frame to the height of the ground,
        shape (1,), relative to the ground below the standing posture [m].
    plan : LIPM or None
        Plan of the centre of mass.
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
        """Predict the path for a desired velocity.

        Parameters
        ----------
        desired : ndarray, shape (3,)
            Desired velocity, forwards and to the left [m/s], and yaw rate [rad/s].
        begin : float
            Time from which the velocity is desired [s].
        t : float
            Time of the prediction [s].

        Returns
        -------
        position : ndarray, shape (2,)
            Position in the world frame [m].
        yaw : float
            Yaw [rad].
        velocity : ndarray, shape (3,)
            Velocity, forwards and to the left [m/s], and yaw rate [rad/s].
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
        """Fit the plane of the ground to the feet.

        If the feet show no slope in some direction, for example because they are on a line, the
        plane is level in that direction.
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
        """Return the position of a foot's frame, (3,), if it stands at a place (2,) [m]."""
        return np.array([*xy, self.nominal_feet[foot][2] + self._ground_height(xy)])

    def _ground_height(self, xy: Array) -> float:
        """Return the ground's height at (2,) [m]: `ground_height` without its checks, for speed."""
        return float(self.ground_height.A[0] @ xy + self.ground_height.b[0])

    def com_target(self, t: float) -> Motion:
        """Return the target of the centre of mass at t [s]: the plan, at the posture's height."""
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
        """Return the target of the base's rotation at t [s]: the posture's, at the path's yaw."""
        yaw = self.yaw + self.velocity[2] * (t - self.time)
        rotation = frozen(rotation_z(yaw) @ self.nominal_state.frame_pose("base").rotation)
        return rotation, frozen(np.array([0.0, 0.0, self.velocity[2]])), _ZERO

    def foot_target(self, foot: str, t: float) -> Motion:
        """Return the target position of a foot at t [s], in the air or where it stands."""
        if foot in self.swinging:
            return self.swinging[foot].path(t)
        return self.feet[foot], np.zeros(3), np.zeros(3)

    def foot_rotation_target(self, foot: str, t: float) -> Motion:
        """Return the target rotation of a flat foot at t [s]: flat, and turning with the path."""
        flat, each = self.nominal_state.frame_pose(foot).rotation, self.swinging.get(foot)
        if each is None:
            return rotation_z(self.yaw) @ flat, np.zeros(3), np.zeros(3)
        (first, last), up = each.yaws, np.array([0.0, 0.0, 1.0])
        part, rate, acceleration = Swing(
            np.zeros(3), (last - first) * up, each.path.lift_off, each.path.touchdown, 0.0
        )(t)
        return rotation_z(first + part[2]) @ flat, rate, acceleration

    def normal_force_bound(self, foot: str, t: float, ramp: float, full_load: float) -> float:
        """Return the upper bound of a normal force while all feet stand [N].

        The bound falls from `full_load` to 0 within `ramp` [s] before the foot lifts off, and rises
        likewise after touchdown. If the stance is too short for both, each takes half of the
        stance.
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
    """Return a horizontal vector, (2,), rotated to the left by a yaw angle [rad]."""
    c, s = cos(yaw), sin(yaw)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])


def yaw_of(rotation: Array) -> float:
    """Return the yaw angle, to the left, of a rotation matrix [rad]."""
    return float(np.arctan2(rotation[1, 0], rotation[0, 0]))
