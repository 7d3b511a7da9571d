"""`rollout`: the one loop that closes a controller with the physics, and the record it leaves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
import pinocchio as pin

from floatbase._arrays import Array, positive, read_only
from floatbase.dynamics.contacts import Contacts
from floatbase.errors import FloatbaseError, InputError
from floatbase.robots.robot import Robot
from floatbase.robots.state import State
from floatbase.simulation.physics import Push, Simulation

Outcome = Literal["completed", "fell", "diverged", "controller failed"]


class Controller(Protocol):
    """Anything that gives torques for a state: its answer has `.tau`, shape (d,), N·m, and may have `.forces`, shape (k,)."""

    def __call__(self, q: Array, v: Array, t: float) -> Any:
        """The command for configuration q and velocity v at time t, s."""


class Actuators(Protocol):
    """What stands between the torques a controller asks for and those the joints get, with a memory of its own."""

    def step(self, tau_desired: Array, q_joints: Array, v_joints: Array, dt: float) -> Array:
        """The torques of the next dt s, shape (d,), N·m.

        q_joints, v_joints: (d,) rad and rad/s, positions and velocities of the joints now.
        """


@dataclass(frozen=True, eq=False)
class Rollout:
    """What happened, one row for each control tick, taken before the tick's torques act.

    time: (n,) s, the simulation's clock. q: (n, nq). v: (n, nv). tau: (n, d) N·m, the torques applied, within the motors'
    limits, their mean over the tick. tau_desired: (n, d) N·m, what the controller asked for. planned: (n, k) N, world,
    the controller's contact forces (NaN where it gave none). measured: (n, k) N, world, those of the physics during the
    tick (NaN for a constraint that the physics does not know). foot_positions: (n, points, 3) m, world.
    outcome: "completed", "fell", "diverged" or "controller failed" (then `error` holds its exception): the record ends there.
    """

    robot: Robot
    contacts: Contacts
    time: Array
    q: Array
    v: Array
    tau: Array
    tau_desired: Array
    planned: Array
    measured: Array
    foot_positions: Array
    pushes: tuple[Push, ...]
    outcome: Outcome
    error: FloatbaseError | None = None

    def __len__(self) -> int:
        return int(self.time.size)

    def state(self, i: int) -> State:
        """The state at row i."""
        return State(self.robot, self.q[i], self.v[i])

    @property
    def final(self) -> State:
        """The last state on record."""
        self._check_not_empty()
        return self.state(-1)

    @property
    def com(self) -> Array:
        """Centre of mass at each row, shape (n, 3), m, world."""
        return read_only(np.reshape([self.state(i).com for i in range(len(self))], (-1, 3)))

    def _check_not_empty(self) -> None:
        if not len(self):
            raise InputError(f"this record is empty: {self.outcome}{'' if self.error is None else f', {self.error}'}")

    def slip(self) -> Array:
        """How far each contact point strayed from where it was first, shape (points,), m."""
        self._check_not_empty()
        return read_only(np.linalg.norm(self.foot_positions - self.foot_positions[0], axis=2).max(axis=0))

    def __repr__(self) -> str:
        return f"Rollout({self.robot.name}, {self.time[-1] if len(self) else 0.0:.3f} s, {self.outcome})"


def rollout(
    sim: Simulation,
    controller: Controller,
    duration: float,
    pushes: Sequence[Push] = (),
    control_period: float | None = None,
    actuators: Actuators | None = None,
) -> Rollout:
    """Run a controller on the physics for `duration` s from the simulation's present state.

    pushes: forces on the robot; their start is on the simulation's clock, which a reset sets to 0. control_period: s,
    a whole multiple of the simulation's timestep, which it is by default. actuators: what the commanded torques pass
    through in every step of the physics, such as `HydraulicActuators`; none by default, then joints get what was asked
    for. They keep their state from one rollout to the next: reset them yourself, `actuators.reset(…)`, with the
    simulation.
    A fall, a divergence of the physics or a controller that finds no answer ends the rollout; the record up to there is
    returned and says so.
    Raises `InputError` for a period that does not divide, a push that is none, and a controller without `.tau`.
    """
    _check(sim, controller, pushes)
    positive("duration", duration, "s")
    period = sim.timestep if control_period is None else positive("control_period", control_period, "s")
    substeps = round(period / sim.timestep)
    if substeps < 1 or abs(substeps * sim.timestep - period) > 1e-9:
        raise InputError(
            f"control_period {period:g} s is not a whole multiple of the simulation's timestep {sim.timestep:g} s."
        )
    run = _Run(sim, controller, tuple(pushes), actuators)
    outcome: Outcome = "completed"
    error: FloatbaseError | None = None
    for _ in range(max(1, round(duration / period))):
        try:
            command = controller(sim.q, sim.v, sim.time)
        except FloatbaseError as failure:
            outcome, error = "controller failed", failure
            break
        run.tick(command, substeps)
        if sim.diverged:
            outcome = "diverged"
            break
        if sim.fallen:
            outcome = "fell"
            break
    return run.record(outcome, error)


def _check(sim: Simulation, controller: Controller, pushes: Sequence[Push]) -> None:
    """What a rollout is handed must be of the right kind, and of one robot."""
    if not isinstance(sim, Simulation):
        raise InputError(f"rollout needs a Simulation first, as fb.Simulation(robot), not {sim!r}.")
    if not callable(controller):
        raise InputError(f"the controller must be callable as controller(q, v, t), not {controller!r}.")
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


class _Run:
    """The rows collected on the way."""

    def __init__(self, sim: Simulation, controller: Controller, pushes: tuple[Push, ...], actuators: Actuators | None):
        self.sim = sim
        self.pushes = pushes
        self.actuators = actuators
        contacts = getattr(controller, "contacts", None)
        self.contacts = contacts if isinstance(contacts, Contacts) else _all_feet(sim.robot)
        self._columns = _columns(self.contacts, sim.point_names)
        self.rows: list[tuple[Array | float, ...]] = []

    def tick(self, command: Any, substeps: int) -> None:
        """Apply one command for its period and keep what was there before and during it."""
        if not hasattr(command, "tau"):
            raise InputError(f"a controller must answer with .tau (N·m), as fb.Command does; got {command!r}.")
        sim = self.sim
        time, q, v, feet = sim.time, sim.q, sim.v, self._columns @ sim.contact_positions()
        desired = np.array(command.tau, dtype=np.float64)
        forces, applied = np.zeros((len(sim.point_names), 3)), np.zeros(sim.robot.d)
        for _ in range(substeps):
            tau = self._actuated(desired)
            sim.step(tau, self.pushes)
            forces += sim.contact_forces() / substeps
            applied += sim.torques() / substeps
        planned = getattr(command, "forces", None)
        planned = np.full(self.contacts.k, np.nan) if planned is None else np.asarray(planned, dtype=np.float64)
        count = np.maximum(self._columns.sum(axis=1, keepdims=True), 1.0)
        if planned.shape != (self.contacts.k,):
            raise InputError(
                f"the controller planned forces of shape {planned.shape}; its contacts ({', '.join(self.contacts.names)}) "
                f"have {self.contacts.k} numbers. A controller that changes its stance runs one rollout for each."
            )
        known = self._columns.sum(axis=1) > 0  # points that the physics has; the others are not measured
        measured = np.full(self.contacts.k, np.nan)
        measured[self.contacts.point_entries] = np.where(known[:, None], self._columns @ forces, np.nan).ravel()
        feet = np.where(known[:, None], feet, np.nan)
        self.rows.append((time, q, v, applied, desired, planned, measured, feet / count))

    def _actuated(self, desired: Array) -> Array:
        """The torques the joints get in the next step when these are wanted, N·m."""
        if self.actuators is None:
            return desired
        sim, robot = self.sim, self.sim.robot
        # joints without limits are stored as (cos, sin); the way from the neutral configuration holds their angles
        q_joints = pin.difference(robot.model, pin.neutral(robot.model), sim.q)[robot.nv - robot.d :]
        return np.asarray(self.actuators.step(desired, q_joints, sim.v[robot.nv - robot.d :], sim.timestep))

    def record(self, outcome: Outcome, error: FloatbaseError | None) -> Rollout:
        """The finished value."""
        robot, k = self.sim.robot, self.contacts.k
        shapes = {
            "time": (),
            "q": (robot.nq,),
            "v": (robot.nv,),
            "tau": (robot.d,),
            "tau_desired": (robot.d,),
            "planned": (k,),
            "measured": (k,),
            "foot_positions": (self.contacts.n_points, 3),
        }
        columns: dict[str, Any] = {
            name: read_only(np.array([row[i] for row in self.rows]).reshape((len(self.rows), *shape)))
            for i, (name, shape) in enumerate(shapes.items())
        }
        return Rollout(robot, self.contacts, pushes=self.pushes, outcome=outcome, error=error, **columns)


def _all_feet(robot: Robot) -> Contacts:
    """All feet, flat ones with their corners: what is measured when the controller names no contacts."""
    flat = [foot.frame for foot in robot.feet if foot.is_flat]
    points = [foot.frame for foot in robot.feet if not foot.is_flat]
    contacts = [*(Contacts.points(robot, frames=points) if points else ())]
    contacts += [*(Contacts.flat_feet(robot, frames=flat) if flat else ())]
    return Contacts(contacts) if contacts else Contacts.none()


def _columns(contacts: Contacts, measured: tuple[str, ...]) -> Array:
    """Which measured points make up each point of the contacts, shape (n, n_measured), of 0 and 1.

    A point contact in the middle of a flat foot takes all its corners.
    """
    match = [
        [float(name == point or name.startswith(f"{point} corner ")) for name in measured] for point in contacts.point_names
    ]
    return np.array(match).reshape(contacts.n_points, len(measured))
