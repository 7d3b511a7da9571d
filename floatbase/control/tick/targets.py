"""The targets of a problem's tasks as one array, which the compiled tick reads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import prod
from types import MappingProxyType
from typing import Any, NamedTuple, cast

import numpy as np

from floatbase._validation import Array, as_array, cached_property
from floatbase.control.problem import Problem
from floatbase.errors import InputError
from floatbase.objectives import Task
from floatbase.objectives._task import TargetTask

COM, ANGULAR_MOMENTUM, ORIENTATION, FRAME, AXIS, POSTURE, FORCE, TORQUE = range(8)
CENTRE_OF_PRESSURE = 8
# kind, then indices in the task's targets: of the value, from one row of it to the next, of
# velocity and acceleration. A pose in a reference is a position and an orientation in it.
_TASK_ROWS: Mapping[str, tuple[tuple[int, ...], ...]] = {
    "com": ((COM, 0, 1, 3, 6),),
    "angular momentum": ((ANGULAR_MOMENTUM, 0, 0, 0, 3),),
    "orientation": ((ORIENTATION, 0, 3, 9, 12),),
    "frame": ((FRAME, 0, 1, 3, 6),),
    "axis": ((AXIS, 0, 1, 3, 6),),
    "relative pose": ((FRAME, 3, 4, 16, 22), (ORIENTATION, 0, 4, 19, 25)),
    "posture": ((POSTURE, 0, 0, 0, 0),),
    "force": ((FORCE, 0, 0, 0, 0),),
    "torque": ((TORQUE, 0, 0, 0, 0),),
    "centre of pressure": ((CENTRE_OF_PRESSURE, 0, 0, 0, 0),),
}


def compiled_rows(task: Task) -> tuple[tuple[int, ...], ...]:
    """Return the compiled form of a task, which its own class declares, or ().

    The residual of a task without a compiled form is called.
    """
    return _TASK_ROWS.get(vars(type(task)).get("compiled_as", ""), ())


class TaskTargets(NamedTuple):
    """The targets of one task."""

    task_index: int  # in the problem's tasks
    rows: tuple[tuple[int, ...], ...]  # of `_TASK_ROWS`
    task: TargetTask
    shapes: Mapping[str, tuple[int, ...]]  # of the target and its derivatives, by field
    entries: slice  # in the array of all targets


class TargetLayout:
    """Positions of all targets in one array: those of the tasks with a compiled form."""

    def __init__(self, problem: Problem):
        self._problem = problem
        self.size = 0
        self.tasks = list[TaskTargets]()
        robot, k = problem.robot, problem.contacts.k
        for i, task in enumerate(problem.tasks):
            if rows := compiled_rows(task):
                target_task = cast(TargetTask, task)
                shapes = target_task.shapes_for(robot, k)
                end = self.size + sum(prod(shape) for shape in shapes.values())
                self.tasks.append(TaskTargets(i, rows, target_task, shapes, slice(self.size, end)))
                self.size = end
        # of several tasks with the same name, the first one
        self.names = MappingProxyType(
            {each.task.name: each.entries for each in reversed(self.tasks)}
        )
        # those that are functions of time
        self.varying = [each for each in self.tasks if each.task.is_time_varying]

    def at(self, t: float) -> Array:
        """Return all targets at a time, a new array."""
        targets = self.constant.copy()
        for each in self.varying:
            self._write(each, targets, t)
        return targets

    @cached_property
    def constant(self) -> Array:
        """Array with the constant targets, and zeros for those that are functions of time."""
        targets = np.zeros(self.size)
        for each in self.tasks:
            if not each.task.is_time_varying:
                self._write(each, targets, 0.0)
        return targets

    def _write(self, each: TaskTargets, targets: Array, t: float) -> None:
        """Write the targets of one task at a time into the array."""
        first = each.entries.start
        for value in each.task.targets_at(self._problem.robot, self._problem.contacts.k, t):
            targets[first : first + value.size] = value.ravel()
            first += value.size

    def fixed_tasks(self, targets: Array) -> list[Task]:
        """Return the problem's tasks with constant targets from an array."""
        tasks: list[Task] = list(self._problem.tasks)
        for each in self.tasks:
            values, first = {}, each.entries.start
            for name, shape in each.shapes.items():
                values[name] = targets[first : first + prod(shape)].reshape(shape)
                first += prod(shape)
            tasks[each.task_index] = replace(cast(Any, each.task), **values)
        return tasks

    def fixed_problem(self, targets: Array) -> Problem:
        """Return the problem with constant targets from an array."""
        tasks = self.fixed_tasks(as_array("targets", targets, (self.size,)))
        for each in self.tasks:  # checks that need the robot
            cast(TargetTask, tasks[each.task_index]).targets_at(
                self._problem.robot, self._problem.contacts.k, 0.0
            )
        return replace(self._problem, tasks=tasks)

    def check_size(self, targets: Array) -> None:
        """Raise `InputError` if an array does not have one entry for each target."""
        if targets.shape != (self.size,):
            raise InputError(
                f"targets has shape {targets.shape}; it must have shape ({self.size},). Start from "
                f"controller.targets_at(t), and write into the entries that controller.targets "
                f"names: {', '.join(self.names)}."
            )
