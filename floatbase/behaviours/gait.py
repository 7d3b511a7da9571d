"""`Gait`: which foot is in the air when."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import floor, inf
from types import MappingProxyType

import numpy as np

from floatbase._validation import (
    Value,
    as_instance,
    as_integer,
    as_number,
    as_positive,
    as_string,
    checked,
)
from floatbase.errors import InputError, unknown_name
from floatbase.robots import Robot

# s: times of a schedule that differ by less are the same; sums of periods round
TIME_TOLERANCE = 1e-9
_MAX_PERIOD = 100.0  # s, of a period: more is a slip of units
_MAX_PHASES = 1000  # asked for at once


@dataclass(frozen=True, eq=False)
class Gait(Value):
    """A contact schedule: foot f is in the air for `swing` s from start + (n + offsets[f]) period
    on, n = 0, 1, 2, …

    offsets: for each foot the part of the period at which it lifts, from 0 to 1; feet that are not
        among them never lift.
    period: s, from one lift-off of a foot to its next.
    swing: s, for which a foot is in the air, less than the period.
    start: s, before which no foot lifts.
    stop: s, from which on no foot lifts any more; one that is in the air then still comes down.
        None: it goes on.

    `trot`, `crawl` and `walk` make the usual ones. Raises `InputError` for numbers that do not fit.
    """

    offsets: Mapping[str, float]
    period: float = field(metadata=checked(as_positive, "s", maximum=_MAX_PERIOD))
    swing: float = field(metadata=checked(as_positive, "s", maximum=_MAX_PERIOD))
    start: float = field(default=0.0, metadata=checked(as_number, "s"))
    stop: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.offsets, Mapping) or not self.offsets:
            raise InputError(
                'offsets must be a mapping from feet to parts of the period, such as {"left": 0.0, '
                '"right": 0.5}.'
            )
        offsets = {
            as_string("foot", foot): as_number(f"offset of {foot}", offset)
            for foot, offset in self.offsets.items()
        }
        for foot, offset in offsets.items():
            if not 0.0 <= offset < 1.0:
                raise InputError(
                    f"the offset of {foot} is {offset:g}; it must be from 0 to less than 1."
                )
        object.__setattr__(self, "offsets", MappingProxyType(offsets))
        if self.stop is not None:
            object.__setattr__(self, "stop", as_number("stop", self.stop, "s"))
        if self.swing > self.period - TIME_TOLERANCE:
            raise InputError(
                f"swing is {self.swing:g} s of a period of {self.period:g} s; each foot must stand "
                f"for a while."
            )

    @staticmethod
    def trot(robot: Robot, swing: float = 0.25, pause: float = 0.0, start: float = 1.0) -> Gait:
        """Diagonal pairs of a quadruped in turns, with a pause on all feet after each swing; all
        times in s.
        """
        front, hind = _front_and_hind_feet(robot)
        step = as_positive("swing", swing, "s") + as_positive("pause", pause, "s", allow_zero=True)
        offsets = {front[0]: 0.0, hind[1]: 0.0, front[1]: 0.5, hind[0]: 0.5}
        return Gait({foot: offsets[foot] for foot in _foot_names(robot)}, 2.0 * step, swing, start)

    @staticmethod
    def crawl(robot: Robot, swing: float = 0.3, pause: float = 0.2, start: float = 1.0) -> Gait:
        """One foot of a quadruped after the other, hind before front on each side, with a pause
        after each; times in s.
        """
        front, hind = _front_and_hind_feet(robot)
        step = as_positive("swing", swing, "s") + as_positive("pause", pause, "s", allow_zero=True)
        offsets = {hind[0]: 0.0, front[0]: 0.25, hind[1]: 0.5, front[1]: 0.75}
        return Gait({foot: offsets[foot] for foot in _foot_names(robot)}, 4.0 * step, swing, start)

    @staticmethod
    def walk(robot: Robot, swing: float = 0.6, pause: float = 0.1, start: float = 1.0) -> Gait:
        """The two feet of a biped in turns, with a pause on both after each swing; times in s."""
        names = _foot_names(robot)
        if len(names) != 2:
            raise InputError(
                f"{robot.name} has {len(names)} feet; Gait.walk is for two. Gait.trot and "
                f"Gait.crawl are for four."
            )
        step = as_positive("swing", swing, "s") + as_positive("pause", pause, "s", allow_zero=True)
        return Gait(dict(zip(names, (0.0, 0.5), strict=True)), 2.0 * step, swing, start)

    @property
    def feet(self) -> tuple[str, ...]:
        """Names of the feet."""
        return tuple(self.offsets)

    def swing_at(self, foot: str, t: float) -> tuple[float, float] | None:
        """When a foot lifted and when it lands, s, if it is in the air at time t, s; None if it
        stands.
        """
        t, first_lift_off = as_number("t", t, "s"), self._first_lift_off(foot)
        cycles = floor((t + TIME_TOLERANCE - first_lift_off) / self.period)
        lift_off = first_lift_off + cycles * self.period
        swinging = (
            cycles >= 0
            and t < lift_off + self.swing - TIME_TOLERANCE
            and self._allows_lift_off(lift_off)
        )
        return (lift_off, lift_off + self.swing) if swinging else None

    def stance(self, t: float) -> tuple[str, ...]:
        """The feet that stand at time t, s."""
        return tuple(foot for foot in self.offsets if self.swing_at(foot, t) is None)

    def next_swing(self, foot: str, t: float) -> tuple[float, float] | None:
        """The first swing of a foot that begins at time t, s, or later, as (lift_off, touchdown),
        s; None where there is none.
        """
        t, first_lift_off = as_number("t", t, "s"), self._first_lift_off(foot)
        lift_off = (
            first_lift_off
            + max(0, -floor((first_lift_off - t + TIME_TOLERANCE) / self.period)) * self.period
        )
        return (lift_off, lift_off + self.swing) if self._allows_lift_off(lift_off) else None

    def phases(
        self, t: float, n: int, max_duration: float = 5.0
    ) -> list[tuple[float, float, tuple[str, ...]]]:
        """The next n times of one stance from t on, as (begin, end, standing feet), s; one that
        does not end is cut.

        max_duration: s, after which a stance is cut, and the list ends.
        """
        n, t, max_duration = (
            as_integer("n", n, 1, _MAX_PHASES),
            as_number("t", t, "s"),
            as_positive("max_duration", max_duration, "s"),
        )
        phases: list[tuple[float, float, tuple[str, ...]]] = []
        while len(phases) < n:
            end = self._next_contact_change(t)
            stance = self.stance(t)
            if end - t > max_duration:
                return [*phases, (t, t + max_duration, stance)]
            phases.append((t, end, stance))
            t = end
        return phases

    def starting_at(self, t: float) -> Gait:
        """The same lift-offs, but for those before time t, s: what would be in the air then stands
        until it lifts next.
        """
        if as_number("t", t, "s") <= self.start:
            return self
        almost_one = 1.0 - TIME_TOLERANCE / self.period
        offsets = {
            foot: (self._first_lift_off(foot) - t) / self.period % 1.0 for foot in self.offsets
        }
        return replace(
            self,
            offsets={
                foot: 0.0 if offset >= almost_one else offset for foot, offset in offsets.items()
            },
            start=t,
        )

    def _allows_lift_off(self, time: float) -> bool:
        return self.stop is None or time < self.stop - TIME_TOLERANCE

    def _first_lift_off(self, foot: str) -> float:
        """When a foot lifts first, s, if the gait goes on until then."""
        if not isinstance(foot, str) or foot not in self.offsets:
            raise unknown_name("foot", foot, self.offsets)
        return self.start + self.offsets[foot] * self.period

    def _next_contact_change(self, t: float) -> float:
        """When a foot lifts or lands next after t, s."""
        times = [inf]
        for foot in self.offsets:
            current, upcoming = (
                self.swing_at(foot, t),
                self.next_swing(foot, t + 2.0 * TIME_TOLERANCE),
            )
            times += [current[1]] if current else []
            times += [upcoming[0]] if upcoming else []
        return min(times)


def check_always_supported(gait: Gait) -> None:
    """Raise `InputError` for a gait of all feet that lifts them all at once: fewest stand when one
    has just lifted.
    """
    if not any(gait.next_swing(foot, gait.start) for foot in gait.feet):
        return
    endless = replace(gait, stop=None)
    for offset in gait.offsets.values():
        if not endless.stance(gait.start + (1.0 + offset) * gait.period):
            raise InputError(
                f"this gait has all feet in the air at {offset:g} of its period; one must stand at "
                f"any time, as running is not "
                "built: give feet other offsets, or a shorter swing."
            )


def _foot_names(robot: Robot) -> tuple[str, ...]:
    return tuple(foot.frame for foot in as_instance("robot", robot, Robot).feet)


def _front_and_hind_feet(robot: Robot) -> tuple[tuple[str, str], tuple[str, str]]:
    """The front feet and the hind feet of a quadruped, left before right."""
    names = _foot_names(robot)
    if len(names) != 4:
        raise InputError(
            f"{robot.name} has {len(names)} feet; this gait is for four. Gait.walk is for two."
        )
    standing = robot.standing()
    positions = {name: standing.point(name) for name in names}
    by_x = sorted(names, key=lambda name: -positions[name][0])
    rows = [sorted(pair, key=lambda name: -positions[name][1]) for pair in (by_x[:2], by_x[2:])]
    if not all(np.sign(positions[left][1]) > np.sign(positions[right][1]) for left, right in rows):
        raise InputError(
            f"{robot.name} does not stand on two feet to the left and two to the right: make its "
            f"Gait by offsets."
        )
    return (rows[0][0], rows[0][1]), (rows[1][0], rows[1][1])
