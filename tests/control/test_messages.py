"""Errors of tasks, limits and controllers: their types, and the names and numbers in them."""

import copy
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace

import judges
import numpy as np
import pytest
from messages import missing, raises, refused

import floatbase as fb
from floatbase.control import AnalyticController, LinearInequality
from floatbase.errors import InputError, UnknownNameError

GO2, SOLO = judges.load("go2"), judges.load("solo12")
CONTACTS = fb.Contacts.points(GO2)
STATE = GO2.standing()
UP = [0.0, 0.0, 1.0]
NAN = np.full(18, np.nan)


class Own:
    """A user-defined task, with attributes that a test removes or replaces."""

    def __init__(self, without: str = "", **parts: object):
        self.block, self.name, self.weight = "qdd", "mine", 1.0
        self.residual = lambda eom, t=0.0: fb.Affine.identity(3)
        vars(self).update(parts)
        vars(self).pop(without, None)


def own(residual: Callable[..., object]) -> Own:
    return Own(residual=residual)


def constant(residual: object) -> Own:
    return own(lambda eom, t=0.0: residual)


def controller(*tasks: object, **options: object) -> fb.WholeBodyController:
    return fb.WholeBodyController(GO2, CONTACTS, tasks, **options)


def rows(block, n, m=None, owners=()):
    return LinearInequality("r", block, (np.eye(n), np.ones(m or n)), owners)


@pytest.mark.parametrize(
    "case",
    [
        (lambda: controller(facets=2), "facets", 2, 3),
        (lambda: controller(min_normal_force={"FL_foot": lambda t: -1.0}), "min_normal_force",
            "FL_foot", -1),
        (lambda: controller(max_normal_force={"FL_foot": -1.0}), "max_normal_force", "FL_foot",
            -1),
        (lambda: controller(max_normal_force=lambda t: 1.0), "max_normal_force"),
        (lambda: controller(max_normal_force={"FL_foot": lambda: 1.0}), "max_normal_force",
            "FL_foot"),
        (lambda: controller(torque_limits=[1.0, 2.0]), "torque_limits", 12, 2),
        (lambda: controller(torque_limits=0.0), "torque_limits", 12, 0),
        (lambda: controller(inequalities=rows("tau", 12)), "inequalities", "LinearInequality"),
        (lambda: controller(inequalities=[np.eye(12)]), "inequalities", "LinearInequality", 12),
        (lambda: controller(inequalities=[rows("tau", 3)]), "r", "tau", 3, 12),
        (lambda: controller(inequalities=[rows("forces", 9)]), "r", "forces", 9, 12),
        (lambda: controller(inequalities=[LinearInequality("r", "tau", lambda eom, t: 3.0)]), "r",
            "G", "h", 3),
        (lambda: controller(inequalities=[rows("tau", 12, owners=("a",))]), "r", 1, 12),
        (lambda: controller(inequalities=2 * [rows("tau", 12)]), "r 0"),
        (lambda: rows("lambda", 12), "r", "lambda", "qdd", "tau", "forces"),
        (lambda: rows("tau", 12, 3), "h", "r", 3, 12),
        (lambda: LinearInequality("r", "tau", np.eye(12)), "r", "G", "h"),
        (lambda: LinearInequality("r", "tau", (np.ones(12), [1.0])), "G", "r", 12),
        (lambda: LinearInequality("r", "tau", lambda eom: 3.0), "r", "eom", "t"),
        (lambda: controller(Own(without="block")), "Own", "block"),
        (lambda: controller(constant(np.ones(3))), "residual", "mine", "ndarray"),
        (lambda: controller(own(lambda eom: None)), "residual", "mine", "eom", "t"),
        (lambda: controller(own(lambda eom, t: fb.Affine(np.ones(18), [0.0]))), "mine", "A", 18),
        (lambda: controller(own(lambda eom, t: fb.Affine(np.eye(18), NAN))), "mine", "b", np.nan),
        (lambda: controller(Own(block="foo")), "mine", "block", "foo", "qdd", "tau", "forces"),
        (lambda: controller(Own(weight=-1.0)), "weight", "mine", -1),
        (lambda: controller(Own()), "residual", "mine", "qdd", 3, 18),
        (lambda: controller(fb.CoMTask), "tasks", "CoMTask"),
        (lambda: controller(SimpleNamespace(**vars(Own()) | {"residual": np.eye(3)})), "tasks",
            "SimpleNamespace"),
        (lambda: controller().replace(tasks=[Own()]), "residual", "mine", "qdd", 3, 18),
        (lambda: controller(modify_qp=lambda qp: qp), "modify_qp", "eom"),
        (lambda: controller(modify_qp=lambda qp, eom: None), "modify_qp", "QP"),
        (lambda: controller(modify_qp=lambda qp, eom: replace(qp, blocks={})), "modify_qp",
            "blocks"),
        (lambda: fb.WholeBodyController(GO2, CONTACTS, fb.CoMTask(UP)), "tasks", "CoMTask"),
        (lambda: controller(fb.PostureTask(np.zeros(5))), "q", 5, 19),
        (lambda: controller(fb.ForceTask(np.zeros(3))), "target", 3, 12),
        (lambda: controller(fb.TorqueTask(np.zeros(3))), "target", 3, 12),
        (lambda: controller(fb.TorqueTask(lambda t: None)), "target", 12, "None"),
        (lambda: controller(fb.CoMTask(lambda t: [0.0])), "position", 1, 3),
        (lambda: controller(fb.CoMTask(lambda t: (UP, UP, [0.0]))), "acceleration", 1, 3),
        (lambda: controller(fb.CoMTask(lambda t: (UP, UP))), 2, "position", "velocity",
            "acceleration"),
        (lambda: controller(fb.CoMTask(lambda t: None)), "position", 3, "None"),
        (lambda: controller(fb.CoMTask(lambda t: (UP, None, UP))), "velocity", 3, "None"),
        (lambda: controller(fb.CoMTask(lambda t: ([0, [0]], UP, UP))), "position", 3),
        (lambda: controller(fb.OrientationTask("base", lambda t: np.zeros((3, 3)))), "rotation",
            "base"),
        (lambda: controller(fb.PostureTask(STATE.q, UP)), "velocity", 3, 12),
        (lambda: fb.CoMTask(lambda: UP), "position", "t"),
        (lambda: fb.CoMTask(UP, lambda t: UP), "velocity", "position"),
        (lambda: fb.CoMTask(lambda t: UP, UP), "velocity", "position"),
        (lambda: fb.PostureTask(STATE.q[None]), "q", 1, 19),
        (lambda: fb.OrientationTask("base", lambda t, f: UP), "rotation", "base", "f"),
        (lambda: fb.OrientationTask("base", 2 * np.eye(3)), "rotation", "base"),
        (lambda: fb.OrientationTask("base", np.diag([1, 1, -1])), "rotation", "base"),
        (lambda: controller()(1.1 * STATE.q, STATE.v), "q", 1.1),
    ],
)  # fmt: skip
def test_bad_input_is_refused_by_name(case):
    call, *wanted = case
    refused(call, InputError, *wanted)


@pytest.mark.parametrize(
    "case",
    [
        (lambda: controller().qp(STATE).without("frictions"), "frictions", "friction"),
        (lambda: controller(min_normal_force={"FL_fot": 1.0}), "min_normal_force", "FL_fot",
            "FL_foot"),
        (lambda: controller(solver="dapq"), "solver", "dapq", "daqp"),
        (lambda: controller(backend="quick"), "backend", "quick", "compiled", "reference"),
        (lambda: fb.WholeBodyController(SOLO, CONTACTS, []), "solo12", "FL_foot", "FL_FOOT"),
        (lambda: controller(fb.FrameTask("FL_fot", UP)), "go2", "FL_fot", "FL_foot"),
        (lambda: controller(fb.OrientationTask("torso")), "go2", "torso"),
        (lambda: AnalyticController(GO2, fb.Contacts.points(SOLO), STATE), "go2", "FL_FOOT",
            "FL_foot"),
    ],
)  # fmt: skip
def test_an_unknown_name_is_refused_with_similar_names(case):
    call, *wanted = case
    refused(call, UnknownNameError, *wanted)


def test_the_error_of_a_trajectory_that_begins_later_mentions_time_zero():
    def later(t: float) -> np.ndarray:
        if t < 1.0:
            raise ArithmeticError(f"nothing at {t}")
        return STATE.com

    for make in (lambda tasks: controller(*tasks), lambda tasks: controller().replace(tasks=tasks)):
        with raises(ArithmeticError, 0) as raised:
            make([fb.CoMTask(later)])
        assert any(not missing(note, "t", 0) for note in raised.value.__notes__)


@pytest.mark.parametrize("number", ["10", np.array(10.0), np.float32(10.0), 10])
def test_a_number_of_another_type_is_used_or_refused(number):
    """Gains and weights that pass their check can be used in computations."""
    try:
        task = fb.CoMTask(UP, kp=number, kd=number, weight=number)
    except InputError:
        return
    command = controller(task)(STATE.q, STATE.v)
    expected = controller(fb.CoMTask(UP, kp=10.0, kd=10.0, weight=10.0))(STATE.q, STATE.v)
    assert np.allclose(command.tau, expected.tau)


@pytest.mark.parametrize("name", ["backend", "tasks", "limits", "problem"])
def test_the_arguments_of_a_controller_cannot_be_set(name):
    made = controller(fb.ForceTask(), backend="reference")
    for one in (made, copy.deepcopy(made), made.replace(contacts=CONTACTS)):
        with raises(AttributeError, name):
            setattr(one, name, getattr(one, name))


@pytest.mark.parametrize("name", ["task", "facets", "torque_limits", "on_infeasible"])
def test_a_controller_takes_no_attribute_that_it_would_not_read(name):
    with raises(AttributeError, name):
        setattr(controller(fb.ForceTask(), backend="reference"), name, 3)
