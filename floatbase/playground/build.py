"""The objects that settings ask for: world, actuators and controller."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array, T
from floatbase.actuators import FirstOrderLag
from floatbase.behaviours import Gait, Stand, Walk, pitch_and_yaw
from floatbase.control import WholeBodyController
from floatbase.dynamics import Contacts
from floatbase.errors import InputError, unknown_name
from floatbase.objectives import (
    CoMTask,
    ForceTask,
    FrameTask,
    OrientationTask,
    PostureTask,
    Task,
    TorqueTask,
    standing_tasks,
)
from floatbase.playground.equation import EQUATION
from floatbase.playground.mismatch import ModelMismatch
from floatbase.playground.perturbed import BaseMotors, Perturbation, PerturbedSimulation
from floatbase.playground.settings import GAITS, IDEAL_BANDWIDTH, Settings, six_digits
from floatbase.robots import Robot, State
from floatbase.simulation import Controller, Ground

_RECOVERY_GAITS = {4: ("trot", 0.2), 2: ("walk", 0.4)}  # with its swing, s, by number of feet
_FIRST_STEP_DELAY = 1.0  # s from a control to the first step
LIFT_HEIGHT = 0.04  # m that a foot which is to leave the ground is lifted
_NODDING_FREQUENCY = 0.6  # Hz, loops of the ellipse: quicker ones let the feet slip
_YAW_OVER_PITCH = 1.15  # the ellipse is a little wider in yaw
_RAMP_TIME = 1.5  # s in which the ellipse grows from nothing


def ground(settings: Settings) -> Ground:
    """The true ground."""
    mu, normal = settings.friction[1], np.array(settings.normals[1])
    return Ground(mu) if settings.slope[1] == 0.0 else Ground(mu, normal=normal)


def perturbation(settings: Settings, robot: Robot) -> Perturbation:
    """What holds in the world instead of (7).

    Raises `UnknownNameError` for a leg that is switched off and is no foot's name.
    """
    off = settings.actual_off
    return Perturbation(
        mass=settings.mass[1],
        disabled_contacts=Contacts.feet(robot).only(settings.leg).point_names
        if "forces" in off
        else (),
        adhesion_force=float(round(robot.weight)) if "cones" in off else 0.0,
        **_switched_off({term.name: term.perturbation_option for term in EQUATION}, off),
    )


def mismatch(settings: Settings) -> ModelMismatch | None:
    """What the controller assumes instead of (7); None where that is exact."""
    off = settings.assumed_off
    ignored = "forces" in off and settings.leg not in settings.lifted_feet
    made = ModelMismatch(
        mass=settings.mass[0],
        ignored_contacts=[settings.leg] if ignored else (),
        **_switched_off({term.name: term.mismatch_option for term in EQUATION}, off),
    )
    return None if made.is_exact else made


def _switched_off(options: dict[str, str], off: tuple[str, ...]) -> dict[str, Any]:
    """The options, by name of the term, of terms that are off."""
    return {option: False for term, option in options.items() if option and term in off}


def actuators(settings: Settings, robot: Robot, state: State) -> FirstOrderLag | None:
    """The true actuators, which begin with the torques that hold the robot up in `state`; None for
    perfect ones.
    """
    if settings.bandwidth[1] >= IDEAL_BANDWIDTH:
        return None
    lag = FirstOrderLag(robot, settings.bandwidth[1])
    hold = WholeBodyController(robot, Contacts.feet(robot), standing_tasks(state))
    lag.reset(hold(state.q, state.v).tau)
    return lag


def gait(settings: Settings, robot: Robot) -> Gait:
    """The gait that was chosen, which begins soon after.

    Raises `InputError` where a robot with so many feet has no such gait.
    """
    gaits = _by_feet(GAITS, robot)
    if settings.gait not in gaits:
        raise unknown_name(f"gait of {robot.name}", settings.gait, gaits)
    return gaits[settings.gait](robot, start=six_digits(settings.start_time + _FIRST_STEP_DELAY))


def recovery_gait(robot: Robot) -> tuple[str, float]:
    """Name and swing, s, of the gait with which a pushed robot steps."""
    return _by_feet(_RECOVERY_GAITS, robot)


def _by_feet(table: dict[int, T], robot: Robot) -> T:
    """The entry of a table for as many feet as the robot has."""
    n = len(robot.feet)
    if n not in table:
        numbers = " or ".join(map(str, sorted(table)))
        raise InputError(f"{robot.name} has {n} feet. The playground has gaits for {numbers} feet.")
    return table[n]


def controller(
    settings: Settings, robot: Robot, sim: PerturbedSimulation, state: State
) -> Controller:
    """The controller of a robot that is to stand as in `state`, or to walk.

    Raises `FloatbaseError` where settings and robot do not fit.
    """
    contacts = Contacts.feet(
        robot, settings.friction[0], normals=settings.normals[0] if settings.slope[0] else None
    )
    for name in (*settings.lifted_feet, *filter(None, [settings.leg])):
        if name not in contacts.names:
            raise unknown_name("foot", name, contacts.names)
    assumed = mismatch(settings)
    options: dict[str, Any] = {
        "facets": settings.facets,
        "torque_limits": settings.torque_fraction * robot.torque_limits,
        "min_normal_force": settings.min_normal_force,
        "modify_qp": assumed,
    }
    made: Controller
    if settings.gait is not None:
        *velocity, yaw_rate = settings.velocity
        made = Walk(robot, contacts, gait(settings, robot), velocity, yaw_rate, **options)
    elif settings.steps_when_pushed:
        name, swing = recovery_gait(robot)
        made = Stand(robot, contacts, _by_feet(GAITS, robot)[name](robot, swing=swing), **options)
    else:
        stance = contacts.without(*settings.lifted_feet) if settings.lifted_feet else contacts
        made = WholeBodyController(robot, stance, _tasks(settings, state), **options)
    return BaseMotors(made, sim, assumed) if "zeros" in settings.actual_off else made


def _tasks(settings: Settings, state: State) -> list[Task]:
    """The tasks of a robot that stands as in `state`."""
    motion, posture, effort = settings.weights
    gains: dict[str, Any] = {"kp": settings.kp, "weight": six_digits(10.0 * motion)}
    level: Any = state.frame_pose("base").rotation
    if settings.nod:
        level = nodding_rotation(level, settings.nod, settings.start_time)
    tasks: list[Task] = [
        CoMTask(state.com + settings.com_shift if any(settings.com_shift) else state.com, **gains),
        OrientationTask("base", level, **gains),
        PostureTask(state.q, weight=six_digits(1e-3 * posture)),
    ]
    if effort != 1.0:
        weight = six_digits(1e-5 * effort)
        tasks += [ForceTask(weight=weight), TorqueTask(weight=weight)]
    return tasks + [
        FrameTask(name, state.point(name) + [0.0, 0.0, LIFT_HEIGHT])
        for name in settings.lifted_feet
    ]


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
