"""A problem as plain arrays for the compiled tick.

The arrays of one robot or one contact are made once, so that a controller with other contacts is
cheap.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, TypeAlias, cast

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._validation import Array
from floatbase.control.joint_limits import JointLimits
from floatbase.control.limits import BLOCKS, hard_maximum
from floatbase.control.problem import AssumedModel, Problem, assumed_model
from floatbase.control.soft import ContactMotionTask, SoftConstraint
from floatbase.control.tick.targets import TargetLayout
from floatbase.dynamics import (
    FlatFootContact,
    FrictionContact,
    LinearConstraint,
    MotionConstraint,
    PointContact,
    RollingWheel,
)
from floatbase.dynamics._compiled import Acceleration, FrameConnection, FrameMotion
from floatbase.friction import FrictionPolyhedron
from floatbase.objectives import AxisTask
from floatbase.robots import Robot

POINT, FLAT, WHEEL, FRAME, CONNECTION, USER_DEFINED = range(6)  # kinds of contacts
CONTACT_KINDS: dict[type, int] = {PointContact: POINT, FlatFootContact: FLAT, RollingWheel: WHEEL}
QDD, TAU, FORCES = range(len(BLOCKS))
CAPTURE_POINT = len(BLOCKS)  # of a group of rows that the tick computes itself
_POSE_SIZE = 12  # numbers of a pose: rotation column by column, then position
_FRAME_SIZE = _POSE_SIZE + 7  # of `ContactTable.frames`
# entries of `sizes`: numbers of joints, contacts, points, rows of eq. (5), rows of one cone
# (its facets and the minimum normal force), rows of `TaskTable`, driven joints, entries of λ,
# targets, numbers of user-defined contacts, user-defined tasks, groups of user-defined inequalities
N_JOINTS, N_CONTACTS, N_POINTS, N_MOTION_ROWS, N_CONE_ROWS, N_TASKS, N_DRIVEN = range(7)
N_FORCES, N_TARGETS, N_CONTACT_NUMBERS, N_USER_TASKS, N_INEQUALITIES = range(7, 12)
# then 1 or 0: A and J are equal, `Inequalities.has_optional`, there are joint limits
SAME_ROWS, HAS_OPTIONAL, HAS_JOINT_LIMITS = range(12, 15)
UNDERACTUATED, HAS_CONES = range(15, 17)  # likewise, as in `AssumedModel`
Indices: TypeAlias = npt.NDArray[np.int64]
# facets, inner_approximation and facet_rotation of a `FrictionPolyhedron`
PolyhedronOptions: TypeAlias = tuple[int, bool, float]


def contact_kind(contact: MotionConstraint) -> int:
    """Return the kind of a contact in the tables of the tick."""
    if type(contact) is LinearConstraint:
        kinds = {FrameMotion: FRAME, FrameConnection: CONNECTION}
        return kinds.get(type(contact.function), USER_DEFINED)
    return CONTACT_KINDS.get(type(contact), USER_DEFINED)


def acceleration_of(contact: MotionConstraint) -> Acceleration:
    """Return the acceleration that the rows of a contact prescribe; the tick's inputs contain it.

    The inputs contain all rows of user-defined contacts.
    """
    if contact_kind(contact) == USER_DEFINED:
        return None
    part: Any = contact.function if isinstance(contact, LinearConstraint) else contact
    return cast(Acceleration, getattr(part, "acceleration", None))


def soft_contact_task(problem: Problem) -> ContactMotionTask | None:
    """Return the task of soft contacts if the tick computes the rows of all, otherwise None."""
    tasks = [task for task in problem.tasks if type(task) is ContactMotionTask]
    rigid = [each.contact for each in problem.contacts if isinstance(each, SoftConstraint)]
    if len(tasks) != 1 or len(rigid) < len(problem.contacts) or list(tasks[0].contacts) != rigid:
        return None
    fixed = [contact_kind(c) != USER_DEFINED and acceleration_of(c) is None for c in rigid]
    return tasks[0] if all(fixed) else None


@lru_cache(maxsize=16)
def pack_robot(robot: Robot) -> tuple[Indices, tuple[Array, ...]]:
    """Return the tables of `dynamics.Model`: the tree, then links, joints and armature."""
    model = robot.model
    tree, joints, links = [], [], []
    for i, (joint, link) in enumerate(zip(model.joints, model.inertias, strict=True)):
        indices = (model.idx_vs[i], model.nvs[i], model.idx_qs[i], model.nqs[i])
        tree.append((model.parents[i], *indices, joint.shortname().startswith("JointModelP")))
        data, axis = joint.createData(), np.zeros(3)
        if joint.nv == 1:
            joint.calc(data, np.eye(joint.nq)[0])
            axis = np.ravel(data.S).reshape(2, 3).sum(axis=0)  # linear or angular
        joints.append([*_flat_pose(model.jointPlacements[i]), *axis])
        links.append([*link.inertia.ravel(), *link.lever, link.mass])
    return np.array(tree, np.int64), (np.array(links), np.array(joints), np.array(model.armature))


def pack_problem(problem: Problem, layout: TargetLayout) -> tuple[Indices, Indices, Array]:
    """Return a problem as the arrays of `tick.unpack`.

    Raises `UnknownNameError` if a frame does not exist.
    """
    soft = soft_contact_task(problem)
    contacts, frames, points, cones = _pack_contacts(problem, soft)
    forces = problem.contacts.point_force_indices[::3]
    points = np.column_stack([points, forces])
    cones[:, 4] = np.repeat(forces, problem.limits.facets + 1)
    tasks, gains, poses = _pack_tasks(problem, layout)
    (tree, robot_tables), limits = pack_robot(problem.robot), problem.limits
    assumed = assumed_model(problem) or AssumedModel()
    gravity = assumed.gravity * np.array(problem.robot.model.gravity.linear)
    terms = (*gravity, assumed.mass, assumed.velocity_forces, assumed.drift)
    contacts[:, 6] = [name in assumed.ignored_contacts for name in problem.contacts.names]
    n_inequalities = len(limits.all_inequalities(problem.contacts))
    kinds = contacts[:, 1]
    sizes = {
        N_JOINTS: len(tree),
        N_CONTACTS: len(contacts),
        N_POINTS: len(points),
        N_MOTION_ROWS: contacts[:, 4].sum(),
        N_CONE_ROWS: limits.facets + 1,
        N_TASKS: len(tasks),
        N_DRIVEN: problem.robot.d,
        N_FORCES: problem.contacts.k,
        N_TARGETS: layout.size,
        N_CONTACT_NUMBERS: contact_numbers(contacts, problem.robot.nv),
        N_USER_TASKS: len(problem.tasks) - len(layout.tasks) - (soft is not None),
        N_INEQUALITIES: n_inequalities,
        SAME_ROWS: not np.any((kinds == FLAT) | (kinds == USER_DEFINED) | contacts[:, 6]),
        HAS_OPTIONAL: n_inequalities > 0 or np.any(hard_maximum(problem.contacts, limits)),
        HAS_JOINT_LIMITS: limits.joint_limits is not None,
        UNDERACTUATED: assumed.underactuated,
        HAS_CONES: assumed.cones,
    }
    float_tables = (
        terms, *robot_tables, frames, points, gains, poses, cones, limits.torque_limits,
        *_pack_joint_limits(limits.joint_limits, problem.robot.d), soft.weight if soft else 0.0,
    )  # fmt: skip
    int_tables = np.concatenate([np.ravel(table) for table in (tree, contacts, tasks)])
    return (
        np.array([sizes[entry] for entry in range(len(sizes))], np.int64),
        int_tables,
        np.concatenate([np.ravel(table) for table in float_tables]),
    )


def contact_numbers(contacts: Indices, nv: int) -> int:
    """Return how many of a tick's inputs belong to contacts. contacts: table of `ContactTable`."""
    user = contacts[contacts[:, 1] == USER_DEFINED]
    matrices = sum(m * (nv + 1) + k * nv + 3 * n for n, m, k in user[:, 3:6])
    return int(matrices + np.sum(contacts[:, 7]))


def _pack_joint_limits(limits: JointLimits | None, d: int) -> tuple[Array, Array]:
    """Return the table (6, d) of `inequalities.joint_bounds`, then control period and weight."""
    if limits is None:
        return np.zeros((6, d)), np.zeros(2)
    maxima = limits.speeds, limits.acceleration, *limits.decelerations
    table = np.array([limits.lower, limits.upper, *maxima])
    return table, np.array([limits.period, limits.weight or 0.0])


def _pack_contacts(problem: Problem, soft: ContactMotionTask | None) -> tuple[Any, ...]:
    """Return contacts (C, 9), frames (C, 19) and points (P, 3), and cones (P (F + 1), 5).

    The first two arrays are those of `kinematics.ContactTable`, the last is `Inequalities.cones`.
    """
    limits = problem.limits
    found = [
        _pack_contact(problem.robot, contact, limits.polyhedron_options)
        for contact in (problem.contacts if soft is None else soft.contacts)
    ]
    table, frames, points, cones = zip(*found, strict=True) if found else ((), (), (), ())
    tables = np.array(table, np.int64).reshape(-1, 9)
    tables[:, 2] = np.cumsum(tables[:, 3]) - tables[:, 3]
    return tables, *(
        np.concatenate([np.zeros((0, width)), *parts])
        for width, parts in ((_FRAME_SIZE, frames), (3, points), (5, cones))
    )


def _pack_contact(
    robot: Robot, contact: MotionConstraint, options: PolyhedronOptions
) -> tuple[tuple[int, ...], Array, Array, Array]:
    """Return one contact: table row, frame (1, 19), points (p, 3) and cones (p (F + 1), 5)."""
    if contact_kind(contact) != USER_DEFINED:
        return _pack_builtin_contact(robot, cast(Any, contact), options)
    n = 0
    cones: Array = np.zeros((0, 5))
    if isinstance(contact, FrictionContact):
        n, cones = len(contact.point_names), _cones(contact, options)
    row = (0, USER_DEFINED, 0, n, len(contact.row_names), contact.k, 0, 0, 0)
    return row, np.zeros((1, _FRAME_SIZE)), np.zeros((n, 3)), cones


@lru_cache(maxsize=256)
def _pack_builtin_contact(
    robot: Robot, contact: Any, options: PolyhedronOptions
) -> tuple[tuple[int, ...], Array, Array, Array]:
    """Return one contact of a built-in class, as `_pack_contact` does."""
    kind, surface, other = contact_kind(contact), np.zeros(7), 0
    cones: Array = np.zeros((0, 5))
    points: Array = np.zeros((0, 3))
    if kind in (FRAME, CONNECTION):
        frame = contact.function.frame
        other = _frame_placement(robot, getattr(contact.function, "other", "universe"))[0]
    else:
        frame, cones = contact.frame, _cones(contact, options)
        points = np.reshape(contact.corners if kind == FLAT else contact.centre, (-1, 3))
        surface[:3], surface[3] = contact.normal, getattr(contact, "radius", 0.0)
        surface[4:] = getattr(contact, "axis", 0.0)
    joint, pose = _frame_placement(robot, frame)
    n_inputs = 0 if acceleration_of(contact) is None else 3
    numbers = len(points), len(contact.row_names), contact.k
    row = (joint, kind, 0, *numbers, 0, n_inputs, other)
    return row, np.concatenate([pose, surface])[None], points, cones


def _cones(contact: FrictionContact, options: PolyhedronOptions) -> Array:
    """Return facets and -normal of each point with their lengths, and a zero, (p (F + 1), 5)."""
    polyhedron = FrictionPolyhedron(contact.normal, contact.mu, *options)
    rows = np.vstack([polyhedron.face_matrix, -polyhedron.normal])
    cones = np.column_stack([rows, np.linalg.norm(rows, axis=1), np.zeros(len(rows))])
    return np.tile(cones, (len(contact.point_names), 1))


def _pack_tasks(problem: Problem, layout: TargetLayout) -> tuple[Any, ...]:
    """Return tasks (N, 7), gains (N, 3) and frames (2 N, 12): the tables of `costs.TaskTable`.

    Only the built-in tasks are included, so the positions of user-defined tasks in the list do not
    matter.
    """
    table, gains, poses = list[tuple[int, ...]](), list[tuple[float, ...]](), list[Array]()
    for _, rows, task, _, entries in layout.tasks:
        joint, pose = _frame_placement(problem.robot, getattr(task, "frame", "universe"))
        reference, place = _frame_placement(problem.robot, getattr(task, "reference", "universe"))
        if isinstance(task, AxisTask):
            pose[:3] = pose[:9].reshape(3, 3).T @ np.asarray(task.axis)
        for kind, value, stride, *derivatives in rows:
            indices = [entries.start + index for index in (value, *derivatives)]
            table.append((kind, joint, reference, stride, *indices))
            gains.append((task.weight, getattr(task, "kp", 0.0), getattr(task, "kd", 0.0)))
            poses += pose, place
    return (
        np.array(table, np.int64).reshape(-1, 7),
        np.array(gains).reshape(-1, 3),
        np.array(poses).reshape(-1, _POSE_SIZE),
    )


def _frame_placement(robot: Robot, name: str) -> tuple[int, Array]:
    """Return the joint that carries a frame, and the frame's pose in it, shape (12,)."""
    frame = robot.model.frames[robot.frame_id(name)]
    return int(frame.parentJoint), _flat_pose(frame.placement)


def _flat_pose(pose: pin.SE3) -> Array:
    """Return a pose as 12 numbers."""
    return np.concatenate([pose.rotation.T.ravel(), pose.translation])
