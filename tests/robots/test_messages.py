"""What a robot, a state or a name that cannot be used is answered: what was wrong, what would be right, what to do."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import judges
import numpy as np
import pytest

import floatbase as fb
from floatbase.errors import FloatbaseError, InputError, UnknownNameError, unknown_name
from floatbase.robots import Foot

GO2 = judges.load("go2")
Q = GO2.standing().q
UPSIDE_DOWN = np.array([*Q[:3], 0.0, 0.0, 0.0, 0.0, *Q[7:]])  # a quaternion of no length


def with_entry(value: np.ndarray, at: int, entry: float) -> np.ndarray:
    changed = np.array(value)
    changed[at] = entry
    return changed


@pytest.mark.parametrize(
    ("make", "kind", "text"),
    [
        (lambda: fb.load("go3"), UnknownNameError, r"unknown robot 'go3'; near names: go2, .*fb\.catalogue\(\) says what"),
        (lambda: fb.load("GO2 "), UnknownNameError, "unknown robot 'GO2 '; near names: go2, "),
        (lambda: fb.load("talus"), UnknownNameError, "unknown robot 'talus'; near names: .*talos"),
        (lambda: fb.load("zzz"), UnknownNameError, "unknown robot 'zzz'; known: "),
        (lambda: fb.load(3), UnknownNameError, "unknown robot 3"),
        (
            lambda: fb.load("my/robot.urdf"),
            UnknownNameError,
            r"'my/robot.urdf' is no robot's name but a file's; fb.load_urdf\('my/robot.urdf', feet=\[…\]\).*: go2, solo12, ",
        ),
        (lambda: fb.load(Path("x.urdf")), UnknownNameError, r"fb.load_urdf\('x.urdf'"),
        (lambda: fb.load("anymal"), InputError, r"limbs end with .*LF_FOOT.*, RH_FOOT"),
        (lambda: fb.load("anymal"), InputError, r'so its feet must be given: fb.load\("anymal", feet=\["name of a foot frame'),
        (lambda: fb.load("iris"), InputError, r"A robot that flies has none: feet=\[\]"),
        (lambda: fb.load("go2", feet=["FL_foot", "FL_foot"]), InputError, "foot 'FL_foot' of go2 is given twice; name each"),
        (lambda: fb.load("cassie"), InputError, "cassie comes as an SDF file; floatbase reads URDF. Choose one of go2"),
        (lambda: fb.load("go2", feet="FL_foot"), InputError, r'must be a list of frames, as in feet=\["FL_foot"\]'),
        (lambda: fb.load("go2", feet=["FL_fot"]), UnknownNameError, r"unknown frame of go2 'FL_fot'; near names: FL_foot"),
        (lambda: fb.load("go2", feet=["FL_foot"], foot_radius=-0.1), InputError, "foot_radius is -0.1; it must be ≥ 0 m"),
        (lambda: fb.load("go2", torque_limits=[1.0]), InputError, r"one number > 0 or 12 of them \(N·m\); got shape \(1,\)"),
        (lambda: fb.load("go2", torque_limits=-1.0), InputError, "torque_limits must be one number > 0 or 12"),
        (lambda: fb.load("go2", torque_limits=np.nan), InputError, "torque_limits must be one number > 0 or 12"),
        (lambda: fb.load("go2", posture=[0.0]), InputError, r"posture has shape \(1,\); it must have shape \(19,\)"),
        (lambda: Foot("toe", -1.0), InputError, "radius of foot toe is -1; it must be ≥ 0 m"),
        (lambda: Foot("toe", corners=np.eye(2, 3)), InputError, "corners of toe span no area; a flat foot needs at least 3"),
        (lambda: GO2.standing(height=5.0), InputError, "cannot put all its feet on the ground with its base 5 m above it"),
        (lambda: GO2.standing(height=5.0), InputError, "Ask for another height, or load it with another posture"),
        (lambda: GO2.frame_id("FL_fot"), UnknownNameError, r"near names: FL_foot, .*robot\.frames lists them all"),
        (lambda: GO2.random_state(spread=-1.0), InputError, "spread is -1; it must be ≥ 0"),
        (lambda: fb.State("go2", Q), InputError, r"robot must be a Robot, as fb.load\(.go2.\), not 'go2'"),
        (lambda: fb.State(GO2, Q[:5]), InputError, r"q has shape \(5,\); it must have shape \(19,\)"),
        (lambda: fb.State(GO2, Q, Q), InputError, r"v has shape \(19,\); it must have shape \(18,\)"),
        (lambda: fb.State(GO2, "q"), InputError, r"q must be numbers of shape \(19,\), not 'q'"),
        (lambda: fb.State(GO2, with_entry(Q, 9, np.nan)), InputError, r"q holds nan at index \[9\]; every entry must be a"),
        (lambda: fb.State(GO2, Q, with_entry(np.zeros(18), 2, -np.inf)), InputError, r"v holds -inf at index \[2\]"),
        (lambda: fb.State(GO2, 1.1 * Q), InputError, r"quaternion q\[3:7\] \(x y z w\) has length 1.1; it must be 1"),
        (lambda: fb.State(GO2, 1.1 * Q), InputError, r"Divide it by its length, or use robot\.standing\(\)"),
        (lambda: GO2.standing().point("toe"), UnknownNameError, "unknown frame of go2 'toe'"),
        (lambda: GO2.standing().integrate([1.0]), InputError, r"dv has shape \(1,\); it must have shape \(18,\)"),
        (lambda: GO2.standing().difference([1.0]), InputError, r"q has shape \(1,\); it must have shape \(19,\)"),
    ],
)
def test_bad_input_is_told_what_would_be_right(make: Callable[[], object], kind: type[FloatbaseError], text: str) -> None:
    with pytest.raises(kind, match=text):
        make()


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: fb.load("go2", posture=UPSIDE_DOWN), "quaternion"),
        (lambda: fb.load("go2", foot_radius=0.1), "foot_radius"),  # without feet it would be ignored
        (lambda: fb.load("go2", torque_limits="strong"), "torque_limits"),
        (lambda: GO2.standing(height="high"), "height"),
        (lambda: GO2.standing(height=np.nan), "height"),
        (lambda: GO2.standing().point("FL_foot", [1.0, 2.0]), "offset"),
    ],
)
def test_what_cannot_be_used_is_an_error_of_the_package_that_names_the_argument(make: Callable[[], object], text: str) -> None:
    with pytest.raises(InputError, match=text):
        make()


def test_all_errors_of_the_package_can_be_caught_by_one_name() -> None:
    for make in (lambda: fb.load("go3"), lambda: fb.State(GO2, Q[:5]), lambda: fb.Contacts([1])):
        with pytest.raises(fb.FloatbaseError):
            make()
    with pytest.raises(KeyError, match="^unknown robot 'go3'"):  # the message itself, not its repr
        fb.load("go3")
    with pytest.raises(ValueError, match="shape"):
        fb.State(GO2, Q[:5])


def test_unknown_names_list_the_near_ones_or_all_of_a_few() -> None:
    assert "near names: FL_foot" in str(unknown_name("frame", "FL_fot", ["FL_foot", "base", "x", "y", "z", "w", "v"]))
    assert "foot_left" in str(unknown_name("frame", "left", ["foot_left", "base"]))
    few = str(unknown_name("solver", "osqp", ["daqp", "cvxpy"]))
    assert "daqp" in few
    assert "cvxpy" in few
    many = str(unknown_name("frame", "??", [f"frame {i}" for i in range(50)], "robot.frames lists them all."))
    assert "frame 0" in many
    assert many.endswith("…. robot.frames lists them all.")
