"""`rollout`: the one loop that closes a controller with the physics."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
import pinocchio as pin

from floatbase._arrays import Array, checked, positive
from floatbase.dynamics import Contacts
from floatbase.errors import FloatbaseError, InputError
from floatbase.simulation.physics import Push, Simulation
from floatbase.simulation.record import Outcome, Rollout, Row, joined, recorded


class Controller(Protocol):
    """Anything that gives torques for a state: its answer has `.tau`, shape (d,), N·m, and may have `.forces`, shape (k,).

    It may have an attribute `contacts`, a `Contacts`: the stance that its last answer was for, which may change from one
    tick to the next. Without it all feet are taken.
    """

    def __call__(self, q: Array, v: Array, t: float) -> Any:
        """The command for configuration q and velocity v at time t, s."""


class Actuators(Protocol):
    """What stands between the torques a controller asks for and those the joints get, with a memory of its own."""

    def step(self, tau_desired: Array, q_joints: Array, v_joints: Array, dt: float) -> Array:
        """The torques of the next dt s, shape (d,), N·m.

        q_joints, v_joints: (d,) rad and rad/s, positions and velocities of the joints now.
        """


def rollout(
    sim: Simulation,
    controller: Controller,
    duration: float,
    pushes: Sequence[Push] = (),
    control_period: float | None = None,
    actuators: Actuators | None = None,
) -> Rollout:
    """Run a controller on the physics for `duration` s, a whole number of control periods, from its present state.

    pushes: forces on the robot; their start is on the simulation's clock, which a reset sets to 0. control_period: s,
    a whole multiple of the simulation's timestep, which it is by default. actuators: what the commanded torques pass
    through in every step of the physics, such as `HydraulicActuators`; none by default, then joints get what was asked
    for. They keep their state from one rollout to the next: reset them yourself, `actuators.reset(…)`, with the
    simulation.
    A controller that changes its stance shows the present one as `.contacts`. A fall, a divergence of the physics, a
    controller that finds no answer or torques that are no numbers end the rollout; the record up to there is returned and
    says so.
    Raises `InputError` for a period or a duration that does not divide, a push that is none or moves nothing, a controller
    that cannot be called as controller(q, v, t), and an answer without `.tau`.
    """
    _check(sim, controller, pushes)
    period = sim.timestep if control_period is None else control_period
    substeps = _multiple("control_period", period, "the simulation's timestep", sim.timestep)
    ticks = _multiple("duration", duration, "the control period", substeps * sim.timestep)
    run = _Run(sim, controller, tuple(pushes), actuators)
    outcome: Outcome = "completed"
    error: FloatbaseError | None = None
    for _ in range(ticks):
        try:
            command = controller(sim.q, sim.v, sim.time)
        except FloatbaseError as failure:
            outcome, error = "controller failed", failure
            break
        try:
            run.tick(command, substeps)
        except _NotFinite as failure:
            outcome, error = "controller failed", failure
            break
        if sim.diverged:
            outcome = "diverged"
            break
        if sim.fallen:
            outcome = "fell"
            break
    return run.record(outcome, error)


def _multiple(name: str, time: float, unit: str, period: float) -> int:
    """How many periods, s, make up a time, s; `InputError` where it is no whole number of them."""
    time = positive(name, time, "s")
    count = round(time / period)
    if count < 1 or abs(count * period - time) > 1e-6 * period + 1e-9 * time:
        near = max(count, 1) * period
        raise InputError(f"{name} {time:g} s is not a whole multiple of {unit} {period:g} s; {near:g} s would be.")
    return count


def _check(sim: Simulation, controller: Controller, pushes: Sequence[Push]) -> None:
    """What a rollout is handed must be of the right kind, and of one robot."""
    if not isinstance(sim, Simulation):
        raise InputError(f"rollout needs a Simulation first, as fb.Simulation(robot), not {sim!r}.")
    if not callable(controller):
        raise InputError(f"the controller must be callable as controller(q, v, t), not {controller!r}.")
    _check_call(controller)
    robot = getattr(controller, "robot", sim.robot)
    if robot is not sim.robot:
        raise InputError(
            f"the controller is one for {robot!r}, the simulation holds {sim.robot!r}: make both from one fb.load."
        )
    if not isinstance(pushes, Sequence):
        raise InputError(f"pushes must be a list, as in pushes=[fb.Push(…)], not {pushes!r}.")
    for push in pushes:
        if not isinstance(push, Push):
            raise InputError(f"pushes must hold fb.Push values; {push!r} is none.")
        sim.pushed_body(push)


def _check_call(controller: Controller) -> None:
    """A controller must take (q, v, t). What does not tell its parameters, as some that are not Python, is let pass."""
    try:
        signature = inspect.signature(controller)
    except (TypeError, ValueError):
        return
    try:
        signature.bind(None, None, 0.0)
    except TypeError as error:
        name = getattr(controller, "__name__", type(controller).__name__)
        raise InputError(
            f"rollout calls controller(q, v, t) with the time t, s; {name} takes {signature} ({error}). Let it take all "
            f"three, as in lambda q, v, t: …"
        ) from None


class _NotFinite(InputError):
    """Torques that are no numbers: an outcome, where other mistakes in a controller are raised."""


class _Run:
    """The rows collected on the way."""

    def __init__(self, sim: Simulation, controller: Controller, pushes: tuple[Push, ...], actuators: Actuators | None):
        self.sim = sim
        self.controller = controller
        self.pushes = pushes
        self.actuators = actuators
        self.feet = Contacts.feet(sim.robot)
        self.contacts = self._stance()
        self.rows: list[Row] = []

    def tick(self, command: Any, substeps: int) -> None:
        """Apply one command for its period and keep what was there before and during it."""
        desired = self._desired(command)
        stance = self._stance()
        planned = self._planned(command, stance)
        if not self.rows or stance is not self.rows[-1].stance:
            self.contacts = joined(self.contacts, stance)
        sim = self.sim
        time, q, v, feet = sim.time, sim.q, sim.v, sim.contact_positions()
        forces, applied = np.zeros((len(sim.point_names), 3)), np.zeros(sim.robot.d)
        for _ in range(substeps):
            sim.step(self._actuated(desired), self.pushes)
            forces += sim.contact_forces() / substeps
            applied += sim.torques() / substeps
        self.rows.append(Row(time, q, v, applied, desired, forces, feet, stance, planned))

    def _desired(self, command: Any) -> Array:
        """The torques of a command, shape (d,)."""
        if not hasattr(command, "tau"):
            d = self.sim.robot.d
            raise InputError(
                f"a controller must answer with .tau, shape ({d},), N·m, as a Command does; got {command!r}. Any object "
                f"with .tau will do: types.SimpleNamespace(tau=…)."
            )
        return self._finite("the controller's torques", command.tau)

    def _stance(self) -> Contacts:
        """The contacts that the controller has now; all feet when it names none."""
        contacts = getattr(self.controller, "contacts", None)
        return contacts if isinstance(contacts, Contacts) else self.feet

    def _planned(self, command: Any, stance: Contacts) -> Array | None:
        """The forces of a command, shape (k,), or None where it has none."""
        forces = getattr(command, "forces", None)
        if forces is None:
            return None
        planned = np.array(forces, dtype=np.float64)
        if planned.shape != (stance.k,):
            raise InputError(
                f"the controller planned forces of shape {planned.shape}; its contacts ({', '.join(stance.names)}) have "
                f"{stance.k} numbers. A controller that changes its stance has the present one as its .contacts."
            )
        return planned

    def _actuated(self, desired: Array) -> Array:
        """The torques the joints get in the next step when these are wanted, N·m."""
        if self.actuators is None:
            return desired
        sim, robot = self.sim, self.sim.robot
        # joints without limits are stored as (cos, sin); the way from the neutral configuration holds their angles
        q_joints = pin.difference(robot.model, pin.neutral(robot.model), sim.q)[robot.nv - robot.d :]
        tau = self.actuators.step(desired, q_joints, sim.v[robot.nv - robot.d :], sim.timestep)
        return self._finite("the actuators' torques", tau)

    def _finite(self, name: str, tau: Any) -> Array:
        """The torques, shape (d,); `_NotFinite` where they are no numbers."""
        tau = np.array(tau, dtype=np.float64)
        if tau.shape == (self.sim.robot.d,) and not np.all(np.isfinite(tau)):
            joint = self.sim.robot.joint_names[int(np.argmin(np.isfinite(tau)))]
            raise _NotFinite(f"{name} hold {tau[~np.isfinite(tau)][0]} at {joint} at {self.sim.time:.3f} s.")
        return checked(name, tau, (self.sim.robot.d,), "N·m")

    def record(self, outcome: Outcome, error: FloatbaseError | None) -> Rollout:
        """The finished value."""
        return recorded(self.sim, self.contacts, self.rows, pushes=self.pushes, outcome=outcome, error=error)
