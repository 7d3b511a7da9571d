"""Soft contacts: (5) as a cost instead of rows, for states in which no forces hold them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from floatbase._validation import Array, Value, as_positive, read_only
from floatbase.affine import Affine
from floatbase.dynamics import (
    Block,
    Contacts,
    EquationsOfMotion,
    FrictionContact,
    MotionConstraint,
)
from floatbase.objectives import Task
from floatbase.robots import State

SOFT_CONTACT_WEIGHT = 1e4  # of contacts that must give way, beside 10 of the tasks


@dataclass(frozen=True, eq=False)
class SoftConstraint(Value):
    """A constraint that holds no motion: its forces act, and `ContactMotionTask` asks for its rows.

    contact: the rigid one.
    """

    contact: MotionConstraint
    row_names: ClassVar[tuple[str, ...]] = ()

    @property
    def name(self) -> str:
        """The contact's name."""
        return self.contact.name

    @property
    def k(self) -> int:
        """The contact's number of force components."""
        return self.contact.k

    def jacobian(self, state: State, t: float = 0.0) -> Array:
        """J of (4), shape (k, nv), at time t, s."""
        return self.contact.jacobian(state, t)

    def constraint(self, state: State, t: float = 0.0) -> tuple[Array, Array]:
        """(5) without rows."""
        return read_only(np.zeros((0, state.robot.nv))), read_only(np.zeros(0))


@dataclass(frozen=True, eq=False)
class SoftContact(SoftConstraint):
    """A soft constraint whose forces act at points, inside their cones."""

    contact: FrictionContact

    @property
    def mu(self) -> float:
        """The contact's coefficient of friction."""
        return self.contact.mu

    @property
    def normal(self) -> Array:
        """The contact's unit normal, shape (3,), world."""
        return self.contact.normal

    @property
    def point_names(self) -> tuple[str, ...]:
        """The contact's points."""
        return self.contact.point_names

    def positions(self, state: State) -> Array:
        """World positions of the points, shape (n, 3), m."""
        return self.contact.positions(state)


@dataclass(frozen=True, eq=False)
class ContactMotionTask(Value):
    """The motion that contacts hold, as a wish: residual A q̈ - b of (5), m/s² and rad/s².

    contacts: as if they were rigid. weight: of ½‖residual‖² in the objective.
    """

    contacts: Contacts
    weight: float
    name: str = "motion of the contacts"
    block: ClassVar[Block] = "qdd"

    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> Affine:
        """A q̈ - b, shape (m,)."""
        A, b = self.contacts.constraint(eom.state, t)
        return Affine(A, -b)


def with_soft_contacts(
    contacts: Contacts, tasks: Sequence[Task], weight: float
) -> tuple[Contacts, tuple[Task, ...]]:
    """Contacts and tasks, soft or not, as those of a controller whose contacts give way at this
    weight.
    """
    rigid = Contacts(
        [
            contact.contact if isinstance(contact, SoftConstraint) else contact
            for contact in contacts
        ]
    )
    other_tasks = [task for task in tasks if not isinstance(task, ContactMotionTask)]
    motion_task = ContactMotionTask(rigid, as_positive("contact_weight", weight))
    soft = [SoftContact(c) if isinstance(c, FrictionContact) else SoftConstraint(c) for c in rigid]
    return Contacts(soft), (*other_tasks, motion_task)


def contact_weight_of(tasks: Sequence[Task]) -> float | None:
    """The weight of soft contacts among the tasks, None where there is none."""
    return next((task.weight for task in tasks if isinstance(task, ContactMotionTask)), None)
