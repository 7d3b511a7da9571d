"""`Push`: a force on the robot for a limited time."""

from __future__ import annotations

import math
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
    """A constant force on the robot for a limited time.

    If the push covers only a fraction of a timestep, that fraction of the force acts during the
    step. The impulse is therefore always force times duration.

    Parameters
    ----------
    force : array_like, shape (3,)
        Force in the world frame, applied at the origin of `frame` [N].
    start : float, optional
        Time at which the push begins, on the simulation's clock [s].
    duration : float, optional
        Duration of the push [s].
    frame : str, optional
        Name of a frame of the robot; "base" is the base link.

    Examples
    --------
    >>> import floatbase as fb
    >>> push = fb.Push([0.0, 30.0, 0.0], start=0.5)
    >>> push.acts_at(0.55), push.acts_at(0.65)
    (True, False)
    """

    force: Array = field(metadata=checked(as_array, (3,), "N"))
    start: float = field(default=0.0, metadata=checked(as_positive, "s", allow_zero=True))
    duration: float = field(default=0.1, metadata=checked(as_positive, "s"))
    frame: str = field(default="base", metadata=checked(as_string))

    @staticmethod
    def horizontal(
        force: float, towards: float, start: float = 0.0, duration: float = 0.1, frame: str = "base"
    ) -> Push:
        """Return a horizontal push with a magnitude and a direction.

        Parameters
        ----------
        force : float
            Magnitude of the force; a negative force pushes in the opposite direction [N].
        towards : float
            Direction of the push: 0 is along the world's x axis, 90 along its y axis [°].
        start : float, optional
            Time at which the push begins, on the simulation's clock [s].
        duration : float, optional
            Duration of the push [s].
        frame : str, optional
            Name of a frame of the robot; "base" is the base link.

        Returns
        -------
        Push
            The push.

        Raises
        ------
        InputError
            If an argument is not a number, or is out of range.

        Examples
        --------
        >>> import floatbase as fb
        >>> fb.Push.horizontal(30.0, 90.0).force.round(6)
        array([ 0., 30.,  0.])
        """
        force = as_number("force", force, "N")
        angle = math.radians(as_number("towards", towards, "degrees"))
        vector = [force * math.cos(angle), force * math.sin(angle), 0.0]
        return Push(vector, start, duration, frame)  # type: ignore[arg-type]

    def acts_at(self, t: float) -> bool:
        """Return whether the push acts at a given time.

        Parameters
        ----------
        t : float
            Time on the simulation's clock [s].

        Returns
        -------
        bool
            True from `start` on, and before `start + duration`.
        """
        t = as_number("t", t, "s")
        return self.start - _CLOCK_TOLERANCE <= t < self.start + self.duration - _CLOCK_TOLERANCE

    def active_fraction(self, t: float, timestep: float) -> float:
        """Return the fraction of a timestep during which the push acts.

        Parameters
        ----------
        t : float
            Time at which the step begins [s].
        timestep : float
            Length of the step [s].

        Returns
        -------
        float
            Fraction from 0 to 1 [-].
        """
        active_time = min(self.start + self.duration, t + timestep) - max(self.start, t)
        return max(0.0, active_time) / timestep


def as_pushes(pushes: Sequence[Push]) -> tuple[Push, ...]:
    """Return a list of pushes as a tuple, checked."""
    if not isinstance(pushes, Sequence):
        raise InputError(
            f"pushes must be a list, as in pushes=[fb.Push(…)], not {short_repr(pushes)}."
        )
    example = "fb.Push([0.0, 30.0, 0.0])"
    return tuple(as_instance("each of the pushes", push, Push, example) for push in pushes)


def active_pushes(pushes: tuple[Push, ...], begin: float, end: float) -> tuple[Push, ...]:
    """Return the pushes that act at any time from `begin` to `end` [s]."""
    begin, end = begin + _CLOCK_TOLERANCE, end - _CLOCK_TOLERANCE
    return tuple(p for p in pushes if p.start < end and begin < p.start + p.duration)
