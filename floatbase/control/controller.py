"""`WholeBodyController`: (26)(27) solved at every tick, on the compiled way where it can be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any, ClassVar, Literal, TypeAlias, get_args

import numpy.typing as npt

from floatbase._validation import MAX_MAGNITUDE, Array, FixedAttributes, as_array, as_number, as_instance, numeric_copy, read_only
from floatbase.control.belief import TRUTH, Belief
from floatbase.control.command import Command
from floatbase.control.limits import Limits, NormalForces, Rows
from floatbase.control.problem import Problem, rehearsal
from floatbase.control.soft import contact_weight_of, softened
from floatbase.control.tick import Compiled, Given, cache_warning, obstacle
from floatbase.dynamics import Contacts
from floatbase.errors import InputError, unknown_name
from floatbase.objectives import Task
from floatbase.qp import QP, Solution, check_solver, solve
from floatbase.robots import Robot, State, as_torque_limits

Path: TypeAlias = Literal["auto", "compiled", "readable"]

_ANOTHER = "make another, fb.WholeBodyController(robot, contacts, tasks, {}=…)"
_OPTIONS = (
    "facets",
    "inside",
    "turn",
    "min_normal_force",
    "max_normal_force",
    "torque_limits",
    "rows",
    "contact_weight",
    "belief",
    "solver",
    "path",
)


class WholeBodyController(FixedAttributes):
    """(26)(27) at every tick: the torques that serve the tasks best while (7), friction, contacts and motors allow them.

    robot: the robot to control.
    contacts: its contacts with the ground.
    tasks: values such as `fb.CoMTask`, or any object of the form of `floatbase.objectives.Task`. Where none acts on forces, or
        none on torques, a `ForceTask()` or a `TorqueTask()` of small weight is added, so that the optimum is unique.
    facets, inside, turn: the friction polyhedron, see `floatbase.friction.FrictionPolyhedron`.
    min_normal_force, max_normal_force: N, at every contact point, so at each corner of a flat foot; one number, or a mapping
        from the name of a contact to a number or a function of t: a foot that is unloaded. The name of a foot that does not
        stand bounds nothing until it does, so that `replace(contacts=…)` may lift it; other names that are no contact's are
        errors.
    torque_limits: N·m, one number or shape (d,), the robot's by default; np.inf switches them off.
    rows: inequality rows of one's own on q̈, τ or λ, see `floatbase.control.Rows`.
    contact_weight: None holds the contacts by rows, (5). A number, such as 1e4, puts ½ contact_weight ‖A q̈ - b‖² into the
        objective instead: contacts give way where torques and friction do not suffice to hold them, and only rows of one's own
        and bounds of normal forces can make a tick infeasible.
    belief: what is taken for (7), the truth by default, see `floatbase.control.Belief`; any other takes the readable path.
    solver: one of `floatbase.qp.solvers()`.
    path: "readable" assembles and solves the QP as it is written. "compiled" solves the same problem many times faster
        (`floatbase.control.tick`), with tasks, constraints and rows of one's own too. "auto" takes compiled where it can.

    The attribute `path` says which way runs, `path_reason` why. `problem` is what is solved. The first compiled controller ever
    compiles for about a minute, unless the set-up did (`python -m floatbase compile`). Later ones load what was compiled,
    from the package's folder, the user's cache or NUMBA_CACHE_DIR, whichever can be written to; they answer alike to the bit,
    and the process that compiled may differ by rounding. Where nothing can be kept, `path_reason` says why. A state that the
    compiled tick cannot answer to the last digits, or that has no answer, is handed to the readable path, and its
    `Command.path` says so.

    Functions of t and objects of one's own are tried once when a controller is made with them, at t = 0, where the robot
    stands: a trajectory that begins later must give something at 0 too.

    Raises `InputError` for arguments that do not fit. A call raises `InfeasibleError` with the rows in conflict.
    """

    _hints: ClassVar[dict[str, str]] = {
        **{name: f"controller.replace({name}=…) is a new one that has it" for name in ("contacts", "tasks", "limits")},
        **{name: _ANOTHER.format(name) for name in _OPTIONS},
        **dict.fromkeys(("robot", "problem", "compiled", "path_reason", "requested_path"), _ANOTHER.format("…")),
    }

    def __init__(
        self,
        robot: Robot,
        contacts: Contacts,
        tasks: Sequence[Task],
        *,
        facets: int = 4,
        inside: bool = True,
        turn: float = 0.0,
        min_normal_force: NormalForces = 0.0,
        max_normal_force: NormalForces | None = None,
        torque_limits: npt.ArrayLike | None = None,
        rows: Sequence[Rows] = (),
        contact_weight: float | None = None,
        belief: Belief = TRUTH,
        solver: str = "daqp",
        path: Path = "auto",
    ):
        as_instance("robot", robot, Robot)
        limits = robot.torque_limits if torque_limits is None else as_torque_limits(robot.d, torque_limits)
        bounds = Limits(limits, facets, inside, min_normal_force, max_normal_force, rows, turn)
        problem = Problem(robot, contacts, tasks, bounds, belief)
        if contact_weight is not None:
            problem = Problem(robot, *softened(contacts, problem.tasks, contact_weight), bounds, belief)
        belief.check(contacts)
        bounds.check_names(contacts.names, _feet(robot))
        with rehearsal():
            problem.qp(robot.standing())  # names that do not exist and shapes that do not fit are told now, and not in the loop
        self._prepare(problem, solver, path)

    def _prepare(self, problem: Problem, solver: str, path: Path, warm_up: bool = True) -> None:
        """Keep a checked problem, and prepare the compiled tick where it can be had. warm_up: run it once, outside the loop."""
        self.problem, self.solver, self.requested_path = problem, solver, path
        check_solver(solver)
        if not isinstance(path, str) or path not in get_args(Path):
            raise unknown_name("path", path, get_args(Path))
        reason = "it was requested" if path == "readable" else _obstacle(problem, solver)
        compiled = None if reason else Compiled(problem)
        if compiled is not None and warm_up:
            reason = compiled.warm_up()
        if reason and path == "compiled":
            raise InputError(f'path="compiled" is not possible: {reason}. path="auto" takes the fastest that is.')
        self.compiled = None if reason else compiled
        self.path: Literal["compiled", "readable"] = "readable" if reason else "compiled"
        self.path_reason = reason or "nothing stands in its way" + cache_warning()
        self._initialised = True

    def __getstate__(self) -> tuple[Problem, str, Path]:
        """Copies and pickles hold the problem; the compiled tick has views into Pinocchio's memory and is made anew."""
        return self.problem, self.solver, self.requested_path

    def __setstate__(self, state: tuple[Problem, str, Path]) -> None:
        self._prepare(*state)

    @property
    def robot(self) -> Robot:
        """The robot to control."""
        return self.problem.robot

    @property
    def contacts(self) -> Contacts:
        """Its contacts."""
        return self.problem.contacts

    @property
    def tasks(self) -> Sequence[Task]:
        """All tasks, with the regularisation that was added."""
        return self.problem.tasks

    @property
    def limits(self) -> Limits:
        """Friction, normal forces and torque limits."""
        return self.problem.limits

    def qp(self, state: State, t: float = 0.0) -> QP:
        """The QP of one tick, to look at."""
        return self.problem.qp(state, t)

    def __call__(self, q: npt.ArrayLike, v: npt.ArrayLike, t: float = 0.0) -> Command:
        """The tick: torques for configuration q, shape (nq,), and velocity v, shape (nv,), at time t in s."""
        if type(t) is not float or not -MAX_MAGNITUDE <= t <= MAX_MAGNITUDE:
            t = as_number("t", t, "s")
        if v is None:  # State takes it for rest; here it is a slip
            as_array("v", v, (self.robot.nv,))
        command = None if self.compiled is None else self._compiled_command(self.compiled, q, v, t)
        if command is not None:
            return command
        solution = solve(self.qp(State(self.robot, q, v), t), self.solver)
        tau, qdd, forces = (read_only(solution[block]) for block in ("tau", "qdd", "forces"))
        return Command(tau, qdd, forces, self.contacts, "readable", solution)

    def _compiled_command(self, tick: Compiled, q: npt.ArrayLike, v: npt.ArrayLike, t: float) -> Command | None:
        """The compiled tick's answer, or None where the readable path must answer, or say what is wrong."""
        at, moving = numeric_copy(q), numeric_copy(v)
        if at is None or moving is None:
            return None
        answer = tick(at, moving, t)
        if answer is None:
            return None
        numbers = answer[0]
        numbers.setflags(write=False)
        solution = partial(self._solution_of, at, moving, t, *answer)
        return Command(numbers[tick.tau], numbers[tick.qdd], numbers[tick.forces], self.contacts, "compiled", solution)

    def _solution_of(self, q: Array, v: Array, t: float, numbers: Array, n_active: int, given: Given) -> Solution:
        """The readable problem at q, v and t, with what `Compiled.__call__` returned for them as its solution."""
        tick = self.compiled
        assert tick is not None  # it answered
        x, mu = numbers[: tick.forces.stop], tick.multipliers(numbers, n_active, given)
        return Solution(tick.qp(q, v, t, given), x, mu, "compiled", n_active)

    def replace(
        self, *, contacts: Contacts | None = None, tasks: Sequence[Task] | None = None, limits: Limits | None = None
    ) -> WholeBodyController:
        """A new controller with other contacts, tasks or limits and everything else as here; cheap enough for the loop.

        Other limits: `dataclasses.replace(controller.limits, max_normal_force={"FL_foot": 0.0})`.
        """
        weight = contact_weight_of(self.tasks)
        if weight is not None:
            contacts, tasks = softened(
                self.contacts if contacts is None else contacts, self.tasks if tasks is None else tasks, weight
            )
        new: dict[str, Any] = {"contacts": contacts, "tasks": tasks, "limits": limits}
        problem = replace(self.problem, **{name: value for name, value in new.items() if value is not None})
        if limits is not None:
            limits.check_names(problem.contacts.names, self.contacts.names, _feet(self.robot), before=self.limits)
        other = object.__new__(type(self))
        other._prepare(problem, self.solver, self.requested_path, warm_up=self.compiled is None)
        if other.compiled is None:
            problem.check()
        elif tasks is not None or limits is not None or other.compiled.own.any:  # what its tables have not found to fit
            problem.check(other.compiled.unknown)
        return other

    def __repr__(self) -> str:
        return f"WholeBodyController({self.robot.name}, {len(self.contacts)} contacts, {len(self.tasks)} tasks, {self.path})"


def _obstacle(problem: Problem, solver: str) -> str:
    """Why a problem cannot run compiled, or ""."""
    return obstacle(problem, solver) if problem.belief.is_true else "its belief is not the truth"


def _feet(robot: Robot) -> list[str]:
    """Frames of the feet, which are the names of contacts there."""
    return [foot.frame for foot in robot.feet]
