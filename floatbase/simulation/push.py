"""`Push`: a force on the robot for a while."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_instance,
    as_number,
    as_positive,
    as_string,
    checked,
    short_repr,
)
from floatbase.errors import InputError

# s: the clock is a sum of timesteps; the rounding of a minute of milliseconds is 5e-11 s
_CLOCK_TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False)
class Push(Value):
    """A force on the robot for a while.

    A timestep that the push covers in part gets that part of the force: its impulse is force times
    duration.

    force: (3,) N, world, at the origin of the frame.
    start, duration: s, on the simulation's clock.
    frame: name of a frame of the robot; "base" is the base link.
    """

    force: Array = field(metadata=checked(as_array, (3,), "N"))
    start: float = field(default=0.0, metadata=checked(as_positive, "s", allow_zero=True))
    duration: float = field(default=0.1, metadata=checked(as_positive, "s"))
    frame: str = field(default="base", metadata=checked(as_string))

    def acts_at(self, t: float) -> bool:
        """Whether the push acts at t, s."""
        t = as_number("t", t, "s")
        return self.start - _CLOCK_TOLERANCE <= t < self.start + self.duration - _CLOCK_TOLERANCE

    def active_fraction(self, t: float, timestep: float) -> float:
        """The part of the step from t to t + timestep, s, in which the push acts: 0 to 1."""
        active_time = min(self.start + self.duration, t + timestep) - max(self.start, t)
        return max(0.0, active_time) / timestep


def as_pushes(pushes: Sequence[Push]) -> tuple[Push, ...]:
    """A list of pushes as a tuple, checked."""
    if not isinstance(pushes, Sequence):
        raise InputError(
            f"pushes must be a list, as in pushes=[fb.Push(…)], not {short_repr(pushes)}."
        )
    return tuple(
        as_instance("each of the pushes", push, Push, "fb.Push([0.0, 30.0, 0.0])")
        for push in pushes
    )


def active_pushes(pushes: tuple[Push, ...], begin: float, end: float) -> tuple[Push, ...]:
    """Those that act at any time from begin to end, s."""
    return tuple(
        p
        for p in pushes
        if p.start < end - _CLOCK_TOLERANCE and begin < p.start + p.duration - _CLOCK_TOLERANCE
    )
