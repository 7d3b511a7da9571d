"""A robot, its world and its controller as the playground's settings make them; with or without a
page.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

import floatbase as fb
from floatbase._validation import Array
from floatbase.actuators import FirstOrderLag
from floatbase.behaviours import Gait, Stand, Walk, pitch_and_yaw
from floatbase.control import Command, ModelMismatch
from floatbase.dynamics import Contacts, equations_of_motion
from floatbase.playground.settings import Settings
from floatbase.robots import Robot, State
from floatbase.simulation import Actuators, Controller, Perturbation, PerturbedSimulation

# s between ticks: go2's reference QP takes 1.5 ms, so that half of the time is left for physics and
# pictures
PERIOD = 4e-3
_NODDING_FREQUENCY = 0.6  # Hz, loops of the ellipse: quicker ones let the feet slip
_YAW_OVER_PITCH = 1.15  # the ellipse is a little wider in yaw
_RAMP_TIME = 1.5  # s in which the ellipse grows from nothing


class BaseMotors:
    """A controller around another one that drives motors of the base which no robot has: S without
    its zeros.

    At each tick `sim.base_wrench` becomes the base's rows of (7), M q̈ + h - Jᵀ λ, of what the
    controller plans, with M, h and J
    as it believes them: zero, but for rounding, unless it believes in such motors.

    mismatch: the controller's; the truth by default.
    """

    def __init__(
        self,
        controller: Controller,
        sim: PerturbedSimulation,
        mismatch: ModelMismatch | None = None,
    ):
        self.controller, self.sim, self.mismatch = (
            controller,
            sim,
            ModelMismatch() if mismatch is None else mismatch,
        )

    @property
    def contacts(self) -> Contacts:
        """Those of the controller now."""
        held: Contacts = self.controller.contacts  # type: ignore[attr-defined]
        return held

    def __call__(self, q: npt.ArrayLike, v: npt.ArrayLike, t: float = 0.0) -> Command:
        """The tick."""
        command: Command = self.controller(q, v, t)  # type: ignore[arg-type]
        eom = self.mismatch.assumed_equations(
            equations_of_motion(State(self.sim.robot, q, v), self.contacts)
        )
        self.sim.base_wrench = (eom.M @ command.qdd + eom.h - eom.J.T @ command.forces)[:6]
        return command


def nodding_rotation(
    rotation: npt.ArrayLike, size: float, begin: float = 0.0
) -> Callable[[float], tuple[Array, Array, Array]]:
    """Orientations that describe an ellipse in pitch and yaw around `rotation`, as
    `OrientationTask` takes them.

    rotation: (3, 3), world.
    size: rad, half its width in pitch.
    begin: s, when it grows from nothing.
    Returns R (3, 3), angular velocity and acceleration, rad/s and rad/s², world, as a function of
    t.
    """
    home = np.asarray(rotation, dtype=float)

    def angles(t: float) -> Array:
        s = min(max((t - begin) / _RAMP_TIME, 0.0), 1.0)
        phase = 2.0 * math.pi * _NODDING_FREQUENCY * (t - begin)
        return (
            size
            * s**3
            * (10.0 - 15.0 * s + 6.0 * s**2)
            * np.array([math.sin(phase), _YAW_OVER_PITCH * math.cos(phase)])
        )

    turning = pitch_and_yaw(angles)

    def path(t: float) -> tuple[Array, Array, Array]:
        turn, omega, alpha = turning(t)
        return turn @ home, omega, alpha

    return path


_NAMESPACE: dict[str, Any] = {
    "fb": fb, "PerturbedSimulation": PerturbedSimulation, "Perturbation": Perturbation,
    "ModelMismatch": ModelMismatch, "FirstOrderLag": FirstOrderLag,
    "Gait": Gait, "Stand": Stand, "Walk": Walk, "BaseMotors": BaseMotors,
    "nodding_rotation": nodding_rotation,
}  # fmt: skip


class Session:
    """A robot under settings that change while it runs.

    robot: as from `fb.load`. settings: those at first.
    `sim`, `controller` and `actuators` are what `rollout` takes, made by the very lines that
    `settings.code` shows, with a tick every `PERIOD`: the same on every machine, so that a run can
    be had again. `last` is the newest record, which `observe` is told of. `refusal` says why a
    change was refused, and then `settings` stay as they were.
    """

    def __init__(self, robot: Robot, settings: Settings | None = None):
        self.robot = robot
        self.settings = Settings() if settings is None else settings
        self.last: fb.Rollout | None = None
        self.refusal = ""
        self._make_simulation()
        self.controller: Controller = self._make_controller(self.settings, self.home)

    def _make_simulation(self) -> None:
        """A world on the true ground, with the robot standing in it."""
        names = _NAMESPACE | {"robot": self.robot}
        perturbation = eval(self.settings.perturbation(self.robot), names)
        self.sim: PerturbedSimulation = PerturbedSimulation(
            self.robot, eval(self.settings.ground(), names), perturbation=perturbation
        )
        self._ground = self.settings.slope[1]
        self.home = self.sim.state
        self._make_actuators()

    def _make_actuators(self) -> None:
        names = _NAMESPACE | {"robot": self.robot, "state": self.home}
        exec("\n".join(self.settings.actuator_lines()), names)
        self.actuators: Actuators | None = names["actuators"]
        if self.last is not None and isinstance(self.actuators, FirstOrderLag):
            self.actuators.reset(self.last.tau[-1])

    def _make_controller(self, settings: Settings, state: State) -> Controller:
        """The controller that settings ask for, of a robot that is to stand as in `state`. Raises
        `FloatbaseError`.
        """
        names = _NAMESPACE | {"robot": self.robot, "sim": self.sim, "state": state}
        exec("\n".join(settings.controller_lines(self.robot)), names)
        made: Controller = names["controller"]
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

    def observe(self, record: fb.Rollout) -> None:
        """Take note of the newest slice."""
        self.last = record

    def change(self, **changes: Any) -> bool:
        """Change settings; returns whether the robot was put back on its feet for it, as another
        slope asks for.
        """
        before, self.settings = self.settings, replace(self.settings, **changes)
        refused, new_ground = self.settings, self.settings.slope[1] != self._ground
        try:
            self._update_simulation(before)
            self._update_controller(before)
            self.refusal = ""
        except fb.FloatbaseError as error:
            self.refusal, self.settings = str(error), before
            self._update_simulation(refused)
        return new_ground

    def _update_simulation(self, before: Settings) -> None:
        """World and actuators of the settings: a new world where the slope is another one, else the
        same, changed.
        """
        now = self.settings
        if now.slope[1] != self._ground:
            self.last = None
            self._make_simulation()
            return
        perturbation: Perturbation = eval(
            now.perturbation(self.robot), _NAMESPACE | {"robot": self.robot}
        )
        self.sim.perturbation = replace(perturbation, friction=now.friction[1])
        if now.bandwidth[1] != before.bandwidth[1]:
            self._make_actuators()

    def _update_controller(self, before: Settings) -> None:
        """The controller of the settings; a walk whose velocity or gait alone changes goes on."""
        now, walk = self.settings, self.walk
        if walk is not None and before.gait and replace(now, gait=None, velocity=(0, 0, 0), start_time=0.0) == replace(
            before, gait=None, velocity=(0, 0, 0), start_time=0.0
        ):  # fmt: skip
            walk.velocity, walk.yaw_rate = list(now.velocity[:2]), now.velocity[2]
            if now.gait is None:
                walk.gait = replace(walk.gait, stop=self.sim.time)
            elif now.gait != before.gait:
                walk.gait = self._make_controller(now, self.home).gait  # type: ignore[attr-defined]
            return
        self.controller = self._make_controller(now, self._standing_state_here())
        if self.robot.is_floating:
            self.sim.base_wrench = np.zeros(6)  # of motors that may be there no more

    def after_reset(self) -> None:
        """After a reset of the simulation: schedules count from the clock's new beginning, and
        actuators hold the robot.
        """
        self.last = None
        self.settings = replace(self.settings, start_time=0.0)
        self._make_actuators()
        self.controller = self._make_controller(self.settings, self.home)

    def _standing_state_here(self) -> State:
        """The standing posture where the feet are now: on the same place, turned as the robot is."""
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
            bool(self._ground),
        ]
        return turned.replace(q=q)
