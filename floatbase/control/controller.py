"""`WholeBodyController`: (26)(27) assembled by `build_qp`, solved each tick; where it can, on a fast path."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from types import SimpleNamespace
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
import numpy.typing as npt

from floatbase._arrays import Array, positive, read_only
from floatbase.control.tick import Compiled, announce_if_slow, cache_warning, obstacle
from floatbase.dynamics import MOTION_NOISE, Contacts, EquationsOfMotion, equations_of_motion, resolved_motion
from floatbase.errors import InfeasibleError, InputError, unknown_name
from floatbase.friction import FrictionPolyhedron
from floatbase.objectives import ForceTask, Task, TorqueTask
from floatbase.qp import QP, Solution, check_solver, finished, solve
from floatbase.robots import Robot, State, torque_limits_of

Path: TypeAlias = Literal["auto", "compiled", "readable"]


@dataclass(frozen=True, eq=False)
class Limits:
    """What the inequalities of (26)(27) are made of.

    facets, inside: the friction polyhedron of every contact point (see `FrictionPolyhedron`). min_normal_force: N, for
    normal · f ≥ min_normal_force at every point. torque_limits: shape (d,), N·m, +inf where there is none.
    """

    torque_limits: Array
    facets: int = 4
    inside: bool = True
    min_normal_force: float = 0.0

    def __post_init__(self) -> None:
        limits = np.ravel(self.torque_limits)
        object.__setattr__(self, "torque_limits", torque_limits_of(limits.size, limits))
        positive("min_normal_force", self.min_normal_force, "N", allow_zero=True)
        polyhedron = FrictionPolyhedron(np.array([0.0, 0.0, 1.0]), 1.0, self.facets)  # says what is wrong with the number
        object.__setattr__(self, "facets", polyhedron.facets)


@dataclass(frozen=True, eq=False, repr=False)
class Command:
    """One answer of the controller.

    tau: (d,) N·m, joint torques to apply. qdd: (nv,), the acceleration planned with them. forces: (k,) N, world, the contact
    forces planned with them, stacked as in `contacts`. active: names of the inequality rows that push; multipliers: theirs,
    by name. path: which of the controller's paths answered, "compiled" or "readable". evidence: makes `solution`,
    the readable problem with this answer to it; it is put together when first asked for, which the tick need not wait for.
    """

    tau: Array
    qdd: Array
    forces: Array
    contacts: Contacts
    evidence: Callable[[], Solution]
    path: str = "readable"

    def __init__(
        self,
        tau: Array,
        qdd: Array,
        forces: Array,
        contacts: Contacts,
        evidence: Callable[[], Solution],
        path: str = "readable",
    ) -> None:  # a frozen dataclass would set one field after the other, a microsecond in every tick
        self.__dict__.update(tau=tau, qdd=qdd, forces=forces, contacts=contacts, evidence=evidence, path=path)

    @cached_property
    def solution(self) -> Solution:
        """The QP of this tick with its optimum, multipliers and residuals."""
        return self.evidence()

    def force(self, name: str) -> Array:
        """The planned force of one contact, shape (3,), N, world: for a flat foot the resultant of its corners."""
        return self.contacts.force_of(self.forces, name)

    @property
    def active(self) -> tuple[str, ...]:
        """Names of the inequality rows that push, such as "FL_foot facet 2" or "torque limit FL_calf_joint upper"."""
        return self.solution.active

    @property
    def multipliers(self) -> dict[str, float]:
        """Multiplier of each active row, by name."""
        return self.solution.multipliers

    def __repr__(self) -> str:
        return (
            f"Command(|tau|={np.linalg.norm(self.tau):.3g} N·m, |forces|={np.linalg.norm(self.forces):.3g} N, "
            f"{len(self.active)} rows active, {self.path})"
        )


def build_qp(eom: EquationsOfMotion, tasks: Sequence[Task], limits: Limits, t: float = 0.0) -> QP:
    """(26)(27) as a QP in x = (q̈, τ, λ).

    Objective: the sum of (weight / 2) ‖residual‖² of the tasks. Equalities: the equations of motion (7). Inequalities:
    the friction polyhedron (28) and normal force of every contact point, and the torque limits. Source: the document,
    §4.1.

    Where A of (5) loses rank, or nearly (solo8 on four feet), its rows repeat each other, and a measured velocity that is not
    quite one the contacts allow makes them contradict each other: met to the letter they would ask for any acceleration.
    So the rows count along the directions that A resolves well, as everywhere (`floatbase.dynamics.resolved_motion`).
    """
    nv, d, k = eom.nv, eom.d, eom.k
    blocks = {"qdd": slice(0, nv), "tau": slice(nv, nv + d), "forces": slice(nv + d, nv + d + k)}
    n = nv + d + k
    H, g = np.zeros((n, n)), np.zeros(n)
    for task in tasks:
        part, residual = blocks[task.block], task.residual(eom, t)
        if residual.n_in != part.stop - part.start:
            raise InputError(
                f"the residual of {task.name!r} takes {residual.n_in} numbers; its block {task.block!r} has "
                f"{part.stop - part.start}."
            )
        H[part, part] += task.weight * residual.A.T @ residual.A
        g[part] += task.weight * residual.A.T @ residual.b
    motion, b = _resolved_rows(eom)
    A = np.block([[eom.M, -eom.S, -eom.J.T], [motion, np.zeros((len(motion), d + k))]])
    G_force, h_force, force_names = _force_rows(eom.contacts, limits)
    G_torque, h_torque, torque_names = _torque_rows(eom.robot, limits)
    G = np.zeros((len(G_force) + len(G_torque), n))
    G[: len(G_force), blocks["forces"]] = G_force
    G[len(G_force) :, blocks["tau"]] = G_torque
    return QP(
        H=H,
        g=g,
        A=A,
        b=np.concatenate([-eom.h, b]),
        G=G,
        h=np.concatenate([h_force, h_torque]),
        equality_names=_equality_names(eom.robot, eom.contacts),
        inequality_names=force_names + torque_names,
        blocks=blocks,
    )


def _resolved_rows(eom: EquationsOfMotion) -> tuple[Array, Array]:
    """(5) A (m, nv) and b (m,) along the directions that A resolves.

    Raises `InfeasibleError` with the rows where they contradict each other by more than the contacts' own motion explains.
    """
    A, b = resolved_motion(eom)
    gap = np.abs(eom.b - b)
    motion = float(np.max(np.abs(eom.A @ eom.state.v), initial=0.0))
    if np.max(gap, initial=0.0) > 1e-6 + MOTION_NOISE * motion:
        names = _equality_names(eom.robot, eom.contacts)[eom.nv :]
        rows = [names[i] for i in np.flatnonzero(gap > 0.1 * gap.max())]
        raise InfeasibleError(
            f"these motions cannot be kept together: {', '.join(rows)}. At least one of their constraints has to go.", rows
        )
    return A, b


# what does not depend on the state is built once for each contacts, robot and limits (all immutable)
@lru_cache(maxsize=64)
def _force_rows(contacts: Contacts, limits: Limits) -> tuple[Array, Array, tuple[str, ...]]:
    """Friction facets and normal force of every point: G λ ≤ h."""
    per_point = limits.facets + 1
    G = np.zeros((per_point * contacts.n_points, contacts.k))
    h = np.zeros(len(G))
    names: list[str] = []
    for i, point in enumerate(contacts.point_names):
        cone = FrictionPolyhedron(contacts.normals[i], contacts.mus[i], limits.facets, limits.inside)
        rows = slice(per_point * i, per_point * (i + 1))
        G[rows, contacts.point_entries[3 * i : 3 * i + 3]] = np.vstack([cone.rows, -cone.normal])
        h[rows.stop - 1] = -limits.min_normal_force
        names += [f"{point} {name}" for name in cone.names] + [f"{point} normal force"]
    return G, h, tuple(names)


@lru_cache(maxsize=64)
def _torque_rows(robot: Robot, limits: Limits) -> tuple[Array, Array, tuple[str, ...]]:
    """τ ≤ limit and -τ ≤ limit for every joint that has one: G τ ≤ h."""
    limited = np.flatnonzero(np.isfinite(limits.torque_limits))
    rows = np.eye(robot.d)[limited]
    bound = limits.torque_limits[limited]
    names = tuple(f"torque limit {robot.joint_names[i]} {side}" for side in ("upper", "lower") for i in limited)
    return np.vstack([rows, -rows]), np.concatenate([bound, bound]), names


@lru_cache(maxsize=64)
def _equality_names(robot: Robot, contacts: Contacts) -> tuple[str, ...]:
    """Names of the rows of (7)."""
    base = [f"dynamics base {part} {axis}" for part in ("linear", "angular") for axis in "xyz"]
    joints = [f"dynamics {joint}" for joint in robot.joint_names]
    motion = [f"motion {contact.name} {row}" for contact in contacts for row in contact.row_names]
    return tuple((base if robot.is_floating else []) + joints + motion)


class WholeBodyController:
    """(26)(27) every tick: the torques that serve the tasks best while (7), friction, contact and motors allow them.

    tasks: values of `floatbase.objectives.tasks` or anything of that form. When none of them regularises forces or
    torques, a `ForceTask()` and a `TorqueTask()` with their small default weights are added, so that the answer is
    unique; `tasks` shows all. facets, inside: the friction polyhedron. min_normal_force: N, at every contact point.
    torque_limits: N·m, one number or (d,), the robot's by default; np.inf switches them off. solver: one of
    `floatbase.qp.solvers()`.

    path: "readable" assembles and solves the QP as it is written. Where tasks and contacts are the package's own, "compiled"
    solves the same problem many times faster (`floatbase.control.tick`). "auto" takes compiled where it can, else readable. The
    attribute `path` says which it is, `path_reason` why. The first compiled controller ever compiles for about half a minute,
    unless the set-up did (`python -m floatbase compile`); later ones load what was compiled, from the package's folder, the
    user's cache or NUMBA_CACHE_DIR, whichever can be written to. A tick that a fast path cannot
    answer to its last digits, or that has no answer, is answered by the readable path, and its `Command.path` says so.

    Raises `InputError` for arguments that do not fit; a call raises `InfeasibleError` with the rows in conflict.
    """

    def __init__(
        self,
        robot: Robot,
        contacts: Contacts,
        tasks: Sequence[Task],
        *,
        facets: int = 4,
        inside: bool = True,
        min_normal_force: float = 0.0,
        torque_limits: npt.ArrayLike | None = None,
        solver: str = "daqp",
        path: Path = "auto",
    ):
        check_solver(solver)
        if path not in get_args(Path):
            raise unknown_name("path", path, get_args(Path))
        if not isinstance(robot, Robot):
            raise InputError(f"the controller needs a Robot first, as from fb.load, not {type(robot).__name__}.")
        self.robot = robot
        self.contacts = _checked_contacts(contacts)
        self.tasks = _with_regularisation(tasks)
        self.limits = Limits(
            torque_limits=robot.torque_limits if torque_limits is None else torque_limits_of(robot.d, torque_limits),
            facets=facets,
            inside=inside,
            min_normal_force=positive("min_normal_force", min_normal_force, "N", allow_zero=True),
        )
        self.solver = solver
        self.asked_path: Path = path
        self.qp(robot.standing(), 0.0)  # names that do not exist and shapes that do not fit show now, not in the loop
        self._choose_path()
        self._warm_up()

    def qp(self, state: State, t: float = 0.0) -> QP:
        """The problem of one tick, to look at."""
        return build_qp(equations_of_motion(state, self.contacts, t), self.tasks, self.limits, t)

    def __call__(self, q: npt.ArrayLike, v: npt.ArrayLike, t: float = 0.0) -> Command:
        """The tick: torques for configuration q, shape (nq,), and velocity v, shape (nv,), at time t in s."""
        if self._program is not None:
            command = self._fast_tick(self._program, q, v, t)
            if command is not None:
                return command
        solution = solve(self.qp(State(self.robot, q, v), t), self.solver)
        return Command(
            tau=read_only(solution["tau"]),
            qdd=read_only(solution["qdd"]),
            forces=read_only(solution["forces"]),
            contacts=self.contacts,
            evidence=lambda: solution,
        )

    def _fast_tick(self, program: Compiled, q: npt.ArrayLike, v: npt.ArrayLike, t: float) -> Command | None:
        """The program's answer, or None where the readable path must give it, or say what is wrong."""
        try:
            q, v = np.array(q, dtype=np.float64), np.array(v, dtype=np.float64)
        except (TypeError, ValueError):
            return None
        answer = program(q, v, t)
        if answer is None:
            return None
        numbers, held, targets = answer
        numbers.setflags(write=False)
        nv, tail = self.robot.nv, self.robot.nv + self.robot.d
        end = tail + self.contacts.k

        def evidence() -> Solution:
            eom = equations_of_motion(State(self.robot, q, v), self.contacts, t)
            qp = build_qp(eom, program.tasks(targets), self.limits, t)
            return finished(qp, numbers[:end], program.multipliers(numbers, held, len(qp.G)), "compiled", held)

        return Command(numbers[nv:tail], numbers[:nv], numbers[tail:end], self.contacts, evidence, "compiled")

    def replace(self, *, contacts: Contacts | None = None, tasks: Sequence[Task] | None = None) -> WholeBodyController:
        """A new controller with other contacts or tasks and everything else as here; cheap enough for the loop."""
        other = object.__new__(type(self))
        vars(other).update(vars(self))
        if contacts is not None:
            other.contacts = _checked_contacts(contacts)
        if tasks is not None:
            other.tasks = _with_regularisation(tasks)
        other._choose_path()
        if tasks is not None or other._program is None:
            other.qp(self.robot.standing(), 0.0)  # as when it is made: what does not fit shows now
        if self._program is None:
            other._warm_up()
        return other

    def _warm_up(self) -> None:
        """Run one tick of a fast path before the loop does."""
        if self._program is not None:
            often = cache_warning()
            with announce_if_slow(
                f"floatbase compiles its controller{'; ' + often if often else ', once: about half a minute'}."
            ):
                self._program.warm_up()

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "_program"}  # live views cannot be copied

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._choose_path()
        self._warm_up()

    def _choose_path(self) -> None:
        """Set `path`, `path_reason` and the tables of a fast path, or raise when one was asked for and cannot be."""
        self._program: Compiled | None = None
        self.path: Literal["compiled", "readable"] = "readable"
        self.path_reason = "it was asked for"
        if self.asked_path == "readable":
            return
        problem: Any = SimpleNamespace(robot=self.robot, contacts=self.contacts, tasks=self.tasks, limits=self.limits)
        reason = obstacle(problem, self.solver)
        if reason and self.asked_path == "compiled":
            raise InputError(f'path="compiled" is not possible: {reason}. path="auto" takes the fastest that is.')
        if reason:
            self.path_reason = reason
            return
        program = Compiled(problem)
        if not program.fits:
            self.path_reason = "a target has the wrong shape"
            return
        self._program, self.path = program, "compiled"
        self.path_reason = "; ".join(filter(None, ("the tasks and contacts are the package's own", cache_warning())))

    def __repr__(self) -> str:
        return f"WholeBodyController({self.robot.name}, {len(self.contacts)} contacts, {len(self.tasks)} tasks, {self.path})"


def _checked_contacts(contacts: Contacts) -> Contacts:
    if not isinstance(contacts, Contacts):
        raise InputError(f"contacts must be Contacts, as fb.Contacts.points(robot), not {type(contacts).__name__}.")
    return contacts


def _with_regularisation(tasks: Sequence[Task]) -> tuple[Task, ...]:
    if isinstance(tasks, Task) or not isinstance(tasks, Sequence):
        raise InputError(f"tasks must be a list of tasks, such as [fb.CoMTask(state.com)], not {type(tasks).__name__}.")
    tasks = tuple(tasks)
    for task in tasks:
        if isinstance(task, type) or not isinstance(task, Task):
            raise InputError(f"tasks must hold tasks, such as fb.CoMTask(state.com); {task!r} is none.")
        if task.block not in ("qdd", "tau", "forces"):
            raise InputError(f'task {task.name!r} has block {task.block!r}; it must be "qdd", "tau" or "forces".')
        positive(f"weight of {task.name}", task.weight, allow_zero=True)
    missing = [kind() for kind in (ForceTask, TorqueTask) if not any(task.block == kind.block for task in tasks)]
    return tasks + tuple(missing)
