"""`Stand`: stands, and steps when it must."""

from __future__ import annotations

from dataclasses import replace
from math import inf
from typing import Any

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array, as_instance, as_number, as_positive
from floatbase.behaviours.footholds import capture_point, support_margin
from floatbase.behaviours.gait import Gait, check_that_one_stands
from floatbase.behaviours.walk import Walk
from floatbase.control import Command
from floatbase.dynamics import Contacts
from floatbase.errors import InputError
from floatbase.robots import Robot, State

_SLOW = 0.1  # m/s of the centre of mass, below which it stops stepping
_CLEARLY = 0.05  # m by which other feet must be nearer to the capture point for the gait to begin with those that then lift


class Stand(Walk):
    """Stands where it is; with `steps` it walks in place once the capture point comes near the edge of the feet, until slow.

    It begins where in its period the feet that stay can stop the capture point: those that it runs away from lift first.

    robot, contacts, options: as for `Walk`.
    steps: the gait to step by, such as `Gait.trot(robot)`, whose start and stop do not count; None to stand only.
    margin: m, from the capture point to the edge of the support region, below which it steps.
    """

    def __init__(self, robot: Robot, contacts: Contacts, steps: Gait | None = None, *, margin: float = 0.03, **options: Any):
        gait = Gait(dict.fromkeys(as_instance("contacts", contacts, Contacts).names, 0.0), 1.0, 0.5) if steps is None else steps
        self._never = replace(as_instance("steps", gait, Gait, "Gait.trot(robot)"), start=0.0, stop=0.0)
        self.steps, self.margin = steps, as_positive("margin", margin, "m", allow_zero=True, maximum=1.0)
        if {"velocity", "yaw_rate", "gait"} & set(options):
            raise InputError("a Stand goes nowhere, and has no velocity, yaw_rate or gait: give it steps, or make a Walk.")
        super().__init__(robot, contacts, self._never, **options)
        if steps is not None and len(steps.feet) == len(contacts):
            check_that_one_stands(replace(steps, stop=None))

    @property
    def stepping(self) -> bool:
        """Whether it steps now."""
        return self.gait is not self._never

    def __call__(self, q: npt.ArrayLike, v: npt.ArrayLike, t: float = 0.0) -> Command:
        """The tick: torques for configuration q, shape (nq,), and velocity v, shape (nv,), at time t in s."""
        t = as_number("t", t, "s")
        if self.steps is not None and self._goes_on(t):
            self._decide(State(self.robot, q, v), t, self.steps)
        return super().__call__(q, v, t)

    def _begin(self, state: State, t: float) -> None:
        self.gait = self._never
        super()._begin(state, t)

    def _decide(self, state: State, t: float, steps: Gait) -> None:
        """Begin to step, or end it."""
        now = self._now
        if not self.stepping:
            dcm = capture_point(state.com, state.com_velocity, self.omega)
            if support_margin(dcm, self._all.positions(state)[:, :2]) < self.margin:
                self.gait = replace(self._begun(steps, state, dcm), start=t, stop=None)
        elif self.gait.stop is None:
            slow = np.linalg.norm(state.com_velocity[:2]) < _SLOW
            if slow and t > self.gait.start + self.gait.period:
                self.gait = replace(self.gait, stop=t)
        elif not now.swinging:
            self.gait = self._never

    def _begun(self, steps: Gait, state: State, dcm: Array) -> Gait:
        """The gait, begun where in its period the feet that stay are clearly nearer to the capture point, (2,) m."""
        from_zero = replace(steps, start=0.0, stop=None)
        own, *others = (from_zero.after(part * steps.period) for part in sorted(set(steps.offsets.values())))

        def margin(gait: Gait) -> float:
            stay = [name for name in self._all.names if gait.offsets.get(name) != 0.0]
            return support_margin(dcm, self._all.only(*stay).positions(state)[:, :2]) if stay else -inf

        best = max(others, key=margin, default=own)
        return best if margin(best) >= margin(own) + _CLEARLY else own
