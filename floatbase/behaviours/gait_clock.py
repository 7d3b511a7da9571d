"""`GaitClock`: the gait that a walk uses, which follows the requested one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from floatbase.behaviours.gait import TIME_TOLERANCE, Gait


class GaitClock:
    """The gait in use: the requested gait without the lift-offs that had passed."""

    def __init__(self, requested: Gait, t: float):
        self._requested: Gait | None = requested  # None while feet come down before a change
        self.gait = requested.starting_at(t)

    def follows(self, requested: Gait) -> bool:
        """Return whether the gait in use is the requested one."""
        return self._requested is requested

    def update(
        self, requested: Gait, swinging: bool, t: float, delay: Callable[[Gait], float] | None
    ) -> bool:
        """Change to a newly requested gait once all feet stand, and return whether it changed.

        Feet that are in the air come down as planned.
        """
        if self._requested is not None and vars(requested) == vars(self._requested):
            self._requested = requested
        elif not swinging:
            gait = requested.starting_at(t)
            later = delay(gait) if delay else 0.0
            self._requested = requested
            self.gait = replace(gait, start=gait.start + later) if later else gait
            return True
        elif self.gait.stop is None or self.gait.stop > t:
            self._requested, self.gait = None, replace(self.gait, stop=t)
        return False

    def stance(self, names: Sequence[str], t: float) -> tuple[str, ...]:
        """Return the contacts among `names` that stand at t [s]."""
        swinging = {foot for foot in self.gait.feet if self.gait.swing_at(foot, t)}
        return tuple(name for name in names if name not in swinging)

    def lifts_later(self, t: float) -> bool:
        """Return whether a foot lifts off at t [s] or later."""
        begin = max(t, self.gait.start)
        return any(self.gait.next_swing(foot, begin) for foot in self.gait.feet)

    def next_change(self, t: float, replan_time: float) -> float:
        """Return when the stance changes after t, or it is time to plan anew [s].

        The result is at most 5 s later than t.
        """
        return min(self.gait.phases(t, 1)[0][1], replan_time) - TIME_TOLERANCE
