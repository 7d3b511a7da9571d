"""What a `Walk` is made with: its gains, and checks of the rest."""

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
    """(kp in 1/s², weight) of each kind of task of a `Walk`; all are critically damped."""

    com: tuple[float, float] = field(default=(100.0, 10.0), metadata=checked(_as_gains))
    base: tuple[float, float] = field(default=(100.0, 10.0), metadata=checked(_as_gains))
    swing: tuple[float, float] = field(default=(900.0, 10.0), metadata=checked(_as_gains))
    posture: tuple[float, float] = field(default=(100.0, 1e-2), metadata=checked(_as_gains))

    @staticmethod
    def for_contacts(contacts: Contacts) -> Gains:
        """Gains that go with point feet or with flat feet."""
        flat = flat_foot_names(as_instance("contacts", contacts, Contacts))
        return (
            Gains(com=(25.0, 10.0), base=(100.0, 100.0), swing=(400.0, 10.0)) if flat else Gains()
        )


def flat_foot_names(contacts: Contacts) -> set[str]:
    """Names of the flat feet."""
    return {contact.name for contact in contacts if isinstance(contact, FlatFootContact)}


def check_options(behaviour: str, options: Iterable[str]) -> None:
    """Raise `InputError` for an option that `WholeBodyController` does not have. behaviour: name of
    the class.
    """
    known = [
        name
        for name in inspect.signature(WholeBodyController).parameters
        if name not in ("robot", "contacts", "tasks")
    ]
    for name in options:
        if name not in known:
            raise InputError(
                f"{behaviour} has no option {name!r}; beside its own, it takes those of the "
                f"controller: {', '.join(known)}."
            )


def check_gait_feet(gait: Gait, contacts: Contacts) -> None:
    """Raise `InputError` for a gait that lifts what is no contact."""
    for foot in gait.feet:
        if foot not in contacts.names:
            names = ", ".join(contacts.names) or "there are none"
            raise InputError(
                f"the gait lifts {foot}, which is no contact ({names}); Contacts.feet(robot) gives "
                f"a robot's feet."
            )
