"""Robot, simulation and controller made from the settings of the playground, without a page."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

import floatbase as fb
from floatbase._geometry import rotation_z
from floatbase._validation import as_instance
from floatbase.behaviours import Walk
from floatbase.dynamics import Contacts
from floatbase.errors import SimulationWarning, unknown_name
from floatbase.playground import build
from floatbase.playground.perturbed import BaseMotors, PerturbedSimulation
from floatbase.playground.program import program
from floatbase.playground.settings import SETTING_NAMES, Settings
from floatbase.robots import Robot, State
from floatbase.simulation import Actuators, Controller, Push

# s, control period: go2's reference QP takes 1.5 ms, which leaves half of the time for physics and
# pictures
PERIOD = 4e-3


class Session:
    """A robot whose settings can change while it runs.

    Pass `sim`, `controller` and `actuators` to `rollout` with a control period of `PERIOD`. The
    period is the same on every machine, so a run can be reproduced. `last` is the newest record
    passed to `observe`. `refusal` says why the last change was refused; "" if it was accepted.

    Parameters
    ----------
    robot : Robot
        Robot, as from `fb.load`.
    settings : Settings, optional
        Initial settings.

    Raises
    ------
    FloatbaseError
        If the settings do not fit the robot.
    """

    def __init__(self, robot: Robot, settings: Settings | None = None):
        self.robot = as_instance("robot", robot, Robot)
        self.settings = (
            Settings() if settings is None else as_instance("settings", settings, Settings)
        )
        self.last: fb.Rollout | None = None
        self.refusal = ""
        self.sim = self._make_simulation(self.settings)
        self.home = self.sim.state
        self.actuators: Actuators | None = build.actuators(self.settings, robot, self.home)
        self.controller: Controller = build.controller(self.settings, robot, self.sim, self.home)

    def _make_simulation(self, settings: Settings) -> PerturbedSimulation:
        """Return a simulation on the actual ground, with the robot standing."""
        return PerturbedSimulation(
            self.robot,
            build.ground(settings),
            perturbation=build.perturbation(settings, self.robot),
        )

    def _make_actuators(self, settings: Settings) -> Actuators | None:
        """Return actuators that continue with the torques of the last record."""
        made = build.actuators(settings, self.robot, self.home)
        if made is not None and self.last is not None:
            made.reset(self.last.tau[-1])
        return made

    @property
    def walk(self) -> Walk | None:
        """Behaviour that walks, or None if the robot does not walk."""
        inner = (
            self.controller.controller
            if isinstance(self.controller, BaseMotors)
            else self.controller
        )
        return inner if isinstance(inner, Walk) else None

    @property
    def speed_limit(self) -> str:
        """Sentence with the velocity at which the robot walks, if it is limited; otherwise ""."""
        walk = self.walk
        if self.settings.gait is None or walk is None or walk.speed_fraction == 1.0:
            return ""
        x, y, yaw_rate = walk.speed_fraction * np.array(self.settings.velocity)
        return (
            f"The legs are too short for this speed. It is limited to {walk.speed_fraction:.0%}: "
            f"{x:.2f} m/s forwards, {y:.2f} m/s to the left, {yaw_rate:.2f} rad/s."
        )

    def code(self, push: Push | None = None) -> str:
        """Write a program that makes and runs the same robot for 3 s, from its standing posture.

        Parameters
        ----------
        push : Push, optional
            Push that acts at 0.5 s in the program.

        Returns
        -------
        str
            Source code of the program.
        """
        if push is not None:
            as_instance("push", push, Push)
        return program(self.settings, self.robot, PERIOD, push)

    def observe(self, record: fb.Rollout) -> None:
        """Store the newest slice of the run.

        Parameters
        ----------
        record : Rollout
            Record of the slice.
        """
        self.last = as_instance("record", record, fb.Rollout)

    def change(self, **changes: Any) -> bool:
        """Change settings.

        If the new settings are impossible, nothing changes, and `refusal` says why.

        Parameters
        ----------
        **changes
            New values of fields of `Settings`.

        Returns
        -------
        bool
            Whether the robot was put back on its feet, which a change of the actual slope requires.
        """
        before = self.settings
        try:
            for name in changes:
                if name not in SETTING_NAMES:
                    raise unknown_name("setting", name, SETTING_NAMES)
            settings = replace(before, **changes)
            moved = settings.slope[1] != before.slope[1]
            if moved:
                self._start_over(settings)
            else:
                self._go_on(settings)
        except fb.FloatbaseError as error:
            self.refusal = str(error)
            return False
        self.refusal = ""
        return moved

    def _start_over(self, settings: Settings) -> None:
        """Stand in a new simulation; raise `FloatbaseError` before anything has changed."""
        sim = self._make_simulation(settings)
        home = sim.state
        actuators = build.actuators(settings, self.robot, home)
        controller = build.controller(settings, self.robot, sim, home)
        self.settings, self.last, self.sim, self.home = settings, None, sim, home
        self.actuators, self.controller = actuators, controller

    def _go_on(self, settings: Settings) -> None:
        """Continue in the same simulation with new settings."""
        before, walk = self.settings, self.walk
        perturbation = build.perturbation(settings, self.robot)
        actuators = self.actuators
        if settings.bandwidth[1] != before.bandwidth[1]:
            actuators = self._make_actuators(settings)
        if walk is not None and before.gait and _without_gait(settings) == _without_gait(before):
            gait = walk.gait
            if settings.gait is None:
                gait = replace(gait, stop=self.sim.time)
            elif settings.gait != before.gait:
                gait = build.gait(settings, self.robot)
            with warnings.catch_warnings():  # the speed may be limited; each slider would warn
                warnings.simplefilter("ignore", SimulationWarning)
                walk.gait = gait
                walk.velocity = settings.velocity[:2]
                walk.yaw_rate = settings.velocity[2]
        else:
            self.controller = build.controller(
                settings, self.robot, self.sim, self._standing_state_here()
            )
            if self.robot.is_floating:
                self.sim.base_wrench = np.zeros(6)  # the base may have no motors any more
        self.sim.perturbation = replace(perturbation, friction=settings.friction[1])
        self.settings, self.actuators = settings, actuators

    def after_reset(self) -> None:
        """Update the session after a reset of the simulation.

        Schedules restart with the clock, and the actuators hold the robot.
        """
        self.last = None
        self.settings = replace(self.settings, start_time=0.0)
        self.actuators = self._make_actuators(self.settings)
        self.controller = build.controller(self.settings, self.robot, self.sim, self.home)

    def _standing_state_here(self) -> State:
        """Return the standing posture at the current position and heading of the feet."""
        contacts = Contacts.feet(self.robot)
        if self.last is None or not self.robot.is_floating or not len(contacts):
            return self.home
        present = self.last.final
        R, R0 = (state.frame_pose("base").rotation for state in (present, self.home))
        turn = rotation_z(math.atan2(*(R @ R0.T)[[1, 0], 0]))
        q = np.array(self.home.q)
        q[3:7] = pin.Quaternion(turn @ R0).coeffs()
        turned = self.home.replace(q=q)
        q[:3] += (contacts.positions(present) - contacts.positions(turned)).mean(axis=0) * [
            1.0,
            1.0,
            bool(self.settings.slope[1]),
        ]
        return turned.replace(q=q)


def _without_gait(settings: Settings) -> Settings:
    """Return the settings that a walk cannot take over while it continues."""
    return replace(settings, gait=None, velocity=(0.0, 0.0, 0.0), start_time=0.0)
