"""Ground, actuators and controller made from the settings of the playground."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from floatbase._geometry import minimum_jerk
from floatbase._validation import Array, T, as_array, as_number
from floatbase.actuators import FirstOrderLag
from floatbase.behaviours import Gait, Stand, Walk, pitch_and_yaw
from floatbase.control import WholeBodyController
from floatbase.dynamics import Contacts
from floatbase.errors import InputError, SimulationWarning, unknown_name
from floatbase.objectives import (
    CoMTask,
    ForceTask,
    FrameTask,
    OrientationTask,
    PostureTask,
    Task,
    TorqueTask,
    effort_weight,
    standing_tasks,
)
from floatbase.playground.equation import EQUATION
from floatbase.playground.mismatch import ModelMismatch
from floatbase.playground.perturbed import BaseMotors, Perturbation, PerturbedSimulation
from floatbase.playground.settings import GAITS, IDEAL_BANDWIDTH, Settings, six_digits
from floatbase.robots import Robot, State
from floatbase.simulation import Controller, Ground

_RECOVERY_GAITS = {4: ("trot", 0.2), 2: ("walk", 0.4)}  # number of feet: gait and its swing [s]
_FIRST_STEP_DELAY = 1.0  # s from selecting a gait to the first step
LIFT_HEIGHT = 0.04  # m above the ground, of a lifted foot
_NODDING_FREQUENCY = 0.6  # Hz, of the ellipse: the feet slip at higher frequencies
_YAW_OVER_PITCH = 1.15  # the ellipse is a little wider in yaw
_RAMP_TIME = 1.5  # s in which the ellipse grows from zero to its full size


def ground(settings: Settings) -> Ground:
    """Make the actual ground."""
    mu, normal = settings.friction[1], np.array(settings.normals[1])
    return Ground(mu) if settings.slope[1] == 0.0 else Ground(mu, normal=normal)


def perturbation(settings: Settings, robot: Robot) -> Perturbation:
    """Make the perturbation of the simulation, which replaces eq. (7)."""
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
    """Make the controller's model mismatch."""
    off = settings.assumed_off
    ignored = "forces" in off and settings.leg not in settings.lifted_feet
    made = ModelMismatch(
        mass=settings.mass[0],
        ignored_contacts=[settings.leg] if ignored else (),
        **_switched_off({term.name: term.mismatch_option for term in EQUATION}, off),
    )
    return None if made.is_exact else made


def _switched_off(options: dict[str, str], off: tuple[str, ...]) -> dict[str, Any]:
    """Return False for the option of each term that is off; `options` maps terms to options."""
    return {option: False for term, option in options.items() if option and term in off}


def actuators(settings: Settings, robot: Robot, state: State) -> FirstOrderLag | None:
    """Make the actual actuators."""
    if settings.bandwidth[1] >= IDEAL_BANDWIDTH:
        return None
    lag = FirstOrderLag(robot, settings.bandwidth[1])
    hold = WholeBodyController(robot, Contacts.feet(robot), standing_tasks(state))
    lag.reset(hold(state.q, state.v).tau)
    return lag


def gait(settings: Settings, robot: Robot) -> Gait:
    """Make the selected gait, which starts one second after its selection."""
    gaits = _by_feet(GAITS, robot)
    if settings.gait not in gaits:
        raise unknown_name(f"gait of {robot.name}", settings.gait, gaits)
    return gaits[settings.gait](robot, start=six_digits(settings.start_time + _FIRST_STEP_DELAY))


def recovery_gait(robot: Robot) -> tuple[str, float]:
    """Return the gait with which a pushed robot takes steps."""
    return _by_feet(_RECOVERY_GAITS, robot)


def _by_feet(table: dict[int, T], robot: Robot) -> T:
    """Return the entry of a table for the robot's number of feet."""
    n = len(robot.feet)
    if n not in table:
        numbers = " or ".join(map(str, sorted(table)))
        raise InputError(f"{robot.name} has {n} feet. The playground has gaits for {numbers} feet.")
    return table[n]


def controller(
    settings: Settings, robot: Robot, sim: PerturbedSimulation, state: State
) -> Controller:
    """Make a controller for standing or walking."""
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
        with warnings.catch_warnings():  # the speed may be limited
            warnings.simplefilter("ignore", SimulationWarning)
            made = Walk(robot, contacts, gait(settings, robot), velocity, yaw_rate, **options)
    elif settings.steps_when_pushed:
        name, swing = recovery_gait(robot)
        made = Stand(robot, contacts, _by_feet(GAITS, robot)[name](robot, swing=swing), **options)
    else:
        stance = contacts.without(*settings.lifted_feet) if settings.lifted_feet else contacts
        # without joint limits, a switched-off term shows its effect down to the joints' stops
        made = WholeBodyController(
            robot, stance, _tasks(settings, state), joint_limits=None, **options
        )
    return BaseMotors(made, sim, assumed) if "zeros" in settings.actual_off else made


def _tasks(settings: Settings, state: State) -> list[Task]:
    """Return the tasks that keep a robot standing as in `state`."""
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
        weight = six_digits(effort_weight(state.robot) * effort)
        tasks += [ForceTask(weight=weight), TorqueTask(weight=weight)]
    return tasks + [
        FrameTask(name, state.point(name) + [0.0, 0.0, LIFT_HEIGHT])
        for name in settings.lifted_feet
    ]


def nodding_rotation(
    rotation: npt.ArrayLike, size: float, begin: float = 0.0
) -> Callable[[float], tuple[Array, Array, Array]]:
    """Make an orientation target that moves on an ellipse in pitch and yaw, for `OrientationTask`.

    Parameters
    ----------
    rotation : array_like, shape (3, 3)
        Orientation at the centre of the ellipse, in the world frame.
    size : float
        Half the width of the ellipse in pitch [rad].
    begin : float, optional
        Time at which the ellipse starts to grow from zero [s].

    Returns
    -------
    callable
        Function of the time t [s]. It returns the rotation matrix, shape (3, 3), the angular
        velocity, shape (3,) [rad/s], and the angular acceleration, shape (3,) [rad/s²], all in the
        world frame.
    """
    home = as_array("rotation", rotation, (3, 3))
    size, begin = as_number("size", size, "rad"), as_number("begin", begin, "s")

    def angles(t: float) -> Array:
        """Return pitch and yaw at time t."""
        amplitude = size * minimum_jerk((t - begin) / _RAMP_TIME)[0]
        phase = 2.0 * math.pi * _NODDING_FREQUENCY * (t - begin)
        return amplitude * np.array([math.sin(phase), _YAW_OVER_PITCH * math.cos(phase)])

    turning = pitch_and_yaw(angles)

    def path(t: float) -> tuple[Array, Array, Array]:
        """Return rotation, angular velocity and angular acceleration at time t."""
        turn, omega, alpha = turning(t)
        return turn @ home, omega, alpha

    return path
