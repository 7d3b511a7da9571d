"""What a `Walk` is made with: its gains, and checks of the rest."""

from __future__ import annotations

import inspect
from collections.abc import Iterable
from dataclasses import dataclass

from floatbase._validation import Value, as_array, as_instance, as_positive
from floatbase.behaviours.gait import Gait
from floatbase.control import WholeBodyController
from floatbase.dynamics import Contacts, FlatFootContact
from floatbase.errors import InputError


@dataclass(frozen=True, eq=False)
class Gains(Value):
    """(kp in 1/s², weight) of each kind of task of a `Walk`; all are critically damped."""

    com: tuple[float, float] = (100.0, 10.0)
    base: tuple[float, float] = (100.0, 10.0)
    swing: tuple[float, float] = (900.0, 10.0)
    posture: tuple[float, float] = (100.0, 1e-2)

    def __post_init__(self) -> None:
        for name in ("com", "base", "swing", "posture"):
            kp, weight = as_array(f"gains of {name}", getattr(self, name), (2,)).tolist()
            gains = (
                as_positive(f"kp of {name}", kp, "1/s²"),
                as_positive(f"weight of {name}", weight, allow_zero=True),
            )
            object.__setattr__(self, name, gains)

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
