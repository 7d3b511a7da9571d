"""`WholeBodyController`: solves the whole-body QP once per control step, compiled if possible."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import fields, replace
from functools import partial
from typing import Any, Literal, NamedTuple, TypeAlias, cast, get_args

import numpy as np
import numpy.typing as npt

from floatbase._blas import one_blas_thread
from floatbase._validation import (
    MAX_MAGNITUDE,
    Array,
    as_array,
    as_number,
    cached_property,
    numeric_copy,
    one_or_each,
    read_only,
    refuse_new_attributes,
)
from floatbase.control.batch import solve_batch, thread_count
from floatbase.control.command import Command, CommandBatch
from floatbase.control.joint_limits import JointLimits
from floatbase.control.limits import Limits, LinearInequality, NormalForces
from floatbase.control.problem import ModifyQP, Problem, assumed_model, dry_run
from floatbase.control.soft import (
    SOFT_CONTACT_WEIGHT,
    SOFT_LIMIT_WEIGHT,
    contact_weight_of,
    with_soft_contacts,
)
from floatbase.control.tick import CompiledTick, TargetLayout, cache_warning, unsupported_reason
from floatbase.dynamics import Contacts
from floatbase.errors import InfeasibleError, InputError, SolverError, check_arguments, unknown_name
from floatbase.objectives import Task
from floatbase.qp import QP, check_solver
from floatbase.robots import Robot, State
from floatbase.robots._upright import pose_question

Backend: TypeAlias = Literal["auto", "compiled", "reference"]
OnInfeasible: TypeAlias = Literal["raise", "soften"]
Step: TypeAlias = tuple[npt.ArrayLike, npt.ArrayLike, float, Array | None]  # q, v, t and targets


class _Settings(NamedTuple):
    """Settings of a controller besides its problem."""

    solver: str
    backend: Backend
    on_infeasible: OnInfeasible


class WholeBodyController:
    """Whole-body controller: one quadratic program per control step.

    A call returns the torques that fulfil the tasks best, subject to the equations of motion (7),
    the contacts, friction and the torque limits. The attributes of a controller cannot be set;
    `replace` makes a new controller.

    Parameters
    ----------
    robot : Robot
        The robot to control.
    contacts : Contacts
        Contacts of the robot with the ground.
    tasks : sequence of Task, or sequence of sequences of Task
        Tasks such as `fb.CoMTask`, or user-defined objects of the form of
        `floatbase.objectives.Task`. Their weights decide between them: the objective is the sum of
        ½ weight ‖residual‖². A list of lists sets strict
        priorities instead: the first list has the highest priority, and each list is fulfilled as
        well as the lists before it allow. Only the reference backend supports priorities. If no
        task acts on forces, or none on torques, a `ForceTask` or a `TorqueTask` of small weight is
        added (`floatbase.objectives.effort_weight`), so that the optimum is unique. A
        `CentreOfPressureTask` does not count here, since it leaves most forces open.
    facets : int, optional
        Number of facets of the friction polyhedra; see `floatbase.friction.FrictionPolyhedron`.
    inner_approximation : bool, optional
        Whether the polyhedra lie inside the friction cones.
    facet_rotation : float, optional
        Angle by which the facets are rotated about the normal [rad].
    min_normal_force, max_normal_force : float or mapping, optional
        Bounds of the normal force at every contact point, and thus at each corner of a flat foot
        [N]. Each is one number, or a mapping from names of contacts to numbers or functions of t
        [s], for example to unload a foot. A bound may name a foot that is not in contact: it has no
        effect until `replace(contacts=...)` adds the foot. Any other unknown name is an error. The
        defaults are 0 and no maximum.
    torque_limits : float or array_like, shape (d,), optional
        Torque limits [N·m]; np.inf switches them off. The default is those of the robot.
    inequalities : sequence of LinearInequality, optional
        User-defined inequality constraints on q̈, τ or λ.
    joint_limits : JointLimits or {"robot"}, optional
        Position, velocity and acceleration limits of the joints. "robot" uses those of the URDF,
        `JointLimits.of(robot, torque_limits=torque_limits)`, as soft constraints with a weight of
        100. This weight differs from that of a task: a violation costs weight · violation, and the
        residual of a task costs ½ weight · residual². A limit yields if torques or contacts oppose
        the limit, or if a task has a large residual because its target is far out of reach. None
        switches the limits off.
    normal_force_weight : float, optional
        None makes the bounds of normal forces hard. A number makes them soft: their violation
        times this weight is added to the objective [1/N].
    contact_weight : float, optional
        None enforces the contacts as equality constraints, eq. (5). A number, such as 1e4, makes
        them soft: it adds ½ contact_weight ‖A q̈ - b‖² to the objective instead [1/(m/s²)²].
        Contacts then yield if torques and friction cannot hold them. Only joint limits,
        user-defined inequalities and bounds of normal forces can still make the QP infeasible.
    on_infeasible : {"raise", "soften"}, optional
        What to do if the QP has no solution. "raise" raises `InfeasibleError`. "soften" solves
        again with soft joint limits, user-defined inequalities and bounds of normal forces (weight
        1e4). If there is still no solution, the contacts become soft as well (contact_weight=1e4).
        `Command.softened` names what was softened, and `Command.violations` lists the violations.
        The equations of motion, friction and torque limits always hold. The compiled backend
        softens at once, without confirmation by the reference backend.
    modify_qp : callable, optional
        Function (qp, eom) -> QP that changes the problem before it is solved. It is called at every
        control step with the assembled `floatbase.qp.QP` in x = (q̈, τ, λ) and the
        `EquationsOfMotion` at that state. It can add constraints that couple q̈, τ and λ, relax or
        scale rows of eq. (7), or change the objective. It must return a QP in the same x, such as
        `dataclasses.replace(qp, H=..., g=...)`. Only the reference backend supports it, except for
        a `floatbase.playground.ModelMismatch`.
    solver : str, optional
        QP solver, one of `floatbase.qp.solvers()`.
    backend : {"auto", "compiled", "reference"}, optional
        "reference" assembles and solves the QP as it is written. "compiled" solves the same problem
        many times faster (`floatbase.control.tick`), also with user-defined tasks, constraints and
        inequalities. "auto" uses the compiled backend if it supports the problem, otherwise the
        reference backend.

    Raises
    ------
    InputError
        If an argument has a wrong type, shape or value.
    UnknownNameError
        If a name, solver or option does not exist.
    MissingDependencyError
        If `solver` is not installed.

    Notes
    -----
    [FBR]_, eqs. (26), (27). A call raises `InfeasibleError` with the conflicting constraints.

    If the contacts are redundant or nearly so, as in eq. (5) for solo8 on four feet, a measured
    velocity can contradict them. The controller then raises no error, but its q̈ violates
    some rows of eq. (5), by several m/s² for solo8 at joint velocities of 3 rad/s. The residual of
    eq. (5), A q̈ - b, shows how much. See `build_qp`.

    The first compiled controller on a machine compiles for about a minute, unless the installation
    did so (`floatbase compile`). Later processes load the code from disk, and their
    answers are identical to the bit. Answers of the process that compiled may differ by rounding.
    If the code cannot be kept on disk, `backend_reason` says why.

    The properties `backend` and `backend_reason` say which backend is in use and why. If the
    compiled backend finds no answer at a state, or none that is accurate to the last digits, the
    reference backend takes over. `Command.backend` and `Command.solver` say what answered.

    The iterations of a control step are limited, so that the solver takes a few milliseconds at
    most. Beyond the limit, a step of the reference backend ends with DAQP's unrefined result, with
    the answer of the priority levels before, or with a `SolverError`. Softer controllers follow
    with `on_infeasible="soften"`. The conflict that an `InfeasibleError` names is found when its
    message is read. A solver other than "daqp" has no limit. With `backend="reference"`, a call has
    no limit either, and may fall back to the slow solver "active_set"; `attempt` is limited.

    Functions of t and user-defined objects are evaluated once when the controller is made, at t = 0
    and in the standing posture. Functions and objects must therefore be defined at t = 0, even if a
    trajectory starts later.

    Examples
    --------
    >>> robot = fb.load("go2")
    >>> state = robot.standing()
    >>> contacts = fb.Contacts.points(robot)
    >>> controller = fb.WholeBodyController(robot, contacts, fb.standing_tasks(state))
    >>> controller(state.q, state.v).tau.shape
    (12,)
    """

    __setattr__ = refuse_new_attributes
    _softened: tuple[str, ...] = ()  # as in `Command`, if this is the fallback of another one

    def __init__(
        self,
        robot: Robot,
        contacts: Contacts,
        tasks: Sequence[Task] | Sequence[Sequence[Task]],
        *,
        facets: int = 4,
        inner_approximation: bool = True,
        facet_rotation: float = 0.0,
        min_normal_force: NormalForces = 0.0,
        max_normal_force: NormalForces | None = None,
        torque_limits: npt.ArrayLike | None = None,
        inequalities: Sequence[LinearInequality] = (),
        joint_limits: JointLimits | Literal["robot"] | None = "robot",
        normal_force_weight: float | None = None,
        contact_weight: float | None = None,
        on_infeasible: OnInfeasible = "raise",
        modify_qp: ModifyQP | None = None,
        solver: str = "daqp",
        backend: Backend = "auto",
    ):
        limits = Limits.of(
            robot,
            torque_limits=torque_limits,
            joint_limits=joint_limits,
            facets=facets,
            inner_approximation=inner_approximation,
            facet_rotation=facet_rotation,
            min_normal_force=min_normal_force,
            max_normal_force=max_normal_force,
            inequalities=inequalities,
            normal_force_weight=normal_force_weight,
        )
        # `Problem` takes levels apart
        problem = Problem(robot, contacts, cast("Sequence[Task]", tasks), limits, modify_qp)
        if contact_weight is not None:
            problem = with_soft_contacts(problem, contact_weight)
        limits.check_names(robot, contacts.names)
        with dry_run():  # unknown names and wrong shapes raise here, not in the loop
            # without levels, since the QP of a level needs solutions
            replace(problem, level_sizes=()).qp(robot.standing(), slacks=False)
        check_solver(solver)
        _check_choice("backend", backend, Backend)
        _check_choice("on_infeasible", on_infeasible, OnInfeasible)
        self._prepare(problem, _Settings(solver, backend, on_infeasible))
        _ = self._softer_controllers  # made here, because this takes milliseconds

    def _prepare(self, problem: Problem, settings: _Settings, warm_up: bool = True) -> None:
        """Store a checked problem, and prepare the compiled controller if it supports the problem.

        warm_up: whether to run it once, outside the loop.
        """
        self._problem = problem
        self._settings = settings
        if settings.backend == "reference":
            reason = "it was requested"
        elif assumed_model(problem) is None:
            reason = "modify_qp changes the QP"
        elif problem.level_sizes:
            reason = "the tasks have strict priorities"
        else:
            reason = unsupported_reason(problem, settings.solver)
        compiled = None if reason else CompiledTick(problem)
        if compiled is not None and warm_up:
            reason = compiled.warm_up()
        if reason and settings.backend == "compiled":
            raise InputError(
                f'backend="compiled" is not possible: {reason}. backend="auto" uses the fastest '
                f"backend that supports the problem."
            )
        self._compiled = None if reason else compiled
        if self._compiled is not None:
            terms = list(self._compiled.user_terms.names)
            moving = [task.name for task in self._compiled.unchecked_tasks]
            terms += [f"the target of {name}" for name in moving if name not in terms]
            reason = "it supports this problem" + cache_warning()
            reason += f"; these run as Python beside it: {', '.join(terms)}" if terms else ""
        self._backend_reason = reason

    def _with_problem(
        self, problem: Problem, softened: tuple[str, ...] = ()
    ) -> WholeBodyController:
        """Return a controller of another problem with the same settings."""
        other = object.__new__(type(self))
        other._softened = softened
        other._prepare(problem, self._settings, warm_up=self._compiled is None)
        return other

    @cached_property
    def _softer_controllers(self) -> tuple[WholeBodyController, ...]:
        """Make the controllers for infeasible states: soft limits, then soft contacts as well."""
        if self._settings.on_infeasible != "soften":
            return ()
        problem, controllers = self._problem, list[WholeBodyController]()
        softened: tuple[str, ...] = ()
        limits = problem.limits.softened(SOFT_LIMIT_WEIGHT)
        if limits is not problem.limits:
            problem, softened = replace(problem, limits=limits), ("limits",)
            controllers.append(self._with_problem(problem, softened))
        if contact_weight_of(problem.tasks) is None:
            problem = with_soft_contacts(problem, SOFT_CONTACT_WEIGHT)
            controllers.append(self._with_problem(problem, (*softened, "contacts")))
        return tuple(controllers)

    def __getstate__(self) -> tuple[Problem, _Settings]:
        """Return the problem and the settings, for copies and pickles.

        The compiled tick has views into Pinocchio's memory, so it is made again.
        """
        return self._problem, self._settings

    def __setstate__(self, state: tuple[Problem, _Settings]) -> None:
        self._prepare(*state)

    @property
    def problem(self) -> Problem:
        """Problem that is solved."""
        return self._problem

    @property
    def solver(self) -> str:
        """Solver of the reference backend."""
        return self._settings.solver

    @property
    def compiled(self) -> CompiledTick | None:
        """Compiled tick, or None if the reference backend is used."""
        return self._compiled

    @property
    def backend(self) -> Literal["compiled", "reference"]:
        """Backend in use."""
        return "reference" if self._compiled is None else "compiled"

    @property
    def backend_reason(self) -> str:
        """Reason why this backend is in use."""
        return self._backend_reason

    @property
    def robot(self) -> Robot:
        """Robot to control."""
        return self._problem.robot

    @property
    def contacts(self) -> Contacts:
        """Contacts of the robot."""
        return self._problem.contacts

    @property
    def tasks(self) -> Sequence[Task] | Sequence[Sequence[Task]]:
        """All tasks, including the regularization that was added; levels if they are in levels."""
        return self._problem.levels or self._problem.tasks

    @property
    def limits(self) -> Limits:
        """Friction, normal force and torque limits, and user-defined inequalities."""
        return self._problem.limits

    @cached_property
    def _layout(self) -> TargetLayout:
        """Positions of the targets in the array of all targets."""
        return TargetLayout(self._problem) if self._compiled is None else self._compiled.layout

    @property
    def targets(self) -> Mapping[str, slice]:
        """Entries of each task in an array of all targets, by the task's name.

        All tasks of this package have entries, user-defined tasks have none. The entries are
        the target and its derivatives, for example position, velocity and acceleration. Rotation
        matrices are stored row by row. If several tasks have the same name, the entries are those
        of the first one.
        """
        return self._layout.names

    def targets_at(self, t: float = 0.0) -> Array:
        """Return the array of all targets at a given time.

        The array can be changed and passed to a call, which replaces the targets of the tasks:

        >>> robot = fb.load("go2")
        >>> state, contacts = robot.standing(), fb.Contacts.points(robot)
        >>> controller = fb.WholeBodyController(robot, contacts, fb.standing_tasks(state))
        >>> targets = controller.targets_at()
        >>> targets[controller.targets["centre of mass"]][:3] += [0.0, 0.0, 0.02]
        >>> command = controller(state.q, state.v, targets=targets)

        Parameters
        ----------
        t : float, optional
            Time [s].

        Returns
        -------
        ndarray, shape (n,)
            Targets in the order of `targets`, a new array.
        """
        return self._layout.at(as_number("t", t, "s"))

    def qp(self, state: State, t: float = 0.0, *, slacks: bool = True) -> QP:
        """Return the QP of one control step, for inspection or for another solver.

        Parameters
        ----------
        state : State
            State of the robot.
        t : float, optional
            Time [s].
        slacks : bool, optional
            Whether soft inequalities, such as joint limits by default, have slack variables, as in
            `Problem.qp`.

        Returns
        -------
        QP
            The QP in x = (q̈, τ, λ, slacks); with priority levels, that of the last level.
        """
        return self._problem.qp(state, t, slacks=slacks)

    def __call__(
        self,
        q: npt.ArrayLike,
        v: npt.ArrayLike,
        t: float = 0.0,
        targets: npt.ArrayLike | None = None,
    ) -> Command:
        """Compute the command of one control step.

        Parameters
        ----------
        q : array_like, shape (nq,)
            Configuration.
        v : array_like, shape (nv,)
            Generalized velocity: the base's linear [m/s] and angular [rad/s] part in the base
            frame, then the joints [rad/s or m/s].
        t : float, optional
            Time, for tasks and bounds that depend on it [s].
        targets : array_like, shape (n,), optional
            Targets of the tasks, as `targets_at` returns them. They replace those of the tasks, and
            functions of t are not called. Rotation matrices must be exact to 1e-9, otherwise the
            slower reference backend corrects or refuses them.

        Returns
        -------
        Command
            Torques, with the forces and accelerations planned with them.

        Raises
        ------
        InfeasibleError
            If the QP has no solution, unless `on_infeasible` is "soften".
        SolverError
            If the reference backend finds neither a solution nor a conflict within its limit.
        """
        in_loop = self._settings.backend != "reference"
        try:
            command = self._answer(self._checked_step(q, v, t, targets), True, in_loop)
        except InfeasibleError as error:
            if not (question := pose_question(State(self.robot, q))):
                raise
            found = error  # the message is searched for when it is read
            raise InfeasibleError(
                lambda: InfeasibleError(f"{found} {question}", found.constraints)
            ) from None
        assert command is not None
        return command

    def attempt(
        self,
        q: npt.ArrayLike,
        v: npt.ArrayLike,
        t: float = 0.0,
        targets: npt.ArrayLike | None = None,
    ) -> Command | None:
        """Compute the command of one control step, or return None if the QP has no solution.

        Use this method in real-time loops. A call raises an `InfeasibleError` instead, after the
        reference backend has confirmed that there is no solution, which takes milliseconds.

        Parameters
        ----------
        q : array_like, shape (nq,)
            Configuration.
        v : array_like, shape (nv,)
            Generalized velocity: the base's linear [m/s] and angular [rad/s] part in the base
            frame, then the joints [rad/s or m/s].
        t : float, optional
            Time, for tasks and bounds that depend on it [s].
        targets : array_like, shape (n,), optional
            Targets of the tasks, as for a call.

        Returns
        -------
        Command or None
            Torques, with the forces and accelerations planned with them. With
            `on_infeasible="soften"`, the command may be softened.

        Raises
        ------
        SolverError
            If the reference backend finds neither a solution nor a conflict within its limit.

        Notes
        -----
        The compiled backend decides in microseconds. States in which its last digits are lost, and
        problems without a compiled form, need the reference backend.
        """
        return self._answer(self._checked_step(q, v, t, targets), False, True)

    def _answer(self, step: Step, must_answer: bool, in_loop: bool) -> Command | None:
        """Return the command of this controller or of a softer one.

        must_answer: whether to raise an error instead of returning None. in_loop: whether the
        iterations of the reference backend are limited.
        """
        if not self._softer_controllers:
            return self._attempt(step, must_answer, in_loop)
        *others, softest = self, *self._softer_controllers
        for controller in others:
            with suppress(SolverError):  # a softer problem may be easier
                if (command := controller._attempt(step, False, in_loop)) is not None:
                    return command
        return softest._attempt(step, must_answer, in_loop)

    @one_blas_thread()  # also for the checks: several threads take 4 ms for 80,000 numbers
    def batch(
        self,
        Q: npt.ArrayLike,
        V: npt.ArrayLike,
        t: npt.ArrayLike = 0.0,
        targets: npt.ArrayLike | None = None,
        threads: int | None = None,
    ) -> CommandBatch:
        """Compute the commands of many states, in several threads.

        Each row is identical to the bit to `attempt` with this state. A state without a solution
        raises no exception. The compiled backend runs in the threads. User-defined functions and
        the reference backend run in the calling thread, one state after another.

        Parameters
        ----------
        Q : array_like, shape (N, nq)
            Configurations.
        V : array_like, shape (N, nv)
            Generalized velocities, as for a call.
        t : float or array_like, shape (N,), optional
            Time of all states, or of each state [s].
        targets : array_like, shape (n,) or (N, n), optional
            Targets for all states, or for each state, as for a call.
        threads : int, optional
            Number of threads, by default one for each core that the process may use.

        Returns
        -------
        CommandBatch
            Torques, with the accelerations and forces planned with them, and the backend that
            answered each row.

        Raises
        ------
        InputError
            If an argument has a wrong shape or an invalid entry.

        Examples
        --------
        >>> robot = fb.load("go2")
        >>> state, contacts = robot.standing(), fb.Contacts.points(robot)
        >>> controller = fb.WholeBodyController(robot, contacts, fb.standing_tasks(state))
        >>> commands = controller.batch([state.q, state.q], [state.v, state.v])
        >>> commands.tau.shape, commands.status.tolist()
        ((2, 12), ['compiled', 'compiled'])
        """
        # copies in the form that the compiled loop needs
        Q = np.array(as_array("Q", Q, (None, self.robot.nq)), order="C")
        V = np.array(as_array("V", V, (len(Q), self.robot.nv)), order="C")
        times = one_or_each("t", t, len(Q), ())
        if targets is not None:
            targets = one_or_each("targets", targets, len(Q), (self._layout.size,))
        may_soften = bool(self._softer_controllers)
        return solve_batch(self, may_soften, Q, V, times, targets, thread_count(threads))

    def _checked_step(
        self, q: npt.ArrayLike, v: npt.ArrayLike, t: float, targets: npt.ArrayLike | None
    ) -> Step:
        """Return the arguments of a call, with time and targets checked."""
        if type(t) is not float or not -MAX_MAGNITUDE <= t <= MAX_MAGNITUDE:
            t = as_number("t", t, "s")
        if v is None:  # State takes None for rest; here it is a mistake
            as_array("v", v, (self.robot.nv,))
        if targets is None:
            return q, v, t, None
        # the compiled tick checks that numbers are finite
        is_float64 = type(targets) is np.ndarray and targets.dtype.char == "d"
        array = cast(Array, targets) if is_float64 else as_array("targets", targets, (None,))
        self._layout.check_size(array)
        return q, v, t, array

    def _attempt(self, step: Step, must_answer: bool, in_loop: bool) -> Command | None:
        """Return the command of this controller alone."""
        q, v, t, targets = step
        tick = self._compiled
        q_array, v_array = numeric_copy(q), numeric_copy(v)
        if tick is None or q_array is None or v_array is None:
            return self._reference_attempt(step, must_answer, in_loop)
        answer = tick(q_array, v_array, t, targets)
        if answer is None or (must_answer and answer[1] == tick.infeasible):
            return self._reference_attempt(step, must_answer, in_loop)
        result, n_active, inputs = answer
        if n_active == tick.infeasible:
            return None
        result.setflags(write=False)
        targets_of_tick = inputs.packed[: tick.layout.size]
        targets_of_tick.setflags(write=False)  # not `packed` itself: numba compiles for each kind
        problem = self._problem
        return Command(  # in the order of its parameters: names would take 0.25 µs
            result[tick.tau],
            result[tick.qdd],
            result[tick.forces],
            problem.contacts,
            "compiled",
            "compiled",
            partial(tick.solution, q_array, v_array, t, result, n_active, inputs),
            self._softened,
            targets_of_tick,
            tick.layout.names,
            problem.limits.joint_limits,
        )

    def _reference_attempt(self, step: Step, must_answer: bool, in_loop: bool) -> Command | None:
        """Return the reference backend's command."""
        q, v, t, targets = step
        problem = self._problem if targets is None else self._layout.fixed_problem(targets)
        state = State(self.robot, q, v)
        try:
            solution = problem.solve_levels(state, t, self.solver, in_loop)[-1]
        except InfeasibleError:
            if must_answer:
                raise
            return None
        return Command(
            tau=read_only(solution["tau"]),
            qdd=read_only(solution["qdd"]),
            forces=read_only(solution["forces"]),
            contacts=self.contacts,
            backend="reference",
            solver=solution.solver,
            solution=solution,
            softened=self._softened,
            target_values=read_only(self._layout.at(t) if targets is None else targets),
            target_entries=self._layout.names,
            joint_limits=self._problem.limits.joint_limits,
        )

    def replace(
        self,
        *,
        contacts: Contacts | None = None,
        tasks: Sequence[Task] | Sequence[Sequence[Task]] | None = None,
        **limits: Any,
    ) -> WholeBodyController:
        """Return a controller with other contacts, tasks or limits and otherwise equal settings.

        This method is fast enough to be called in the control loop.

        Parameters
        ----------
        contacts : Contacts, optional
            New contacts.
        tasks : sequence of Task, or sequence of sequences of Task, optional
            New tasks, or levels of tasks. To add to the attribute `tasks`, append a task to it, or
            a level to levels.
        **limits
            New limits, as in the constructor: `torque_limits`, `joint_limits`, `facets`,
            `inner_approximation`, `facet_rotation`, `min_normal_force`, `max_normal_force`,
            `normal_force_weight` or `inequalities`. Each option that is not passed keeps its value.
            That includes the braking acceleration of the joint limits if `torque_limits` changes.

        Returns
        -------
        WholeBodyController
            The new controller.

        Raises
        ------
        UnknownArgumentError
            If there is no such limit.
        """
        now = {each.name: getattr(self.limits, each.name) for each in fields(Limits)}
        check_arguments("WholeBodyController.replace", limits, ("contacts", "tasks", *now))
        changed = Limits.of(self.robot, **(now | limits)) if limits else self.limits
        problem = replace(
            self._problem,
            contacts=self.contacts if contacts is None else contacts,
            tasks=self._problem.tasks if tasks is None else cast("Sequence[Task]", tasks),
            level_sizes=self._problem.level_sizes if tasks is None else (),
            limits=changed,
        )
        if (weight := contact_weight_of(self._problem.tasks)) is not None:
            problem = with_soft_contacts(problem, weight)
        if limits:
            names = *problem.contacts.names, *self.contacts.names
            changed.check_names(self.robot, names, before=self.limits)
        other = self._with_problem(problem)
        compiled, has_changed = other._compiled, tasks is not None or bool(limits)
        if compiled is None:
            problem.check()
        elif has_changed or self.limits.inequalities or compiled.user_terms.any:
            problem.check(compiled.unchecked_tasks)  # what the problem arrays have not checked
        return other

    def __repr__(self) -> str:
        return (
            f"WholeBodyController({self.robot.name}, {len(self.contacts)} contacts, "
            f"{len(self._problem.tasks)} tasks, {self.backend})"
        )


def _check_choice(name: str, value: object, choices: object) -> None:
    """Raise `UnknownNameError` if a value is none of the choices of a `Literal`."""
    if not isinstance(value, str) or value not in get_args(choices):
        raise unknown_name(name, value, get_args(choices))
