"""`rollout`: the loop of controller and simulation."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Protocol

import numpy as np

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
from floatbase.errors import (
    FloatbaseError,
    InfeasibleError,
    InputError,
    SimulationWarning,
    SolverError,
    warn,
)
from floatbase.simulation.after_fall import record_settling
from floatbase.simulation.physics import Simulation
from floatbase.simulation.push import Push, active_pushes, as_pushes
from floatbase.simulation.record import Outcome, Recorder, Rollout

# of one record: three hours at 1 ms, and 10 GB; the next rollout continues where this one ends
_MAX_STEPS = 10**7
# fraction of a period by which a time may differ from a whole number of periods: user rounding
_PERIOD_TOLERANCE = 1e-6
_TIME_TOLERANCE = 1e-9  # additional fraction of the time itself: rounding over many periods


class Controller(Protocol):
    """A callable that returns joint torques for the present state.

    The result has an attribute `tau`, shape (d,) [N·m], and optionally `forces`, shape (k,) [N], in
    the world frame. The controller itself may have an attribute `contacts` of type `Contacts`: the
    stance of its last result, which may change from one control step to the next. Without this
    attribute, all feet are used. If it has a method `measure(tau, forces, acceleration)`, `rollout`
    calls it before each control step with the measurements of the last timestep: the motors'
    torques, shape (d,) [N·m], the forces on `sim.point_names`, shape (points, 3), in the world
    frame [N], and the accelerometer, shape (3,), in the base frame [m/s²].
    """

    def __call__(self, q: Array, v: Array, t: float) -> Any:
        """Return the command for configuration q and velocity v at time t [s]."""


class Actuators(Protocol):
    """A model that converts desired torques into joint torques, and may have a state.

    If it has a method `receive(command)`, as `JointServo` has, `rollout` calls it with the command
    of each control step.
    """

    def step(self, tau_desired: Array, q_joints: Array, v_joints: Array, dt: float) -> Array:
        """Return the torques of the next timestep.

        Parameters
        ----------
        tau_desired : ndarray, shape (d,)
            Torques that the controller requested [N·m].
        q_joints : ndarray, shape (d,)
            Joint positions at the beginning of the step [rad or m].
        v_joints : ndarray, shape (d,)
            Joint velocities at the beginning of the step [rad/s or m/s].
        dt : float
            Length of the step [s].

        Returns
        -------
        ndarray, shape (d,)
            Joint torques [N·m].
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
    """Simulate a robot under a controller from the simulation's present state.

    Parameters
    ----------
    sim : Simulation
        The simulation; the next rollout continues where this one ends.
    controller : Controller
        Called as controller(q, v, t) once in each control period; see `Controller`.
    duration : float
        Simulated time [s], a whole number of control periods.
    pushes : sequence of Push, optional
        Forces on the robot. The start of a push refers to the simulation's clock, which a reset
        sets to 0.
    control_period : float, optional
        Time between two calls of the controller [s], a whole number of timesteps; by default one
        timestep.
    actuators : Actuators, optional
        Model such as `HydraulicActuators` or `JointServo` that converts the controller's torques in
        every timestep. Without it, the joints get the controller's torques, within the motors'
        limits. The model's state is kept from one rollout to the next, so reset the model together
        with the simulation.
    settling_time : float, optional
        Time for which the simulation continues after a fall or a controller failure, so that the
        robot comes to lie on the ground [s]; a whole number of control periods. Meanwhile,
        controller and actuators are off, the motors damp the joints, and `sim.link_collisions` is
        on. See `Rollout.controller_off_time`.
    progress : bool, optional
        Whether to show a progress bar.

    Returns
    -------
    Rollout
        One row for each control step. A fall, a divergence of the simulation, an `InfeasibleError`
        or a `SolverError` of the controller, or torques that are not finite numbers end the
        rollout. The rows up to that time are returned, and `outcome` gives the reason. Other errors
        in the controller are raised.

    Raises
    ------
    InputError
        If a duration is not a whole number of periods, if a push has no effect, if the controller
        cannot be called as controller(q, v, t), or if its result has no `tau`.

    Warns
    -----
    SimulationWarning
        If pushes are given, but none acts during this rollout, or if the controller relies on a
        contact or a constraint that the simulation lacks.

    Examples
    --------
    >>> import floatbase as fb
    >>> robot = fb.load("go2")
    >>> standing = robot.standing()
    >>> contacts = fb.Contacts.points(robot, mu=0.7)
    >>> controller = fb.WholeBodyController(robot, contacts, fb.standing_tasks(standing))
    >>> push = fb.Push([0.0, 30.0, 0.0], start=0.01)
    >>> run = fb.rollout(fb.Simulation(robot), controller, duration=0.05, pushes=[push])
    >>> run.outcome, len(run)
    ('completed', 50)
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
            f"A duration of {duration:g} s has {steps} timesteps, but a record holds at most "
            f"{_MAX_STEPS}. Use several rollouts; each continues where the last one ended."
        )
    _warn_of_inactive(pushes, sim.time, sim.time + ticks * substeps * sim.timestep)
    stance = _current_stance(sim, controller)
    record = Recorder(sim, stance, ticks + settling_ticks, substeps)
    missing: set[str] = set()
    _warn_of_missing(sim, stance, missing)

    def end(outcome: Outcome, error: FloatbaseError | None = None) -> Rollout:
        controller_off_time = sim.time
        record_settling(
            sim, record, _current_stance(sim, controller), settling_ticks, substeps, pushes
        )
        return record.to_rollout(pushes, outcome, error, controller_off_time)

    bar: Iterable[int] = range(ticks)
    if as_bool("progress", progress):
        from tqdm.auto import tqdm  # slow to load

        bar = tqdm(bar, "rollout", unit=" ticks")
    measure = getattr(controller, "measure", None)
    receive = getattr(actuators, "receive", None)
    with sim._exclusive():
        for _ in bar:
            t, q, v = sim.time, sim.q, sim.v
            record.before_tick(t, q, v)
            try:
                if measure is not None:
                    measure(sim.torques(), sim.contact_forces(), sim.accelerometer())
                command = controller(q, v, t)
            except (InfeasibleError, SolverError) as error:
                return end("controller failed", error)
            previous, stance = stance, _current_stance(sim, controller)
            if stance is not previous:
                _warn_of_missing(sim, stance, missing)
            try:
                desired = _desired_torques(sim, command)
                planned = _planned_forces(command, stance)
                if receive is not None:
                    receive(command)
                _run_substeps(sim, desired, substeps, pushes, actuators, record)
            except _NonFiniteTorques as error:
                return end("controller failed", error)
            record.complete_tick(desired, stance, planned, command)
            if sim.diverged:
                return record.to_rollout(pushes, "diverged")
            if sim.fallen:
                return end("fell")
        return record.to_rollout(pushes, "completed")


def _period_count(name: str, time: float, unit: str, period: float, minimum: int = 1) -> int:
    """Return how many periods [s] make up a time [s].

    Raises `InputError` if that is not a whole number, or less than `minimum`, which is 0 or 1.
    """
    time = as_positive(name, time, "s", allow_zero=minimum == 0)
    count = round(time / period)
    tolerance = _PERIOD_TOLERANCE * period + _TIME_TOLERANCE * time
    if count < minimum or abs(count * period - time) > tolerance:
        near = max(count, 1) * period
        raise InputError(
            f"{name} is {time:g} s; it must be a whole multiple of {unit}, {period:g} s, such as "
            f"{near:g} s."
        )
    return count


def _warn_of_inactive(pushes: tuple[Push, ...], begin: float, end: float) -> None:
    """Warn if there are pushes and none acts from `begin` to `end` [s]."""
    if not pushes or active_pushes(pushes, begin, end):
        return
    first, what = pushes[0], "The push does not act during this rollout. It"
    if len(pushes) > 1:
        what = f"None of the {len(pushes)} pushes acts during this rollout. The first one"
    if first.start < begin:
        advice = f"Call sim.reset() to restart the clock, or use start=sim.time + {first.start:g}"
    else:
        advice = f"Use a duration of more than {first.start - begin:g} s"
    warn(
        f"{what} acts from {first.start:g} to {first.start + first.duration:g} s, but the rollout "
        f"goes from {begin:g} to {end:g} s. {advice}.",
        SimulationWarning,
    )


def _check_arguments(
    sim: Simulation, controller: Controller, pushes: tuple[Push, ...], actuators: Actuators | None
) -> None:
    """Raise `InputError` for arguments of the wrong type or for a different robot."""
    as_instance("sim", sim, Simulation)
    timestep = sim.model.opt.timestep
    if timestep != sim.timestep:
        raise InputError(
            f"sim.model.opt.timestep is {timestep:g} s, but the simulation was made with "
            f"{sim.timestep:g} s, and control periods are multiples of that. Make a new "
            f"simulation with fb.Simulation(robot, timestep={timestep:g})."
        )
    as_callable("the controller", controller, "controller(q, v, t)")
    check_actuators(actuators)
    for name, part in (("controller is", controller), ("actuators are", actuators)):
        robot = getattr(part, "robot", sim.robot)
        if robot != sim.robot and not sim.robot.has_joints_of(robot):
            raise InputError(
                f"The {name} for {robot!r}, but the simulation is for {sim.robot!r}. Load both "
                f"robots with the same arguments."
            )
    for push in pushes:
        sim.pushed_body(push)


def check_actuators(actuators: Actuators | None) -> None:
    """Raise `InputError` for actuators without a method `step`."""
    if actuators is not None and (
        isinstance(actuators, type) or not callable(getattr(actuators, "step", None))
    ):
        raise InputError(
            f"actuators must have a method step, as HydraulicActuators have, but "
            f"{short_repr(actuators)} has none."
        )


class _NonFiniteTorques(InputError):
    """Torques that are NaN, infinite or not numbers.

    Such torques end the rollout; other errors in a controller are raised.
    """


def _current_stance(sim: Simulation, controller: Controller) -> Contacts:
    """Return the controller's present contacts, or all feet if it has none."""
    contacts = getattr(controller, "contacts", None)
    return contacts if isinstance(contacts, Contacts) else sim.feet


def _warn_of_missing(sim: Simulation, stance: Contacts, known: set[str]) -> None:
    """Warn about contacts that the simulation lacks, and add them to the known ones."""
    missing = {contact.name for contact in stance if not sim.has(contact)} - known
    known |= missing
    if missing:
        warn(
            f"The controller relies on {', '.join(sorted(missing))}, but the simulation "
            f"lacks them. Use fb.Simulation(robot, contacts=controller.contacts). It can have "
            f"points, flat feet and wheels at any frame, fixed frames and rigid connections. "
            f"Moving contacts need fb.Ground(acceleration=…). Other constraints exist only in the "
            f"controller.",
            SimulationWarning,
        )


def _run_substeps(
    sim: Simulation,
    desired: Array,
    substeps: int,
    pushes: tuple[Push, ...],
    actuators: Actuators | None,
    record: Recorder,
) -> None:
    """Simulate one control period under the desired torques, shape (d,) [N·m]."""
    if actuators is not None:
        desired = read_only(desired)  # actuators must not write into the controller's array
    tau = desired
    for _ in range(substeps):
        if actuators is not None:
            tau = actuators.step(desired, *sim.joint_state, sim.timestep)
            tau = _as_torques(sim, "The actuators' torques", tau)
        sim._advance(tau, pushes)
        record.after_step()


def _desired_torques(sim: Simulation, command: Any) -> Array:
    """Return the torques of a command, shape (d,) [N·m]."""
    if not hasattr(command, "tau"):
        raise InputError(
            f"A controller must return an object with an attribute tau, shape ({sim.robot.d},) "
            f"[N·m], such as a Command or types.SimpleNamespace(tau=…). This one returned "
            f"{short_repr(command)}."
        )
    return _as_torques(sim, "The controller's torques", command.tau)


def _as_torques(sim: Simulation, name: str, tau: Any) -> Array:
    """Return torques as an array, shape (d,) [N·m].

    Raises `_NonFiniteTorques` if an entry is not a finite number, and `InputError` if the shape is
    wrong.
    """
    if (
        type(tau) is np.ndarray
        and tau.dtype.char == "d"
        and tau.shape == (sim.robot.d,)
        and np.vdot(tau, tau) <= MAX_MAGNITUDE
    ):
        return tau  # the usual case
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
            f"{name} contain {entries[i]} for joint {sim.robot.joint_names[i]} at {sim.time:.3f} "
            f"s. All torques must be finite numbers."
        ) from None


def _planned_forces(command: Any, stance: Contacts) -> Array | None:
    """Return a command's forces, shape (k,), world frame [N], or None if it has none."""
    forces = getattr(command, "forces", None)
    if forces is None:
        return None
    # float64 is the usual case
    is_float64 = type(forces) is np.ndarray and forces.dtype.char == "d"
    planned = forces if is_float64 else numeric_copy(forces)
    if planned is None:
        raise InputError(f"The controller's forces must be numbers, not {short_repr(forces)}.")
    if planned.shape != (stance.k,):
        raise InputError(
            f"The controller's forces have shape {planned.shape}, but its contacts "
            f"({', '.join(stance.names)}) need shape ({stance.k},). A controller that changes its "
            f"stance, or that wraps such a controller, must have the present stance as its "
            f"attribute contacts."
        )
    return planned
