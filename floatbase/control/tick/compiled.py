"""`CompiledTick`: runs the compiled controller, and says which problems it supports.

numba is slow to load, so the modules that need it are imported when the first problem is compiled.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from functools import lru_cache
from threading import Event, Thread, local
from typing import cast

import numpy as np

from floatbase._validation import Array
from floatbase.control.capture_point import support_corners
from floatbase.control.limits import force_rows, hard_maximum
from floatbase.control.problem import Problem, assemble_qp, modified_qp, residual_of
from floatbase.control.tick.problem_arrays import (
    HAS_CONES,
    N_CONTACT_NUMBERS,
    Indices,
    pack_problem,
)
from floatbase.control.tick.targets import TargetLayout, compiled_rows
from floatbase.control.tick.user_terms import TickInputs, UserTerms
from floatbase.objectives import Task
from floatbase.qp import QP, Solution
from floatbase.robots import Robot, State

_RECHECK_INTERVAL = 1.0  # s between two checks whether numba is compiling
# how many states of a batch a thread takes at a time: enough to be worth a thread, and few enough
# to share the work evenly
_MIN_CHUNK, _MAX_CHUNK = 32, 256

# joints whose axes are fixed in their own frame
_JOINTS = (
    "JointModelR",
    "JointModelPX",
    "JointModelPY",
    "JointModelPZ",
    "JointModelPrismatic",
    "JointModelFreeFlyer",
)


@contextmanager
def announce_if_slow(
    text: str, is_true: Callable[[], bool] = lambda: True, after: float = 6.0
) -> Iterator[None]:
    """Print a message to stderr if the enclosed code takes more than `after` seconds."""
    ended = Event()

    def announce() -> None:
        """Wait for the moment to print the message."""
        delay = after
        while not ended.wait(delay):
            if is_true():
                print(text, file=sys.stderr, flush=True)
                return
            delay = _RECHECK_INTERVAL

    Thread(target=announce, name="floatbase-announcement", daemon=True).start()
    try:
        yield
    finally:
        ended.set()


@contextmanager
def compiling_ahead() -> Iterator[None]:
    """Make other processes wait for the code that this one compiles, instead of compiling too."""
    with ExitStack() as stack:
        with suppress(ImportError, OSError, AttributeError):  # `unsupported_reason` will name it
            from floatbase.control.tick import jit, tick

            stack.enter_context(jit.compile_lock(tick.tick, ahead=True))
        yield


def cache_warning() -> str:
    """Return a remark for messages if compiled code cannot be kept on disk, otherwise ""."""
    from floatbase.control.tick import jit

    if not jit.cache_error:
        return ""
    remedy = "set NUMBA_CACHE_DIR to an empty, writable folder with free space"
    return f"; compiled code cannot be kept on disk ({jit.cache_error}): {remedy}"


def unsupported_reason(problem: Problem, solver: str) -> str:
    """Return why a problem cannot run compiled, or "" if it can."""
    if solver != "daqp":
        return f"solver {solver!r} was requested, but the compiled controller has its own solver"
    try:
        from floatbase.control.tick import jit, tick  # noqa: F401
    except (ImportError, OSError, AttributeError) as error:
        return f"numba cannot be loaded ({error}); reinstall it with pip install numba"
    if not jit.jit_enabled:
        return "NUMBA_DISABLE_JIT is set, so numba does not compile"
    return _unsupported_robot_reason(problem.robot)


@lru_cache(maxsize=16)
def _unsupported_robot_reason(robot: Robot) -> str:
    """Return why a robot cannot run compiled, or ""."""
    if robot.d == 0:
        return f"{robot.name} has no driven joints"
    for i, joint in enumerate(robot.model.joints):
        kind = joint.shortname()
        if i and (not kind.startswith(_JOINTS) or (kind == "JointModelFreeFlyer" and i != 1)):
            return (
                f"joint {robot.model.names[i]!r} is a {kind}, but the compiled controller supports "
                f"only revolute and prismatic joints"
            )
    return ""


class _Memory(local):
    """Workspaces of one thread, for the ticks of all its controllers."""

    arrays = np.empty(0), np.empty(0, np.int64)


_memory = _Memory()


class CompiledTick:
    """The compiled controller of one problem, for which `unsupported_reason` returns ""."""

    def __init__(self, problem: Problem):
        from floatbase.control.tick import dual_search, tick

        robot, nv, d, k = problem.robot, problem.robot.nv, problem.robot.d, problem.contacts.k
        self._problem = problem
        self.layout, self.infeasible = TargetLayout(problem), dual_search.INFEASIBLE
        self.tables = pack_problem(problem, self.layout)
        self.user_terms = UserTerms(problem)
        # those whose targets or residuals are functions
        self.unchecked_tasks = [cast(Task, each.task) for each in self.layout.varying]
        self.unchecked_tasks += [task for task in problem.tasks if not compiled_rows(task)]
        self.default_inputs = self.user_terms.constant_inputs(
            self.layout.constant, int(self.tables[0][N_CONTACT_NUMBERS])
        )
        self._q_shape, self._v_shape, self._n_multipliers = (robot.nq,), (nv,), nv + k
        self.qdd, self.tau, self.forces = slice(0, nv), slice(nv, nv + d), slice(nv + d, nv + d + k)
        self._tick, self._n_stages = tick.tick, tick.N_STAGES
        self._workspace_sizes = tick.workspace_sizes
        self._varies = bool(self.layout.varying) or self.user_terms.varies
        limits = problem.limits
        # weights of the joint limits, and of the groups of user-defined inequalities
        soft = limits.joint_limits, *limits.all_inequalities(problem.contacts)
        self._soft_weights = [(each and each.weight) or np.inf for each in soft]
        self._has_soft = bool(np.isfinite(self._soft_weights).any())
        self._sizes = self._workspace_sizes(self.tables[0], self.default_inputs.packed.size)
        # without user-defined inequalities
        self._result_size = self.forces.stop + 2 * self._n_multipliers + 2 * d * self._has_soft

    def workspace(self, n_inputs: int = 0, n_user_rows: int = 0) -> tuple[Array, Indices]:
        """Return this thread's memory for one tick with as many inputs or the default ones."""
        sizes = self._sizes
        if n_user_rows or n_inputs > self.default_inputs.packed.size:
            sizes = self._workspace_sizes(self.tables[0], n_inputs, n_user_rows)
        floats, ints = _memory.arrays
        if floats.size < sizes[0] or ints.size < sizes[1]:
            floats, ints = _memory.arrays = np.empty(sizes[0]), np.empty(sizes[1], np.int64)
        return floats, ints

    def run(self, q: Array, v: Array, inputs: TickInputs, n_stages: int) -> tuple[Array, int]:
        """Run the first stages of one tick; return its numbers, and the number of active rows."""
        result = self.empty_result(inputs)
        workspace = self.workspace(inputs.packed.size, inputs.n_user_rows)
        n_active = self._tick(q, v, inputs.packed, *self.tables, *workspace, result, n_stages)
        return result, n_active

    def __call__(
        self, q: Array, v: Array, t: float, targets: Array | None = None
    ) -> tuple[Array, int, TickInputs] | None:
        """Run one tick, or return None if the reference backend must decide."""
        if q.shape != self._q_shape or v.shape != self._v_shape:
            return None
        inputs: TickInputs | None = self.default_inputs
        if self._varies or targets is not None:
            inputs = self.inputs_at(q, v, t, targets)
        if inputs is None:
            return None
        result, n_active = self.run(q, v, inputs, self._n_stages)
        decided = n_active >= 0 or n_active == self.infeasible
        return (result, n_active, inputs) if decided else None

    def run_batch(
        self, Q: Array, V: Array, times: Array, targets: Array | None, n_threads: int
    ) -> tuple[Array, Indices]:
        """Run one tick for each row of Q and V; return their (q̈, τ, λ) and their codes.

        Q, V: contiguous and writable. User functions are called in this thread only.
        """
        from floatbase.control.tick import loop, tick

        n, failed = len(Q), list[int]()
        results, codes = np.empty((n, self.forces.stop)), np.empty(n, np.int64)
        size = min(max(-(-n // n_threads), _MIN_CHUNK), _MAX_CHUNK)
        chunks = [slice(first, min(first + size, n)) for first in range(0, n, size)]
        run_ticks = loop.compiled_loop(self._tick)

        def inputs_of(rows: slice) -> list[TickInputs]:
            """Return the inputs of each row, or of all rows together if they are equal."""
            if not self._varies and targets is None:
                return [self.default_inputs]
            all_inputs = []
            for i in range(rows.start, rows.stop):
                given = None if targets is None else targets[i]
                inputs = self.inputs_at(Q[i], V[i], float(times[i]), given)
                if inputs is None:
                    failed.append(i)
                all_inputs.append(inputs or self.default_inputs)
            return all_inputs

        def run(rows: slice, inputs: list[TickInputs]) -> None:
            """Run the ticks of some rows, in any thread."""
            stops = np.cumsum([each.packed.size for each in inputs])
            starts = np.append(0, stops[:-1])
            n_inputs, n_user_rows = np.max(
                [(each.packed.size, each.n_user_rows) for each in inputs], axis=0
            )
            run_ticks(
                self._tick, Q[rows], V[rows], np.resize(starts, rows.stop - rows.start),
                np.resize(stops, rows.stop - rows.start), results[rows], codes[rows],
                np.concatenate([each.packed for each in inputs]), *self.tables,
                *self.workspace(int(n_inputs), int(n_user_rows)),
                max(map(self.empty_result, inputs), key=len), self._n_stages,
            )  # fmt: skip

        if len(chunks) < 2 or n_threads == 1:
            for chunk in chunks:
                run(chunk, inputs_of(chunk))
        else:
            with ThreadPoolExecutor(n_threads) as pool:
                list(pool.map(run, chunks, map(inputs_of, chunks)))
        codes[failed] = tick.INVALID
        return results, codes

    def warm_up(self) -> str:
        """Run one tick outside the loop, which compiles the code or loads it from disk."""
        from floatbase.control.tick import jit, tick

        duration = cache_warning() or ". This happens once and takes about a minute"
        n_compiled = self._compilation_count()
        with announce_if_slow(
            f"floatbase is compiling its controller{duration}.",
            lambda: jit.waiting or self._compilation_count() > n_compiled,
        ):
            try:
                with jit.compile_lock(self._tick):
                    self._tick_standing()
            except Exception as cache_failure:  # damaged files may raise anything
                try:
                    self._tick = tick.tick = jit.without_cache(self._tick)
                    self._tick_standing()
                except Exception as error:
                    # whatever numba raises, the reference backend takes over; no user code runs
                    # here
                    return f"numba could not compile the tick ({type(error).__name__}: {error})"
                jit.cache_error = f"{type(cache_failure).__name__}: {cache_failure}"
        return ""

    def _compilation_count(self) -> int:
        """Return how often the tick was compiled instead of loaded, unfinished ones included."""
        statistics = getattr(self._tick, "stats", None)  # plain Python has none: NUMBA_DISABLE_JIT
        return sum(statistics.cache_misses.values()) if statistics else 0

    def _tick_standing(self) -> None:
        """Run one tick at the robot's standing state."""
        standing = self._problem.robot.standing()
        q, v = np.array(standing.q), np.array(standing.v)
        self.run(q, v, self.default_inputs, self._n_stages)

    def empty_result(self, inputs: TickInputs) -> Array:
        """Return an uninitialized array for the numbers of one tick."""
        size = self._result_size
        if self._has_soft and inputs.inequalities:
            size += sum(self._group_sizes(inputs))
        return np.empty(size)

    def qp(self, q: Array, v: Array, t: float, inputs: TickInputs) -> QP:
        """Return the reference QP of a tick, with the values that user functions returned in it.

        The functions are not called again, since they might return other values.
        """
        eom, costs = self.user_terms.equations(State(self._problem.robot, q, v), t, inputs), []
        for i, task in enumerate(self.layout.fixed_tasks(inputs.packed[: self.layout.size])):
            given = inputs.residuals.get(i) or (task.weight, residual_of(task, eom, t))
            costs.append((task.block, *given))
        limits, end = self._problem.limits, self.layout.size + 2 * eom.contacts.n_points
        both = zip(limits.all_inequalities(eom.contacts), inputs.inequalities, strict=True)
        inequalities = [each.at(eom, t) if given is None else given for each, given in both]
        minimum, maximum = inputs.packed[self.layout.size : end].reshape(2, -1)
        qp = assemble_qp(eom, costs, limits, (minimum, maximum), inequalities)
        return modified_qp(self._problem, qp, eom)

    def solution(
        self, q: Array, v: Array, t: float, result: Array, n_active: int, inputs: TickInputs
    ) -> Solution:
        """Return the reference QP of a tick with the tick's answer; what `__call__` returned."""
        qp, mu = self.qp(q, v, t, inputs), self.multipliers(q, result, n_active, inputs)
        return Solution(qp, result[: self.forces.stop], mu, "compiled", n_active)

    def pack(self, problem: Problem) -> tuple[Indices, Indices, Array]:
        """Return a problem with the same tasks as arrays for the tick: sizes, integers, floats."""
        return pack_problem(problem, self.layout)

    @property
    def row_owners(self) -> list[tuple[str, str, int]]:
        """Kind, owner and number of the rows that the tick numbers, also of those without a bound.

        User-defined rows come after them.
        """
        contacts, limits = self._problem.contacts, self._problem.limits
        names, joints = contacts.point_names, self._problem.robot.joint_names
        of_forces = force_rows(contacts, limits)[1][: len(names) * (limits.facets + 1)]
        owners = [(label.kind, label.owner, label.number or 0) for label in of_forces]
        owners += [("largest normal force", name, 0) for name in names]
        for kind in ("torque limit", "joint limit"):
            for side in ("upper", "lower"):
                owners += [(f"{side} {kind}", name, 0) for name in joints]
        return owners

    def _group_sizes(self, inputs: TickInputs) -> list[int]:
        """Return how many rows each user-defined inequality has in the tick."""
        n_points = self._problem.contacts.n_points  # a capture point has a row for each
        return [n_points if given is None else len(given[1]) for given in inputs.inequalities]

    def multipliers(self, q: Array, result: Array, n_active: int, inputs: TickInputs) -> Array:
        """Return the multipliers of all inequalities of the reference QP."""
        limits, contacts = self._problem.limits, self._problem.contacts
        # the reference QP has rows for limited joints only
        limited, d = np.isfinite(limits.torque_limits), limits.torque_limits.size
        joints = (
            np.full(2 * d, False)
            if limits.joint_limits is None
            else limits.joint_limits.bounded.ravel()
        )
        friction = np.full(contacts.n_points * (limits.facets + 1), self.tables[0][HAS_CONES] == 1)
        group_sizes = self._group_sizes(inputs)
        user_rows = np.full(sum(group_sizes), True)
        for i, end in enumerate(np.cumsum(group_sizes)):
            if inputs.inequalities[i] is None:
                points = contacts.positions(State(self._problem.robot, q))
                user_rows[end - len(points) : end] = False
                user_rows[end - len(points) + np.array(support_corners(points))] = True
        has_row = np.concatenate(
            [friction, hard_maximum(contacts, limits), limited, limited, joints, user_rows]
        )
        sizes = self.forces.stop, 2 * self._n_multipliers
        mu, active = result[sizes[0] : sum(sizes)].reshape(2, -1)[:, :n_active]
        all_rows = np.zeros(has_row.size)
        all_rows[active.astype(np.int64)] = np.maximum(mu, 0.0)
        if self._has_soft:
            weights = np.repeat(self._soft_weights, [2 * d, *group_sizes])
            soft_rows, saturated = all_rows[-len(weights) :], result[sum(sizes) :] > 0.0
            # rows with the opposite sign start at their weight
            soft_rows[saturated] = np.maximum(weights - soft_rows, 0.0)[saturated]
        multipliers: Array = all_rows[has_row]
        return multipliers

    def inputs_at(
        self, q: Array, v: Array, t: float, targets: Array | None = None
    ) -> TickInputs | None:
        """Return the inputs of a tick, in new arrays since other threads may run ticks too."""
        try:
            targets = self.layout.at(t) if targets is None else targets
            if self.user_terms.varies:
                return self.user_terms.inputs(targets, q, v, t)
            packed = self.default_inputs.packed.copy()
            packed[: self.layout.size] = targets
            return TickInputs(packed, *self.default_inputs[1:])
        except Exception:  # user code may raise anything
            return None
