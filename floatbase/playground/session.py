"""A robot, its world and its controller as the playground's settings make them; with or without a
page.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

import floatbase as fb
from floatbase.behaviours import Walk
from floatbase.dynamics import Contacts
from floatbase.playground import build
from floatbase.playground.perturbed import BaseMotors, PerturbedSimulation
from floatbase.playground.program import program
from floatbase.playground.settings import Settings
from floatbase.robots import Robot, State
from floatbase.simulation import Actuators, Controller, Push

# s between ticks: go2's reference QP takes 1.5 ms, so that half of the time is left for physics and
# pictures
PERIOD = 4e-3


class Session:
    """A robot under settings that change while it runs.

    robot: as from `fb.load`. settings: those at first.
    `sim`, `controller` and `actuators` are what `rollout` takes, with a control step every
    `PERIOD`: the same on every machine, so that a run can be had again. `code` shows a program that
    makes the same. `last` is the newest record, which `observe` keeps. `refusal` says why a change
    was refused, and then everything stays as it was.

    Raises `FloatbaseError` where robot and settings do not fit.
    """

    def __init__(self, robot: Robot, settings: Settings | None = None):
        self.robot = robot
        self.settings = Settings() if settings is None else settings
        self.last: fb.Rollout | None = None
        self.refusal = ""
        self.sim = self._make_simulation(self.settings)
        self.home = self.sim.state
        self.actuators: Actuators | None = build.actuators(self.settings, robot, self.home)
        self.controller: Controller = build.controller(self.settings, robot, self.sim, self.home)

    def _make_simulation(self, settings: Settings) -> PerturbedSimulation:
        """A world on the true ground, with the robot standing in it."""
        return PerturbedSimulation(
            self.robot,
            build.ground(settings),
            perturbation=build.perturbation(settings, self.robot),
        )

    def _make_actuators(self, settings: Settings) -> Actuators | None:
        """Actuators that go on with the torques of the last record."""
        made = build.actuators(settings, self.robot, self.home)
        if made is not None and self.last is not None:
            made.reset(self.last.tau[-1])
        return made

    @property
    def walk(self) -> Walk | None:
        """The behaviour that makes steps, where there is one."""
        inner = (
            self.controller.controller
            if isinstance(self.controller, BaseMotors)
            else self.controller
        )
        return inner if isinstance(inner, Walk) else None

    def code(self, push: Push | None = None) -> str:
        """A program that makes and runs the same robot for 3 s, from its standing posture on.

        push: acts at 0.5 s; None for none.
        """
        return program(self.settings, self.robot, PERIOD, push)

    def observe(self, record: fb.Rollout) -> None:
        """Take note of the newest slice."""
        self.last = record

    def change(self, **changes: Any) -> bool:
        """Change settings; returns whether the robot was put back on its feet for it, as another
        slope asks for.

        Where the new settings cannot be, `refusal` says why, and nothing changes.
        """
        before = self.settings
        try:
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
        """Stand in a new world. Raises `FloatbaseError` before anything has changed."""
        sim = self._make_simulation(settings)
        home = sim.state
        actuators = build.actuators(settings, self.robot, home)
        controller = build.controller(settings, self.robot, sim, home)
        self.settings, self.last, self.sim, self.home = settings, None, sim, home
        self.actuators, self.controller = actuators, controller

    def _go_on(self, settings: Settings) -> None:
        """Go on in the same world, changed; a walk goes on where only its velocity or gait changes.
        Raises `FloatbaseError` before anything has changed.
        """
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
            walk.gait, walk.velocity, walk.yaw_rate = (
                gait,
                settings.velocity[:2],
                settings.velocity[2],
            )
        else:
            self.controller = build.controller(
                settings, self.robot, self.sim, self._standing_state_here()
            )
            if self.robot.is_floating:
                self.sim.base_wrench = np.zeros(6)  # of motors that may be there no more
        self.sim.perturbation = replace(perturbation, friction=settings.friction[1])
        self.settings, self.actuators = settings, actuators

    def after_reset(self) -> None:
        """After a reset of the simulation: schedules count from the clock's new beginning, and
        actuators hold the robot.
        """
        self.last = None
        self.settings = replace(self.settings, start_time=0.0)
        self.actuators = self._make_actuators(self.settings)
        self.controller = build.controller(self.settings, self.robot, self.sim, self.home)

    def _standing_state_here(self) -> State:
        """The standing posture where the feet are now, turned as the robot is."""
        contacts = Contacts.feet(self.robot)
        if self.last is None or not self.robot.is_floating or not len(contacts):
            return self.home
        present = self.last.final
        R, R0 = (state.frame_pose("base").rotation for state in (present, self.home))
        turn = pin.exp3(np.array([0.0, 0.0, math.atan2(*(R @ R0.T)[[1, 0], 0])]))
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
    """The settings that a walk does not take over while it goes on."""
    return replace(settings, gait=None, velocity=(0.0, 0.0, 0.0), start_time=0.0)
