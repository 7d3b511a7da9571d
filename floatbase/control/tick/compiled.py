"""The compiled tick as the controller calls it: whether it can run a problem, and the class that runs it.

numba takes a while to load, so the files that need it are imported when the first problem is compiled.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache
from math import prod
from threading import Timer
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from floatbase._arrays import Array
from floatbase.control.tick.tables import CONTACT_KINDS, TASK_KINDS, dynamics_of, tables_of
from floatbase.errors import InputError
from floatbase.objectives import Task, nearest_rotation
from floatbase.robots import Robot, check_unit_lengths

if TYPE_CHECKING:
    from floatbase.control.problem import Problem

# joints whose axes stand still in their own frame
_JOINTS = ("JointModelR", "JointModelPX", "JointModelPY", "JointModelPZ", "JointModelPrismatic", "JointModelFreeFlyer")


@contextmanager
def announce_if_slow(text: str, after: float = 6.0) -> Iterator[None]:
    """Print a text on the error stream when the work inside takes more than `after` s."""
    timer = Timer(after, lambda: print(text, file=sys.stderr, flush=True))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def cache_warning() -> str:
    """What to add to a message where compiled code cannot be kept on disk, or ""."""
    from floatbase.control.tick import jit

    remedy = "set NUMBA_CACHE_DIR to a folder that has room and can be written to"
    return f"; what is compiled cannot be kept ({jit.cache_trouble}): {remedy}" if jit.cache_trouble else ""


def obstacle(problem: Problem, solver: str) -> str:
    """Why a problem cannot run compiled, or "" where it can. solver: name of the requested QP back end."""
    if solver != "daqp":
        return f"solver {solver!r} was requested, and the compiled tick has its own"
    for contact in problem.contacts:
        if type(contact) not in CONTACT_KINDS:
            return f"contact {contact.name!r} is a {type(contact).__name__}; the compiled tick takes points and flat feet"
    for task in problem.tasks:
        if type(task) not in TASK_KINDS:
            return f"task {task.name!r} is a {type(task).__name__}; the compiled tick takes the tasks of the package"
    try:
        from floatbase.control.tick import jit, tick  # noqa: F401
    except (ImportError, OSError, AttributeError) as error:
        return f"numba cannot be loaded ({error}); pip install numba may mend it"
    if not jit.compiles:
        return "NUMBA_DISABLE_JIT is set, and numba compiles nothing"
    return _robot_obstacle(problem.robot)


@lru_cache(maxsize=16)
def _robot_obstacle(robot: Robot) -> str:
    if robot.d == 0:
        return f"{robot.name} has no joints to drive"
    if robot.nv == 1:  # Pinocchio drops one dimension of its Jacobians
        return f"{robot.name} has a single joint and no base: the compiled tick takes two velocities or more"
    for i, joint in enumerate(robot.model.joints):
        kind = joint.shortname()
        if i and (not kind.startswith(_JOINTS) or (kind == "JointModelFreeFlyer" and i != 1)):
            return f"joint {robot.model.names[i]!r} is a {kind}; the compiled tick takes revolute and prismatic joints"
    return "" if dynamics_of(robot).fits else "this Pinocchio lays its results out in another way in memory"


class Compiled:
    """The compiled tick of one problem, for which `obstacle` is "".

    A call with q (nq,) and v (nv,), writable float64 arrays, and t in s returns None where the readable path must decide, else
    the array of numbers that `tick.tick` fills, how many rows are active, and the targets at t.

    qdd, tau, forces: where these are among the numbers.
    arguments: what `tick.tick` takes after q, v and the targets, but for the answer and the parts to run.
    targets: as in `costs.TaskTable`, zeros for those that move.
    workspace: real and whole numbers, memory of the tick.

    Raises `UnknownNameError` for a frame that does not exist and `InputError` for a still target of the wrong shape.
    """

    def __init__(self, problem: Problem):
        from floatbase.control.tick import tick

        robot, nv, d, k = problem.robot, problem.robot.nv, problem.robot.d, problem.contacts.k
        self._problem, self.dynamics = problem, dynamics_of(robot)
        *tables, self.targets, self._moving = tables_of(problem)
        self._q_shape, self._v_shape, self._n_multipliers = (robot.nq,), (nv,), nv + k
        self.qdd, self.tau, self.forces = slice(0, nv), slice(nv, nv + d), slice(nv + d, nv + d + k)
        n_floats, n_ints = tick.workspace_sizes(tables[0])
        self.workspace = np.empty(n_floats), np.empty(n_ints, np.int64)  # of one tick at a time: the dynamics' lock sees to it
        self.arguments = *self.dynamics.views, *tables, *self.workspace
        self._tick, self._parts = tick.tick, tick.PARTS

    def __call__(self, q: Array, v: Array, t: float) -> tuple[Array, int, Array] | None:
        if q.shape != self._q_shape or v.shape != self._v_shape:
            return None
        targets = self._targets_at(t) if self._moving else self.targets
        if targets is None:
            return None
        dynamics, answer = self.dynamics, self.empty_answer()
        with dynamics.lock:
            dynamics.update(q, v)
            n_active = self._tick(q, v, targets, *self.arguments, answer, self._parts)
        return (answer, n_active, targets) if n_active >= 0 else None

    def warm_up(self) -> str:
        """Run a tick, which compiles what it needs or loads it from disk, so that the loop need not wait for it.

        Returns why that is not possible, or "".
        """
        standing = self._problem.robot.standing()
        q, v = np.array(standing.q), np.array(standing.v)
        with announce_if_slow(f"floatbase compiles its controller{cache_warning() or ', once: about a minute'}."):
            try:
                with self.dynamics.lock:
                    self.dynamics.update(q, v)
                    self._tick(q, v, self.targets, *self.arguments, self.empty_answer(), self._parts)
            except Exception as error:  # whatever numba raises, the readable path does without; no code of the user's runs
                return f"numba could not compile the tick ({type(error).__name__}: {error})"
        return ""

    def empty_answer(self) -> Array:
        """An array for the numbers of one tick."""
        return np.empty(self.forces.stop + 2 * self._n_multipliers)

    def tasks(self, targets: Array) -> tuple[Task, ...]:
        """The tasks with the targets of one tick, as a call returned them: functions may return others when called again."""
        values: dict[int, dict[str, Any]] = {}
        for task, first, shape, name, _ in self._moving:
            values.setdefault(task, {})[name] = targets[first : first + prod(shape)].reshape(shape)
        return tuple(replace(cast(Any, task), **values.get(i, {})) for i, task in enumerate(self._problem.tasks))

    def multipliers(self, numbers: Array, n_active: int) -> Array:
        """Multipliers of all inequality rows of the readable QP, from what a call returned."""
        limits, n_points = self._problem.limits, self._problem.contacts.n_points
        limited = np.isfinite(limits.torque_limits)  # the readable QP has rows for these joints only
        has_row = np.concatenate([np.full(n_points * (limits.facets + 1), True), limited, limited])
        mu, active = numbers[self.forces.stop :].reshape(2, -1)[:, :n_active]
        multipliers = np.zeros(has_row.size)
        multipliers[active.astype(np.int64)] = np.maximum(mu, 0.0)
        return multipliers[has_row]

    def _targets_at(self, t: float) -> Array | None:
        """All targets at time t, in an array of their own, as other threads may run ticks too. None for a bad target."""
        targets, robot = self.targets.copy(), self._problem.robot
        for _, first, shape, name, function in self._moving:
            try:
                value: Array = np.asarray(function(t), dtype=np.float64)
                if value.shape != shape:
                    return None
                if name == "rotation":
                    value = nearest_rotation(name, value)
                if name == "q":
                    check_unit_lengths(robot.model, name, value, first=2 if robot.is_floating else 1)
            except (TypeError, ValueError, InputError):
                return None
            targets[first : first + value.size] = value.ravel()
        return targets
