"""Inputs of a tick other than the state: time-varying targets and user-defined terms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias, cast

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array, as_array, read_only
from floatbase.affine import Affine
from floatbase.control.capture_point import CapturePointRows
from floatbase.control.limits import BLOCKS, LinearInequality
from floatbase.control.problem import Problem, residual_of
from floatbase.control.tick.problem_arrays import (
    CAPTURE_POINT,
    USER_DEFINED,
    acceleration_of,
    contact_kind,
    soft_contact_task,
)
from floatbase.control.tick.targets import compiled_rows
from floatbase.dynamics import (
    EquationsOfMotion,
    FrictionContact,
    LinearConstraint,
    MotionConstraint,
    constraint_and_jacobian,
    equations_of_motion,
)
from floatbase.dynamics._compiled import acceleration_at
from floatbase.errors import InputError
from floatbase.robots import State

UNBOUNDED = 1e300  # N, for inf among numbers that must be finite
# rows of an inequality: their numbers as `inequalities.Inequalities` describes them; G and h, or
# None if the tick computes them
Group: TypeAlias = tuple[Array, tuple[Array, Array] | None]
_NO_ROWS: Group = np.zeros(3), (np.zeros((0, 0)), np.zeros(0))


class TickInputs(NamedTuple):
    """Inputs of one tick other than the state."""

    # targets, minimum and maximum normal force of each point, then user-defined contacts, tasks
    # and rows
    packed: Array
    n_user_rows: int = 0  # of all user-defined tasks
    # A, b and J of each user-defined contact, acceleration of each other one that prescribes it
    contacts: Sequence[tuple[Array, ...]] = ()
    # weight and residual of user-defined tasks, by their index in the problem
    residuals: Mapping[int, tuple[float, Affine]] = MappingProxyType({})
    # G and h of user-defined rows, None for rows that the tick computes
    inequalities: Sequence[tuple[Array, Array] | None] = ()


class UserTerms:
    """User-defined objects of a problem, which the problem arrays do not contain.

    Raises `InputError` if an inequality with constant coefficients does not fit the problem.
    """

    def __init__(self, problem: Problem):
        self._problem, self._limits = problem, problem.limits
        soft = soft_contact_task(problem)
        self._tasks = [
            (i, task, BLOCKS.index(task.block))
            for i, task in enumerate(problem.tasks)
            if not compiled_rows(task) and task is not soft
        ]
        rigid = problem.contacts if soft is None else ()
        self._contacts = [contact for contact in rigid if _has_inputs(contact)]
        self._inequalities = [
            (each, _fixed_group(problem, each))
            for each in self._limits.all_inequalities(problem.contacts)
        ]
        # of the terms that need a state
        self.names = [
            contact.name for contact in self._contacts if contact_kind(contact) == USER_DEFINED
        ]
        self.names += [task.name for _, task, _ in self._tasks]
        self.names += [each.name for each, fixed in self._inequalities if fixed is None]
        self.any = bool(self.names or self._contacts)
        self.varies = self.any or self._limits.time_varying
        placeholders = np.zeros(2 * problem.contacts.n_points)
        self._constant_bounds = placeholders if self._limits.time_varying else self._bounds_at(0.0)

    def constant_inputs(self, targets: Array, n_contact_numbers: int) -> TickInputs:
        """Return targets and all that is constant, and zeros for what functions return.

        There are as many zeros as a tick without a state needs.
        """
        zeros = np.zeros(n_contact_numbers + 3 * len(self._tasks))
        groups = [fixed or _NO_ROWS for _, fixed in self._inequalities]
        packed = [targets, self._constant_bounds, zeros, *(numbers for numbers, _ in groups)]
        return TickInputs(np.concatenate(packed), inequalities=[rows for _, rows in groups])

    def _bounds_at(self, t: float) -> Array:
        """Return the minimum, then the maximum normal force of each point at a time, (2 P,)."""
        bounds: Array = np.concatenate(self._limits.hard_normal_forces(self._problem.contacts, t))
        return bounds.clip(max=UNBOUNDED)

    def inputs(self, targets: Array, q: Array, v: Array, t: float) -> TickInputs:
        """Return the inputs of a tick at a state.

        Raises `InputError`, or what user functions raise.
        """
        problem, contacts, inequalities = self._problem, list[tuple[Array, ...]](), []
        bounds = self._bounds_at(t) if self._limits.time_varying else self._constant_bounds
        packed: list[npt.ArrayLike] = [targets, bounds]
        residuals, n_user_rows = dict[int, tuple[float, Affine]](), 0
        eom: Any = None
        if self.names:
            state = State.unchecked(problem.robot, q, v)  # the compiled tick checks q and v
            eom = EquationsOfMotion(state, problem.contacts, t)
        for contact in self._contacts:
            if contact_kind(contact) != USER_DEFINED:
                contacts.append((acceleration_at(acceleration_of(contact), t),))
                packed += contacts[-1]
                continue
            A, b, J = constraint_and_jacobian(contact, eom.state, t)
            contacts.append((A, b, J))
            packed += A.ravel(), b, J.ravel()
            if isinstance(contact, FrictionContact):
                shape = len(contact.point_names), 3
                packed.append(as_array("positions", contact.positions(eom.state), shape).ravel())
        for i, task, block in self._tasks:
            residual, weight = residual_of(task, eom, t), float(task.weight)
            if not weight >= 0.0:
                raise InputError(f"weight of {task.name} is {weight:g}. It must be ≥ 0.")
            residuals[i], A, b = (weight, residual), residual.A, residual.b
            n_user_rows += len(b)
            packed += (block, len(b), weight), A.ravel(), b
        for each, fixed in self._inequalities:
            numbers, rows = fixed or _group(each, eom, t)
            packed.append(numbers)
            inequalities.append(rows)
        return TickInputs(np.concatenate(packed), n_user_rows, contacts, residuals, inequalities)

    def equations(self, state: State, t: float, inputs: TickInputs) -> EquationsOfMotion:
        """Return the equations (7) with the values of user-defined contacts in a tick."""
        contacts = self._problem.contacts
        if not self._contacts:
            return equations_of_motion(state, contacts, t)
        given, rows = iter(inputs.contacts), list[tuple[Array, ...]]()
        for contact in contacts:
            inputs_of_contact = next(given) if _has_inputs(contact) else ()
            if contact_kind(contact) == USER_DEFINED:
                rows.append(inputs_of_contact)
            else:
                constant = _with_acceleration(contact, *inputs_of_contact)
                rows.append(constraint_and_jacobian(constant, state, t))
        A, b, J = (read_only(np.concatenate(parts)) for parts in zip(*rows, strict=True))
        return EquationsOfMotion(state, contacts, t, A=A, b=b, J=J)


def _has_inputs(contact: MotionConstraint) -> bool:
    """Return whether the tick's inputs have numbers of a contact."""
    return contact_kind(contact) == USER_DEFINED or acceleration_of(contact) is not None


def _with_acceleration(contact: Any, *acceleration: Array) -> MotionConstraint:
    """Return a contact with a constant acceleration, or the contact itself if none is given."""
    for value in acceleration:
        is_linear = isinstance(contact, LinearConstraint)
        part = replace(contact.function if is_linear else contact, acceleration=value)
        contact = replace(contact, function=part) if is_linear else part
    return cast(MotionConstraint, contact)


def _group(each: LinearInequality, eom: EquationsOfMotion, t: float = 0.0) -> Group:
    """Return the rows of an inequality at a state."""
    G, h = each.at(eom, t)
    if each.row_names:
        each.labels(len(h))  # raises if their number does not match
    header = (BLOCKS.index(each.block), len(h), each.weight or 0.0)
    return np.concatenate([header, G.ravel(), h]), (G, h)


def _fixed_group(problem: Problem, each: LinearInequality) -> Group | None:
    """Return the rows of an inequality if they need no function at each step, otherwise None."""
    given, n = each.coefficients, problem.contacts.n_points
    if type(given) is CapturePointRows:
        parameters = given.margin, given.horizon, problem.robot.gravity
        header = (CAPTURE_POINT, n, each.weight or 0.0, *parameters)
        return np.append(header, np.zeros(max(3 * n - 3, 0))), None
    if callable(given):
        return None
    return _group(each, EquationsOfMotion(problem.robot.standing(), problem.contacts))
