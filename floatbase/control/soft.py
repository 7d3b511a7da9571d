"""Soft contacts: the contact constraint (5) as a cost, for states in which no forces satisfy it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from floatbase._validation import Array, Value, as_positive, read_only
from floatbase.affine import Affine
from floatbase.control.problem import Problem
from floatbase.dynamics import Block, Contacts, EquationsOfMotion, FrictionContact, MotionConstraint
from floatbase.objectives import Task
from floatbase.robots import State

SOFT_CONTACT_WEIGHT = 1e4  # weight of the motion of soft contacts; tasks have a weight of 10
SOFT_LIMIT_WEIGHT = 1e4  # of limits that are made soft, per N, N·m, rad/s² or m/s²


@dataclass(frozen=True, eq=False)
class SoftConstraint(Value):
    """A constraint whose forces act but whose motion is only a cost, in `ContactMotionTask`."""

    contact: MotionConstraint
    row_names: ClassVar[tuple[str, ...]] = ()

    @property
    def name(self) -> str:
        """Name of the contact."""
        return self.contact.name

    @property
    def k(self) -> int:
        """Number of force components of the contact."""
        return self.contact.k

    def jacobian(self, state: State, t: float = 0.0) -> Array:
        """Return the Jacobian J of eq. (4)."""
        return self.contact.jacobian(state, t)

    def constraint(self, state: State, t: float = 0.0) -> tuple[Array, Array]:
        """Return A and b of eq. (5), which have no rows."""
        return read_only(np.zeros((0, state.robot.nv))), read_only(np.zeros(0))


@dataclass(frozen=True, eq=False)
class SoftContact(SoftConstraint):
    """A soft constraint whose forces act at points, inside their friction cones."""

    contact: FrictionContact

    @property
    def mu(self) -> float:
        """Coefficient of friction of the contact [-]."""
        return self.contact.mu

    @property
    def normal(self) -> Array:
        """Unit normal of the contact, shape (3,), world frame."""
        return self.contact.normal

    @property
    def point_names(self) -> tuple[str, ...]:
        """Names of the contact's points."""
        return self.contact.point_names

    def positions(self, state: State) -> Array:
        """Return the positions of the points."""
        return self.contact.positions(state)


@dataclass(frozen=True, eq=False)
class ContactMotionTask(Value):
    """The motion constraint of contacts as a cost: residual A q̈ - b of eq. (5)."""

    contacts: Contacts
    weight: float
    name: str = "motion of the contacts"
    block: ClassVar[Block] = "qdd"

    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> Affine:
        """Return A q̈ - b as a function of q̈."""
        A, b = self.contacts.constraint(eom.state, t)
        return Affine(A, -b)


def with_soft_contacts(problem: Problem, weight: float) -> Problem:
    """Return a problem with soft contacts from one whose contacts may be soft or rigid."""
    rigid = Contacts([c.contact if isinstance(c, SoftConstraint) else c for c in problem.contacts])
    soft = [SoftContact(c) if isinstance(c, FrictionContact) else SoftConstraint(c) for c in rigid]
    motion = ContactMotionTask(rigid, as_positive("contact_weight", weight))
    others = [task for task in problem.tasks if not isinstance(task, ContactMotionTask)]
    if not problem.level_sizes:
        return replace(problem, contacts=Contacts(soft), tasks=[*others, motion])
    first, *sizes = problem.level_sizes  # the contacts come first
    sizes = [first + len(others) + 1 - len(problem.tasks), *sizes]
    return replace(problem, contacts=Contacts(soft), tasks=[motion, *others], level_sizes=sizes)


def contact_weight_of(tasks: Sequence[Task]) -> float | None:
    """Return the weight of soft contacts among the tasks, or None if there is none."""
    return next((task.weight for task in tasks if isinstance(task, ContactMotionTask)), None)
