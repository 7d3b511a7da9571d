"""Gains of a `Walk`, and checks of its other arguments."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_callable,
    as_instance,
    as_number,
    as_positive,
    checked,
    numeric_copy,
    short_repr,
)
from floatbase.behaviours.terrain import Terrain, as_terrain
from floatbase.behaviours.walk.gait import Gait, check_always_supported
from floatbase.behaviours.walk.swing import Swing, SwingPath
from floatbase.control import WholeBodyController
from floatbase.dynamics import Contacts, FlatFootContact, FrictionContact
from floatbase.errors import InputError, check_arguments
from floatbase.objectives import Task
from floatbase.robots import State

_DEFAULT_REACH, _DEFAULT_REACH_FLAT = 0.2, 0.3  # m
_MAX_SPEED = 10.0  # m/s and rad/s: a larger number must be in another unit
_MAX_ACCELERATION = 100.0  # m/s² and rad/s²: a larger number must be in another unit
# of the options that are functions
_USAGES = {
    "foothold": "foothold(foot, touchdown, walk)",
    "adjustment": "adjustment(plan, path, com, com_velocity, t)",
    "modify_plan": "modify_plan(plan, state)",
    "swing": "swing(start, end, lift_off, touchdown, clearance)",
}


def _as_gains(name: str, value: Any) -> tuple[float, float]:
    """Return a pair (kp in 1/s², weight), checked."""
    kp, weight = as_array(name, value, (2,)).tolist()
    return (
        as_positive(f"kp in {name}", kp, "1/s²"),
        as_positive(f"weight in {name}", weight, allow_zero=True),
    )


@dataclass(frozen=True, eq=False)
class Gains(Value):
    """Gains (kp, weight) of each kind of task of a `Walk`; all tasks are critically damped.

    Parameters
    ----------
    com : (float, float), optional
        Stiffness kp [1/s²] and weight [-] of the task on the centre of mass.
    base : (float, float), optional
        Stiffness kp [1/s²] and weight [-] of the task on the base's orientation.
    swing : (float, float), optional
        Stiffness kp [1/s²] and weight [-] of the tasks on swinging feet.
    posture : (float, float), optional
        Stiffness kp [1/s²] and weight [-] of the posture task. The swinging legs of a small robot
        need large joint accelerations, so a large weight disturbs the centre of mass.
    """

    com: tuple[float, float] = field(default=(100.0, 10.0), metadata=checked(_as_gains))
    base: tuple[float, float] = field(default=(100.0, 10.0), metadata=checked(_as_gains))
    swing: tuple[float, float] = field(default=(900.0, 10.0), metadata=checked(_as_gains))
    posture: tuple[float, float] = field(default=(100.0, 1e-3), metadata=checked(_as_gains))

    @staticmethod
    def for_contacts(contacts: Contacts) -> Gains:
        """Return the default gains for point feet or for flat feet.

        Parameters
        ----------
        contacts : Contacts
            The robot's contacts.

        Returns
        -------
        Gains
            Gains for flat feet if any contact is a flat foot, otherwise for point feet.
        """
        if not flat_foot_names(as_instance("contacts", contacts, Contacts)):
            return Gains()
        return Gains(
            com=(25.0, 10.0), base=(100.0, 100.0), swing=(400.0, 10.0), posture=(100.0, 1e-2)
        )


@dataclass(frozen=True, eq=False)
class WalkOptions:
    """Options of a `Walk` that do not change; `Walk` describes them."""

    clearance: float
    reach: float
    ramp: float
    foothold: Callable[..., npt.ArrayLike]
    adjustment: Callable[..., Mapping[str, npt.ArrayLike]] | None
    modify_plan: Callable[[Any, State], Any] | None
    swing: Callable[..., SwingPath]
    ground: Terrain | None
    tasks: tuple[Task, ...]
    acceleration: Array
    gains: Gains
    controller: Mapping[str, Any]

    @staticmethod
    def checked(contacts: Contacts, **options: Any) -> WalkOptions:
        """Return the options after checking them; None stands for a default."""
        for name, usage in _USAGES.items():
            if options[name] is not None:
                as_callable(name, options[name], usage)
        if not isinstance(options["tasks"], list | tuple):
            raise InputError(f"tasks must be a list of tasks, not {short_repr(options['tasks'])}.")
        limits = as_array("acceleration", options["acceleration"], (2,)).tolist()
        forwards, turning = (
            as_positive("acceleration", limit, unit, maximum=_MAX_ACCELERATION)
            for limit, unit in zip(limits, ("m/s²", "rad/s²"), strict=True)
        )
        reach = _DEFAULT_REACH_FLAT if flat_foot_names(contacts) else _DEFAULT_REACH
        defaults = {"reach": reach, "swing": Swing, "gains": Gains.for_contacts(contacts)}
        given = {name: value for name, value in options.items() if value is not None}
        checked = WalkOptions(**{**options, **defaults, **given})
        return replace(
            checked,
            clearance=as_positive("clearance", checked.clearance, "m", True, maximum=1.0),
            reach=as_positive("reach", checked.reach, "m", maximum=1.0),
            ramp=as_positive("ramp", checked.ramp, "s", True, maximum=1.0),
            ground=as_terrain("ground", checked.ground),
            tasks=tuple(checked.tasks),
            acceleration=np.array([forwards, forwards, turning]),
            gains=as_instance("gains", checked.gains, Gains),
        )


def flat_foot_names(contacts: Contacts) -> set[str]:
    """Return the names of the flat feet."""
    return {contact.name for contact in contacts if isinstance(contact, FlatFootContact)}


def check_options(behaviour: type, options: Iterable[str]) -> None:
    """Raise `UnknownArgumentError` for an option that neither it nor `WholeBodyController` has."""
    _, _, _, *known = inspect.signature(WholeBodyController).parameters  # robot, contacts, tasks
    own = inspect.signature(behaviour).parameters.keys() - {"options"}
    check_arguments(behaviour.__name__, options, {*own, *known})


def as_gait(gait: Gait, contacts: Contacts, may_fly: bool) -> Gait:
    """Return a gait after checking that its feet are contacts and that at least one foot stands.

    may_fly: whether all feet may be in the air.
    """
    if others := [contact.name for contact in contacts if not isinstance(contact, FrictionContact)]:
        raise InputError(
            f"A walk supports the robot at points, soles and wheels, but {', '.join(others)} is "
            f"another constraint. Leave it out, and pass tasks for the arms instead."
        )
    for foot in as_instance("gait", gait, Gait, "Gait.trot(robot)").feet:
        if foot not in contacts.names:
            names = ", ".join(contacts.names) or "none"
            raise InputError(
                f"The gait lifts {foot}, which is not among the contacts: {names}. "
                f"Contacts.feet(robot) returns all feet of a robot."
            )
    if len(gait.feet) == len(contacts) and not may_fly:
        check_always_supported(gait)
    return gait


def as_velocity(velocity: npt.ArrayLike) -> Array:
    """Check a desired velocity, shape (2,), and return it."""
    velocity = as_array("velocity", velocity, (2,), "m/s")
    as_number("speed", float(np.linalg.norm(velocity)), "m/s", maximum=_MAX_SPEED)
    return velocity


def as_yaw_rate(yaw_rate: float) -> float:
    """Check a desired yaw rate and return it."""
    return as_number("yaw_rate", yaw_rate, "rad/s", -_MAX_SPEED, _MAX_SPEED)


def as_vector(name: str, values: npt.ArrayLike, size: int) -> Array:
    """Return a copy of a vector, (size,), after checking its shape; the tick checks its numbers."""
    vector = numeric_copy(values)
    if vector is None or vector.shape != (size,):
        return as_array(name, values, (size,))
    return vector
