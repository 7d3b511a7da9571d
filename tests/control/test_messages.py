"""What tasks, friction and controllers answer to what they cannot use."""

from __future__ import annotations

import copy
from collections.abc import Callable
from types import SimpleNamespace

import judges
import numpy as np
import pytest

import floatbase as fb
from floatbase.errors import FloatbaseError, InputError, UnknownNameError
from floatbase.friction import FrictionPolyhedron

GO2 = judges.load("go2")
CONTACTS = fb.Contacts.points(GO2)
STATE = GO2.standing()
UP = [0.0, 0.0, 1.0]


class Own:
    """A task of one's own, whose parts a test leaves out or makes wrongly."""

    def __init__(self, without: str = "", residual: object = None):
        parts = {"block": "qdd", "name": "mine", "weight": 1.0, "residual": lambda eom, t=0.0: residual}
        vars(self).update({name: part for name, part in parts.items() if name != without})


def own(residual: Callable[..., object]) -> Own:
    task = Own()
    vars(task)["residual"] = residual
    return task


def own_with_nan() -> Own:
    return own(lambda eom, t=0.0: fb.Affine(np.eye(18), np.full(18, np.nan)))


def controller(*tasks: object, **options: object) -> fb.WholeBodyController:
    return fb.WholeBodyController(GO2, CONTACTS, tasks, **options)


@pytest.mark.parametrize(
    ("make", "kind", "text"),
    [
        (lambda: FrictionPolyhedron(UP, 0.7, 2), InputError, "facets is 2; .* whole number ≥ 3"),
        (lambda: FrictionPolyhedron(UP, 0.7, 4.5), InputError, "facets is 4.5; .* whole number ≥ 3"),
        (lambda: FrictionPolyhedron(UP, 0.0), InputError, "friction coefficient mu is 0; it must be > 0"),
        (lambda: FrictionPolyhedron([0.0, 0.0, 0.0], 0.7), InputError, "normal is the zero vector; it must have a direction"),
        (lambda: FrictionPolyhedron(UP, 0.7).margin([1.0]), InputError, r"force has shape \(1,\); .*\(3,\) \(N\)"),
        (lambda: controller(facets=2), InputError, "facets is 2"),
        (lambda: controller(turn=np.nan), InputError, "turn of the facets is nan"),
        (lambda: controller().qp(STATE).without("frictions"), UnknownNameError, "near names: friction"),
        (lambda: controller(min_normal_force=-1.0), InputError, "min_normal_force is -1; it must be ≥ 0 N"),
        (lambda: controller(torque_limits=[1.0, 2.0]), InputError, r"torque_limits must be one number > 0 or 12 of them"),
        (lambda: controller(torque_limits=0.0), InputError, r"torque_limits must be one number > 0 or 12 of them \(N·m\)"),
        (lambda: controller(torque_limits=np.nan), InputError, "torque_limits must be one number > 0"),
        (lambda: controller(solver="dapq"), UnknownNameError, "unknown solver 'dapq'; .*daqp"),
        (lambda: controller(Own(without="block")), InputError, "Own is no task yet, for it has no block; a task"),
        (lambda: controller(Own(residual=np.ones(3))), InputError, r"residual of 'mine' .*fb\.Affine\(A, b\), not ndarray"),
        (lambda: controller(Own()), InputError, "residual of 'mine' must be .*, not NoneType"),
        (
            lambda: controller(own(lambda eom: None)),
            InputError,
            r"residual of 'mine' must be .* called as residual\(eom, t\); <lambda> takes \(eom\): too many",
        ),
        (lambda: controller(own(lambda eom, t: 1 + "")), TypeError, "unsupported operand"),
        (
            lambda: controller(own(lambda eom, t: fb.Affine(np.ones(18), [0.0]))),
            InputError,
            r"task 'mine': A has shape \(18,\); .*: one row alone is rows\[:1\], not rows\[0\]",
        ),
        (lambda: controller(own_with_nan()), InputError, r"task 'mine': b holds nan at index \[0\]"),
        (
            lambda: controller().qp(judges.load("solo12").standing()),
            InputError,
            r"another robot, Robot\('solo12', .*\), than the problem, Robot\('go2', .* 4 feet",
        ),
        (lambda: controller(SimpleNamespace(**vars(Own()) | {"residual": np.eye(3)})), InputError, "a SimpleNamespace is none"),
        (lambda: controller("stand"), InputError, r"tasks must hold tasks, such as fb\.CoMTask\(state\.com\); 'stand' is none"),
        (lambda: controller(fb.FrameTask("FL_fot", UP)), UnknownNameError, "frame of go2 'FL_fot'; near names: FL_foot"),
        (lambda: controller(fb.OrientationTask("torso")), UnknownNameError, "unknown frame of go2 'torso'"),
        (lambda: controller(fb.PostureTask(np.zeros(5))), InputError, r"q of posture has shape \(5,\); .*\(19,\)"),
        (lambda: controller(fb.ForceTask(np.zeros(3))), InputError, r"target of force regularisation .* \(3,\); .*\(12,\)"),
        (lambda: controller(fb.TorqueTask(np.zeros(3))), InputError, r"target of torque regularisation .* \(3,\); .*\(12,\)"),
        (lambda: controller(fb.CoMTask(lambda t: [0.0])), InputError, r"position of centre of mass has shape \(1,\)"),
        (lambda: controller(fb.CoMTask(lambda t: (UP, UP, [0.0]))), InputError, r"acceleration of centre .* shape \(1,\)"),
        (
            lambda: controller(fb.CoMTask(lambda t: (UP, UP))),
            InputError,
            r"function of centre of mass gave 2 targets; it must give one, or all three .* lambda t: \(position, velocity, acc",
        ),
        (lambda: controller(fb.CoMTask(lambda t: None)), InputError, "position of centre of mass must be numbers .* not None"),
        (lambda: controller(fb.CoMTask(lambda t: (UP, None, UP))), InputError, "velocity of centre of mass .* not None"),
        (lambda: controller(fb.TorqueTask(lambda t: None)), InputError, "target of torque regularisation .* not None"),
        (lambda: controller(fb.CoMTask(lambda t: np.array(1.0))), InputError, r"position of .* has shape \(\); .*\(3,\)"),
        (lambda: controller(fb.CoMTask(lambda t: ([0, [0]], UP, UP))), InputError, "position of .* must be numbers of shape"),
        (
            lambda: fb.CoMTask(lambda: UP),
            InputError,
            r"called as position\(t\); <lambda> takes \(\): too many positional argum",
        ),
        (lambda: fb.OrientationTask("base", lambda t, f: UP), InputError, r"called as rotation\(t\); .* 'f'"),
        (lambda: fb.CoMTask(UP, kp=UP), InputError, r"kp of centre of mass has shape \(3,\); it must be one number \(1/s²\)"),
        (lambda: fb.CoMTask(UP, lambda t: UP), InputError, r"velocity of .* cannot be a function: let position be one"),
        (lambda: fb.CoMTask(lambda t: UP, UP), InputError, r"velocity of .* must be left out, for position is a function"),
        (lambda: controller(fb.PostureTask(STATE.q, UP)), InputError, r"velocity of posture has shape \(3,\); .*\(12,\)"),
        (lambda: fb.PostureTask(STATE.q[None]), InputError, r"q of posture has shape \(1, 19\)"),
        (lambda: fb.CoMTask([0.0, 0.0]), InputError, r"position of centre of mass has shape \(2,\); .*\(3,\)"),
        (lambda: fb.CoMTask([0.0, 0.0, np.nan]), InputError, r"position of centre of mass holds nan at index \[2\]"),
        (lambda: fb.CoMTask(UP, velocity=[1.0]), InputError, r"velocity of centre of mass has shape \(1,\)"),
        (lambda: fb.CoMTask(UP, kp=-1.0), InputError, "kp of centre of mass is -1; it must be ≥ 0 1/s²"),
        (lambda: fb.FrameTask("base", UP, kd=-1.0), InputError, "kd of position of base is -1; it must be ≥ 0 1/s"),
        (lambda: fb.PostureTask(STATE.q, weight=-1.0), InputError, "weight of posture is -1; it must be ≥ 0"),
        (lambda: fb.ForceTask(weight=-1.0), InputError, "weight of force regularisation is -1"),
        (lambda: fb.OrientationTask("base", np.eye(2)), InputError, r"rotation of .*base has shape \(2, 2\); .*\(3, 3\)"),
        (lambda: fb.OrientationTask("base", 2 * np.eye(3)), InputError, "a rotation matrix: its columns must be orthonormal"),
        (lambda: fb.OrientationTask("base", np.diag([1, 1, -1])), InputError, r"orthonormal, determinant \+1"),
        (lambda: controller(fb.OrientationTask("base", lambda t: np.zeros((3, 3)))), InputError, "not a rotation matrix"),
        (lambda: fb.WholeBodyController(GO2, [1], []), InputError, r"Contacts, as fb\.Contacts\.points\(robot\), not \[1\]"),
        (
            lambda: fb.WholeBodyController(judges.load("solo12"), CONTACTS, []),
            UnknownNameError,
            "unknown frame of solo12 'FL_foot'; near names: FL_FOOT",
        ),
        (lambda: controller()(np.zeros(3), STATE.v), InputError, r"q has shape \(3,\); it must have shape \(19,\)"),
        (lambda: controller()(STATE.q, np.full(18, np.nan)), InputError, r"v holds nan at index \[0\]"),
        (lambda: controller()(1.1 * STATE.q, STATE.v), InputError, r"has length 1.1; it must be 1\. Divide it by its length"),
    ],
)
def test_bad_input_is_told_what_would_be_right(make: Callable[[], object], kind: type[FloatbaseError], text: str) -> None:
    with pytest.raises(kind, match=text):
        make()


def test_a_trajectory_that_does_not_begin_at_zero_is_told_why_it_was_asked_for_that() -> None:
    def later(t: float) -> np.ndarray:
        if t < 1.0:
            raise ArithmeticError(f"nothing at {t}")
        return STATE.com

    made = (lambda: controller(fb.CoMTask(later)), lambda: controller().replace(tasks=[fb.CoMTask(later)]))
    for make in made:
        with pytest.raises(ArithmeticError, match=r"nothing at 0\.0") as raised:
            make()
        assert any("while a controller was made" in note and "at t = 0" in note for note in raised.value.__notes__)


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: fb.WholeBodyController(GO2, CONTACTS, fb.CoMTask(UP)), "tasks"),
        (lambda: fb.WholeBodyController(GO2, CONTACTS, None), "tasks"),
        (lambda: controller().replace(tasks=3), "tasks"),
        (lambda: fb.WholeBodyController("go2", CONTACTS, []), "Robot"),
        (lambda: controller(torque_limits="strong"), "torque_limits"),
        (lambda: controller(torque_limits=["strong"] * 12), "torque_limits"),
        (lambda: fb.standing_tasks(GO2), "State"),
    ],
)
def test_values_of_another_kind_are_refused_by_an_error_of_the_package(make: Callable[[], object], text: str) -> None:
    with pytest.raises(InputError, match=text):
        make()


@pytest.mark.parametrize("number", ["10", np.array(10.0), np.float32(10.0), 10])
def test_a_number_in_another_dress_is_a_number_or_is_refused(number: object) -> None:
    """Gains and weights that pass their check can be computed with."""
    try:
        task = fb.CoMTask(UP, kp=number, kd=number, weight=number)
    except InputError:
        return
    command = controller(task)(STATE.q, STATE.v)
    expected = controller(fb.CoMTask(UP, kp=10.0, kd=10.0, weight=10.0))(STATE.q, STATE.v)
    assert np.allclose(command.tau, expected.tau)


@pytest.mark.parametrize(
    ("name", "advice"),
    [
        ("torque_limits", "make another, .*torque_limits=…"),
        ("path", "make another"),
        ("tasks", r"controller\.replace\(tasks=…\)"),
        ("task", "no 'task' to set; tasks.*replace"),
    ],
)
def test_what_a_controller_was_made_with_is_not_set_afterwards(name: str, advice: str) -> None:
    made = controller(fb.ForceTask(), path="readable")
    for one in (made, copy.deepcopy(made), made.replace(contacts=CONTACTS)):
        with pytest.raises(InputError, match=advice):
            setattr(one, name, 2.0)


def test_a_class_of_ones_own_sets_its_own_attributes() -> None:
    class Counting(fb.WholeBodyController):
        calls = 0

    made = Counting(GO2, CONTACTS, [fb.ForceTask()], path="readable")
    made.calls += 1
    with pytest.raises(InputError, match="make another"):
        made.path = "compiled"
