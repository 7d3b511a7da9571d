"""What all fast paths of `WholeBodyController` share: does the problem fit, its tables of numbers, Pinocchio's live views.

`obstacle` says in words why a problem does not fit. A `Program` holds the tables of one controller and runs one tick:
`Compiled` of `compiled.py` by the kernel, `Reduced` of `reduced.py` by numpy. Rows of tables that belong to one robot or one
contact are made once and kept, so that a controller with other contacts is cheap.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import prod
from threading import Lock
from typing import TYPE_CHECKING, Any, ClassVar, Literal, cast

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._arrays import Array
from floatbase.dynamics import Contact, Contacts, FlatFootContact, PointContact
from floatbase.errors import InputError
from floatbase.friction import FrictionPolyhedron
from floatbase.objectives import CoMTask, ForceTask, FrameTask, OrientationTask, PostureTask, Task, TorqueTask, nearest_rotation
from floatbase.robots import Robot

if TYPE_CHECKING:
    from floatbase.control import Limits

COM, ORIENTATION, FRAME, POSTURE, FORCE, TORQUE = range(6)  # kinds of task, and
POINT, FLAT = range(2)  # of contact, as in the kernel
_KINDS: dict[type, int] = {
    CoMTask: COM, OrientationTask: ORIENTATION, FrameTask: FRAME, PostureTask: POSTURE, ForceTask: FORCE, TorqueTask: TORQUE
}  # fmt: skip
# their axes stand still in the joint's own frame
_JOINTS = ("JointModelR", "JointModelPX", "JointModelPY", "JointModelPZ", "JointModelPrismatic", "JointModelFreeFlyer")
_WORLD = pin.Convention.WORLD
_POSE = 12  # numbers of a pose: rotation column by column, then the place


def obstacle(robot: Robot, contacts: Contacts, tasks: Sequence[Task], solver: str) -> str:
    """Why the fast paths cannot serve this problem, or "" when they can."""
    if solver != "daqp":
        return f"solver {solver!r} was asked for, and the fast paths have their own"
    for contact in contacts:
        if type(contact) not in (PointContact, FlatFootContact):
            return f"contact {contact.name!r} is a {type(contact).__name__}; the fast paths take point contacts and flat feet"
    for task in tasks:
        if type(task) not in _KINDS:
            return f"task {task.name!r} is a {type(task).__name__}; the fast paths take the tasks of the package"
    return _robot_obstacle(robot)


@lru_cache(maxsize=16)
def _robot_obstacle(robot: Robot) -> str:
    if robot.d == 0:
        return f"{robot.name} has no joints to drive"
    if robot.nv == 1:  # Pinocchio drops one dimension of its Jacobians
        return f"{robot.name} has a single joint and no base: the fast paths take two velocities or more"
    for i, joint in enumerate(robot.model.joints):
        kind = joint.shortname()
        if i and (not kind.startswith(_JOINTS) or (kind == "JointModelFreeFlyer" and i != 1)):
            return f"joint {robot.model.names[i]!r} is a {kind}; the fast paths take revolute and prismatic joints"
    return dynamics_of(robot).check()


@dataclass(frozen=True, eq=False)
class Dynamics:
    """Pinocchio's results of one robot as live views, and the tables that say how its joints hang together.

    views: M (nv, nv), h (nv,), J (6, nv), Ag (6, nv), oMi (n, 12), overwritten by every `update`. rates: dJ/dt (6, nv), twists
    (6 n,), by `update_rates`. tree: (n, 5), links: (n, 4) as in the kernel. lock: held from `update` until the views have been
    read.
    """

    robot: Robot
    data: pin.Data
    views: tuple[Array, ...]
    rates: tuple[Array, Array]
    tree: npt.NDArray[np.int64]
    links: Array
    lock: Any

    @property
    def mass(self) -> float:
        """Of all links, kg."""
        return float(self.links[1:, 0].sum())

    def update(self, q: Array, v: Array) -> None:
        """Fill the views for a configuration and a velocity: all that a tick needs from Pinocchio."""
        pin.nonLinearEffects(self.robot.model, self.data, q, v)
        pin.crba(self.robot.model, self.data, q, _WORLD)

    def update_rates(self, q: Array, v: Array) -> None:
        """Fill `rates`: how J moves, and the world's view of how all joints move, about its origin."""
        pin.computeJointJacobiansTimeVariation(self.robot.model, self.data, q, v)

    def check(self) -> str:
        """What is wrong with the views here, or ""."""
        q, v = self.robot.posture, np.linspace(-1.0, 1.0, self.robot.nv)
        with self.lock:
            self.update(q, v)
            self.update_rates(q, v)
            poses = np.array([_pose(placement) for placement in self.data.oMi])
            twists = np.concatenate([twist.vector for twist in self.data.ov])
            fits = np.array_equal(poses, self.views[-1]) and np.array_equal(self.views[0], self.views[0].T)
            fits &= np.array_equal(twists, self.rates[1])
        return "" if fits else "this Pinocchio lays its results out in another way in memory"


@lru_cache(maxsize=16)
def dynamics_of(robot: Robot) -> Dynamics:
    """One set of views for each robot, shared by its controllers."""
    model, data = robot.model, robot.model.createData()
    first = data.oMi[0].rotation.T
    oMi = np.lib.stride_tricks.as_strided(first, (model.njoints, _POSE), (8 * _POSE, 8))
    tree = [(model.parents[i], model.idx_vs[i], model.nvs[i], model.idx_qs[i], model.nqs[i]) for i in range(model.njoints)]
    links = [(inertia.mass, *inertia.lever) for inertia in model.inertias]
    views = (data.M, data.nle, data.J, data.Ag, oMi)
    rates = (data.dJ, np.lib.stride_tricks.as_strided(data.ov[0].linear, (6 * model.njoints,), (8,)))
    return Dynamics(robot, data, views, rates, np.array(tree, dtype=np.int64), np.array(links), Lock())


@dataclass(frozen=True, eq=False)
class _ContactTable:
    """One contact as programs take it: joint and kind, frame (16,), points (p, 3), cones (p, F + 1, 3)."""

    joint: int
    kind: int
    frame: Array
    points: Array
    cones: Array


@lru_cache(maxsize=256)
def _contact_table(robot: Robot, contact: PointContact | FlatFootContact, facets: int, inside: bool) -> _ContactTable:
    joint, pose = _frame(robot, contact.frame)
    polyhedron = FrictionPolyhedron(contact.normal, contact.mu, facets, inside)
    cone = np.vstack([polyhedron.rows, -polyhedron.normal])
    flat = isinstance(contact, FlatFootContact)
    radius = 0.0 if isinstance(contact, FlatFootContact) else contact.radius
    points = np.reshape(contact.corners if isinstance(contact, FlatFootContact) else contact.centre, (-1, 3))
    frame = np.concatenate([pose, contact.normal, [radius]])
    return _ContactTable(joint, int(flat), frame, np.array(points), np.tile(cone, (len(points), 1, 1)))


Answer = tuple[Array, int]  # numbers, and how many rows hold them
Target = tuple[int, int, tuple[int, ...], str, Callable[[float], npt.ArrayLike]]  # task, place in the table, shape, attribute


class Program(ABC):
    """The tables of one controller, and its tick.

    Raises `UnknownNameError` for a frame that does not exist; `fits` is False when a target has the wrong length, which the
    readable path puts into words.
    """

    path: ClassVar[Literal["compiled", "reduced"]]

    def __init__(self, robot: Robot, contacts: Contacts, tasks: Sequence[Task], limits: Limits):
        self.dynamics = dynamics_of(robot)
        self.robot, self.q_shape, self.v_shape, self.nv, self.d = robot, (robot.nq,), (robot.nv,), robot.nv, robot.d
        self.fits = True
        self._tasks = tuple(tasks)
        self._moving: list[Target] = []
        self._loose = [slice(place, place + 2) for _, _, _, place, size in self.dynamics.tree[1:] if size == 2]
        contact_tables = _stack_contacts(robot, contacts, limits)
        self.targets, task_tables = self._task_tables(robot, tasks, contacts.k)
        bounds = (np.array(limits.torque_limits), float(limits.min_normal_force))
        self.size, self.entries = self.nv + self.d + contacts.k, self.nv + contacts.k
        self.motion_rows = sum(len(contact.row_names) for contact in contacts)
        self._limited = np.isfinite(limits.torque_limits)
        self.force_rows = contact_tables[4].size
        self._prepare(contact_tables, task_tables, bounds)

    def __call__(self, q: Array, v: Array, t: float) -> tuple[Array, int, Array] | None:
        """The answer as `kernel.tick` lays it out, (q̈, τ, λ) first, how many rows hold it, and the targets of time t.

        None when the readable path must decide. q, v: writable float64 arrays.
        """
        if q.shape != self.q_shape or v.shape != self.v_shape:
            return None
        targets = self._targets_at(t) if self._moving else self.targets
        if targets is None:
            return None
        answer = self._answer(q, v, targets)
        return None if answer is None else (*answer, targets)

    def warm_up(self) -> None:
        """Run a tick, which compiles or loads what it needs, so that the loop need not wait for it."""
        standing = self.robot.standing()
        self(np.array(standing.q), np.array(standing.v), 0.0)

    @abstractmethod
    def _prepare(self, contact_tables: tuple[Any, ...], task_tables: tuple[Any, ...], bounds: tuple[Array, float]) -> None:
        """Take the tables of contacts and tasks, the torque limits (d,) and the least normal force."""

    @abstractmethod
    def _answer(self, q: Array, v: Array, targets: Array) -> Answer | None:
        """The answer for q (nq,), v (nv,) and all targets, and how many rows hold it; None as for the tick.

        It is (q̈, τ, λ), from `size` on the multipliers of the rows that push, from `size` + `entries` on their numbers.
        """

    def tasks(self, targets: Array) -> tuple[Task, ...]:
        """The tasks with the targets of one tick, as `__call__` gave them: functions may answer otherwise when asked again."""
        values: dict[int, dict[str, Any]] = {}
        for i, at, shape, name, _ in self._moving:
            values.setdefault(i, {})[name] = targets[at : at + prod(shape)].reshape(shape)
        return tuple(replace(cast(Any, task), **values[i]) if i in values else task for i, task in enumerate(self._tasks))

    def multipliers(self, answer: Array, held: int, rows: int) -> Array:
        """Multipliers of the readable problem's inequality rows, shape (rows,): there only limited joints have torque rows."""
        found = np.zeros(rows)
        place = np.cumsum(self._limited) - 1
        place = np.concatenate([place, place + np.sum(self._limited)])
        mu, numbers = answer[self.size :][:held], answer[self.size + self.entries :][:held].astype(np.int64)
        for number, push in zip(numbers, mu, strict=True):
            at = number if number < self.force_rows else self.force_rows + place[number - self.force_rows]
            found[at] = max(push, 0.0)
        return found

    def _targets_at(self, t: float) -> Array | None:
        """All targets at time t, in an array of their own: ticks of other threads may be under way. None for a wrong form."""
        targets = self.targets.copy()
        for _, at, shape, name, target in self._moving:
            try:
                value: Array = np.asarray(target(t), dtype=np.float64)
            except (TypeError, ValueError):
                return None
            if value.shape != shape or (name == "q" and not self._turned(value)):
                return None
            if name == "rotation":
                try:
                    value = nearest_rotation(name, value)
                except InputError:
                    return None
            targets[at : at + value.size] = value.ravel()
        return targets

    def _turned(self, q: Array) -> bool:
        """Whether (cos, sin) of joints without limits have length 1 in a posture asked for."""
        return all(abs(np.hypot(*q[turn]) - 1.0) <= 1e-6 for turn in self._loose)

    def _task_tables(self, robot: Robot, tasks: Sequence[Task], k: int) -> tuple[Array, tuple[Any, ...]]:
        """All targets in a row, and the tables tasks (N, 3), gains (N, 3), frames (N, 12)."""
        parts: list[Array] = []
        table, gains, frames = np.zeros((len(tasks), 3), np.int64), np.zeros((len(tasks), 3)), np.zeros((len(tasks), _POSE))
        for i, task in enumerate(tasks):
            frame = getattr(task, "frame", None)
            joint, frames[i] = (0, np.zeros(_POSE)) if frame is None else _frame(robot, frame)
            table[i] = _KINDS[type(task)], joint, sum(part.size for part in parts)
            gains[i] = task.weight, getattr(task, "kp", 0.0), getattr(task, "kd", 0.0)
            for name, shape in _targets(task, robot, k):
                value = getattr(task, name)
                at = sum(part.size for part in parts)
                parts.append(np.zeros(shape).ravel())
                if callable(value):
                    self._moving.append((i, at, shape, name, value))
                elif value is not None:
                    self.fits &= np.shape(value) == shape
                    parts[-1] = np.ravel(value) if np.shape(value) == shape else parts[-1]
        return np.concatenate([np.zeros(0), *parts]), (table, gains, frames)


def _stack_contacts(robot: Robot, contacts: Contacts, limits: Limits) -> tuple[Any, ...]:
    """Tables contacts (C, 4), frames (C, 16), points (P, 3), cones (P, F + 1, 3), lengths (P, F + 1)."""
    parts = [_contact_table(robot, _known(contact), limits.facets, limits.inside) for contact in contacts]
    table, at = np.zeros((len(parts), 4), np.int64), 0
    for i, part in enumerate(parts):
        table[i] = part.joint, part.kind, at, len(part.points)
        at += len(part.points)
    frames = np.array([part.frame for part in parts]).reshape(-1, 16)
    points = np.concatenate([np.zeros((0, 3)), *(part.points for part in parts)])
    cones = np.concatenate([np.zeros((0, limits.facets + 1, 3)), *(part.cones for part in parts)])
    return table, frames, points, cones, np.linalg.norm(cones, axis=2)


def _known(contact: Contact) -> PointContact | FlatFootContact:
    assert isinstance(contact, PointContact | FlatFootContact)  # `obstacle` has seen to it
    return contact


def _targets(task: Task, robot: Robot, k: int) -> tuple[tuple[str, tuple[int, ...]], ...]:
    """The targets of a task, in the order in which they are read: attribute and shape."""
    if isinstance(task, OrientationTask):
        return (("rotation", (3, 3)), ("angular_velocity", (3,)), ("angular_acceleration", (3,)))
    if isinstance(task, PostureTask):
        return (("q", (robot.nq,)),)
    if isinstance(task, ForceTask):
        return (("target", (k,)),)
    if isinstance(task, TorqueTask):
        return (("target", (robot.d,)),)
    return (("position", (3,)), ("velocity", (3,)), ("acceleration", (3,)))


def _frame(robot: Robot, frame: str) -> tuple[int, Array]:
    """The joint that carries a frame, and the frame's pose in it, shape (12,)."""
    found = robot.model.frames[robot.frame_id(frame)]
    return int(found.parentJoint), _pose(found.placement)


def _pose(placement: pin.SE3) -> Array:
    return np.concatenate([placement.rotation.T.ravel(), placement.translation])
