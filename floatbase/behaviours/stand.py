"""`Stand`: a controller that stands, and steps if it must."""

from __future__ import annotations

from dataclasses import replace
from math import inf
from typing import Any

import numpy as np

from floatbase._validation import Array, as_instance, as_number, as_positive
from floatbase.behaviours.walk.footholds import capture_point, support_margin
from floatbase.behaviours.walk.gait import Gait, check_always_supported
from floatbase.behaviours.walk.walk import Walk
from floatbase.dynamics import Contacts
from floatbase.errors import InputError
from floatbase.robots import Robot, State

_STOP_SPEED = 0.1  # m/s of the centre of mass, below which the robot stops stepping
# m by which another start of the gait must increase the capture point's margin to be preferred
_MIN_MARGIN_GAIN = 0.05


class Stand(Walk):
    """A controller that stands, and walks in place after a disturbance.

    With a `stepping_gait`, it starts to step when the capture point comes near the edge of the
    support polygon, and stops once the robot is slow. The gait begins at the point of its period at
    which the standing feet can best stop the capture point: feet from which the capture point moves
    away lift off first.

    Parameters
    ----------
    robot : Robot
        The robot.
    contacts : Contacts
        All contacts of the robot, as for `Walk`.
    stepping_gait : Gait, optional
        The gait for stepping, such as `Gait.trot(robot)`; its start and stop are ignored. Without
        it, the robot never steps.
    margin : float, optional
        Distance of the capture point from the edge of the support polygon below which the robot
        steps [m].
    **options : object
        Options of `Walk`, except `velocity`, `yaw_rate` and `gait`.

    Raises
    ------
    InputError
        If an argument is out of range.
    UnknownArgumentError
        If an option is unknown.

    Notes
    -----
    The capture point is from [Pratt2006]_.
    """

    waits_for_weight = False  # it steps because it falls

    def __init__(
        self,
        robot: Robot,
        contacts: Contacts,
        stepping_gait: Gait | None = None,
        *,
        margin: float = 0.03,
        **options: Any,
    ):
        self._feet, gait = as_instance("contacts", contacts, Contacts), stepping_gait
        if gait is None:
            gait = Gait(dict.fromkeys(contacts.names, 0.0), 1.0, 0.5)
        as_instance("stepping_gait", gait, Gait, "Gait.trot(robot)")
        self._standing_gait = replace(gait, start=0.0, stop=0.0)
        self.stepping_gait = stepping_gait
        self.margin = as_positive("margin", margin, "m", allow_zero=True, maximum=1.0)
        if {"velocity", "yaw_rate", "gait"} & set(options):
            raise InputError(
                "Stand has no options velocity, yaw_rate and gait, because it stays in place. Use "
                "stepping_gait, or use Walk."
            )
        super().__init__(robot, contacts, self._standing_gait, **options)
        if stepping_gait is not None and len(stepping_gait.feet) == len(contacts):
            check_always_supported(replace(stepping_gait, stop=None))

    @property
    def stepping(self) -> bool:
        """Whether the robot is stepping now."""
        return self.gait is not self._standing_gait

    def restart(self) -> None:
        """Let the next control step begin to stand in the measured state."""
        self.gait = self._standing_gait
        super().restart()

    def select_gait(self, q: Array, v: Array, t: float) -> None:
        """Begin to step, or stop stepping.

        Parameters
        ----------
        q : ndarray, shape (nq,)
            Configuration.
        v : ndarray, shape (nv,)
            Velocity.
        t : float
            The time [s].
        """
        state, t = State(self.robot, q, v), as_number("t", t, "s")
        if self.stepping_gait is None:
            return
        if not self.stepping:
            dcm = capture_point(state.com, state.com_velocity, self.omega)
            if support_margin(dcm, self._feet.positions(state)[:, :2]) < self.margin:
                start = self._best_start(self.stepping_gait, state, dcm)
                self.gait = replace(start, start=t, stop=None)
        elif self.gait.stop is None:
            slow = np.linalg.norm(state.com_velocity[:2]) < _STOP_SPEED
            if slow and t > self.gait.start + self.gait.period:
                self.gait = replace(self.gait, stop=t)
        elif not self.swings:
            self.gait = self._standing_gait

    def _best_start(self, stepping_gait: Gait, state: State, dcm: Array) -> Gait:
        """Return the gait, started where its stance feet are clearly nearer the capture point."""
        from_zero = replace(stepping_gait, start=0.0, stop=None)
        first, *others = (
            from_zero.starting_at(offset * stepping_gait.period)
            for offset in sorted(set(stepping_gait.offsets.values()))
        )

        def margin(gait: Gait) -> float:
            standing_feet = [name for name in self._feet.names if gait.offsets.get(name) != 0.0]
            points = self._feet.only(*standing_feet).positions(state)
            return support_margin(dcm, points[:, :2]) if len(points) else -inf

        best = max(others, key=margin, default=first)
        return best if margin(best) >= margin(first) + _MIN_MARGIN_GAIN else first
