"""`Progress`: what a walk remembers between control steps, and `GaitClock`, the gait in use."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from math import inf

from floatbase.behaviours.walk.active_plan import ActivePlan
from floatbase.behaviours.walk.gait import TIME_TOLERANCE, Gait
from floatbase.behaviours.walk.path import DesiredMotion, Path
from floatbase.behaviours.walk.plan import StepPlan
from floatbase.behaviours.walk.targets import Lean

_RESTART_GAP = 0.2  # s without a call, after which another controller may have moved the robot
_HISTORY_LENGTH = 500  # changes of stance that are kept: two minutes of a trot, 4 MB


class GaitClock:
    """The gait in use: the requested gait without the lift-offs before its selection."""

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


@dataclass(eq=False)
class Progress:
    """What a walk remembers from one control step to the next, until it starts again."""

    time: float = -inf  # of the last control step [s]
    start_time: float = -inf
    next_change: float = -inf
    lean: Lean = field(default_factory=Lean)  # of the body with the slope of a known ground
    active: ActivePlan | None = None
    planning_path: Path | None = None  # while a plan is being made
    history: deque[StepPlan] = field(default_factory=lambda: deque(maxlen=_HISTORY_LENGTH))
    # set by the first control step
    clock: GaitClock = field(init=False)
    desired: DesiredMotion = field(init=False)

    def continues(self, t: float) -> bool:
        """Return whether a time [s] follows the last control step, so that the walk continues."""
        follows = self.time - TIME_TOLERANCE <= t <= self.time + _RESTART_GAP
        return self.active is not None and t > self.start_time and follows
