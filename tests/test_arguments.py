"""Unknown arguments of public functions and constructors."""

import dataclasses
import pickle
from importlib import import_module
from pathlib import Path

import judges
import numpy as np
import pytest
from messages import raises, refused

import floatbase as fb
from floatbase.behaviours import Walk
from floatbase.control import JointLimits, Limits
from floatbase.errors import UnknownArgumentError

PACKAGES = (
    *("actuators", "affine", "behaviours", "control", "dynamics", "friction", "objectives"),
    *("playground", "qp", "robots", "simulation", "viewer"),
)
URDF = next((Path(__file__).parents[1] / "assets" / "models").glob("*.urdf"))
CASES = {
    "a task": (lambda c: fb.CoMTask(c.robot.standing().com, kP=1.0), "kP", "kp"),
    "a simulation": (lambda c: fb.Simulation(c.robot, dt=1e-3), "dt", "timestep"),
    "a value": (lambda c: fb.Push(forces=[0.0, 0.0, 1.0]), "forces", "force"),
    "contacts": (lambda c: fb.Contacts.feet(c.robot, my=0.5), "my", "mu"),
    "limits of a robot": (lambda c: Limits.of(c.robot, facet=8), "facet", "facets"),
    "joint limits": (lambda c: JointLimits.of(c.robot, wait=1.0), "wait", "weight"),
    "a copy of limits": (lambda c: dataclasses.replace(c.limits, facet=8), "facet", "facets"),
    "another controller": (lambda c: c.replace(inequality=[]), "inequality", "inequalities"),
    "other tasks": (lambda c: c.replace(task=[]), "task", "tasks"),
    "a walk": (lambda c: Walk(c.robot, c.contacts, velocty=1.0), "velocty", "velocity"),
    "a robot": (lambda c: fb.load(c.robot.name, postur=[0.0]), "postur", "posture"),
    "a robot's file": (lambda c: fb.load(URDF, floatin=False), "floatin", "floating"),
    "a function": (lambda c: fb.rollout(None, c, 1.0, push=[]), "push", "pushes"),
}


@pytest.mark.parametrize(("call", "wrong", "right"), CASES.values(), ids=CASES)
def test_an_unknown_argument_is_named_with_the_one_that_exists(call, wrong, right):
    controller = judges.controller_of("go2")
    refused(lambda: call(controller), UnknownArgumentError, wrong, right)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_constructor_of_a_package_names_unknown_arguments(package):
    module = import_module(f"floatbase.{package}")
    names = set(getattr(module, "__all__", ())) & set(vars(module)) - {"Command"}
    for value in (getattr(module, name) for name in sorted(names)):
        if not isinstance(value, type) or getattr(value, "_is_protocol", False):
            continue
        if "__init__" in vars(value) and not issubclass(value, BaseException):
            with raises(UnknownArgumentError, "no_such_argument"):
                value(no_such_argument=1)


def test_other_type_errors_are_those_of_python():
    with raises(TypeError, "position"):
        fb.CoMTask()
    sim = fb.Simulation(judges.load("go2"))
    with raises(TypeError, "wrong"):
        fb.rollout(sim, lambda q, v, t: (lambda right: right)(wrong=1), 0.001)


def test_public_functions_can_be_pickled():
    for function in (fb.load, fb.rollout, fb.standing_tasks):
        assert pickle.loads(pickle.dumps(function)) is function


def test_replaced_limits_are_those_of_the_constructor(standing):
    options = {"torque_limits": 9.0, "joint_limits": None, "max_normal_force": {"FL_foot": 5.0}}
    replaced = judges.controller_of("go2").replace(**options)
    made = judges.controller_of("go2", **options)
    assert np.array_equal(replaced(standing.q, standing.v).tau, made(standing.q, standing.v).tau)
