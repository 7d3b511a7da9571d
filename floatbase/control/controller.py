"""`WholeBodyController`: (26)(27) solved at every tick, on the compiled backend where it can be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any, ClassVar, Literal, TypeAlias, get_args

import numpy.typing as npt

from floatbase._validation import (
    MAX_MAGNITUDE,
    Array,
    FixedAttributes,
    as_array,
    as_instance,
    as_number,
    numeric_copy,
    read_only,
)
from floatbase.control.command import Command
from floatbase.control.limits import Limits, LinearInequality, NormalForces
from floatbase.control.model_mismatch import NO_MISMATCH, ModelMismatch
from floatbase.control.problem import Problem, dry_run
from floatbase.control.soft import contact_weight_of, with_soft_contacts
from floatbase.control.tick import CompiledTick, TickInputs, cache_warning, unsupported_reason
from floatbase.dynamics import Contacts
from floatbase.errors import InputError, unknown_name
from floatbase.objectives import Task
from floatbase.qp import QP, Solution, check_solver, solve
from floatbase.robots import Robot, State
from floatbase.robots._checks import as_torque_limits

Backend: TypeAlias = Literal["auto", "compiled", "reference"]

_MAKE_NEW = "make another, fb.WholeBodyController(robot, contacts, tasks, {}=…)"
_OPTIONS = (
    "facets",
    "inner_approximation",
    "facet_rotation",
    "min_normal_force",
    "max_normal_force",
    "torque_limits",
    "inequalities",
    "contact_weight",
    "mismatch",
    "solver",
    "backend",
)


class WholeBodyController(FixedAttributes):
    """(26)(27) at every tick: the torques that serve the tasks best while (7), friction, contacts
    and motors allow them.

    robot: the robot to control.
    contacts: its contacts with the ground.
    tasks: values such as `fb.CoMTask`, or any object of the form of `floatbase.objectives.Task`.
        Where none acts on forces, or none on torques, a `ForceTask()` or a `TorqueTask()` of small
        weight is added, so that the optimum is unique.
    facets, inner_approximation, facet_rotation: the friction polyhedron, see
        `floatbase.friction.FrictionPolyhedron`.
    min_normal_force, max_normal_force: N, at every contact point, so at each corner of a flat foot;
        one number, or a mapping from the name of a contact to a number or a function of t: a foot
        that is unloaded. The name of a foot that does not stand bounds nothing until it does, so
        that `replace(contacts=…)` may lift it; other names that are no contact's are errors.
    torque_limits: N·m, one number or shape (d,), the robot's by default; np.inf switches them off.
    inequalities: user-defined inequality rows on q̈, τ or λ, see
        `floatbase.control.LinearInequality`.
    contact_weight: None holds the contacts by rows, (5). A number, such as 1e4, puts ½
        contact_weight ‖A q̈ - b‖² into the objective instead: contacts give way where torques and
        friction do not suffice to hold them, and only user-defined rows and bounds of normal forces
        can make a tick infeasible.
    mismatch: what is taken for (7), the truth by default, see `floatbase.control.ModelMismatch`;
        any other takes the reference backend.
    solver: one of `floatbase.qp.solvers()`.
    backend: "reference" assembles and solves the QP as it is written. "compiled" solves the same
        problem many times faster (`floatbase.control.tick`), with tasks, constraints and
        user-defined rows too. "auto" takes compiled where it can.

    The attribute `backend` says which backend runs, `backend_reason` why. `problem` is what is
    solved. The first compiled controller ever compiles for about a minute, unless the set-up did
    (`python -m floatbase compile`). Later ones load what was compiled, from the package's folder,
    the user's cache or NUMBA_CACHE_DIR, whichever can be written to; they answer alike to the bit,
    and the process that compiled may differ by rounding. Where nothing can be kept,
    `backend_reason` says why. A state that the compiled tick cannot answer to the last digits, or
    that has no answer, is handed to the reference backend, and its `Command.backend` says so.

    Functions of t and user-defined objects are tried once when a controller is made with them, at t
    = 0, where the robot
    stands: a trajectory that begins later must give something at 0 too.

    Raises `InputError` for arguments that do not fit. A call raises `InfeasibleError` with the rows
    in conflict.
    """

    _hints: ClassVar[dict[str, str]] = {
        **{
            name: f"controller.replace({name}=…) is a new one that has it"
            for name in ("contacts", "tasks", "limits")
        },
        **{name: _MAKE_NEW.format(name) for name in _OPTIONS},
        **dict.fromkeys(
            ("robot", "problem", "compiled", "backend_reason", "requested_backend"),
            _MAKE_NEW.format("…"),
        ),
    }

    def __init__(
        self,
        robot: Robot,
        contacts: Contacts,
        tasks: Sequence[Task],
        *,
        facets: int = 4,
        inner_approximation: bool = True,
        facet_rotation: float = 0.0,
        min_normal_force: NormalForces = 0.0,
        max_normal_force: NormalForces | None = None,
        torque_limits: npt.ArrayLike | None = None,
        inequalities: Sequence[LinearInequality] = (),
        contact_weight: float | None = None,
        mismatch: ModelMismatch = NO_MISMATCH,
        solver: str = "daqp",
        backend: Backend = "auto",
    ):
        as_instance("robot", robot, Robot)
        limits = (
            robot.torque_limits
            if torque_limits is None
            else as_torque_limits(robot.d, torque_limits)
        )
        checked_limits = Limits(
            limits,
            facets,
            inner_approximation,
            min_normal_force,
            max_normal_force,
            inequalities,
            facet_rotation,
        )
        problem = Problem(robot, contacts, tasks, checked_limits, mismatch)
        if contact_weight is not None:
            problem = Problem(
                robot,
                *with_soft_contacts(contacts, problem.tasks, contact_weight),
                checked_limits,
                mismatch,
            )
        mismatch.check_names(contacts)
        checked_limits.check_names(contacts.names, _foot_frames(robot))
        with dry_run():
            problem.qp(
                robot.standing()
                # names that do not exist and shapes that do not fit are told now, and not in the
                # loop
            )
        self._prepare(problem, solver, backend)

    def _prepare(
        self, problem: Problem, solver: str, backend: Backend, warm_up: bool = True
    ) -> None:
        """Keep a checked problem, and prepare the compiled tick where it can be had. warm_up: run
        it once, outside the loop.
        """
        self.problem, self.solver, self.requested_backend = problem, solver, backend
        check_solver(solver)
        if not isinstance(backend, str) or backend not in get_args(Backend):
            raise unknown_name("backend", backend, get_args(Backend))
        reason = (
            "it was requested" if backend == "reference" else _unsupported_reason(problem, solver)
        )
        compiled = None if reason else CompiledTick(problem)
        if compiled is not None and warm_up:
            reason = compiled.warm_up()
        if reason and backend == "compiled":
            raise InputError(
                f'backend="compiled" is not possible: {reason}. backend="auto" takes the fastest '
                f"that is."
            )
        self.compiled = None if reason else compiled
        self.backend: Literal["compiled", "reference"] = "reference" if reason else "compiled"
        self.backend_reason = reason or "nothing stands in its way" + cache_warning()
        self._initialised = True

    def __getstate__(self) -> tuple[Problem, str, Backend]:
        """Copies and pickles hold the problem; the compiled tick has views into Pinocchio's memory
        and is made anew.
        """
        return self.problem, self.solver, self.requested_backend

    def __setstate__(self, state: tuple[Problem, str, Backend]) -> None:
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
        """The tick: torques for configuration q, shape (nq,), and velocity v, shape (nv,), at time
        t in s.
        """
        if type(t) is not float or not -MAX_MAGNITUDE <= t <= MAX_MAGNITUDE:
            t = as_number("t", t, "s")
        if v is None:  # State takes it for rest; here it is a slip
            as_array("v", v, (self.robot.nv,))
        command = None if self.compiled is None else self._compiled_command(self.compiled, q, v, t)
        if command is not None:
            return command
        solution = solve(self.qp(State(self.robot, q, v), t), self.solver)
        tau, qdd, forces = (read_only(solution[block]) for block in ("tau", "qdd", "forces"))
        return Command(tau, qdd, forces, self.contacts, "reference", solution)

    def _compiled_command(
        self, tick: CompiledTick, q: npt.ArrayLike, v: npt.ArrayLike, t: float
    ) -> Command | None:
        """The compiled tick's answer, or None where the reference backend must answer, or say what
        is wrong.
        """
        q_array, v_array = numeric_copy(q), numeric_copy(v)
        if q_array is None or v_array is None:
            return None
        answer = tick(q_array, v_array, t)
        if answer is None:
            return None
        result = answer[0]
        result.setflags(write=False)
        solution = partial(self._solution_of, q_array, v_array, t, *answer)
        return Command(
            result[tick.tau],
            result[tick.qdd],
            result[tick.forces],
            self.contacts,
            "compiled",
            solution,
        )

    def _solution_of(
        self, q: Array, v: Array, t: float, result: Array, n_active: int, inputs: TickInputs
    ) -> Solution:
        """The reference problem at q, v and t, with what `CompiledTick.__call__` returned for them
        as its solution.
        """
        tick = self.compiled
        assert tick is not None  # it answered
        x, mu = result[: tick.forces.stop], tick.multipliers(result, n_active, inputs)
        return Solution(tick.qp(q, v, t, inputs), x, mu, "compiled", n_active)

    def replace(
        self,
        *,
        contacts: Contacts | None = None,
        tasks: Sequence[Task] | None = None,
        limits: Limits | None = None,
    ) -> WholeBodyController:
        """A new controller with other contacts, tasks or limits and everything else as here; cheap
        enough for the loop.

        Other limits: `dataclasses.replace(controller.limits, max_normal_force={"FL_foot": 0.0})`.
        """
        weight = contact_weight_of(self.tasks)
        if weight is not None:
            contacts, tasks = with_soft_contacts(
                self.contacts if contacts is None else contacts,
                self.tasks if tasks is None else tasks,
                weight,
            )
        new: dict[str, Any] = {"contacts": contacts, "tasks": tasks, "limits": limits}
        problem = replace(
            self.problem, **{name: value for name, value in new.items() if value is not None}
        )
        if limits is not None:
            limits.check_names(
                problem.contacts.names,
                self.contacts.names,
                _foot_frames(self.robot),
                before=self.limits,
            )
        other = object.__new__(type(self))
        other._prepare(problem, self.solver, self.requested_backend, warm_up=self.compiled is None)
        if other.compiled is None:
            problem.check()
        elif (
            tasks is not None or limits is not None or other.compiled.user_terms.any
        ):  # what its tables have not found to fit
            problem.check(other.compiled.unchecked_tasks)
        return other

    def __repr__(self) -> str:
        return (
            f"WholeBodyController({self.robot.name}, {len(self.contacts)} contacts, "
            f"{len(self.tasks)} tasks, {self.backend})"
        )


def _unsupported_reason(problem: Problem, solver: str) -> str:
    """Why a problem cannot run compiled, or ""."""
    return (
        unsupported_reason(problem, solver)
        if problem.mismatch.is_exact
        else "its model mismatch is not zero"
    )


def _foot_frames(robot: Robot) -> list[str]:
    """Frames of the feet, which are the names of contacts there."""
    return [foot.frame for foot in robot.feet]
