"""`rollout`: the one loop that closes a controller with the physics."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from tqdm.auto import tqdm

from floatbase._validation import (
    MAX_MAGNITUDE,
    Array,
    as_array,
    as_bool,
    as_callable,
    as_instance,
    as_positive,
    numeric_copy,
    read_only,
    short_repr,
)
from floatbase.dynamics import Contacts
from floatbase.errors import FloatbaseError, InputError, SimulationWarning
from floatbase.simulation.physics import Push, Simulation, acting, pushes_of
from floatbase.simulation.record import Outcome, Recorder, Rollout
from floatbase.simulation.settling import settle as lie_down

_MOST_STEPS = 10**7  # of one record: three hours at 1 ms, and 10 GB; the next rollout goes on where this one ends
_PERIOD_ERROR = 1e-6  # part of a period by which a time may miss a whole number of them: how people round
_TIME_ERROR = 1e-9  # part of the time by which it may: the rounding of many periods


class Controller(Protocol):
    """Anything that gives torques for a state: its answer has `.tau`, shape (d,), N·m, and may have `.forces`, shape (k,), N.

    It may have an attribute `contacts`, a `Contacts`: the stance that its last answer was for, which may change from one
    tick to the next. Without it all feet are taken.
    """

    def __call__(self, q: Array, v: Array, t: float) -> Any:
        """The command for configuration q and velocity v at time t, s."""


class Actuators(Protocol):
    """What stands between the torques that a controller desires and those that the joints get; it may have a memory."""

    def step(self, tau_desired: Array, q_joints: Array, v_joints: Array, dt: float) -> Array:
        """The torques of the next dt s, shape (d,), N·m.

        tau_desired: (d,) N·m, the controller's.
        q_joints, v_joints: (d,) rad and rad/s, of the joints now.
        dt: s.
        """


def rollout(
    sim: Simulation,
    controller: Controller,
    duration: float,
    pushes: Sequence[Push] = (),
    control_period: float | None = None,
    actuators: Actuators | None = None,
    settle: float = 0.0,
    progress: bool = False,
) -> Rollout:
    """Run a controller on the physics from its present state.

    sim: the physics; where it ends, the next rollout goes on.
    controller: called as controller(q, v, t) once in each control period; see `Controller`.
    duration: s, a whole number of control periods.
    pushes: forces on the robot; they start on the simulation's clock, which a reset sets to 0.
    control_period: s, a whole number of the simulation's timesteps; one by default.
    actuators: what the controller's torques pass through in every timestep, such as `HydraulicActuators`; without it the
        joints get the controller's torques, within the motors' limits. Its memory lasts from one rollout to the next: reset
        it with the simulation.
    settle: s, a whole number of control periods, for which a robot goes on after a fall or a controller's failure, to lie on
        the ground in the end: controller and actuators are off, the motors brake, `sim.links` is on. See `Rollout.off_at`.
    progress: whether a bar shows how far it is.

    A fall, a divergence of the physics, an error of the package that the controller raises, torques that are no finite numbers
    end the rollout: `outcome` says so, and the rows up to there are returned.
    Raises `InputError` for a control period or a duration that is no whole number of periods, for a push that moves nothing,
    for a controller that cannot be called as controller(q, v, t), and for an answer without `.tau`.
    Warns (`SimulationWarning`) where pushes are given and none acts in this rollout.
    """
    pushes = pushes_of(pushes)
    _check(sim, controller, pushes, actuators)
    period = sim.timestep if control_period is None else control_period
    substeps = _multiple("control_period", period, "the simulation's timestep", sim.timestep)
    ticks = _multiple("duration", duration, "the control period", substeps * sim.timestep)
    more = _multiple("settle", settle, "the control period", substeps * sim.timestep, least=0)
    steps = (ticks + more) * substeps
    if steps > _MOST_STEPS:
        raise InputError(f"duration {duration:g} s has {steps} timesteps; at most {_MOST_STEPS} fit in one record.")
    idle = _idle(pushes, sim.time, sim.time + ticks * substeps * sim.timestep)
    if idle:
        warnings.warn(idle, SimulationWarning, stacklevel=2)
    record = Recorder(sim, _stance(sim, controller), ticks + more, substeps)

    def end(outcome: Outcome, error: FloatbaseError | None = None) -> Rollout:
        off_at = sim.time
        lie_down(sim, record, _stance(sim, controller), more, substeps, pushes)
        return record.finished(pushes, outcome, error, off_at)

    for _ in tqdm(range(ticks), "rollout", unit=" ticks") if as_bool("progress", progress) else range(ticks):
        t, q, v = sim.time, sim.q, sim.v
        record.before(t, q, v)
        try:
            command = controller(q, v, t)
        except FloatbaseError as failure:
            return end("controller failed", failure)
        stance = _stance(sim, controller)
        try:
            desired = _desired(sim, command)
            planned = _planned(command, stance)
            _act(sim, desired, substeps, pushes, actuators, record)
        except _NotFinite as failure:
            return end("controller failed", failure)
        record.complete(desired, stance, planned)
        if sim.diverged:
            return record.finished(pushes, "diverged")
        if sim.fallen:
            return end("fell")
    return record.finished(pushes, "completed")


def _multiple(name: str, time: float, unit: str, period: float, least: int = 1) -> int:
    """How many periods, s, make up a time, s: `InputError` where that is no whole number, or less than `least`, 0 or 1."""
    time = as_positive(name, time, "s", allow_zero=least == 0)
    count = round(time / period)
    if count < least or abs(count * period - time) > _PERIOD_ERROR * period + _TIME_ERROR * time:
        near = max(count, 1) * period
        raise InputError(f"{name} {time:g} s is not a whole multiple of {unit} {period:g} s; {near:g} s would be.")
    return count


def _idle(pushes: tuple[Push, ...], begin: float, end: float) -> str:
    """What is said where there are pushes and none acts from begin to end, s: "" where one does."""
    if not pushes or acting(pushes, begin, end):
        return ""
    first = pushes[0]
    several = f"none of the {len(pushes)} pushes acts: the first" if len(pushes) > 1 else "the push does not act: it"
    if first.start < begin:
        what = f"sim.reset() starts the clock again, or give start=sim.time + {first.start:g}"
    else:
        what = f"a duration of more than {first.start - begin:g} s reaches it"
    span = f"goes from {first.start:g} to {first.start + first.duration:g} s, this rollout from {begin:g} to {end:g} s"
    return f"{several} {span}; {what}."


def _check(sim: Simulation, controller: Controller, pushes: tuple[Push, ...], actuators: Actuators | None) -> None:
    """Raise `InputError` for what is of another kind or of another robot."""
    as_instance("sim", sim, Simulation)
    timestep = sim.model.opt.timestep
    if timestep != sim.timestep:
        raise InputError(
            f"sim.model.opt.timestep is {timestep:g} s; the simulation was made with {sim.timestep:g} s, and control periods "
            f"count in that: make another, fb.Simulation(robot, timestep={timestep:g})."
        )
    as_callable("the controller", controller, "controller(q, v, t)")
    check_actuators(actuators)
    for name, part in (("controller is", controller), ("actuators are", actuators)):
        robot = getattr(part, "robot", sim.robot)
        if robot != sim.robot:
            raise InputError(
                f"the {name} for {robot!r}, the simulation holds {sim.robot!r}: load both with the same arguments."
            )
    for push in pushes:
        sim.pushed_body(push)


def check_actuators(actuators: Actuators | None) -> None:
    """Raise `InputError` for what has no method `step`."""
    if actuators is not None and (isinstance(actuators, type) or not callable(getattr(actuators, "step", None))):
        raise InputError(f"actuators must have a method step, as HydraulicActuators have; {short_repr(actuators)} has none.")


class _NotFinite(InputError):
    """Torques that are NaN, infinite or no numbers: they end the rollout, other mistakes in a controller are raised."""


def _stance(sim: Simulation, controller: Controller) -> Contacts:
    """The controller's contacts now; all feet when it names none."""
    contacts = getattr(controller, "contacts", None)
    return contacts if isinstance(contacts, Contacts) else sim.feet


def _act(
    sim: Simulation,
    desired: Array,
    substeps: int,
    pushes: tuple[Push, ...],
    actuators: Actuators | None,
    record: Recorder,
) -> None:
    """Go on for a control period under the desired torques, shape (d,), N·m."""
    if actuators is not None:
        desired = read_only(desired)  # they must not write into the controller's own
    tau = desired
    for _ in range(substeps):
        if actuators is not None:
            tau = _torques(sim, "the actuators' torques", actuators.step(desired, *sim.joints, sim.timestep))
        sim.advance(tau, pushes)
        record.after_step()


def _desired(sim: Simulation, command: Any) -> Array:
    """The torques of a command, shape (d,), N·m."""
    if not hasattr(command, "tau"):
        raise InputError(
            f"a controller must answer with .tau, shape ({sim.robot.d},), N·m, as a Command does; got {command!r}. Any "
            f"object with .tau will do: types.SimpleNamespace(tau=…)."
        )
    return _torques(sim, "the controller's torques", command.tau)


def _torques(sim: Simulation, name: str, tau: Any) -> Array:
    """Torques as an array, shape (d,). Raises `_NotFinite`, or `InputError` for another shape."""
    if type(tau) is np.ndarray and tau.dtype.char == "d" and tau.shape == (sim.robot.d,) and np.vdot(tau, tau) <= MAX_MAGNITUDE:
        return tau  # as most of them are
    try:
        return as_array(name, tau, (sim.robot.d,), "N·m")
    except InputError:
        entries = np.array(tau, dtype=object)
        if entries.shape != (sim.robot.d,):
            raise
        i = [numeric_copy(x) is not None and abs(float(x)) <= MAX_MAGNITUDE for x in entries].index(False)
        raise _NotFinite(f"{name} hold {entries[i]} at {sim.robot.joint_names[i]} at {sim.time:.3f} s.") from None


def _planned(command: Any, stance: Contacts) -> Array | None:
    """A command's forces, shape (k,), N, world, or None where it has none."""
    forces = getattr(command, "forces", None)
    if forces is None:
        return None
    plain = type(forces) is np.ndarray and forces.dtype.char == "d"  # float64, as most of them are
    planned = forces if plain else numeric_copy(forces)
    if planned is None:
        raise InputError(f"the controller planned forces that are no numbers: {short_repr(forces)}.")
    if planned.shape != (stance.k,):
        raise InputError(
            f"the controller planned forces of shape {planned.shape}; its contacts ({', '.join(stance.names)}) have "
            f"{stance.k} numbers. A controller that changes its stance, or one around it, has the present one as .contacts."
        )
    return planned
