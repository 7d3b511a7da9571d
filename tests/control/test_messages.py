"""Errors of tasks, limits and controllers: their types, and the names and numbers in them."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import judges
import numpy as np
import pytest
from messages import missing, raises, refused

import floatbase as fb
from floatbase.control import AnalyticController, Limits, LinearInequality
from floatbase.errors import InputError, UnknownNameError

GO2, SOLO = judges.load("go2"), judges.load("solo12")
CONTACTS = fb.Contacts.points(GO2)
STATE = GO2.standing()
UP = [0.0, 0.0, 1.0]


class Own:
    """A user-defined task, with attributes that a test removes or replaces."""

    def __init__(self, without: str = "", residual: object = None):
        parts = {
            "block": "qdd",
            "name": "mine",
            "weight": 1.0,
            "residual": lambda eom, t=0.0: residual,
        }
        vars(self).update({name: part for name, part in parts.items() if name != without})


def own(residual: Callable[..., object]) -> Own:
    task = Own()
    vars(task)["residual"] = residual
    return task


def own_with_nan() -> Own:
    return own(lambda eom, t=0.0: fb.Affine(np.eye(18), np.full(18, np.nan)))


def controller(*tasks: object, **options: object) -> fb.WholeBodyController:
    return fb.WholeBodyController(GO2, CONTACTS, tasks, **options)


class Fixed(Own):
    """A user-defined task with a residual of fixed size."""

    def __init__(self, **wrong: object):
        super().__init__()
        vars(self).update({"residual": lambda eom, t=0.0: fb.Affine.identity(3)} | wrong)


def rows(
    block: str, n: int, m: int | None = None, owners: tuple[str, ...] = ()
) -> LinearInequality:
    return LinearInequality("r", block, (np.eye(n), np.ones(m or n)), owners)


def analytic(**swap: object) -> AnalyticController:
    return AnalyticController(**{"robot": GO2, "contacts": CONTACTS, "state": STATE} | swap)


@pytest.mark.parametrize(
    "case",
    [
        (lambda: controller(facets=2), InputError, "facets", 2, 3),
        (lambda: controller(facet_rotation=np.nan), InputError, "facet_rotation", np.nan),
        (
            lambda: controller().qp(STATE).without("frictions"),
            UnknownNameError,
            "frictions",
            "friction",
        ),
        (lambda: controller(min_normal_force=-1.0), InputError, "min_normal_force", -1),
        (
            lambda: controller(min_normal_force={"FL_fot": 1.0}),
            UnknownNameError,
            "min_normal_force",
            "FL_fot",
            "FL_foot",
        ),
        (
            lambda: controller(min_normal_force={"FL_foot": lambda t: -1.0}),
            InputError,
            "min_normal_force",
            "FL_foot",
            -1,
        ),
        (lambda: controller(max_normal_force=-1.0), InputError, "max_normal_force", -1),
        (
            lambda: controller(max_normal_force={"FL_foot": -1.0}),
            InputError,
            "max_normal_force",
            "FL_foot",
            -1,
        ),
        (lambda: controller(max_normal_force=lambda t: 1.0), InputError, "max_normal_force"),
        (lambda: controller(max_normal_force=[1.0, 2.0]), InputError, "max_normal_force", 1, 2),
        (
            lambda: controller(max_normal_force={"FL_foot": lambda: 1.0}),
            InputError,
            "max_normal_force",
            "FL_foot",
        ),
        (lambda: Limits(np.ones(12), min_normal_force=-50.0), InputError, "min_normal_force", -50),
        (lambda: Limits(np.ones(12), facets=2), InputError, "facets", 2),
        (lambda: controller(torque_limits=[1.0, 2.0]), InputError, "torque_limits", 12, 2),
        (lambda: controller(torque_limits=0.0), InputError, "torque_limits", 12, 0),
        (lambda: controller(torque_limits=np.nan), InputError, "torque_limits", np.nan),
        (lambda: controller(torque_limits="strong"), InputError, "torque_limits", "strong"),
        (lambda: controller(torque_limits=["strong"] * 12), InputError, "torque_limits", "strong"),
        (lambda: controller(solver="dapq"), UnknownNameError, "solver", "dapq", "daqp"),
        (
            lambda: controller(backend="quick"),
            UnknownNameError,
            "backend",
            "quick",
            "compiled",
            "reference",
        ),
        (
            lambda: controller(inequalities=rows("tau", 12)),
            InputError,
            "inequalities",
            "LinearInequality",
        ),
        (
            lambda: controller(inequalities=[np.eye(12)]),
            InputError,
            "inequalities",
            "LinearInequality",
            12,
        ),
        (lambda: controller(inequalities=[rows("tau", 3)]), InputError, "r", "tau", 3, 12),
        (lambda: controller(inequalities=[rows("forces", 9)]), InputError, "r", "forces", 9, 12),
        (
            lambda: controller(inequalities=[LinearInequality("r", "tau", lambda eom, t: 3.0)]),
            InputError,
            "r",
            "G",
            "h",
            3,
        ),
        (lambda: controller(inequalities=[rows("tau", 12, owners=("a",))]), InputError, "r", 1, 12),
        (lambda: controller(inequalities=2 * [rows("tau", 12)]), InputError, "r 0"),
        (lambda: rows("lambda", 12), InputError, "r", "lambda", "qdd", "tau", "forces"),
        (lambda: rows("tau", 12, 3), InputError, "h", "r", 3, 12),
        (lambda: LinearInequality("r", "tau", np.eye(12)), InputError, "r", "G", "h"),
        (lambda: LinearInequality("r", "tau", (np.ones(12), [1.0])), InputError, "G", "r", 12),
        (lambda: LinearInequality("r", "tau", lambda eom: 3.0), InputError, "r", "eom", "t"),
        (lambda: controller(Own(without="block")), InputError, "Own", "block"),
        (lambda: controller(Own(residual=np.ones(3))), InputError, "residual", "mine", "ndarray"),
        (lambda: controller(Own()), InputError, "residual", "mine", "NoneType"),
        (lambda: controller(own(lambda eom: None)), InputError, "residual", "mine", "eom", "t"),
        (lambda: controller(own(lambda eom, t: 1 + "")), TypeError),  # the user's error itself
        (
            lambda: controller(own(lambda eom, t: fb.Affine(np.ones(18), [0.0]))),
            InputError,
            "mine",
            "A",
            18,
        ),
        (lambda: controller(own_with_nan()), InputError, "mine", "b", np.nan),
        (
            lambda: controller(Fixed(block="foo")),
            InputError,
            "mine",
            "block",
            "foo",
            "qdd",
            "tau",
            "forces",
        ),
        (lambda: controller(Fixed(weight=-1.0)), InputError, "weight", "mine", -1),
        (lambda: controller(Fixed()), InputError, "residual", "mine", "qdd", 3, 18),
        (lambda: controller(fb.CoMTask), InputError, "tasks", "CoMTask"),
        (
            lambda: controller(SimpleNamespace(**vars(Own()) | {"residual": np.eye(3)})),
            InputError,
            "tasks",
            "SimpleNamespace",
        ),
        (lambda: controller("stand"), InputError, "tasks", "stand"),
        (lambda: controller().replace(tasks=3), InputError, "tasks", 3),
        (
            lambda: controller().replace(tasks=[Fixed()]),
            InputError,
            "residual",
            "mine",
            "qdd",
            3,
            18,
        ),
        (
            lambda: controller(modify_qp=lambda qp: qp),
            InputError,
            "modify_qp",
            "eom",
        ),
        (lambda: controller(modify_qp=lambda qp, eom: None), InputError, "modify_qp", "QP"),
        (
            lambda: controller(modify_qp=lambda qp, eom: replace(qp, blocks={})),
            InputError,
            "modify_qp",
            "blocks",
        ),
        (
            lambda: fb.WholeBodyController(GO2, CONTACTS, fb.CoMTask(UP)),
            InputError,
            "tasks",
            "CoMTask",
        ),
        (lambda: fb.WholeBodyController(GO2, CONTACTS, None), InputError, "tasks", "None"),
        (lambda: fb.WholeBodyController(GO2, [1], []), InputError, "contacts", "Contacts", 1),
        (lambda: fb.WholeBodyController("go2", CONTACTS, []), InputError, "robot", "Robot", "go2"),
        (
            lambda: fb.WholeBodyController(SOLO, CONTACTS, []),
            UnknownNameError,
            "solo12",
            "FL_foot",
            "FL_FOOT",
        ),
        (lambda: fb.standing_tasks(GO2), InputError, "state", "State"),
        (lambda: controller().qp(SOLO.standing()), InputError, "solo12", "go2"),
        (
            lambda: controller(fb.FrameTask("FL_fot", UP)),
            UnknownNameError,
            "go2",
            "FL_fot",
            "FL_foot",
        ),
        (lambda: controller(fb.OrientationTask("torso")), UnknownNameError, "go2", "torso"),
        (lambda: controller(fb.PostureTask(np.zeros(5))), InputError, "q", 5, 19),
        (lambda: controller(fb.ForceTask(np.zeros(3))), InputError, "target", 3, 12),
        (lambda: controller(fb.TorqueTask(np.zeros(3))), InputError, "target", 3, 12),
        (lambda: controller(fb.TorqueTask(lambda t: None)), InputError, "target", 12, "None"),
        (lambda: controller(fb.CoMTask(lambda t: [0.0])), InputError, "position", 1, 3),
        (
            lambda: controller(fb.CoMTask(lambda t: (UP, UP, [0.0]))),
            InputError,
            "acceleration",
            1,
            3,
        ),
        (
            lambda: controller(fb.CoMTask(lambda t: (UP, UP))),
            InputError,
            2,
            "position",
            "velocity",
            "acceleration",
        ),
        (lambda: controller(fb.CoMTask(lambda t: None)), InputError, "position", 3, "None"),
        (
            lambda: controller(fb.CoMTask(lambda t: (UP, None, UP))),
            InputError,
            "velocity",
            3,
            "None",
        ),
        (lambda: controller(fb.CoMTask(lambda t: np.array(1.0))), InputError, "position", 3),
        (lambda: controller(fb.CoMTask(lambda t: ([0, [0]], UP, UP))), InputError, "position", 3),
        (
            lambda: controller(fb.OrientationTask("base", lambda t: np.zeros((3, 3)))),
            InputError,
            "rotation",
            "base",
        ),
        (lambda: controller(fb.PostureTask(STATE.q, UP)), InputError, "velocity", 3, 12),
        (lambda: fb.CoMTask(lambda: UP), InputError, "position", "t"),
        (lambda: fb.CoMTask(UP, kp=UP), InputError, "kp", 3),
        (lambda: fb.CoMTask(UP, kp=-1.0), InputError, "kp", -1),
        (lambda: fb.CoMTask(UP, lambda t: UP), InputError, "velocity", "position"),
        (lambda: fb.CoMTask(lambda t: UP, UP), InputError, "velocity", "position"),
        (lambda: fb.CoMTask(UP, velocity=[1.0]), InputError, "velocity", 1, 3),
        (lambda: fb.CoMTask([0.0, 0.0]), InputError, "position", 2, 3),
        (lambda: fb.CoMTask([0.0, 0.0, np.nan]), InputError, "position", np.nan),
        (lambda: fb.FrameTask("base", UP, kd=-1.0), InputError, "kd", "base", -1),
        (lambda: fb.PostureTask(STATE.q[None]), InputError, "q", 1, 19),
        (lambda: fb.PostureTask(STATE.q, weight=-1.0), InputError, "weight", -1),
        (lambda: fb.ForceTask(weight=-1.0), InputError, "weight", -1),
        (lambda: fb.OrientationTask("base", lambda t, f: UP), InputError, "rotation", "base", "f"),
        (lambda: fb.OrientationTask("base", np.eye(2)), InputError, "rotation", "base", 2, 3),
        (lambda: fb.OrientationTask("base", 2 * np.eye(3)), InputError, "rotation", "base"),
        (lambda: fb.OrientationTask("base", np.diag([1, 1, -1])), InputError, "rotation", "base"),
        (lambda: controller()(np.zeros(3), STATE.v), InputError, "q", 3, 19),
        (lambda: controller()(STATE.q, np.full(18, np.nan)), InputError, "v", np.nan),
        (lambda: controller()(1.1 * STATE.q, STATE.v), InputError, "q", 1.1),
        (lambda: analytic(com=[0.0, 0.0]), InputError, "com", 2, 3),
        (lambda: analytic(kp=-1.0), InputError, "kp", -1),
        (lambda: analytic(kd=0.0), InputError, "kd", 0),
        (lambda: analytic(alpha=-0.1), InputError, "alpha", -0.1),
        (lambda: analytic(bias_weight=0.0), InputError, "bias_weight", 0),
        (lambda: analytic(posture_weight=0.0), InputError, "posture_weight", 0),
        (lambda: analytic(torque_weight=np.nan), InputError, "torque_weight", np.nan),
        (lambda: analytic(a=np.nan), InputError, "a", np.nan),
        (lambda: analytic(state=SOLO.standing()), InputError, "state", "go2"),
        (lambda: analytic(robot="go2"), InputError, "robot", "Robot", "go2"),
        (lambda: analytic(contacts=["FL_foot"]), InputError, "contacts", "Contacts", "FL_foot"),
        (lambda: analytic(state=np.zeros(19)), InputError, "state", "State", 19),
        (
            lambda: analytic(contacts=fb.Contacts.points(SOLO)),
            UnknownNameError,
            "go2",
            "FL_FOOT",
            "FL_foot",
        ),
    ],
)
def test_bad_input_is_refused_by_name(case: tuple[Any, ...]) -> None:
    refused(*case)


def test_the_error_of_a_trajectory_that_begins_later_explains_why_it_was_evaluated_at_zero() -> (
    None
):
    def later(t: float) -> np.ndarray:
        if t < 1.0:
            raise ArithmeticError(f"nothing at {t}")
        return STATE.com

    made = (
        lambda: controller(fb.CoMTask(later)),
        lambda: controller().replace(tasks=[fb.CoMTask(later)]),
    )
    for make in made:
        with raises(ArithmeticError, 0) as raised:
            make()
        assert any(not missing(note, "t", 0) for note in raised.value.__notes__)


@pytest.mark.parametrize("number", ["10", np.array(10.0), np.float32(10.0), 10])
def test_a_number_of_another_type_is_used_or_refused(number: object) -> None:
    """Gains and weights that pass their check can be used in computations."""
    try:
        task = fb.CoMTask(UP, kp=number, kd=number, weight=number)
    except InputError:
        return
    command = controller(task)(STATE.q, STATE.v)
    expected = controller(fb.CoMTask(UP, kp=10.0, kd=10.0, weight=10.0))(STATE.q, STATE.v)
    assert np.allclose(command.tau, expected.tau)


@pytest.mark.parametrize("name", ["backend", "tasks", "limits", "problem"])
def test_what_a_controller_was_made_with_cannot_be_set(name: str) -> None:
    made = controller(fb.ForceTask(), backend="reference")
    for one in (made, copy.deepcopy(made), made.replace(contacts=CONTACTS)):
        with raises(AttributeError, name):
            setattr(one, name, getattr(one, name))


@pytest.mark.parametrize("name", ["task", "facets", "torque_limits", "on_infeasible"])
def test_a_controller_takes_no_attribute_that_it_would_not_read(name: str) -> None:
    with raises(AttributeError, name):
        setattr(controller(fb.ForceTask(), backend="reference"), name, 3)
