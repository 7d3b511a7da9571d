"""What robots, states and names refuse: the type of each error, and the names and numbers in it."""

from pathlib import Path

import judges
import numpy as np
import pytest
from messages import missing, refused
from values import controller

import floatbase as fb
from floatbase.dynamics import fixed_frame, rigid_between
from floatbase.errors import InputError, UnknownNameError, unknown_name
from floatbase.robots import Foot
from floatbase.simulation import LiveSimulation

GO2 = judges.load("go2")
Q = GO2.standing().q
UPSIDE_DOWN = np.array([*Q[:3], 0.0, 0.0, 0.0, 0.0, *Q[7:]])  # a quaternion of no length


def with_entry(value, at, entry):
    changed = np.array(value)
    changed[at] = entry
    return changed


@pytest.mark.parametrize(
    "case",
    [
        (lambda: fb.load("go3"), "go3", "go2"),
        (lambda: fb.load("GO2 "), "GO2 ", "go2"),
        (lambda: fb.load("talus"), "talus", "talos"),
        (lambda: fb.load("zzz"), "zzz", "a1"),
        (lambda: fb.load("my/robot"), "my/robot", ".urdf", "go2", "solo12"),
        (lambda: fb.load(Path("x/robot")), "x/robot", ".xml"),
        (lambda: fb.load("go2", feet=["FL_fot"]), "go2", "FL_fot", "FL_foot"),
        (lambda: GO2.standing().point("toe"), "go2", "toe"),
        (lambda: GO2.frame_id("FL_fot"), "FL_fot", "FL_foot"),
    ],
)  # fmt: skip
def test_an_unknown_name_is_refused_with_similar_names(case):
    call, *wanted = case
    refused(call, UnknownNameError, *wanted)


@pytest.mark.parametrize(
    "case",
    [
        (lambda: fb.load("cassie"), "cassie", "go2"),
        (lambda: fb.load("go2", feet=["FL_foot", "FL_foot"]), "FL_foot", "go2"),
        (lambda: fb.load("go2", feet="FL_foot"), "feet", "FL_foot"),
        (lambda: fb.load("go2", feet=["FL_foot"], foot_radius=-0.1), "foot_radius", -0.1),
        (lambda: fb.load("go2", foot_radius=0.1), "foot_radius", "feet"),
        (lambda: fb.load("go2", posture=UPSIDE_DOWN), "posture", 0),
        (lambda: Foot("toe", corners=np.eye(2, 3)), "corners", "toe", 3),
        (lambda: Foot("toe", axis=[0.0, 1.0, 0.0]), "radius", "toe", "wheel", 0),
        (lambda: Foot("toe", 0.1, axis=np.zeros(3)), "axis", "toe"),
        (lambda: Foot("toe", 0.1, corners=np.eye(3), axis=[0.0, 1.0, 0.0]), "corners", "axis"),
        (lambda: GO2.standing(height=5.0), "go2", "height", 5),
        (lambda: fb.State(GO2, with_entry(Q, 9, np.nan)), "q", np.nan, 9),
        (lambda: fb.State(GO2, Q, with_entry(np.zeros(18), 2, -np.inf)), "v", -np.inf, 2),
        (lambda: fb.State(GO2, 1.1 * Q), "q", 1.1),
    ],
)  # fmt: skip
def test_bad_input_is_refused_by_name(case):
    call, *wanted = case
    refused(call, InputError, *wanted)


def test_all_errors_of_the_package_can_be_caught_by_one_name():
    for make in (lambda: fb.load("go3"), lambda: fb.State(GO2, Q[:5]), lambda: fb.Contacts([1])):
        with pytest.raises(fb.FloatbaseError):
            make()
    with pytest.raises(KeyError) as caught:
        fb.load("go3")
    assert not str(caught.value).startswith(('"', "'"))  # the message itself, not its repr
    with pytest.raises(ValueError):
        fb.State(GO2, Q[:5])


def test_unknown_names_list_the_near_ones_or_all_of_a_few():
    near = str(unknown_name("frame", "FL_fot", ["FL_foot", "base", "x", "y", "z", "w", "v"]))
    assert not missing(near, "FL_fot", "FL_foot") and missing(near, "base") == ["base"]
    frame = unknown_name("frame", "left", ["foot_left", "base"])
    assert not missing(str(frame), "left", "foot_left")
    solver = unknown_name("solver", "osqp", ["daqp", "cvxpy"])
    assert not missing(str(solver), "osqp", "daqp", "cvxpy")
    frames = [f"frame {i}" for i in range(50)]
    many = str(unknown_name("frame", "??", frames, "robot.frames lists them all."))
    assert not missing(many, "frame 0") and missing(many, "frame 49")
    assert many.endswith(" robot.frames lists them all.")


class Unprintable:
    def __repr__(self):
        raise RuntimeError


@pytest.mark.parametrize(
    "value",
    [Unprintable(), [Unprintable()], [10**5000], 10**5000, "a" * 10**5, "\ud800", b"x" * 999],
    ids=["object", "list", "digits in a list", "digits", "text", "surrogate", "bytes"],
)
def test_any_value_has_a_short_message(value):
    for call in (
        lambda: fb.load(value), lambda: fb.Push(value), lambda: GO2.frame_id(value),
        lambda: fb.solve(controller().qp(GO2.standing()), value),
        lambda: fb.Contacts.points(GO2, frames=value),
    ):  # fmt: skip
        with pytest.raises(fb.FloatbaseError) as caught:
            call()
        assert len(str(caught.value)) < 1000


@pytest.mark.parametrize("name", ["a\0b", "\ud800"])
def test_a_name_that_no_file_can_hold_is_refused(name, tmp_path):
    view = fb.Viewer(GO2)
    view.show(GO2.standing())
    for call in (
        lambda: fixed_frame(name), lambda: rigid_between("base", name),
        lambda: fb.FrameTask(name, np.zeros(3)),
        lambda: view.add_text(name, "x"), lambda: view.save(tmp_path / f"{name}.html"),
    ):  # fmt: skip
        with pytest.raises(InputError):
            call()


def test_bytes_are_no_numbers_and_the_smallest_numbers_have_a_quotient():
    with pytest.raises(InputError):
        fb.ForceTask(bytearray(12))
    for number in (1e-320, 1e-31):
        with pytest.raises(InputError):
            LiveSimulation(fb.Simulation(GO2), controller(), print, control_period=number)
