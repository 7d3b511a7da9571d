"""`WholeBodyController`: (26)(27) solved at every tick, on the compiled backend where it can be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Literal, TypeAlias, get_args

import numpy.typing as npt

from floatbase._validation import (
    MAX_MAGNITUDE,
    Array,
    as_array,
    as_instance,
    as_number,
    cached_property,
    numeric_copy,
    read_only,
    refuse_new_attributes,
)
from floatbase.control.command import Command
from floatbase.control.limits import Limits, LinearInequality, NormalForces
from floatbase.control.problem import ModifyQP, Problem, dry_run
from floatbase.control.soft import SOFT_CONTACT_WEIGHT, contact_weight_of, with_soft_contacts
from floatbase.control.tick import CompiledTick, TickInputs, cache_warning, unsupported_reason
from floatbase.dynamics import Contacts
from floatbase.errors import InfeasibleError, InputError, unknown_name
from floatbase.objectives import Task
from floatbase.qp import QP, Solution, check_solver, solve
from floatbase.robots import Robot, State
from floatbase.robots._checks import as_torque_limits

Backend: TypeAlias = Literal["auto", "compiled", "reference"]
OnInfeasible: TypeAlias = Literal["raise", "soften"]


class WholeBodyController:
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
    on_infeasible: "raise" raises `InfeasibleError`. "soften" answers a tick without a solution once
        more with contact_weight=1e4, and sets `Command.softened`.
    modify_qp: a function (qp, eom) -> QP that changes the problem before it is solved, called at
        every control step with the assembled `floatbase.qp.QP` in x = (q̈, τ, λ) and the
        `EquationsOfMotion` at that state: to add rows that couple q̈, τ and λ, to relax or scale
        rows of (7), or to change the objective. It returns a QP in the same x, such as
        `dataclasses.replace(qp, H=…, g=…)`, and takes the reference backend. None changes nothing.
    solver: one of `floatbase.qp.solvers()`.
    backend: "reference" assembles and solves the QP as it is written. "compiled" solves the same
        problem many times faster (`floatbase.control.tick`), with tasks, constraints and
        user-defined rows too. "auto" takes compiled where it can.

    The attribute `backend` says which backend runs, `backend_reason` why. `problem` is what is
    solved. The first compiled controller ever compiles for about a minute, unless the set-up did
    (`python -m floatbase compile`). Later ones load that code from disk and answer alike to the
    bit; the process that compiled may differ by rounding. Where the code cannot be kept on disk,
    `backend_reason` says why. A state that the compiled tick cannot answer to the last digits, or
    that has no answer, is handed to the reference backend, and its `Command.backend` says so.

    Functions of t and user-defined objects are tried once when a controller is made with them, at t
    = 0, where the robot stands: a trajectory that begins later must give something at 0 too.

    Attributes cannot be set. `controller.replace(contacts=…)`, also with tasks or limits, makes a
    new controller.

    Raises `InputError` for arguments that do not fit. A call raises `InfeasibleError` with the rows
    in conflict.
    """

    __setattr__ = refuse_new_attributes
    _softened = False  # whether this controller answers what another one finds infeasible

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
        on_infeasible: OnInfeasible = "raise",
        modify_qp: ModifyQP | None = None,
        solver: str = "daqp",
        backend: Backend = "auto",
    ):
        as_instance("robot", robot, Robot)
        if torque_limits is None:
            torque_limits = robot.torque_limits
        limits = Limits(
            as_torque_limits(robot.d, torque_limits),
            facets,
            inner_approximation,
            min_normal_force,
            max_normal_force,
            inequalities,
            facet_rotation,
        )
        problem = Problem(robot, contacts, tasks, limits, modify_qp)
        if contact_weight is not None:
            problem = _softened(problem, contact_weight)
        limits.check_names(contacts.names, _foot_frames(robot))
        with dry_run():  # unknown names and shapes that do not fit raise here, not in the loop
            problem.qp(robot.standing())
        check_solver(solver)
        _check_choice("backend", backend, Backend)
        _check_choice("on_infeasible", on_infeasible, OnInfeasible)
        self._prepare(problem, solver, backend, on_infeasible)

    def _prepare(
        self,
        problem: Problem,
        solver: str,
        backend: Backend,
        on_infeasible: OnInfeasible,
        warm_up: bool = True,
    ) -> None:
        """Keep a checked problem, and prepare the compiled tick where it can be had. warm_up: run
        it once, outside the loop.
        """
        self._problem, self._settings = problem, (solver, backend, on_infeasible)
        if backend == "reference":
            reason = "it was requested"
        elif problem.modify_qp is not None:
            reason = "modify_qp changes the QP"
        else:
            reason = unsupported_reason(problem, solver)
        compiled = None if reason else CompiledTick(problem)
        if compiled is not None and warm_up:
            reason = compiled.warm_up()
        if reason and backend == "compiled":
            raise InputError(
                f'backend="compiled" is not possible: {reason}. backend="auto" takes the fastest '
                f"that is."
            )
        self._compiled = None if reason else compiled
        self._backend_reason = reason or "nothing stands in its way" + cache_warning()

    def _with_problem(self, problem: Problem) -> WholeBodyController:
        """A controller of another problem with the same settings."""
        other = object.__new__(type(self))
        other._prepare(problem, *self._settings, warm_up=self._compiled is None)
        return other

    def __getstate__(self) -> tuple[Problem, tuple[str, Backend, OnInfeasible]]:
        """Copies and pickles hold the problem; the compiled tick has views into Pinocchio's memory
        and is made anew.
        """
        return self._problem, self._settings

    def __setstate__(self, state: tuple[Problem, tuple[str, Backend, OnInfeasible]]) -> None:
        self._prepare(state[0], *state[1])

    @property
    def problem(self) -> Problem:
        """The problem that is solved."""
        return self._problem

    @property
    def solver(self) -> str:
        """The solver of the reference backend."""
        return self._settings[0]

    @property
    def compiled(self) -> CompiledTick | None:
        """The compiled tick, None on the reference backend."""
        return self._compiled

    @property
    def backend(self) -> Literal["compiled", "reference"]:
        """The backend that runs."""
        return "reference" if self._compiled is None else "compiled"

    @property
    def backend_reason(self) -> str:
        """Why that backend runs."""
        return self._backend_reason

    @property
    def robot(self) -> Robot:
        """The robot to control."""
        return self._problem.robot

    @property
    def contacts(self) -> Contacts:
        """Its contacts."""
        return self._problem.contacts

    @property
    def tasks(self) -> Sequence[Task]:
        """All tasks, with the regularisation that was added."""
        return self._problem.tasks

    @property
    def limits(self) -> Limits:
        """Friction, normal forces and torque limits."""
        return self._problem.limits

    def qp(self, state: State, t: float = 0.0) -> QP:
        """The QP of one tick, to look at."""
        return self._problem.qp(state, t)

    def __call__(self, q: npt.ArrayLike, v: npt.ArrayLike, t: float = 0.0) -> Command:
        """The tick: torques for configuration q, shape (nq,), and velocity v, shape (nv,), at time
        t in s.
        """
        if type(t) is not float or not -MAX_MAGNITUDE <= t <= MAX_MAGNITUDE:
            t = as_number("t", t, "s")
        if v is None:  # State takes it for rest; here it is a slip
            as_array("v", v, (self.robot.nv,))
        try:
            return self._answer(q, v, t)
        except InfeasibleError:
            if self._settings[2] == "raise" or contact_weight_of(self.tasks) is not None:
                raise
            return self._soft_controller._answer(q, v, t)

    @cached_property
    def _soft_controller(self) -> WholeBodyController:
        """The same controller with soft contacts."""
        other = self._with_problem(_softened(self._problem, SOFT_CONTACT_WEIGHT))
        other._softened = True
        return other

    def _answer(self, q: npt.ArrayLike, v: npt.ArrayLike, t: float) -> Command:
        command = (
            None if self._compiled is None else self._compiled_command(self._compiled, q, v, t)
        )
        if command is not None:
            return command
        solution = solve(self.qp(State(self.robot, q, v), t), self.solver)
        tau, qdd, forces = (read_only(solution[block]) for block in ("tau", "qdd", "forces"))
        return Command(tau, qdd, forces, self.contacts, "reference", solution, self._softened)

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
            self._softened,
        )

    def _solution_of(
        self, q: Array, v: Array, t: float, result: Array, n_active: int, inputs: TickInputs
    ) -> Solution:
        """The reference problem at q, v and t, with what `CompiledTick.__call__` returned for them
        as its solution.
        """
        tick = self._compiled
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
        problem = replace(
            self._problem,
            contacts=self.contacts if contacts is None else contacts,
            tasks=self.tasks if tasks is None else tasks,
            limits=self.limits if limits is None else limits,
        )
        if (weight := contact_weight_of(self.tasks)) is not None:
            problem = _softened(problem, weight)
        if limits is not None:
            limits.check_names(
                problem.contacts.names,
                self.contacts.names,
                _foot_frames(self.robot),
                before=self.limits,
            )
        other = self._with_problem(problem)
        if other._compiled is None:
            problem.check()
        elif tasks is not None or limits is not None or other._compiled.user_terms.any:
            # what its tables have not found to fit
            problem.check(other._compiled.unchecked_tasks)
        return other

    def __repr__(self) -> str:
        return (
            f"WholeBodyController({self.robot.name}, {len(self.contacts)} contacts, "
            f"{len(self.tasks)} tasks, {self.backend})"
        )


def _check_choice(name: str, value: object, choices: object) -> None:
    """Raise `UnknownNameError` for a value that is none of a `Literal`'s."""
    if not isinstance(value, str) or value not in get_args(choices):
        raise unknown_name(name, value, get_args(choices))


def _softened(problem: Problem, weight: float) -> Problem:
    """The problem with soft contacts."""
    contacts, tasks = with_soft_contacts(problem.contacts, problem.tasks, weight)
    return replace(problem, contacts=contacts, tasks=tasks)


def _foot_frames(robot: Robot) -> list[str]:
    """Frames of the feet, which are the names of contacts there."""
    return [foot.frame for foot in robot.feet]
