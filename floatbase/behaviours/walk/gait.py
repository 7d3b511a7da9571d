"""`Gait`: a periodic contact schedule."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
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
from floatbase.linear_algebra import rank
from floatbase.robots import Robot, State

# s: times of a schedule that differ by less count as equal, because sums of periods are rounded
TIME_TOLERANCE = 1e-9
_MAX_PERIOD = 100.0  # s, of a period: a larger number must be in another unit
_MAX_PHASES = 1000  # periods of constant stance in one call


@lru_cache(maxsize=64)
def can_keep_flat(robot: Robot, soles: tuple[str, ...]) -> bool:
    """Return whether the legs can keep soles flat while the body moves in any direction.

    Legs with fewer than six independent joints cannot, such as legs without an ankle roll joint.
    """
    bent = State(robot, State(robot, robot.posture).integrate(np.linspace(0.1, 0.5, robot.nv)))
    return all(rank(bent.frame_jacobian(sole)[:, 6:]) == 6 for sole in soles)


@dataclass(frozen=True, eq=False)
class Gait(Value):
    """A periodic contact schedule: which foot is in the air at which time.

    Foot f lifts off at start + (n + offsets[f]) period for n = 0, 1, 2, ..., and stays in the air
    for `swing`. `trot`, `crawl`, `walk`, `pace`, `bound`, `flying_trot` and `pronk` make the usual
    gaits.

    Parameters
    ----------
    offsets : dict of str to float
        Lift-off of each foot as a fraction of the period, at least 0 and less than 1 [-]. Feet that
        are not listed never lift off.
    period : float
        Time from one lift-off of a foot to its next [s].
    swing : float
        Time that a foot spends in the air, less than the period [s].
    start : float, optional
        Time before which no foot lifts off [s].
    stop : float or None, optional
        No foot lifts off from this time on [s]; feet in the air at that time still come down. With
        None, the gait does not stop.

    Raises
    ------
    InputError
        If an offset is out of range, or if the swing is as long as the period.

    Examples
    --------
    >>> from floatbase.behaviours import Gait
    >>> gait = Gait({"left": 0.0, "right": 0.5}, period=1.0, swing=0.4)
    >>> gait.stance(0.2)
    ('right',)
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
                'offsets must map feet to fractions of the period, such as {"left": 0.0, "right": '
                "0.5}."
            )
        offsets = {
            as_string("foot", foot): as_number(f"offset of {foot}", offset)
            for foot, offset in self.offsets.items()
        }
        for foot, offset in offsets.items():
            if not 0.0 <= offset < 1.0:
                raise InputError(
                    f"The offset of {foot} is {offset:g}; it must be at least 0 and less than 1."
                )
        object.__setattr__(self, "offsets", MappingProxyType(offsets))
        if self.stop is not None:
            object.__setattr__(self, "stop", as_number("stop", self.stop, "s"))
        if self.swing > self.period - TIME_TOLERANCE:
            raise InputError(
                f"swing is {self.swing:g} s; it must be shorter than the period of "
                f"{self.period:g} s, so that each foot also stands."
            )

    @staticmethod
    def trot(robot: Robot, swing: float = 0.25, pause: float = 0.0, start: float = 1.0) -> Gait:
        """Return a trot, in which the diagonal pairs of a quadruped's feet swing alternately.

        Parameters
        ----------
        robot : Robot
            A robot with four feet.
        swing : float, optional
            Time that a foot spends in the air [s]. An error of the capture point grows by e^{ω
            swing} meanwhile, with `Walk.omega`, so low or fast robots need shorter swings.
        pause : float, optional
            Time on all feet after each swing [s].
        start : float, optional
            Time of the first lift-off [s].

        Returns
        -------
        Gait
            The gait.
        """
        front, hind = _front_and_hind_feet(robot)
        offsets = {front[0]: 0.0, hind[1]: 0.0, front[1]: 0.5, hind[0]: 0.5}
        return _in_turn(robot, offsets, 2, swing, pause, start)

    @staticmethod
    def crawl(robot: Robot, swing: float = 0.3, pause: float = 0.2, start: float = 1.0) -> Gait:
        """Return a crawl, in which a quadruped's feet swing one after the other.

        On each side, the hind foot swings before the front foot.

        Parameters
        ----------
        robot : Robot
            A robot with four feet.
        swing : float, optional
            Time that a foot spends in the air [s].
        pause : float, optional
            Time on all feet after each swing [s].
        start : float, optional
            Time of the first lift-off [s].

        Returns
        -------
        Gait
            The gait.
        """
        front, hind = _front_and_hind_feet(robot)
        offsets = {hind[0]: 0.0, front[0]: 0.25, hind[1]: 0.5, front[1]: 0.75}
        return _in_turn(robot, offsets, 4, swing, pause, start)

    @staticmethod
    def walk(
        robot: Robot,
        swing: float | None = None,
        pause: float | None = None,
        start: float | None = None,
    ) -> Gait:
        """Return a walk, in which the feet of a biped or a quadruped swing one after the other.

        A quadruped's feet swing in the order of `crawl`, without a pause. A biped on flat feet
        pauses on both feet. A biped on balls or points cannot stand still, so it begins to walk at
        once, with short swings. A biped whose legs cannot keep its soles flat, for example without
        an ankle roll joint, also makes short swings.

        Parameters
        ----------
        robot : Robot
            A robot with two or four feet.
        swing : float, optional
            Time that a foot spends in the air [s]; by default 0.25, 0.6 for a biped whose soles
            stay flat, and 0.15 for a biped on points.
        pause : float, optional
            Time on all feet after each swing [s]; by default 0, or 0.1 for a biped on flat feet.
        start : float, optional
            Time of the first lift-off [s]; by default 1, or 0 for a biped on points.

        Returns
        -------
        Gait
            The gait.
        """
        names = _foot_names(robot)
        if len(names) not in (2, 4):
            raise InputError(
                f"{robot.name} has {len(names)} feet, but Gait.walk needs two or four. Make its "
                f"gait with Gait(offsets, …)."
            )
        values: tuple[float, float, float] = (0.25, 0.0, 1.0)
        if len(names) == 2:
            soles = tuple(foot.frame for foot in robot.feet if foot.is_flat)
            flat_swing = 0.6 if can_keep_flat(robot, soles) else 0.25
            values = (flat_swing, 0.1, 1.0) if soles else (0.15, 0.0, 0.0)
        swing, pause, start = (
            default if given is None else given
            for default, given in zip(values, (swing, pause, start), strict=True)
        )
        if len(names) == 4:
            return Gait.crawl(robot, swing, pause, start)
        return _in_turn(robot, dict(zip(names, (0.0, 0.5), strict=True)), 2, swing, pause, start)

    @staticmethod
    def pace(robot: Robot, swing: float = 0.25, pause: float = 0.0, start: float = 1.0) -> Gait:
        """Return a pace, in which the left and the right feet of a quadruped swing alternately.

        The body sways to the side, which needs friction: `Walk` refuses a pace if it is too low.

        Parameters
        ----------
        robot : Robot
            A robot with four feet.
        swing : float, optional
            Time that a foot spends in the air [s].
        pause : float, optional
            Time on all feet after each swing [s].
        start : float, optional
            Time of the first lift-off [s].

        Returns
        -------
        Gait
            The gait.
        """
        front, hind = _front_and_hind_feet(robot)
        offsets = {front[0]: 0.0, hind[0]: 0.0, front[1]: 0.5, hind[1]: 0.5}
        return _in_turn(robot, offsets, 2, swing, pause, start)

    @staticmethod
    def bound(robot: Robot, swing: float = 0.25, pause: float = 0.0, start: float = 1.0) -> Gait:
        """Return a bound, in which the front and the hind feet of a quadruped swing alternately.

        The body sways forwards and backwards, which needs friction: `Walk` refuses a bound if it is
        too low.

        Parameters
        ----------
        robot : Robot
            A robot with four feet.
        swing : float, optional
            Time that a foot spends in the air [s].
        pause : float, optional
            Time on all feet after each swing [s].
        start : float, optional
            Time of the first lift-off [s].

        Returns
        -------
        Gait
            The gait.
        """
        front, hind = _front_and_hind_feet(robot)
        offsets = {front[0]: 0.0, front[1]: 0.0, hind[0]: 0.5, hind[1]: 0.5}
        return _in_turn(robot, offsets, 2, swing, pause, start)

    @staticmethod
    def flying_trot(
        robot: Robot, stance: float = 0.16, flight: float = 0.04, start: float = 1.0
    ) -> Gait:
        """Return a flying trot, in which all feet are in the air between two diagonal stances.

        `Walk` refuses this gait, because no foot stands in flight; use `MPC`.

        Parameters
        ----------
        robot : Robot
            A robot with four feet.
        stance : float, optional
            Time that a foot spends on the ground [s].
        flight : float, optional
            Time without any foot on the ground after each stance [s].
        start : float, optional
            Time of the first lift-off [s].

        Returns
        -------
        Gait
            The gait.
        """
        stance = as_positive("stance", stance, "s", maximum=_MAX_PERIOD)
        flight = as_positive("flight", flight, "s", maximum=_MAX_PERIOD)
        trot = Gait.trot(robot, stance, flight, start)
        return replace(trot, swing=stance + 2.0 * flight)

    @staticmethod
    def pronk(robot: Robot, swing: float = 0.25, pause: float = 0.25, start: float = 1.0) -> Gait:
        """Return a pronk, in which all feet of a quadruped swing together.

        The robot flies during each swing, so `Walk` refuses this gait; use `MPC`.

        Parameters
        ----------
        robot : Robot
            A robot with four feet.
        swing : float, optional
            Time that a foot spends in the air [s].
        pause : float, optional
            Time on all feet after each swing [s].
        start : float, optional
            Time of the first lift-off [s].

        Returns
        -------
        Gait
            The gait.
        """
        offsets = dict.fromkeys(
            _front_and_hind_feet(robot)[0] + _front_and_hind_feet(robot)[1], 0.0
        )
        return _in_turn(robot, offsets, 1, swing, pause, start)

    @property
    def feet(self) -> tuple[str, ...]:
        """Names of the feet."""
        return tuple(self.offsets)

    def swing_at(self, foot: str, t: float) -> tuple[float, float] | None:
        """Return the swing of a foot that is in the air at a given time.

        Parameters
        ----------
        foot : str
            Name of the foot.
        t : float
            The time [s].

        Returns
        -------
        (float, float) or None
            Times of lift-off and touchdown [s]; None if the foot stands.
        """
        t, first_lift_off = as_number("t", t, "s"), self._first_lift_off(foot)
        cycles = floor((t + TIME_TOLERANCE - first_lift_off) / self.period)
        lift_off = first_lift_off + cycles * self.period
        touchdown = lift_off + self.swing
        swinging = cycles >= 0 and t < touchdown - TIME_TOLERANCE
        return (lift_off, touchdown) if swinging and self._allows_lift_off(lift_off) else None

    def stance(self, t: float) -> tuple[str, ...]:
        """Return the feet that stand at a given time.

        Parameters
        ----------
        t : float
            The time [s].

        Returns
        -------
        tuple of str
            Names of the feet.
        """
        return tuple(foot for foot in self.offsets if self.swing_at(foot, t) is None)

    def next_swing(self, foot: str, t: float) -> tuple[float, float] | None:
        """Return the first swing of a foot that begins at a given time or later.

        Parameters
        ----------
        foot : str
            Name of the foot.
        t : float
            The time [s].

        Returns
        -------
        (float, float) or None
            Times of lift-off and touchdown [s]; None if there are no more swings.
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
        """Return the next periods of constant stance.

        Parameters
        ----------
        t : float
            Time at which the search starts [s].
        n : int
            Largest number of periods.
        max_duration : float, optional
            A stance that lasts longer is cut off at this duration, and the list ends there [s].

        Returns
        -------
        list of (float, float, tuple of str)
            Beginning, end [s] and standing feet of each period.
        """
        n = as_integer("n", n, 1, _MAX_PHASES)
        t = as_number("t", t, "s")
        max_duration = as_positive("max_duration", max_duration, "s")
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
        """Return the same gait without the lift-offs before a given time.

        A foot that would be in the air at that time stands until its next lift-off.

        Parameters
        ----------
        t : float
            The time [s].

        Returns
        -------
        Gait
            The gait.
        """
        if as_number("t", t, "s") <= self.start:
            return self
        almost_one = 1.0 - TIME_TOLERANCE / self.period
        offsets = dict(self.offsets)
        for foot in offsets:
            offset = (self._first_lift_off(foot) - t) / self.period % 1.0
            offsets[foot] = 0.0 if offset >= almost_one else offset
        return replace(self, offsets=offsets, start=t)

    def _allows_lift_off(self, time: float) -> bool:
        """Return whether feet may lift off at a time [s]."""
        return self.stop is None or time < self.stop - TIME_TOLERANCE

    def _first_lift_off(self, foot: str) -> float:
        """Return when a foot would first lift off if the gait did not stop [s]."""
        if not isinstance(foot, str) or foot not in self.offsets:
            raise unknown_name("foot", foot, self.offsets)
        return self.start + self.offsets[foot] * self.period

    def _next_contact_change(self, t: float) -> float:
        """Return when a foot next lifts off or lands after a time [s]."""
        times = [inf]
        for foot in self.offsets:
            current = self.swing_at(foot, t)
            upcoming = self.next_swing(foot, t + 2.0 * TIME_TOLERANCE)
            times += [current[1]] if current else []
            times += [upcoming[0]] if upcoming else []
        return min(times)


def flight_offset(gait: Gait) -> float | None:
    """Return the fraction of the period at which all feet are in the air; None if one stands.

    It suffices to check each lift-off: the fewest feet stand when one has just lifted off.
    """
    endless = replace(gait, stop=None)
    if any(gait.next_swing(foot, gait.start) for foot in gait.feet):
        for offset in gait.offsets.values():
            if not endless.stance(gait.start + (1.0 + offset) * gait.period):
                return offset
    return None


def check_always_supported(gait: Gait) -> None:
    """Raise `InputError` for a gait that has all feet in the air at some time.

    All contacts are assumed to be feet of the gait.
    """
    offset = flight_offset(gait)
    if offset is not None:
        raise InputError(
            f"This gait has all feet in the air at the fraction {offset:g} of its period. At least "
            "one foot must stand at any time. Use other offsets or a shorter swing, or use MPC, "
            "which can fly."
        )


def _in_turn(
    robot: Robot, offsets: Mapping[str, float], n: int, swing: float, pause: float, start: float
) -> Gait:
    """Return a gait with n swings in turn, each followed by a pause [s]."""
    swing = as_positive("swing", swing, "s", maximum=_MAX_PERIOD)
    step = swing + as_positive("pause", pause, "s", allow_zero=True)
    return Gait({foot: offsets[foot] for foot in _foot_names(robot)}, n * step, swing, start)


def _foot_names(robot: Robot) -> tuple[str, ...]:
    """Return the names of a robot's feet."""
    return tuple(foot.frame for foot in as_instance("robot", robot, Robot).feet)


def _front_and_hind_feet(robot: Robot) -> tuple[tuple[str, str], tuple[str, str]]:
    """Return the front feet and the hind feet of a quadruped, left before right."""
    names = _foot_names(robot)
    if len(names) != 4:
        raise InputError(
            f"{robot.name} has {len(names)} feet, but this gait needs four. For two feet, use "
            f"Gait.walk."
        )
    standing = robot.standing()
    positions = {name: standing.point(name) for name in names}
    by_x = sorted(names, key=lambda name: -positions[name][0])
    rows = [sorted(pair, key=lambda name: -positions[name][1]) for pair in (by_x[:2], by_x[2:])]
    if not all(np.sign(positions[left][1]) > np.sign(positions[right][1]) for left, right in rows):
        raise InputError(
            f"{robot.name} does not have two feet on the left and two on the right. Make its gait "
            f"with Gait(offsets, …)."
        )
    return (rows[0][0], rows[0][1]), (rows[1][0], rows[1][1])
