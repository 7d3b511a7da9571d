"""What a tick is given beside the state: moving targets, and the numbers of tasks, constraints and rows of one's own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array, read_only
from floatbase.affine import Affine
from floatbase.control.problem import Problem, residual_of
from floatbase.control.tick.moment import TickEquations, TickState
from floatbase.control.tick.tables import BLOCKS, CONTACT_KINDS, TASK_KINDS, Dynamics
from floatbase.dynamics import EquationsOfMotion, equations_of_motion, constraint_and_jacobian
from floatbase.errors import InputError
from floatbase.robots import State

NO_LIMIT = 1e300  # N, for inf among numbers that must be finite


class Given(NamedTuple):
    """What one tick is given."""

    numbers: Array  # targets, least and largest normal force of each point, then own contacts, tasks and rows
    rows: int = 0  # of all tasks of one's own
    contacts: Sequence[tuple[Array, Array, Array]] = ()  # A, b and J of each own contact
    residuals: Mapping[int, tuple[float, Affine]] = MappingProxyType(
        {}
    )  # weight and residual of tasks of one's own, by their number
    normal_forces: tuple[Array, Array] = (np.zeros(0), np.zeros(0))  # least and largest of each point, (P,)
    inequalities: Sequence[tuple[Array, Array]] = ()  # G and h of rows of one's own


class Own:
    """What a problem has of its owner's making: objects that the tables of the tick do not know.

    any: whether there is something. changes: whether it, or a bound of a normal force, must be asked for at every tick.
    """

    def __init__(self, problem: Problem, dynamics: Dynamics):
        self._problem, self._dynamics, self._limits = problem, dynamics, problem.limits
        self._tasks = [(i, task, BLOCKS[task.block]) for i, task in enumerate(problem.tasks) if type(task) not in TASK_KINDS]
        self._contacts = [contact for contact in problem.contacts if type(contact) not in CONTACT_KINDS]
        self.any = bool(self._tasks or self._contacts or self._limits.rows)
        self.changes = self.any or self._limits.move
        bounds = np.zeros((2, problem.contacts.n_points))  # of those that move: they are asked at a time
        self._still = (bounds[0], bounds[1]) if self._limits.move else self._limits.normal_forces(problem.contacts)
        self._bounds = _finite(self._still)

    def nothing(self, targets: Array) -> Given:
        """Targets, what still bounds of normal forces are, and otherwise as many zeros as a tick without a state needs."""
        nv = self._problem.robot.nv
        own = sum(len(contact.row_names) * (nv + 1) + contact.k * nv for contact in self._contacts)
        nothing = np.zeros(own + 3 * len(self._tasks) + 2 * len(self._limits.rows))
        return Given(np.concatenate([targets, *self._bounds, nothing]), normal_forces=self._still)

    def given(self, targets: Array, q: Array, v: Array, t: float) -> Given:
        """What a tick is given at a state. Raises `InputError`, or what functions of the owner's raise."""
        problem, limits = self._problem, self._limits
        bounds = limits.normal_forces(problem.contacts, t)
        parts: list[npt.ArrayLike] = [targets, *(_finite(bounds) if limits.move else self._bounds)]
        if not self.any:
            return Given(np.concatenate(parts), normal_forces=bounds)
        eom = TickEquations(TickState(self._dynamics, q, v), problem.contacts, t)
        contacts, residuals, rows, inequalities = [], {}, 0, []
        for contact in self._contacts:
            A, b, J = constraint_and_jacobian(contact, eom.state, t)
            contacts.append((A, b, J))
            parts += A.ravel(), b, J.ravel()
        for i, task, block in self._tasks:
            residual, weight = residual_of(task, eom, t), float(task.weight)
            if not weight >= 0.0:
                raise InputError(f"weight of {task.name} is {weight:g}; it must be ≥ 0.")
            residuals[i], A, b = (weight, residual), residual.A, residual.b
            rows += len(b)
            parts += (block, len(b), weight), A.ravel(), b
        for each in limits.rows:
            G, h = each.at(eom, t)
            if each.owners:
                each.labels(len(h))  # raises where there is another number of them
            inequalities.append((G, h))
            parts += (BLOCKS[each.block], len(h)), G.ravel(), h
        return Given(np.concatenate(parts), rows, contacts, residuals, bounds, inequalities)

    def equations(self, state: State, t: float, given: Given) -> EquationsOfMotion:
        """(7) with what the own contacts said in a tick."""
        contacts = self._problem.contacts
        if not self._contacts:
            return equations_of_motion(state, contacts, t)
        own = iter(given.contacts)
        rows = [constraint_and_jacobian(contact, state, t) if type(contact) in CONTACT_KINDS else next(own) for contact in contacts]
        A, b, J = (read_only(np.concatenate(parts)) for parts in zip(*rows, strict=True))
        return EquationsOfMotion(state, contacts, state.M, state.h, state.robot.S, J, A, b)


def _finite(bounds: tuple[Array, Array]) -> tuple[Array, Array]:
    return bounds[0], np.minimum(bounds[1], NO_LIMIT)
