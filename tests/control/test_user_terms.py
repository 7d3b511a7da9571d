"""User-defined tasks and constraints: the same answers on both backends, and their errors."""

import copy
import pickle
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import ClassVar

import judges
import numpy as np
import pytest
from messages import raises
from numba.core import event

import floatbase as fb
from floatbase.control import LinearInequality
from floatbase.control.tick import tick
from floatbase.dynamics import EquationsOfMotion, LinearConstraint, PointContact, RollingWheel
from floatbase.errors import InfeasibleError, InputError


@dataclass
class MyCoM:
    """`fb.CoMTask` as a user would write it."""

    target: np.ndarray
    weight: float = 10.0
    name: str = "my centre of mass"
    block: ClassVar[str] = "qdd"

    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> fb.Affine:
        s = eom.state
        desired = -100.0 * (s.com - self.target) - 20.0 * s.com_velocity
        return fb.Affine(s.com_jacobian, s.com_drift - desired)


@dataclass
class MyHand:
    """`fb.FrameTask` as a user would write it; the target moves at 0.1 m/s."""

    frame: str
    target: np.ndarray
    weight: float = 7.0
    name: str = "my hand"
    block: ClassVar[str] = "qdd"

    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> fb.Affine:
        s = eom.state
        e = s.point(self.frame) - self.target - [0.1 * t, 0.0, 0.0]
        e_dot = s.frame_velocity(self.frame)[:3] - [0.1, 0.0, 0.0]
        J, drift = s.frame_jacobian(self.frame)[:3], s.frame_drift(self.frame)[:3]
        return fb.Affine(J, drift + 400.0 * e + 40.0 * e_dot)


@dataclass
class MyEffort:
    """Forces or torques that share a load: rows on λ or τ, with a matrix that couples entries."""

    block: str
    weight: float = 1e-3

    @property
    def name(self) -> str:
        return f"my {self.block}"

    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> fb.Affine:
        n = eom.k if self.block == "forces" else eom.d
        return fb.Affine(np.eye(n) - np.ones((n, n)) / n, 0.1 * np.arange(n))


STATE_PARTS = ("com", "com_velocity", "com_jacobian", "com_drift", "M", "h", "joint_transforms")
FRAME_PARTS = ("frame_jacobian", "frame_velocity", "frame_drift", "point")
HANDS = {"go2": "FL_foot", "solo12": "FL_FOOT", "talos": "gripper_left_base_link"}


def stance(robot: fb.Robot) -> fb.Contacts:
    """Return the contacts of the feet, without the one that serves as a hand."""
    contacts = judges.stance(robot)
    return contacts.without(HANDS[robot.name]) if HANDS[robot.name] in contacts.names else contacts


# tasks --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("robot", HANDS, indirect=True)
def test_a_user_defined_task_does_what_the_same_built_in_task_does(robot):
    at, frame, contacts = robot.standing(), HANDS[robot.name], stance(robot)
    hand = at.point(frame) + [0.0, 0.0, 0.05]
    others = [*fb.standing_tasks(at)[1:], fb.ForceTask(weight=1e-4)]
    own = [MyCoM(at.com), others[0], MyHand(frame, hand), *others[1:]]
    rate = np.array([0.1, 0.0, 0.0])
    moving = fb.FrameTask(frame, lambda t: (hand + t * rate, rate, np.zeros(3)), weight=7.0)
    known, _ = judges.pair(robot, contacts, [fb.CoMTask(at.com), moving, *others])
    compiled, reference = judges.pair(robot, contacts, own)
    active = 0
    for i, state in enumerate(judges.near_and_far(robot.name, 8)):
        assert judges.difference(compiled, reference, state, 0.1 * i) < judges.agreement(robot)
        assert judges.difference(compiled, known, state, 0.1 * i) < judges.agreement(robot)
        active += len(known(state.q, state.v).active)
    assert active > 8, "nothing was saturated: these states try nothing"


def test_user_defined_tasks_on_torques_and_forces(go2):
    efforts = [MyEffort("forces"), MyEffort("tau"), fb.ForceTask(), fb.TorqueTask()]
    tasks = [*fb.standing_tasks(go2.standing()), *efforts]
    both = judges.pair(go2, judges.stance(go2), tasks)
    assert judges.largest_difference(both, judges.near_and_far("go2", 6)) < judges.agreement(go2)


@dataclass
class Looks:
    """A task that keeps what it sees, and may have any number of rows."""

    seen: list[EquationsOfMotion]
    rows: int = 2
    weight: float = 1.0
    name: str = "looks"
    block: ClassVar[str] = "qdd"

    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> fb.Affine:
        self.seen.append(eom)
        return fb.Affine(np.ones((self.rows, eom.nv)), np.zeros(self.rows))


@pytest.mark.parametrize("robot", ["go2", "talos", "ur5"], indirect=True)
def test_a_user_defined_task_sees_equations_of_motion_that_do_not_change_later(robot):
    close, seen = partial(np.allclose, rtol=1e-10, atol=1e-10), []
    contacts, frame = judges.stance(robot), robot.model.frames[robot.model.nframes - 1].name
    tasks = [*fb.standing_tasks(robot.standing()), Looks(seen)]
    controller = fb.WholeBodyController(robot, contacts, tasks, backend="compiled")
    states = judges.states(robot.name, 5)  # more than a robot's cached memory holds
    seen.clear()
    for state in states:
        controller(state.q, state.v)
    assert len(seen) == len(states)
    for eom, state in zip(seen, states, strict=True):
        expected = fb.equations_of_motion(state, contacts)
        copies = (pickle.loads(pickle.dumps(eom)), copy.copy(eom)) if eom is seen[0] else ()
        for other in (eom, *copies):
            for part in STATE_PARTS:
                found = getattr(other.state, part)
                assert close(found, getattr(state, part)), part
                assert not found.flags.writeable
            for part in ("M", "h", "S", "J", "A", "b"):
                assert close(getattr(other, part), getattr(expected, part)), part
            for ask in FRAME_PARTS:
                assert close(getattr(other.state, ask)(frame), getattr(state, ask)(frame)), ask
            assert (other.nv, other.d, other.k) == (expected.nv, expected.d, expected.k)
            assert other.state.frame_pose(frame).isApprox(state.frame_pose(frame))
    with raises(AttributeError, "nothing"):
        _ = seen[0].nothing
    with pytest.raises(AttributeError):
        seen[0].M = np.eye(robot.nv)


def test_arrays_that_a_task_keeps_do_not_change_when_their_state_is_gone(go2):
    """The memory of a state is reused by states of later ticks."""
    seen = []
    tasks = [*fb.standing_tasks(go2.standing()), Looks(seen)]
    controller = judges.pair(go2, judges.stance(go2), tasks)[0]

    def arrays(state: fb.State) -> list[np.ndarray]:
        """Return all arrays that the state of a new tick provides."""
        seen.clear()
        controller(state.q, state.v)
        at = seen.pop().state
        asked = [getattr(at, ask)("base") for ask in FRAME_PARTS]
        kept = [getattr(at, part) for part in STATE_PARTS]
        return [*asked, at.frame_pose("base").homogeneous, *kept]

    kept = arrays(go2.random_state(1_000))
    before = [array.copy() for array in kept]
    others = [arrays(state) for state in judges.states("go2", 6)]
    assert all(np.array_equal(array, was) for array, was in zip(kept, before, strict=True))
    pairs = [pair for other in others for pair in zip(other, kept, strict=True)]
    assert not any(np.array_equal(*pair) for pair in pairs)


def test_a_task_may_have_more_rows_in_one_tick_than_in_another(go2):
    task = Looks([], rows=0)
    both = judges.pair(go2, judges.stance(go2), [*fb.standing_tasks(go2.standing()), task])
    for task.rows in (0, 3, 1, 400, 2):
        state = go2.random_state(task.rows, 0.1)
        assert judges.difference(*both, state) < judges.agreement(go2)


def test_the_solution_is_that_of_the_tick_when_user_defined_objects_have_moved_on(go2):
    task, slider, pull = MyCoM(np.array(go2.standing().com)), {"bound": 40.0}, np.ones(1)

    class Drive(LinearConstraint):
        """A constraint that returns the array that it works in."""

        def constraint(self, state: fb.State, t: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
            return np.eye(18)[6:7], pull

    drive = Drive("drive", 1, lambda state, t: (np.eye(18)[6:7], np.zeros(1)))
    push = LinearInequality("push", "forces", lambda eom, t: (np.eye(10)[2:3], [slider["bound"]]))
    bounds = {"FL_foot": lambda t: slider["bound"]}
    contacts = judges.stance(go2).without("FR_foot") + fb.Contacts([drive])
    tasks, options = [task, *fb.standing_tasks(go2.standing())], {"max_normal_force": bounds}
    controller, _ = judges.pair(go2, contacts, tasks, inequalities=[push], **options)
    command = controller(go2.standing().q, np.zeros(18))
    assert command.backend == "compiled"
    slider.update(bound=7.0)
    pull[:] = 50.0
    task.target, task.weight = task.target + 1.0, 3.0
    solution = command.solution
    residuals = solution.residuals
    assert max(residuals.stationarity, residuals.equality, residuals.inequality) < 1e-7
    assert np.allclose(solution["tau"], command.tau)


def test_threads_may_share_a_controller_whose_task_calls_another_controller():
    robot, states = judges.load("go2"), judges.states("go2", 40, 0.1)
    inner = judges.controller_of("go2", backend="compiled")

    class Nested(MyCoM):
        def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> fb.Affine:
            found = super().residual(eom, t)
            # this runs a tick of the same robot
            inner(eom.state.replace(v=np.zeros(18)).q, np.zeros(18))
            return found

    tasks = [Nested(robot.standing().com), *fb.standing_tasks(robot.standing())[1:]]
    controller, _ = judges.pair(robot, judges.stance(robot), tasks)
    expected = [controller(state.q, state.v).tau for state in states]

    def wrong(shift: int) -> list[int]:
        order = (np.arange(200) + shift) % len(states)
        taus = [(i, controller(states[i].q, states[i].v).tau) for i in order]
        return [i for i, tau in taus if not np.array_equal(tau, expected[i])]

    with ThreadPoolExecutor(3) as pool:
        assert list(pool.map(wrong, (0, 13, 27))) == [[], [], []]


class _Wrong:
    """A task that is right at t = 0 and wrong in one way later."""

    name, weight, block = "odd", 1.0, "qdd"

    def __init__(self, later: Callable[[], object], at_first: fb.Affine | None = None):
        self.later, self.at_first = later, at_first or fb.Affine.identity(18)

    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> object:
        return self.later() if t else self.at_first


def _fail() -> object:
    raise RuntimeError("the sensor is gone")


@pytest.mark.parametrize(
    ("later", "kind", "named"),
    [
        (lambda: np.eye(18), InputError, ("residual", "odd", "ndarray")),
        (lambda: fb.Affine.identity(12), InputError, ("residual", "odd", "qdd", 12, 18)),
        (lambda: fb.Affine(np.full((1, 18), np.nan), [0.0]), InputError, ("odd", "A", np.nan)),
        (_fail, RuntimeError, ("the sensor is gone",)),
    ],
)
def test_a_task_that_goes_wrong_is_reported_on_both_backends(later, kind, named, go2):
    for controller in judges.pair(go2, judges.stance(go2), [_Wrong(later)]):
        assert controller(go2.standing().q, np.zeros(18)).backend == controller.backend
        with raises(kind, *named):
            controller(go2.standing().q, np.zeros(18), 1.0)


def test_nothing_is_compiled_when_tasks_contacts_or_rows_change(go2):
    controller = judges.controller_of("go2", backend="compiled")
    state, at = go2.random_state(1, 0.1), go2.standing()
    feet = fb.Contacts.points(go2, frames=["FR_foot", "RL_foot", "RR_foot"])
    held = fb.Contacts([LinearConstraint("hold", 2, lambda s, t: (np.eye(18)[6:8], np.zeros(2)))])
    com, hand = MyCoM(at.com), MyHand("FL_foot", at.point("FL_foot"))
    push = LinearInequality("push", "tau", (np.eye(12), np.full(12, 20.0)))
    lists = (fb.standing_tasks(at), [com], [com, hand])
    choices = product((feet, feet + held), lists, ((), [push]))
    with event.install_recorder("numba:compile") as recorder:
        for contacts, tasks, rows in choices:
            bounds = {"FR_foot": 90.0}
            other = controller.replace(
                contacts=contacts, tasks=tasks, inequalities=rows, max_normal_force=bounds
            )
            assert other(state.q, state.v).backend == "compiled"
    assert not recorder.buffer
    assert len(tick.tick.signatures) == 1  # numba compiles again for a read-only array


# constraints --------------------------------------------------------------------------------------


def hold(robot: fb.Robot, joints: list[int]) -> fb.Contacts:
    """Return a constraint that gives some joints accelerations as a function of time.

    No two of its rows have the same unit.
    """
    n = len(joints)
    rows = np.eye(robot.nv)[joints] * (1.0 + np.arange(n))[:, None]
    held = LinearConstraint("held", n, lambda state, t: (rows, np.full(n, np.sin(t))))
    return fb.Contacts([held])


@pytest.mark.parametrize("robot", ["go2", "talos"], indirect=True)
def test_user_defined_constraints_are_kept_with_the_same_torques(robot):
    feet = judges.stance(robot)
    for contacts in (feet + hold(robot, [7, 9]), hold(robot, [8]) + feet, hold(robot, [6, 7, 8])):
        compiled, reference = judges.pair(robot, contacts)
        for i, state in enumerate(judges.near_and_far(robot.name, 3)):
            assert judges.difference(compiled, reference, state, 0.2 * i) < judges.agreement(robot)
            with np.errstate(all="ignore"):
                try:
                    command = compiled(state.q, state.v, 0.2 * i)
                except InfeasibleError:
                    continue
            eom = fb.equations_of_motion(state, contacts, 0.2 * i)
            residuals = eom.residual(command.qdd, command.tau, command.forces)
            assert max(np.max(np.abs(r)) for r in residuals) < 1e-6


def test_a_user_defined_constraint_is_evaluated_once_in_a_tick(backend, go2):
    asked, rows = [], (np.eye(18)[6:7], np.zeros(1))
    held = LinearConstraint("held", 1, lambda state, t: asked.append(t) or rows)
    contacts = judges.stance(go2) + fb.Contacts([held])
    controller = fb.WholeBodyController(go2, contacts, [], backend=backend)
    asked.clear()
    assert controller(go2.standing().q, np.zeros(18), 0.3).backend == backend
    assert asked == [0.3]


def test_a_constraint_may_have_a_jacobian_that_is_not_its_rows(go2):
    """λ acts on two joints, and the rows constrain one of them."""

    class Coupled(LinearConstraint):
        def jacobian(self, state: fb.State, t: float = 0.0) -> np.ndarray:
            return np.eye(18)[6:7] + np.eye(18)[7:8]

    held = Coupled("held", 1, lambda state, t: (np.eye(18)[6:7], np.zeros(1)))
    both = judges.pair(go2, judges.stance(go2).without("FL_foot") + fb.Contacts([held]))
    assert judges.largest_difference(both, judges.near_and_far("go2", 4)) < judges.agreement(go2)


class Reuses(PointContact):
    """A contact that returns the same arrays every time; its rows are twice those of a point.

    Both sets of rows express the same constraint.
    """

    rows, right_side = np.zeros((3, 18)), np.zeros(3)

    def constraint(self, state: fb.State, t: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        A, b = super().constraint(state, t)
        self.rows[:], self.right_side[:] = 2.0 * A, 2.0 * b
        return self.rows, self.right_side

    def jacobian(self, state: fb.State, t: float = 0.0) -> np.ndarray:
        self.rows[:] = super().jacobian(state, t)
        return self.rows


def test_user_defined_contacts_may_write_into_the_same_arrays_again(go2):
    others = fb.Contacts.points(go2, frames=["RL_foot", "RR_foot"])
    frames = ("FL_foot", "FR_foot")
    own = fb.Contacts([Reuses(frame, radius=0.022) for frame in frames])
    same = fb.Contacts([PointContact(frame, radius=0.022) for frame in frames])
    A, b = own.constraint(go2.random_state(0))
    expected, right_side = same.constraint(go2.random_state(0))
    assert np.array_equal(A, 2.0 * expected) and np.array_equal(b, 2.0 * right_side)
    assert np.array_equal(own.jacobian(go2.random_state(0)), same.jacobian(go2.random_state(0)))
    known, _ = judges.pair(go2, others + same)
    for controller in judges.pair(go2, others + own):
        for state in judges.near_and_far("go2", 3):
            assert judges.difference(controller, known, state) < judges.agreement(go2)


def test_a_user_defined_contact_whose_shapes_do_not_fit_together_is_refused(backend, go2):
    class Short(PointContact):
        def constraint(self, state: fb.State, t: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
            A, b = super().constraint(state, t)
            return A[:2], b

    with raises(InputError, "A", "b", "J", "FL_foot", 2, 3, 18):
        fb.WholeBodyController(go2, fb.Contacts([Short("FL_foot")]), [], backend=backend)


def test_a_rolling_wheel_and_a_user_defined_contact_carry_forces_in_their_cones(go2):
    class MyPoint(PointContact):
        """A subclass of a built-in contact, which the tick treats as user-defined."""

    feet = fb.Contacts.points(go2, frames=["FR_foot", "RL_foot"])
    own = [RollingWheel("FL_foot", [0.0, 1.0, 0.0], 0.022), MyPoint("RR_foot", radius=0.022)]
    tasks = list(fb.standing_tasks(go2.standing()))
    for contacts in (feet + fb.Contacts(own), fb.Contacts(own[::-1]) + feet):
        both = judges.pair(go2, contacts, tasks, min_normal_force=3.0)
        gap = judges.largest_difference(both, judges.near_and_far("go2", 5))
        assert gap < judges.agreement(go2)
