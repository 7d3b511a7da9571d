"""The whole-body QP: robot, contacts, tasks and limits, and the QP that they define at a state."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import islice
from typing import NamedTuple, TypeAlias, cast

import numpy as np

from floatbase._blas import one_blas_thread
from floatbase._validation import (
    Array,
    Value,
    as_bool,
    as_callable,
    as_instance,
    as_integer,
    as_positive,
    checked,
    frozen,
    short_repr,
)
from floatbase.affine import Affine
from floatbase.control._priorities import solve_levels, split_levels
from floatbase.control.limits import BLOCKS, SIZES, Limits, force_bounds, force_rows, torque_rows
from floatbase.dynamics import (
    CONSTRAINT_NOISE,
    Block,
    Contacts,
    EquationsOfMotion,
    equations_of_motion,
    resolved_constraint,
)
from floatbase.errors import FloatbaseError, InfeasibleError, InputError
from floatbase.objectives import CentreOfPressureTask, ForceTask, Task, TorqueTask, effort_weight
from floatbase.qp import QP, ConstraintLabel, Solution, solve
from floatbase.qp._changed import changed
from floatbase.qp.solve import Budget, solve_in_step
from floatbase.robots import Robot, State
from floatbase.robots._checks import as_torque_limits

ModifyQP: TypeAlias = Callable[[QP, EquationsOfMotion], QP]  # of `Problem.modify_qp`
Costs: TypeAlias = Sequence[tuple[Block, float, Affine]]  # block, weight and residual of each task
_TASK_ATTRIBUTES = ("block", "name", "weight", "residual")
# m/s²: contact rows that disagree by less do so because Jacobians and drifts are rounded
INCONSISTENCY_TOLERANCE = 1e-6


class AssumedModel(NamedTuple):
    """What a controller assumes instead of eqs. (5), (7) and (28), by default nothing else.

    A `modify_qp` runs compiled if its own class has `compiled_as = "assumed model"`, and these
    attributes.
    """

    mass: float = 1.0  # multiple of M and h
    gravity: float = 1.0  # multiple of the part of h that does not depend on the velocity
    velocity_forces: float = 1.0  # multiple of the other part of h
    drift: float = 1.0  # multiple of b
    ignored_contacts: Sequence[str] = ()  # contacts whose forces are missing from (7)
    underactuated: bool = True  # whether the base's rows of (7) hold
    cones: bool = True  # whether friction and minimum normal forces are constraints


@dataclass(frozen=True, eq=False)
class Problem(Value):
    """Control problem without a state: what a `WholeBodyController` solves.

    Parameters
    ----------
    robot : Robot
        The robot to control.
    contacts : Contacts
        Contacts of the robot with the ground.
    tasks : sequence of Task, or sequence of sequences of Task
        Tasks, or levels of tasks with strict priorities, the highest first. A `ForceTask` or a
        `TorqueTask` of weight `effort_weight` is added, to the last level, if no task acts on
        forces, or none on torques. A `CentreOfPressureTask` does not count, since it leaves most
        forces open.
        The attribute is the list of all tasks.
    limits : Limits
        Inequality constraints.
    modify_qp : callable, optional
        Function (qp, eom) -> QP, applied to the assembled QP. None leaves it unchanged.
    level_sizes : sequence of int, optional
        Number of tasks in each priority level. It follows from `tasks` if these are levels.

    Raises
    ------
    InputError
        If an argument has a wrong type. Names and shapes are checked by `qp`.

    Notes
    -----
    [FBR]_, eqs. (26), (27).
    """

    robot: Robot = field(metadata=checked(as_instance, Robot))
    contacts: Contacts = field(metadata=checked(as_instance, Contacts))
    tasks: Sequence[Task]
    limits: Limits = field(metadata=checked(as_instance, Limits))
    modify_qp: ModifyQP | None = None
    level_sizes: Sequence[int] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.modify_qp is not None:
            as_callable("modify_qp", self.modify_qp, "modify_qp(qp, eom)")
        tasks, sizes = _with_regularization(self.robot, self.tasks)
        if not isinstance(self.level_sizes, list | tuple):
            raise InputError(
                f"level_sizes must be a list of integers, not {short_repr(self.level_sizes)}."
            )
        sizes = sizes or [
            as_integer("each of level_sizes", size, 1, len(tasks)) for size in self.level_sizes
        ]
        if sizes:
            added = len(tasks) - sum(sizes)  # regularization tasks that complete the last level
            if not 0 <= added <= 2:
                raise InputError(
                    f"level_sizes is {sizes}, but there are {len(tasks)} tasks. The sizes must add "
                    f"up to the number of tasks."
                )
            sizes[-1] += added
            if self.modify_qp is not None:
                raise InputError("modify_qp cannot change a problem with priority levels.")
        object.__setattr__(self, "tasks", tasks)
        object.__setattr__(self, "level_sizes", tuple(sizes))
        as_torque_limits(self.robot.d, self.limits.torque_limits)
        if self.limits.joint_limits is not None:
            self.limits.joint_limits.check_size(self.robot)

    def _label(self) -> str:
        return "the control problem"

    @property
    def levels(self) -> tuple[tuple[Task, ...], ...]:
        """Tasks of each priority level; empty if the tasks are weighted."""
        tasks = iter(self.tasks)
        return tuple(tuple(islice(tasks, size)) for size in self.level_sizes)

    def qp(self, state: State, t: float = 0.0, *, slacks: bool = True) -> QP:
        """Return the QP at a state and a time.

        Parameters
        ----------
        state : State
            State of the robot.
        t : float, optional
            Time [s].
        slacks : bool, optional
            Whether soft inequalities, such as joint limits by default, have slack variables, so
            that any QP solver can solve the problem. False gives the smaller problem in which
            `penalties` marks them. Only solvers of this package know `penalties`.

        Returns
        -------
        QP
            The QP in x = (q̈, τ, λ, slacks). With priority levels it is the QP of the last level,
            with the optima of the other levels as equality constraints.

        Raises
        ------
        InputError
            If the state belongs to a different robot, or if shapes do not fit.
        UnknownNameError
            If a frame does not exist.
        InfeasibleError
            If the motion constraints of the contacts are inconsistent, or if the first of several
            levels has no solution.
        """
        if self.level_sizes:
            qp = self.solve_levels(state, t)[-1].qp
        else:
            self._check_robot(state)
            eom = equations_of_motion(state, self.contacts, t)
            qp = modified_qp(self, build_qp(eom, self.tasks, self.limits, t, slacks=False), eom)
        return qp.with_slacks() if as_bool("slacks", slacks) else qp

    @one_blas_thread()
    def solve_levels(
        self, state: State, t: float = 0.0, solver: str = "daqp", in_loop: bool = False
    ) -> list[Solution]:
        """Solve the QPs of all priority levels at a state and a time.

        Parameters
        ----------
        state : State
            State of the robot.
        t : float, optional
            Time [s].
        solver : str, optional
            QP solver, one of `floatbase.qp.solvers()`.
        in_loop : bool, optional
            Whether to limit the iterations of "daqp" as in a control step, without a fallback. The
            list then ends before a level, after the first, that has no answer within the limit.

        Returns
        -------
        list of Solution
            Solution of each level; the last one is the answer. Without levels, the list has one
            element.

        Raises
        ------
        InputError
            If the state belongs to a different robot, or if shapes do not fit.
        InfeasibleError
            If there is no solution.
        """
        if not self.level_sizes:
            qp = self.qp(state, t, slacks=False)
            return [solve_in_step(qp, solver, Budget()) if in_loop else solve(qp, solver)]
        self._check_robot(state)
        eom = equations_of_motion(state, self.contacts, t)
        levels = self.levels
        costs = [_costs(level, eom, t) for level in levels]
        inequalities = [each.at(eom, t) for each in self.limits.all_inequalities(self.contacts)]
        bounds = self.limits.hard_normal_forces(self.contacts, t)
        first = assemble_qp(eom, costs[0], self.limits, bounds, inequalities)
        qps = [first]
        for terms in costs[1:]:
            H, g = _objective(terms, first.blocks, first.n)
            qps.append(changed(first, H=0.5 * (H + H.T), g=g))
        return solve_levels(qps, levels, costs, solver, Budget() if in_loop else None)

    def _check_robot(self, state: State) -> None:
        """Raise `InputError` if a state belongs to a different robot."""
        if isinstance(state, State) and state.robot != self.robot:
            raise InputError(
                f"state belongs to a different robot, {state.robot!r}. The robot of the problem is "
                f"{self.robot!r}. Pass a state of that robot."
            )

    def check(self, tasks: Sequence[Task] | None = None) -> None:
        """Check names and shapes as `qp` does, at the standing state and t = 0, without a QP.

        Parameters
        ----------
        tasks : sequence of Task, optional
            Tasks to check. The default is all tasks.

        Raises
        ------
        InputError
            If shapes do not fit.
        UnknownNameError
            If a name does not exist.
        """
        with dry_run():
            eom = _standing_equations(self.robot, self.contacts)
            for task in self.tasks if tasks is None else tasks:
                residual_of(task, eom)
            self.limits.normal_forces(self.contacts)
            for inequality in self.limits.all_inequalities(self.contacts):
                inequality.labels(len(inequality.at(eom)[0]))


def build_qp(
    eom: EquationsOfMotion,
    tasks: Sequence[Task],
    limits: Limits,
    t: float = 0.0,
    *,
    slacks: bool = True,
) -> QP:
    """Assemble the whole-body QP at a state.

    The objective is the sum of (weight / 2) ‖residual‖² of the tasks. The equality constraints are
    the equations of motion (7). The inequality constraints are those of `limits`.

    Parameters
    ----------
    eom : EquationsOfMotion
        Equations of motion (7) at a state.
    tasks : sequence of Task
        Tasks, at least one for each block of x. Otherwise the optimum is not unique (`Problem` adds
        what is missing).
    limits : Limits
        Inequality constraints.
    t : float, optional
        Time at which time-varying targets, bounds and inequalities are evaluated [s].
    slacks : bool, optional
        Whether soft inequalities have slack variables, as in `Problem.qp`.

    Returns
    -------
    QP
        The QP in x = (q̈, τ, λ, slacks).

    Raises
    ------
    InputError
        If an argument has a wrong type, or if shapes do not fit.
    UnknownNameError
        If a frame does not exist.
    InfeasibleError
        If the motion constraints of the contacts are inconsistent.

    Notes
    -----
    [FBR]_, eqs. (26), (27). [FBR]_, §4.1.

    If A of eq. (5) loses rank or nearly does (solo8 on four feet), its rows are redundant. A
    measured velocity that does not quite satisfy the contacts then makes them inconsistent. The
    constraint is therefore applied only along the directions that A resolves well
    (`floatbase.dynamics.resolved_constraint`).
    """
    as_instance("eom", eom, EquationsOfMotion)
    as_instance("limits", limits, Limits)
    if not isinstance(tasks, Sequence) or not all(hasattr(task, "residual") for task in tasks):
        raise InputError(
            f"tasks must be a list of tasks, such as [fb.CoMTask(state.com)], not "
            f"{short_repr(tasks)}."
        )
    costs = _costs(tasks, eom, t)
    inequalities = [each.at(eom, t) for each in limits.all_inequalities(eom.contacts)]
    normal_forces = limits.hard_normal_forces(eom.contacts, t)
    qp = assemble_qp(eom, costs, limits, normal_forces, inequalities)
    return qp.with_slacks() if as_bool("slacks", slacks) else qp


def modified_qp(problem: Problem, qp: QP, eom: EquationsOfMotion) -> QP:
    """Apply the `modify_qp` of a problem to its QP at a state."""
    if problem.modify_qp is None:
        return qp
    modified = as_instance("the result of modify_qp", problem.modify_qp(qp, eom), QP)
    if modified.blocks != qp.blocks:
        raise InputError(
            f"modify_qp changed the blocks of x from {dict(qp.blocks)} to "
            f"{dict(modified.blocks)}. It must keep x = (q̈, τ, λ)."
        )
    return modified


def assumed_model(problem: Problem) -> AssumedModel | None:
    """Return the model that a problem assumes, or None if its `modify_qp` is anything else."""
    change = problem.modify_qp
    if change is None:
        return AssumedModel()
    is_compiled = vars(type(change)).get("compiled_as") == "assumed model"
    return cast(AssumedModel, change) if is_compiled else None


def assemble_qp(
    eom: EquationsOfMotion,
    costs: Costs,
    limits: Limits,
    normal_forces: tuple[Array, Array],
    inequalities: Sequence[tuple[Array, Array]],
) -> QP:
    """Assemble the QP of `build_qp` from terms that are already evaluated at the state."""
    nv, d, k = eom.nv, eom.d, eom.k
    blocks = {"qdd": slice(0, nv), "tau": slice(nv, nv + d), "forces": slice(nv + d, nv + d + k)}
    n = nv + d + k
    H, g = _objective(costs, blocks, n)
    motion, b = _resolved_motion_rows(eom)
    A = np.zeros((nv + len(motion), n))
    A[:nv, :nv], A[:nv, nv : nv + d], A[:nv, nv + d :] = eom.M, -eom.S, -eom.J.T
    A[nv:, :nv] = motion
    G_force, names = force_rows(eom.contacts, limits)
    G_torque, h_torque, torque_names = torque_rows(eom.robot, limits)
    parts: list[tuple[Block, float | None, Array, Array]] = [
        ("forces", None, G_force, force_bounds(eom.contacts, limits, *normal_forces)),
        ("tau", None, G_torque, h_torque),
    ]
    names += torque_names
    if limits.joint_limits is not None:
        G_joint, h_joint, joint_names = limits.joint_limits.rows(eom.state)
        parts.append(("qdd", limits.joint_limits.weight, G_joint, h_joint))
        names += joint_names
    user_defined = limits.all_inequalities(eom.contacts)
    for inequality, (G_user, h_user) in zip(user_defined, inequalities, strict=True):
        parts.append((inequality.block, inequality.weight, G_user, h_user))
        names += inequality.labels(len(G_user))
    G, penalties, row = np.zeros((len(names), n)), np.full(len(names), np.inf), 0
    for block, weight, G_part, _ in parts:
        rows = slice(row, row + len(G_part))
        G[rows, blocks[block]] = G_part
        penalties[rows] = np.inf if weight is None else weight
        row = rows.stop
    h = np.concatenate([part[3] for part in parts])
    b, equality_names = np.concatenate([-eom.h, b]), _equality_names(eom.robot, eom.contacts)
    soft = penalties if np.isfinite(penalties).any() else None
    for array in (H, g, A, b, G, h):
        frozen(array)  # `QP` copies others
    return QP(H, g, A, b, G, h, equality_names, names, blocks, soft)


def _costs(tasks: Sequence[Task], eom: EquationsOfMotion, t: float) -> Costs:
    """Return block, weight and residual of each task at a state."""
    return [(task.block, task.weight, residual_of(task, eom, t)) for task in tasks]


def _objective(costs: Costs, blocks: Mapping[str, slice], n: int) -> tuple[Array, Array]:
    """Return H, up to rounding symmetric, and g of the sum of (weight / 2) ‖residual‖²."""
    H, g = np.zeros((n, n)), np.zeros(n)
    parts = {block: (H[entries, entries], g[entries]) for block, entries in blocks.items()}
    for block, weight, (A, b) in costs:
        (H_block, g_block), weighted = parts[block], weight * A.T
        H_block += weighted @ A
        g_block += weighted @ b
    return H, g


@contextmanager
def dry_run() -> Iterator[None]:
    """Add a note to exceptions that user code raises while a controller is made.

    The note says that user functions are evaluated at t = 0 and in the standing posture.
    """
    try:
        yield
    except FloatbaseError:
        raise
    except Exception as error:
        error.add_note(
            "This error was raised while a controller was made. User functions are evaluated once "
            "then, at t = 0 and in the standing posture, so they must be defined there."
        )
        raise


@lru_cache(maxsize=64)
def _standing_equations(robot: Robot, contacts: Contacts) -> EquationsOfMotion:
    """Return the equations of motion (7) at the standing state of a robot."""
    return equations_of_motion(robot.standing(), contacts)


def _with_regularization(robot: Robot, tasks: Sequence[Task]) -> tuple[tuple[Task, ...], list[int]]:
    """Return the tasks with small regularization tasks where they are missing, and level sizes.

    A `ForceTask` or `TorqueTask` is added if no task determines the forces, or none the torques.
    There are no level sizes if the tasks are not in levels.
    """
    if hasattr(tasks, "residual") or not isinstance(tasks, Sequence):
        raise InputError(
            f"tasks must be a list of tasks, such as [fb.CoMTask(state.com)], not "
            f"{short_repr(tasks)}."
        )
    tasks, sizes = split_levels(tasks)
    for task in tasks:
        lacks = [part for part in _TASK_ATTRIBUTES if not hasattr(task, part)]
        if 0 < len(lacks) < len(_TASK_ATTRIBUTES):
            raise InputError(
                f"{type(task).__name__} is not a task: it lacks {', '.join(lacks)}. A task has "
                f"block, name, weight and residual(eom, t), see floatbase.objectives.Task."
            )
        if lacks or isinstance(task, type) or not callable(task.residual):
            raise InputError(
                f"tasks must contain tasks, such as fb.CoMTask(state.com), not {short_repr(task)}."
            )
        if task.block not in BLOCKS:
            raise InputError(
                f'block of task {task.name!r} is {task.block!r}. It must be "qdd", "tau" or '
                f'"forces".'
            )
        as_positive(f"weight of {task.name}", task.weight, allow_zero=True)
    blocks = {task.block for task in tasks if not isinstance(task, CentreOfPressureTask)}
    kinds = [kind for kind in (ForceTask, TorqueTask) if kind.block not in blocks]
    missing = [kind(weight=effort_weight(robot)) for kind in kinds]
    return tuple(tasks + cast("list[Task]", missing)), sizes


def residual_of(task: Task, eom: EquationsOfMotion, t: float = 0.0) -> Affine:
    """Return the residual of a task, after checking that it fits its block of x."""
    try:
        residual = task.residual(eom, t)
    except InputError as error:  # such as an `Affine` with NaN: name the task
        if f"of {task.name}" in str(error):
            raise
        raise InputError(f"task {task.name!r}: {error}") from None
    except TypeError:
        as_callable(f"the residual of {task.name!r}", task.residual, "residual(eom, t)")
        raise
    if not isinstance(residual, Affine):
        raise InputError(
            f"The residual of {task.name!r} must be A x + b of its block x, as fb.Affine(A, b), "
            f"not of type {type(residual).__name__}."
        )
    size = getattr(eom, SIZES[task.block])
    if residual.n_in != size:
        raise InputError(
            f"The residual of {task.name!r} has {residual.n_in} columns, but its block "
            f"{task.block!r} has {size} entries."
        )
    return residual


def _resolved_motion_rows(eom: EquationsOfMotion) -> tuple[Array, Array]:
    """Return A (m, nv) and b (m,) of (5) along the directions that A resolves.

    Raises `InfeasibleError` with the rows that are inconsistent by more than the contacts' own
    motion explains.
    """
    A, b = resolved_constraint(eom)
    gap = np.abs(eom.b - b)
    velocity = np.abs(eom.A @ eom.state.v).max(initial=0.0)
    if gap.max(initial=0.0) > INCONSISTENCY_TOLERANCE + CONSTRAINT_NOISE * velocity:
        rows = _equality_names(eom.robot, eom.contacts)[eom.nv :]
        names = [rows[i] for i in np.flatnonzero(gap > 0.1 * gap.max())]
        raise InfeasibleError(
            f"These motion constraints are inconsistent: {', '.join(names)}. Remove at least one "
            f"of them.",
            names,
        )
    return A, b


@lru_cache(maxsize=64)
def _equality_names(robot: Robot, contacts: Contacts) -> tuple[ConstraintLabel, ...]:
    """Return the names of the rows of (7)."""
    base = [f"base {part} {axis}" for part in ("linear", "angular") for axis in "xyz"]
    owners = [*(base if robot.is_floating else []), *robot.joint_names]
    labels = [ConstraintLabel(f"dynamics {owner}", "dynamics", owner) for owner in owners]
    for name, rows in ((contact.name, contact.row_names) for contact in contacts):
        for i, row in enumerate(rows):
            labels.append(ConstraintLabel(f"motion {name} {row}", "motion", name, i))
    return tuple(labels)
