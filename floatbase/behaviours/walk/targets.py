"""Targets of a `Walk`'s tasks: the functions that define them.

`compiled_targets` computes the same numbers from arrays.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import cos, exp, sin
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._geometry import rotation_z
from floatbase._validation import Array, as_number
from floatbase.behaviours.walk.footholds import capture_point, step_adjustment
from floatbase.behaviours.walk.path import Path
from floatbase.behaviours.walk.plan import DCM_DEAD_ZONE, PlannedSwing, StepPlan
from floatbase.behaviours.walk.posture import WalkingPosture
from floatbase.behaviours.walk.swing import Swing

Motion: TypeAlias = tuple[Array, Array, Array]  # position, velocity, acceleration
# called as adjustment(plan, path, com, com_velocity, t); returns the ends of the swings, (2,) or
# (3,), in the world frame [m]
Adjustment: TypeAlias = Callable[[StepPlan, Path, Array, Array, float], Mapping[str, npt.ArrayLike]]
_LEAN_RATE = 15.0  # 1/s: the body leans with stairs 0.2 s later than they rise
UNBOUNDED = 1e6  # N: a bound that no robot in the catalogue reaches
_MAX_HEIGHT_CHANGE, _MAX_PITCH = 1.0, 1.0  # m, rad: larger numbers must be in another unit
_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Lean:
    """A pitch that approaches a goal with continuous velocity and acceleration."""

    goal: float = 0.0
    begin: float = 0.0
    difference: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __call__(self, t: float) -> tuple[float, float, float]:
        """Return the pitch at t [s], its velocity and its acceleration [rad, rad/s, rad/s²].

        The difference from the goal is e^{-rate s} (a + b s + c s²), where s begins at 0.
        """
        s, (a, b, c) = max(t - self.begin, 0.0), self.difference
        decay, value, slope = exp(-_LEAN_RATE * s), a + b * s + c * s * s, b + 2.0 * c * s
        return (
            self.goal + decay * value,
            decay * (slope - _LEAN_RATE * value),
            decay * (2.0 * c - 2.0 * _LEAN_RATE * slope + _LEAN_RATE**2 * value),
        )

    def towards(self, goal: float, t: float) -> Lean:
        """Return the lean that continues from t [s] on towards another goal [rad]."""
        now, velocity, acceleration = self(t)
        a = now - goal
        b = velocity + _LEAN_RATE * a
        c = acceleration / 2.0 + _LEAN_RATE * b - _LEAN_RATE**2 / 2.0 * a
        return Lean(goal, t, (a, b, c))


@dataclass(frozen=True, eq=False)
class BodyPose:
    """Height and pitch of the body relative to the standing posture, and how far it leans."""

    height: float
    pitch: float
    lean: Lean = field(default_factory=Lean)

    @staticmethod
    def checked(height: float, pitch: float) -> BodyPose:
        """Check a requested height [m] and pitch [rad], and return them as a pose."""
        return BodyPose(
            as_number("height", height, "m", -_MAX_HEIGHT_CHANGE, _MAX_HEIGHT_CHANGE),
            as_number("pitch", pitch, "rad", -_MAX_PITCH, _MAX_PITCH),
        )


def adjusted_ends(
    posture: WalkingPosture,
    reach: float,
    plan: StepPlan,
    path: Path,
    com: Array,
    com_velocity: Array,
    t: float,
) -> dict[str, Array]:
    """Return the ends of the swings, shifted by the error of the DCM, as far as the legs reach."""
    error = capture_point(com, com_velocity, posture.omega) - plan.plan.dcm(t)
    zone, ends = dead_zone(posture, plan), {}
    for foot, swing in plan.planned_swings.items():
        time_left = swing.path.touchdown - t
        shift = step_adjustment(error, time_left, posture.omega, zone)
        com_at_touchdown = com[:2] + com_velocity[:2] * time_left
        end: Array = swing.planned_end[:2] + shift
        end = posture.clamp_to_reach(foot, end, com_at_touchdown, path.yaw, reach)
        ends[foot] = posture.on_ground(foot, end, swing.ground)
    return ends


def dead_zone(posture: WalkingPosture, plan: StepPlan) -> float:
    """Return the error of the DCM that moves no step [m]: zero on two points."""
    return DCM_DEAD_ZONE if len(plan.stance) > 2 or posture.flat_feet else 0.0


def com_target(posture: WalkingPosture, pose: BodyPose, plan: StepPlan, t: float) -> Motion:
    """Return the target of the centre of mass at t [s]: the plan, at the posture's height."""
    x, v, a = plan.plan(t)
    slope = plan.ground.slope
    height = posture.state.com[2] + pose.height + plan.ground.height(x)
    return np.array([*x, height]), np.array([*v, slope @ v]), np.array([*a, slope @ a])


def base_target(posture: WalkingPosture, pose: BodyPose, path: Path, t: float) -> Motion:
    """Return the target of the base's rotation at t [s]: pitched from the posture's, then yawed."""
    lean, rate, acceleration = pose.lean(t)
    c, s, turning = cos(pose.pitch + lean), sin(pose.pitch + lean), path.velocity[2]
    pitched = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]) @ posture.rotation("base")
    yaw = rotation_z(path.yaw)
    forwards, left = yaw[:, 0], yaw[:, 1]
    angular_acceleration = acceleration * left - rate * turning * forwards
    return yaw @ pitched, rate * left + turning * _UP, angular_acceleration


def foot_rotation_target(
    posture: WalkingPosture, foot: str, swing: PlannedSwing, t: float
) -> Motion:
    """Return the target rotation of a flat foot in the air at t [s].

    Yaw and tilt follow a minimum-jerk profile. The angular velocity is exact for a tilt about a
    fixed axis.
    """
    parts = Swing(np.zeros(3), _UP, swing.path.lift_off, swing.path.touchdown, 0.0)(t)
    fraction, rate, acceleration = (part[2] for part in parts)
    yaw, tilt = (first + fraction * (last - first) for first, last in (swing.yaws, swing.tilts))
    turn, change = swing.yaws[1] - swing.yaws[0], swing.tilts[1] - swing.tilts[0]
    lean = pin.exp3(np.array([*tilt, 0.0]))
    axis = np.array([*change, 0.0]) + turn * lean[:, 2]
    return lean @ rotation_z(yaw) @ posture.rotation(foot), rate * axis, acceleration * axis


def normal_force_bound(plan: StepPlan, foot: str, t: float, ramp: float, full_load: float) -> float:
    """Return the upper bound of a normal force while all feet stand [N].

    The bound falls from `full_load` to 0 within `ramp` [s] before the foot lifts off, and rises
    likewise after touchdown. If the stance is too short for both, each takes half of the stance.
    """
    (begin, end), (landed, lifts) = plan.interval, plan.ramps[foot]
    ramp = min(ramp, (end - begin) / 2.0)
    fraction = min((end - t) / ramp if lifts else np.inf, (t - begin) / ramp if landed else np.inf)
    return full_load * max(fraction, 0.0) if fraction < 1.0 else UNBOUNDED
