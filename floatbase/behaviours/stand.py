"""`Stand`: stands, and steps when it must."""

from __future__ import annotations

from dataclasses import replace
from math import inf
from typing import Any

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array, as_instance, as_number, as_positive
from floatbase.behaviours.footholds import capture_point, support_margin
from floatbase.behaviours.gait import Gait, check_always_supported
from floatbase.behaviours.walk import Walk
from floatbase.control import Command
from floatbase.dynamics import Contacts
from floatbase.errors import InputError
from floatbase.robots import Robot, State

_STOP_SPEED = 0.1  # m/s of the centre of mass, below which it stops stepping
# m by which other feet must be nearer to the capture point for the gait to begin with those that
# then lift
_MIN_MARGIN_GAIN = 0.05


class Stand(Walk):
    """Stands where it is; with a `stepping_gait` it walks in place once the capture point comes
    near the edge of the feet, until slow.

    It begins where in its period the feet that stay can stop the capture point: those that it runs
    away from lift first.

    robot, contacts, options: as for `Walk`.
    stepping_gait: the gait to step by, such as `Gait.trot(robot)`, whose start and stop do not
        count; None to stand only.
    margin: m, from the capture point to the edge of the support region, below which it steps.
    """

    def __init__(
        self,
        robot: Robot,
        contacts: Contacts,
        stepping_gait: Gait | None = None,
        *,
        margin: float = 0.03,
        **options: Any,
    ):
        gait = (
            Gait(dict.fromkeys(as_instance("contacts", contacts, Contacts).names, 0.0), 1.0, 0.5)
            if stepping_gait is None
            else stepping_gait
        )
        self._standing_gait = replace(
            as_instance("stepping_gait", gait, Gait, "Gait.trot(robot)"), start=0.0, stop=0.0
        )
        self.stepping_gait, self.margin = (
            stepping_gait,
            as_positive("margin", margin, "m", allow_zero=True, maximum=1.0),
        )
        if {"velocity", "yaw_rate", "gait"} & set(options):
            raise InputError(
                "a Stand goes nowhere, and has no velocity, yaw_rate or gait: give it a "
                "stepping_gait, or make a Walk."
            )
        super().__init__(robot, contacts, self._standing_gait, **options)
        if stepping_gait is not None and len(stepping_gait.feet) == len(contacts):
            check_always_supported(replace(stepping_gait, stop=None))

    @property
    def stepping(self) -> bool:
        """Whether it steps now."""
        return self.gait is not self._standing_gait

    def __call__(self, q: npt.ArrayLike, v: npt.ArrayLike, t: float = 0.0) -> Command:
        """The tick: torques for configuration q, shape (nq,), and velocity v, shape (nv,), at time
        t in s.
        """
        t = as_number("t", t, "s")
        if self.stepping_gait is not None and self._continues(t):
            self._update_stepping(State(self.robot, q, v), t, self.stepping_gait)
        return super().__call__(q, v, t)

    def _initialize(self, state: State, t: float) -> None:
        self.gait = self._standing_gait
        super()._initialize(state, t)

    def _update_stepping(self, state: State, t: float, stepping_gait: Gait) -> None:
        """Begin to step, or end it."""
        ref = self._ref
        if not self.stepping:
            dcm = capture_point(state.com, state.com_velocity, self.omega)
            if support_margin(dcm, self._all_contacts.positions(state)[:, :2]) < self.margin:
                self.gait = replace(self._best_start(stepping_gait, state, dcm), start=t, stop=None)
        elif self.gait.stop is None:
            slow = np.linalg.norm(state.com_velocity[:2]) < _STOP_SPEED
            if slow and t > self.gait.start + self.gait.period:
                self.gait = replace(self.gait, stop=t)
        elif not ref.swinging:
            self.gait = self._standing_gait

    def _best_start(self, stepping_gait: Gait, state: State, dcm: Array) -> Gait:
        """The gait, begun where in its period the feet that stay are clearly nearer to the capture
        point, (2,) m.
        """
        from_zero = replace(stepping_gait, start=0.0, stop=None)
        first, *others = (
            from_zero.starting_at(offset * stepping_gait.period)
            for offset in sorted(set(stepping_gait.offsets.values()))
        )

        def margin(gait: Gait) -> float:
            standing_feet = [
                name for name in self._all_contacts.names if gait.offsets.get(name) != 0.0
            ]
            return (
                support_margin(dcm, self._all_contacts.only(*standing_feet).positions(state)[:, :2])
                if standing_feet
                else -inf
            )

        best = max(others, key=margin, default=first)
        return best if margin(best) >= margin(first) + _MIN_MARGIN_GAIN else first
