"""Inputs of a tick other than the state: time-varying targets and user-defined terms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array, read_only
from floatbase.affine import Affine
from floatbase.control.limits import BLOCKS
from floatbase.control.problem import Problem, residual_of
from floatbase.control.tick.problem_arrays import CONTACT_KINDS
from floatbase.control.tick.targets import compiled_rows
from floatbase.dynamics import EquationsOfMotion, constraint_and_jacobian, equations_of_motion
from floatbase.errors import InputError
from floatbase.robots import State

UNBOUNDED = 1e300  # N, for inf among numbers that must be finite


class TickInputs(NamedTuple):
    """Inputs of one tick other than the state."""

    # targets, minimum and maximum normal force of each point, then user-defined contacts, tasks
    # and rows
    packed: Array
    n_user_rows: int = 0  # of all user-defined tasks
    contacts: Sequence[tuple[Array, Array, Array]] = ()  # A, b and J of each user-defined contact
    # weight and residual of user-defined tasks, by their index in the problem
    residuals: Mapping[int, tuple[float, Affine]] = MappingProxyType({})
    # minimum and maximum of each point, (P,)
    normal_forces: tuple[Array, Array] = (np.zeros(0), np.zeros(0))
    inequalities: Sequence[tuple[Array, Array]] = ()  # G and h of user-defined rows


class UserTerms:
    """User-defined objects of a problem, which the problem arrays do not contain."""

    def __init__(self, problem: Problem):
        self._problem, self._limits = problem, problem.limits
        self._tasks = [
            (i, task, BLOCKS.index(task.block))
            for i, task in enumerate(problem.tasks)
            if not compiled_rows(task)
        ]
        self._contacts = [
            contact for contact in problem.contacts if type(contact) not in CONTACT_KINDS
        ]
        self._inequalities = self._limits.all_inequalities(problem.contacts)
        self.any = bool(self._tasks or self._contacts or self._inequalities)
        self.varies = self.any or self._limits.time_varying
        self.names = [contact.name for contact in self._contacts]
        self.names += [task.name for _, task, _ in self._tasks]
        self.names += [each.name for each in self._inequalities]
        bounds = np.zeros((2, problem.contacts.n_points))  # placeholders if they vary with time
        self._constant_bounds = (
            (bounds[0], bounds[1])
            if self._limits.time_varying
            else self._limits.hard_normal_forces(problem.contacts)
        )
        self._finite_bounds = _finite(self._constant_bounds)

    def zero_inputs(self, targets: Array) -> TickInputs:
        """Return targets, constant bounds of normal forces, and zeros for the user-defined terms.

        There are as many zeros as a tick without a state needs.
        """
        nv = self._problem.robot.nv
        contact_size = sum(
            len(contact.row_names) * (nv + 1) + contact.k * nv for contact in self._contacts
        )
        zeros = np.zeros(contact_size + 3 * len(self._tasks) + 3 * len(self._inequalities))
        return TickInputs(
            np.concatenate([targets, *self._finite_bounds, zeros]),
            normal_forces=self._constant_bounds,
        )

    def inputs(self, targets: Array, q: Array, v: Array, t: float) -> TickInputs:
        """Return the inputs of a tick at a state.

        Raises `InputError`, or what user functions raise.
        """
        problem, limits = self._problem, self._limits
        bounds, finite = self._constant_bounds, self._finite_bounds
        if limits.time_varying:
            bounds = limits.hard_normal_forces(problem.contacts, t)
            finite = _finite(bounds)
        packed: list[npt.ArrayLike] = [targets, *finite]
        if not self.any:
            return TickInputs(np.concatenate(packed), normal_forces=bounds)
        state = State.unchecked(problem.robot, q, v)  # the compiled tick checks q and v
        eom = EquationsOfMotion(state, problem.contacts, t)
        contacts = []
        residuals = {}
        n_user_rows = 0
        inequalities = []
        for contact in self._contacts:
            A, b, J = constraint_and_jacobian(contact, eom.state, t)
            contacts.append((A, b, J))
            packed += A.ravel(), b, J.ravel()
        for i, task, block in self._tasks:
            residual, weight = residual_of(task, eom, t), float(task.weight)
            if not weight >= 0.0:
                raise InputError(f"weight of {task.name} is {weight:g}. It must be ≥ 0.")
            residuals[i], A, b = (weight, residual), residual.A, residual.b
            n_user_rows += len(b)
            packed += (block, len(b), weight), A.ravel(), b
        for each in self._inequalities:
            G, h = each.at(eom, t)
            if each.row_names:
                each.labels(len(h))  # raises if their number does not match
            inequalities.append((G, h))
            packed += (BLOCKS.index(each.block), len(h), each.weight or 0.0), G.ravel(), h
        return TickInputs(
            np.concatenate(packed), n_user_rows, contacts, residuals, bounds, inequalities
        )

    def equations(self, state: State, t: float, inputs: TickInputs) -> EquationsOfMotion:
        """Return the equations (7) with the values of user-defined contacts in a tick."""
        contacts = self._problem.contacts
        if not self._contacts:
            return equations_of_motion(state, contacts, t)
        user_contacts = iter(inputs.contacts)
        rows = [
            constraint_and_jacobian(contact, state, t)
            if type(contact) in CONTACT_KINDS
            else next(user_contacts)
            for contact in contacts
        ]
        A, b, J = (read_only(np.concatenate(parts)) for parts in zip(*rows, strict=True))
        return EquationsOfMotion(state, contacts, t, A=A, b=b, J=J)


def _finite(bounds: tuple[Array, Array]) -> tuple[Array, Array]:
    """Replace infinite upper bounds of normal forces with `UNBOUNDED`."""
    return bounds[0], np.minimum(bounds[1], UNBOUNDED)
