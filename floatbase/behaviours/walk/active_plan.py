"""`ActivePlan`: a plan in use, whose targets are written in each control step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from types import ModuleType
from typing import Any, cast

import numpy as np

from floatbase._validation import Array, as_array
from floatbase.behaviours.walk.lipm import LIPM
from floatbase.behaviours.walk.path import DesiredMotion, Path
from floatbase.behaviours.walk.plan import StepPlan
from floatbase.behaviours.walk.posture import MIN_SIDE_FRACTION, WalkingPosture
from floatbase.behaviours.walk.swing import Swing, SwingPath
from floatbase.behaviours.walk.targets import (
    Adjustment,
    BodyPose,
    adjusted_ends,
    base_target,
    com_target,
    dead_zone,
    foot_rotation_target,
)
from floatbase.control.tick import announce_if_slow


@dataclass(eq=False)
class ActivePlan:
    """A plan in use: the path and the ends of its swings move from one control step to the next.

    The functions of `targets` define what `write` writes. If the plan has the usual form, one
    compiled function writes the same numbers.
    """

    posture: WalkingPosture
    plan: StepPlan
    desired: DesiredMotion
    pose: BodyPose
    reach: float
    entries: Mapping[str, slice]
    adjustment: Adjustment | None = None
    compiled: bool = True

    def __post_init__(self) -> None:
        plan = self.plan
        self._path, self._swings = plan.path, plan.swings
        usual = type(plan.plan) is LIPM and plan.plan.omega == self.posture.omega
        usual &= all(type(path) is Swing for path in self._swings.values())
        usual &= self.compiled and self.adjustment is None
        self._numbers = _compiled_module() if usual else None
        if self._numbers:
            self._write = self._numbers.write_targets
            self._body = self._pack_body(self._numbers)
            self._pieces = np.array(cast(LIPM, plan.plan).pieces)
            self._rows = self._pack_swings(self._numbers)

    @property
    def path(self) -> Path:
        """The body's path at the last control step."""
        numbers = self._numbers
        if numbers is None:
            return self._path
        position = self._body[numbers.POSITION : numbers.POSITION + 2].copy()
        velocity = self._body[numbers.VELOCITY : numbers.VELOCITY + 3].copy()
        time, yaw = float(self._body[numbers.TIME]), float(self._body[numbers.YAW])
        return Path(time, position, yaw, velocity)

    @property
    def swings(self) -> dict[str, SwingPath]:
        """Present paths of the feet in the air."""
        numbers = self._numbers
        if numbers is None:
            return self._swings
        return {
            foot: path.with_end(row[numbers.END : numbers.END + 3].copy())
            for (foot, path), row in zip(self._swings.items(), self._rows, strict=True)
        }

    def changed(self, desired: DesiredMotion, pose: BodyPose) -> ActivePlan:
        """Return the same plan in its present state with another desired motion and pose."""
        swings, planned = self.swings, self.plan.planned_swings
        moved = {foot: replace(swing, path=swings[foot]) for foot, swing in planned.items()}
        now = replace(self.plan, path=self.path, planned_swings=moved)
        other = replace(self, plan=now, desired=desired, pose=pose)
        other.plan = self.plan
        return other

    def write(self, t: float, com: Array, com_velocity: Array, out: Array) -> None:
        """Move to a time, and write the targets of one control step."""
        if self._numbers is not None:
            self._write(t, com, com_velocity, self._body, self._pieces, self._rows, out)
        else:
            self._write_reference(t, com, com_velocity, out)

    def _write_reference(self, t: float, com: Array, com_velocity: Array, out: Array) -> None:
        """Write the targets by the functions that define them."""
        posture, plan = self.posture, self.plan
        path = self._path = self._path.moved(self.desired, t)
        if self.adjustment is None:
            ends = adjusted_ends(posture, self.reach, plan, path, com, com_velocity, t)
        else:
            # copies, since users may keep them
            ends = self._user_ends(path, com.copy(), com_velocity.copy(), t)
        self._swings = {
            foot: swing.with_end(ends[foot]) if foot in ends else swing
            for foot, swing in self._swings.items()
        }
        motions = {
            "centre of mass": com_target(posture, self.pose, plan, t),
            "orientation of base": base_target(posture, self.pose, path, t),
        }
        for foot, swing in self._swings.items():
            motions[f"position of {foot}"] = swing(t)
            if foot in posture.flat_feet:
                motions[f"orientation of {foot}"] = foot_rotation_target(
                    posture, foot, plan.planned_swings[foot], t
                )
        for name, motion in motions.items():
            out[self.entries[name]] = np.concatenate([np.ravel(part) for part in motion])

    def _user_ends(self, path: Path, com: Array, com_velocity: Array, t: float) -> dict[str, Array]:
        """Return the ends of swings by the user-defined adjustment, each of shape (3,) [m]."""
        assert self.adjustment is not None
        ends = {}
        for foot, end in self.adjustment(self.plan, path, com, com_velocity, t).items():
            position = as_array(f"the adjusted foothold of {foot}", end, (None,), "m")
            if foot in self._swings:
                ground = self.plan.planned_swings[foot].ground
                if len(position) == 2:
                    position = self.posture.on_ground(foot, position, ground)
                ends[foot] = as_array(f"the adjusted foothold of {foot}", position, (3,), "m")
        return ends

    def _pack_body(self, numbers: Any) -> Array:
        """Return the array `body` of `compiled_targets`."""
        posture, plan, path = self.posture, self.plan, self._path
        desired, lean = self.desired, self.pose.lean
        body = np.zeros(numbers.BODY_SIZE)
        for first, values in (
            (numbers.TIME, (path.time, *path.position, path.yaw, *path.velocity)),
            (numbers.FIRST, desired.first),
            (numbers.LATER, desired.later),
            (numbers.FIRST_UNTIL, (desired.first_until, desired.begin)),
            (numbers.ACCELERATION, desired.acceleration),
            (numbers.OMEGA, (posture.omega, posture.state.com[2] + self.pose.height)),
            (numbers.GROUND, (*plan.ground.slope, plan.ground.level)),
            (numbers.DEAD_ZONE, (dead_zone(posture, plan), self.reach, MIN_SIDE_FRACTION)),
            (numbers.COM_ENTRY, (self.entries["centre of mass"].start,)),
            (numbers.BASE_ENTRY, (self.entries["orientation of base"].start,)),
            (numbers.BASE_ROTATION, posture.rotation("base").ravel()),
            (numbers.PITCH, (self.pose.pitch + lean.goal, lean.begin, *lean.difference)),
        ):
            body[first : first + len(values)] = values
        return body

    def _pack_swings(self, numbers: Any) -> Array:
        """Return the array `swings` of `compiled_targets`."""
        posture = self.posture
        rows = np.zeros((len(self._swings), numbers.SWING_SIZE))
        for row, (foot, planned) in zip(rows, self.plan.planned_swings.items(), strict=True):
            path: Any = planned.path
            (yaw, last_yaw), (tilt, last_tilt) = planned.yaws, planned.tilts
            rotation = -1
            if foot in posture.flat_feet:
                rotation = self.entries[f"orientation of {foot}"].start
            for first, values in (
                (numbers.START, path.start),
                (numbers.PLANNED_END, planned.planned_end[:2]),
                (numbers.END, path.end),
                (numbers.LIFT_OFF, (path.lift_off, path.touchdown, path.height)),
                (numbers.NOMINAL, posture.nominal_feet[foot]),
                (numbers.LANDING, (*planned.ground.slope, planned.ground.level)),
                (numbers.FIRST_YAW, (yaw, last_yaw - yaw)),
                (numbers.FIRST_TILT, tilt),
                (numbers.TILT_CHANGE, last_tilt - tilt),
                (numbers.FOOT_ROTATION, posture.rotation(foot).ravel()),
                (numbers.POSITION_ENTRY, (self.entries[f"position of {foot}"].start, rotation)),
            ):
                row[first : first + len(values)] = values
        return rows


def _compiled_module() -> ModuleType:
    """Return the module of the compiled function, which loads numba."""
    from floatbase.behaviours.walk import compiled_targets

    return compiled_targets


@cache
def compile_targets() -> None:
    """Compile the function that writes the targets, or load it from disk, outside the loop."""
    numbers: Any = _compiled_module()
    body, pieces = np.zeros(numbers.BODY_SIZE), np.zeros((1, numbers.PIECE_SIZE))
    body[numbers.ACCELERATION : numbers.OMEGA + 1] = 1.0
    body[numbers.BASE_ENTRY] = 9.0
    swings, out = np.zeros((0, numbers.SWING_SIZE)), np.zeros(24)
    with announce_if_slow("floatbase is compiling the targets of its walks. This happens once."):
        numbers.write_targets(0.0, np.zeros(3), np.zeros(3), body, pieces, swings, out)
