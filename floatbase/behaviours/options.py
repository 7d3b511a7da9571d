"""Gains of a `Walk`, and checks of its other options."""

from __future__ import annotations

import inspect
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from floatbase._validation import Value, as_array, as_instance, as_positive, checked
from floatbase.behaviours.gait import Gait
from floatbase.control import WholeBodyController
from floatbase.dynamics import Contacts, FlatFootContact
from floatbase.errors import InputError


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
        flat = flat_foot_names(as_instance("contacts", contacts, Contacts))
        return (
            Gains(com=(25.0, 10.0), base=(100.0, 100.0), swing=(400.0, 10.0), posture=(100.0, 1e-2))
            if flat
            else Gains()
        )


def flat_foot_names(contacts: Contacts) -> set[str]:
    """Return the names of the flat feet."""
    return {contact.name for contact in contacts if isinstance(contact, FlatFootContact)}


def check_options(behaviour: str, options: Iterable[str]) -> None:
    """Raise `InputError` for an option that `WholeBodyController` does not have."""
    known = [
        name
        for name in inspect.signature(WholeBodyController).parameters
        if name not in ("robot", "contacts", "tasks")
    ]
    for name in options:
        if name not in known:
            raise InputError(
                f"{behaviour} has no option {name!r}. Besides its own options, it accepts those of "
                f"WholeBodyController: {', '.join(known)}."
            )


def check_gait_feet(gait: Gait, contacts: Contacts) -> None:
    """Raise `InputError` for a gait with a foot that is not a contact."""
    for foot in gait.feet:
        if foot not in contacts.names:
            names = ", ".join(contacts.names) or "none"
            raise InputError(
                f"The gait lifts {foot}, which is not among the contacts: {names}. "
                f"Contacts.feet(robot) returns all feet of a robot."
            )
