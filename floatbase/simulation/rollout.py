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
from floatbase.simulation.after_fall import record_settling
from floatbase.simulation.physics import Push, Simulation, active_pushes, as_pushes
from floatbase.simulation.record import Outcome, Recorder, Rollout

_MAX_STEPS = (
    10**7
)  # of one record: three hours at 1 ms, and 10 GB; the next rollout goes on where this one ends
# part of a period by which a time may miss a whole number of them: how people round
_PERIOD_TOLERANCE = 1e-6
_TIME_TOLERANCE = 1e-9  # part of the time by which it may: the rounding of many periods


class Controller(Protocol):
    """Anything that gives torques for a state: its answer has `.tau`, shape (d,), N·m, and may have
    `.forces`, shape (k,), N.

    It may have an attribute `contacts`, a `Contacts`: the stance that its last answer was for,
    which may change from one tick to the next. Without it all feet are taken.
    """

    def __call__(self, q: Array, v: Array, t: float) -> Any:
        """The command for configuration q and velocity v at time t, s."""


class Actuators(Protocol):
    """What stands between the torques that a controller desires and those that the joints get; it
    may have a memory.
    """

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
    settling_time: float = 0.0,
    progress: bool = False,
) -> Rollout:
    """Run a controller on the physics from its present state.

    sim: the physics; where it ends, the next rollout goes on.
    controller: called as controller(q, v, t) once in each control period; see `Controller`.
    duration: s, a whole number of control periods.
    pushes: forces on the robot; they start on the simulation's clock, which a reset sets to 0.
    control_period: s, a whole number of the simulation's timesteps; one by default.
    actuators: what the controller's torques pass through in every timestep, such as
        `HydraulicActuators`; without it the joints get the controller's torques, within the motors'
        limits. Its memory lasts from one rollout to the next: reset it with the simulation.
    settling_time: s, a whole number of control periods, for which a robot goes on after a fall or a
        controller's failure, to lie on the ground in the end: controller and actuators are off, the
        motors damp the joints, `sim.link_collisions` is on. See `Rollout.controller_off_time`.
    progress: whether a bar shows how far it is.

    A fall, a divergence of the physics, an error of the package that the controller raises, torques
    that are no finite numbers end the rollout: `outcome` says so, and the rows up to there are
    returned. Raises `InputError` for a control period or a duration that is no whole number of
    periods, for a push that moves nothing, for a controller that cannot be called as controller(q,
    v, t), and for an answer without `.tau`. Warns (`SimulationWarning`) where pushes are given and
    none acts in this rollout.
    """
    pushes = as_pushes(pushes)
    _check_arguments(sim, controller, pushes, actuators)
    period = sim.timestep if control_period is None else control_period
    substeps = _period_count("control_period", period, "the simulation's timestep", sim.timestep)
    ticks = _period_count("duration", duration, "the control period", substeps * sim.timestep)
    settling_ticks = _period_count(
        "settling_time", settling_time, "the control period", substeps * sim.timestep, minimum=0
    )
    steps = (ticks + settling_ticks) * substeps
    if steps > _MAX_STEPS:
        raise InputError(
            f"duration {duration:g} s has {steps} timesteps; at most {_MAX_STEPS} fit in one "
            f"record."
        )
    warning = _inactive_push_warning(pushes, sim.time, sim.time + ticks * substeps * sim.timestep)
    if warning:
        warnings.warn(warning, SimulationWarning, stacklevel=2)
    record = Recorder(sim, _current_stance(sim, controller), ticks + settling_ticks, substeps)

    def end(outcome: Outcome, error: FloatbaseError | None = None) -> Rollout:
        controller_off_time = sim.time
        record_settling(
            sim, record, _current_stance(sim, controller), settling_ticks, substeps, pushes
        )
        return record.to_rollout(pushes, outcome, error, controller_off_time)

    for _ in (
        tqdm(range(ticks), "rollout", unit=" ticks")
        if as_bool("progress", progress)
        else range(ticks)
    ):
        t, q, v = sim.time, sim.q, sim.v
        record.before_tick(t, q, v)
        try:
            command = controller(q, v, t)
        except FloatbaseError as error:
            return end("controller failed", error)
        stance = _current_stance(sim, controller)
        try:
            desired = _desired_torques(sim, command)
            planned = _planned_forces(command, stance)
            _run_substeps(sim, desired, substeps, pushes, actuators, record)
        except _NonFiniteTorques as error:
            return end("controller failed", error)
        record.complete_tick(desired, stance, planned)
        if sim.diverged:
            return record.to_rollout(pushes, "diverged")
        if sim.fallen:
            return end("fell")
    return record.to_rollout(pushes, "completed")


def _period_count(name: str, time: float, unit: str, period: float, minimum: int = 1) -> int:
    """How many periods, s, make up a time, s: `InputError` where that is no whole number, or less
    than `minimum`, 0 or 1.
    """
    time = as_positive(name, time, "s", allow_zero=minimum == 0)
    count = round(time / period)
    if (
        count < minimum
        or abs(count * period - time) > _PERIOD_TOLERANCE * period + _TIME_TOLERANCE * time
    ):
        near = max(count, 1) * period
        raise InputError(
            f"{name} {time:g} s is not a whole multiple of {unit} {period:g} s; {near:g} s would "
            f"be."
        )
    return count


def _inactive_push_warning(pushes: tuple[Push, ...], begin: float, end: float) -> str:
    """What is said where there are pushes and none acts from begin to end, s: "" where one does."""
    if not pushes or active_pushes(pushes, begin, end):
        return ""
    first = pushes[0]
    several = (
        f"none of the {len(pushes)} pushes acts: the first"
        if len(pushes) > 1
        else "the push does not act: it"
    )
    if first.start < begin:
        what = f"sim.reset() starts the clock again, or give start=sim.time + {first.start:g}"
    else:
        what = f"a duration of more than {first.start - begin:g} s reaches it"
    span = (
        f"goes from {first.start:g} to {first.start + first.duration:g} s, this rollout from "
        f"{begin:g} to {end:g} s"
    )
    return f"{several} {span}; {what}."


def _check_arguments(
    sim: Simulation, controller: Controller, pushes: tuple[Push, ...], actuators: Actuators | None
) -> None:
    """Raise `InputError` for what is of another kind or of another robot."""
    as_instance("sim", sim, Simulation)
    timestep = sim.model.opt.timestep
    if timestep != sim.timestep:
        raise InputError(
            f"sim.model.opt.timestep is {timestep:g} s; the simulation was made with "
            f"{sim.timestep:g} s, and control periods "
            f"count in that: make another, fb.Simulation(robot, timestep={timestep:g})."
        )
    as_callable("the controller", controller, "controller(q, v, t)")
    check_actuators(actuators)
    for name, part in (("controller is", controller), ("actuators are", actuators)):
        robot = getattr(part, "robot", sim.robot)
        if robot != sim.robot:
            raise InputError(
                f"the {name} for {robot!r}, the simulation holds {sim.robot!r}: load both with the "
                f"same arguments."
            )
    for push in pushes:
        sim.pushed_body(push)


def check_actuators(actuators: Actuators | None) -> None:
    """Raise `InputError` for what has no method `step`."""
    if actuators is not None and (
        isinstance(actuators, type) or not callable(getattr(actuators, "step", None))
    ):
        raise InputError(
            f"actuators must have a method step, as HydraulicActuators have; "
            f"{short_repr(actuators)} has none."
        )


class _NonFiniteTorques(InputError):
    """Torques that are NaN, infinite or no numbers: they end the rollout, other mistakes in a
    controller are raised.
    """


def _current_stance(sim: Simulation, controller: Controller) -> Contacts:
    """The controller's contacts now; all feet when it names none."""
    contacts = getattr(controller, "contacts", None)
    return contacts if isinstance(contacts, Contacts) else sim.feet


def _run_substeps(
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
            tau = _as_torques(
                sim,
                "the actuators' torques",
                actuators.step(desired, *sim.joint_state, sim.timestep),
            )
        sim.advance(tau, pushes)
        record.after_step()


def _desired_torques(sim: Simulation, command: Any) -> Array:
    """The torques of a command, shape (d,), N·m."""
    if not hasattr(command, "tau"):
        raise InputError(
            f"a controller must answer with .tau, shape ({sim.robot.d},), N·m, as a Command does; "
            f"got {command!r}. Any "
            f"object with .tau will do: types.SimpleNamespace(tau=…)."
        )
    return _as_torques(sim, "the controller's torques", command.tau)


def _as_torques(sim: Simulation, name: str, tau: Any) -> Array:
    """Torques as an array, shape (d,). Raises `_NonFiniteTorques`, or `InputError` for another
    shape.
    """
    if (
        type(tau) is np.ndarray
        and tau.dtype.char == "d"
        and tau.shape == (sim.robot.d,)
        and np.vdot(tau, tau) <= MAX_MAGNITUDE
    ):
        return tau  # as most of them are
    try:
        return as_array(name, tau, (sim.robot.d,), "N·m")
    except InputError:
        entries = np.array(tau, dtype=object)
        if entries.shape != (sim.robot.d,):
            raise
        i = [numeric_copy(x) is not None and abs(float(x)) <= MAX_MAGNITUDE for x in entries].index(
            False
        )
        raise _NonFiniteTorques(
            f"{name} hold {entries[i]} at {sim.robot.joint_names[i]} at {sim.time:.3f} s."
        ) from None


def _planned_forces(command: Any, stance: Contacts) -> Array | None:
    """A command's forces, shape (k,), N, world, or None where it has none."""
    forces = getattr(command, "forces", None)
    if forces is None:
        return None
    is_float64 = (
        type(forces) is np.ndarray and forces.dtype.char == "d"
    )  # float64, as most of them are
    planned = forces if is_float64 else numeric_copy(forces)
    if planned is None:
        raise InputError(
            f"the controller planned forces that are no numbers: {short_repr(forces)}."
        )
    if planned.shape != (stance.k,):
        raise InputError(
            f"the controller planned forces of shape {planned.shape}; its contacts "
            f"({', '.join(stance.names)}) have "
            f"{stance.k} numbers. A controller that changes its stance, or one around it, has the "
            f"present one as .contacts."
        )
    return planned
