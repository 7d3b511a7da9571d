"""Values cannot be written to, neither their arrays nor their attributes, and copies and pickles of
them are as good.
"""

import copy
import inspect
import multiprocessing
import pickle
import threading
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from importlib import import_module

import judges
import numpy as np
import pytest
from numpy.testing import assert_array_equal
from values import UP, controller, record, values

import floatbase as fb
from floatbase.actuators import Delay, FirstOrderLag, HydraulicActuators
from floatbase.control import AnalyticController
from floatbase.dynamics import PointContact

WITHOUT_ARRAYS = """
    ActiveSetRun FeasibleSpace Gains Gait LinearConstraint LinearInequality Problem Residuals
    SensorNoise drive
"""
NO_VALUES = {
    "control and physics, tested below": "AnalyticController Cylinders HydraulicActuators "
    "Simulation WholeBodyController",
    "a text": "ConstraintLabel",
    "memory of a thread or a window": "LiveSimulation SliderPanel Viewer",
    "a link to MuJoCo, with tests of its own": "MujocoAdapter",
    "an answer that rollout copies": "TorqueCommand",
    "with a memory of what they do": "JointServo Jump Latency MPC Observed Stand StepPlan Walk",
    "with a memory of torques, copied below": "Delay FirstOrderLag",
    "shapes of a picture": "Item PictureOptions View",
    "made of functions of a lesson": "ConstantTorques MinimumCostController NumericJudge",
}


def packages():
    names = (
        "actuators behaviours control dynamics friction lessons lessons.lesson04 objectives "
        "qp robots simulation viewer"
    )
    return [fb, *(import_module(f"floatbase.{name}") for name in names.split())]


def arrays_of(value):
    names = [name for name in dir(value) if not name.startswith("_")]
    return {name: array for name in names if isinstance(array := getattr(value, name), np.ndarray)}


def same(a, b):
    """Whether two values hold the same numbers and texts, at whatever depth."""
    if isinstance(a, np.ndarray):
        return np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
    if isinstance(a, Mapping):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, (tuple, list)):
        return len(a) == len(b) and all(map(same, a, b))
    if (
        isinstance(a, fb.Robot)
        or not type(a).__module__.startswith("floatbase")
        or not hasattr(a, "__dict__")
    ):
        return callable(a) or a == b
    names = [name for name in dir(a) if not name.startswith("_") and not callable(getattr(a, name))]
    return type(a) is type(b) and all(
        same(getattr(a, name), getattr(b, name)) for name in names if name != "reduced"
    )


def test_every_public_class_is_tested_here_or_no_value():
    classes = {
        name: found
        for package in packages()
        for name in getattr(package, "__all__", vars(package))  # a lesson has no list
        if inspect.isclass(found := getattr(package, name)) and not issubclass(found, Exception)
    }
    protocols = {name for name, found in classes.items() if getattr(found, "_is_protocol", False)}
    excused = " ".join(NO_VALUES.values()).split()
    assert sorted(set(classes) - protocols) == sorted(
        {*excused, *(name for name in values() if name in classes)}
    )
    made = {name: type(value) for name, value in values().items()}
    assert [name for name, found in classes.items() if made.get(name, found) is not found] == []


def test_no_array_and_no_attribute_of_a_value_can_be_written_to():
    robot, state, contacts = values()["Robot"], values()["State"], values()["Contacts"]
    own = {"AnalyticController": AnalyticController(robot, contacts, state)}
    own["Cylinders"] = HydraulicActuators(robot).cylinders
    for kind, value in (values() | own).items():
        arrays = arrays_of(value)
        assert bool(arrays) != (kind in WITHOUT_ARRAYS.split()), kind
        for name, array in arrays.items():
            with pytest.raises(ValueError):
                array[...] = 0.0
                pytest.fail(f"{kind}.{name} was written to")
            with pytest.raises((AttributeError, fb.FloatbaseError)):
                setattr(value, name, array)
                pytest.fail(f"{kind}.{name} was set")
            with pytest.raises((AttributeError, fb.FloatbaseError)):
                delattr(value, name)
                pytest.fail(f"{kind}.{name} was deleted")


@pytest.mark.parametrize(
    "copied", [copy.copy, copy.deepcopy, lambda value: pickle.loads(pickle.dumps(value))]
)
def test_copies_of_values_hold_the_same_and_are_read_only_too(copied):
    robot = values()["Robot"]
    for kind, value in values().items():
        other = copied(value)
        assert same(value, other), kind
        assert [name for name, array in arrays_of(other).items() if array.flags.writeable] == [], (
            kind
        )
    mapped = copied(values()["Affine"])
    with pytest.raises(TypeError):
        mapped.blocks["top"] = slice(0, 2)
    assert copied(robot) == robot != judges.load("solo12") and judges.load("go2") in {copied(robot)}
    assert judges.load("go2") != fb.load("go2", torque_limits=10.0)


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda value: pickle.loads(pickle.dumps(value))])
def test_a_copy_of_a_simulation_goes_on_like_the_original(copied):
    robot = values()["Robot"]
    state = values()["State"]
    contacts = values()["Contacts"]
    control = controller()
    push = fb.Push([0.0, 60.0, 0.0], start=0.005)
    sim, oil = fb.Simulation(robot), HydraulicActuators(robot)
    fb.rollout(sim, control, 0.01, [push], actuators=oil)
    others, alone = copied((sim, control, oil)), copied(control)
    runs = [
        fb.rollout(s, c, 0.02, [push], actuators=a) for s, c, a in ((sim, control, oil), others)
    ]
    assert_array_equal(runs[0].q, runs[1].q)
    assert np.ptp(runs[0].q, axis=0).max() > 1e-4
    assert not others[2].state.pressures.flags.writeable
    assert not others[2].cylinders.areas.flags.writeable
    fb.rollout(sim, alone, 0.001)  # the controller of a robot that was copied, and not the robot
    analytic = AnalyticController(robot, contacts, state)
    assert_array_equal(copied(analytic)(state.q, state.v).tau, analytic(state.q, state.v).tau)
    assert not copied(analytic).com.flags.writeable


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda value: pickle.loads(pickle.dumps(value))])
def test_a_copy_of_a_late_actuator_goes_on_like_the_original_and_alone(copied):
    robot = values()["Robot"]
    still, first, second = np.zeros(12), np.arange(12.0), -np.arange(12.0)
    for late in (Delay(robot, 2e-3), FirstOrderLag(robot, 10.0)):
        late.step(first, still, still, 1e-3)
        other = copied(late)
        steps = [[one.step(second, still, still, 1e-3) for _ in range(3)] for one in (late, other)]
        assert_array_equal(*steps)
        assert np.ptp(steps[0], axis=0).max() > 0.5


@pytest.mark.front_end
def test_values_come_back_from_another_process():
    robot, control = values()["Robot"], controller()
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        back = dict(zip(values(), pool.map(copy.copy, values().values()), strict=True))
        run = pool.submit(fb.rollout, fb.Simulation(robot), control, 0.005).result()
    assert [kind for kind, value in back.items() if not same(value, values()[kind])] == []
    assert_array_equal(run.q, record().q)
    assert isinstance(back["State"], fb.State) and not back["State"].q.flags.writeable
    fb.Simulation(robot).reset(run.final)  # a state of the same robot


def test_threads_need_not_wait_for_what_another_computes_of_a_value_and_all_get_the_same():
    """A lock would be held for ever in a process that is forked meanwhile."""
    started, go_on = threading.Event(), threading.Event()

    class Slow(PointContact):
        @property
        def point_names(self):
            if threading.current_thread() is not threading.main_thread():
                started.set()
                assert go_on.wait(10.0), "the main thread waits for this one"
            return (self.frame,)

    contacts = fb.Contacts([Slow("FL_foot")])
    with ThreadPoolExecutor(1) as pool:
        other = pool.submit(lambda: contacts.normals)
        assert started.wait(10.0)
        normals = contacts.normals
        go_on.set()
        assert other.result() is normals is contacts.normals


def test_what_a_value_returns_cannot_be_written_to():
    state, contacts, command = values()["State"], values()["Contacts"], values()["Command"]
    wrenches = values()["WrenchSet"]
    answers = {
        "frame_jacobian": state.frame_jacobian("base"), "frame_drift": state.frame_drift("base"),
        "point": state.point("base"),
        "positions": contacts.positions(state), "jacobian": contacts.jacobian(state),
        "A": contacts.constraint(state)[0],
        "support_region": wrenches.support_region(),
        "solution block": command.solution["tau"],
        "slip": record().slip(), "final q": record().final.q,
        "command force": command.force("FL_foot"),
    }  # fmt: skip
    for shape in (values()["FrictionCone"], values()["FrictionPolyhedron"]):
        answers |= {
            f"projection of {force} to {shape}": shape.project(force)
            for force in ([5.0, 0.0, 1.0], UP, -UP)
        }
    assert [name for name, array in answers.items() if array.flags.writeable] == []
    with pytest.raises(TypeError):
        command.solution.qp.blocks["tau"] = slice(0, 1)
