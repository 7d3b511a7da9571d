"""Lesson 01: its experiments are what they say, and wrong answers get the hint that fits."""

from __future__ import annotations

import numpy as np
import pytest
from hints import missed, right

import floatbase as fb
from floatbase.lessons import joint_servo, lesson01
from floatbase.robots import Robot, unbolted

F_R = np.array([-60.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def arm() -> Robot:
    return fb.load("ur5", posture=lesson01.PRESSING)


@pytest.fixture(scope="module")
def go2() -> Robot:
    return fb.load("go2")


def test_a_servo_follows_its_path_at_its_ends(arm: Robot) -> None:
    state = unbolted(arm).standing()
    path = lesson01.turn(joint=2, angle=0.7, duration=1.5)
    assert np.allclose(path(0.0), 0.0)
    assert np.allclose(path(9.0), 0.7 * np.eye(6)[2])
    circle = lesson01.wave(0, 1, 1.0, 2.0)
    assert np.allclose(circle(2.0), 0.0)
    assert not np.allclose(circle(1.0), 0.0)
    servo = joint_servo(state, np.arange(6.0), path, stiffness=10.0, damping=0.0)
    assert np.allclose(servo(state.q, state.v, 9.0).tau, np.arange(6.0) + 7.0 * np.eye(6)[2])


def test_a_servo_turns_joints_without_limits_back_too() -> None:
    state = fb.load("kinova").standing()  # three of its joints are (cos, sin) in q
    turned = state.integrate(0.1 * np.eye(6)[0])
    assert np.allclose(joint_servo(state)(turned, state.v, 0.0).tau, -10.0 * np.eye(6)[0])


@pytest.mark.parametrize("thrust", [30.0, -30.0])
def test_thrusters_are_drawn_below_the_feet_where_no_leg_hides_them(go2: Robot, thrust: float) -> None:
    view, contacts = fb.Viewer(go2, scale=0.003), fb.Contacts.points(go2)
    try:
        sliders = lesson01.thruster_panel(view, go2.standing(), contacts).sliders
        sliders["left_feet"].value = sliders["right_feet"].value = thrust
        arrows = [view.canvas.picture[f"thrust/{name}"].matrix for name in contacts.names]
        for arrow, foot in zip(arrows, contacts.positions(go2.standing()), strict=True):
            ends = arrow[2, 3], arrow[2, 3] + arrow[2, 2]
            assert ends[1] - ends[0] == pytest.approx(0.003 * thrust)
            assert max(ends) == pytest.approx(foot[2])
    finally:
        view.close()


def test_wrong_moments_of_the_bolts_get_their_hint(arm: Robot) -> None:
    state, cut = arm.standing(), unbolted(arm).standing()
    tool = state.point("tool0")
    whole = cut.h[:6] - (cut.frame_jacobian("tool0")[:3].T @ F_R)[:6]
    wrong = [
        (np.cross(tool, F_R), "the wall's own moment"),
        (-np.cross(cut.point("tool0") - cut.com, F_R), "about the centre of mass"),
        (whole[3:], "weight's moment"),
        ([0.0, 60.0 * tool[2], 0.0], "to the side"),
        (tool * F_R, "cross product"),
        (-F_R, "needs a lever"),
        (F_R, "f_r itself"),
        (np.zeros(3), "nobody answers"),
        (None, "no answer yet"),
        (np.ones((3, 1)), "`.ravel()` makes it flat"),
        (np.full(3, np.nan), "not finite"),
        (np.ones(3), "Neither right"),
    ]
    assert missed("01.1", wrong) == []


def test_wrong_actuation_matrices_get_their_hint(go2: Robot) -> None:
    S = np.vstack([np.zeros((6, 8)), np.eye(8)])
    wrong = [
        (np.eye(8), "How many rows does a base add"),
        (S.T, "transpose"),
        (np.roll(S, -6, axis=0), "base comes first"),
        (-S, "sign"),
        (S[5:], "more than one row"),
        (np.vstack([np.zeros((1, 8)), S]), "quaternion"),
        (go2.S, "S of go2"),
        (np.zeros((14, 8)), "no motor"),
        (None, "no answer yet"),
        (np.zeros(3), "shape (3,)"),
    ]
    assert missed("01.2", wrong) == []


def test_wrong_friction_bounds_get_their_hint(go2: Robot) -> None:
    wrong = [
        (9.81, "has to come from friction"),
        (0.7, "one more factor"),
        (0.7 * 9.81 / 4, "one foot"),
        (4 * 0.7 * 9.81, "one weight"),
        (9.81 / 0.7, "does not divide"),
        (0.7 * 9.81 / np.sqrt(2), "the round cone"),
        (0.7 * 0.7 * 9.81, "μ, once"),
        (-0.7 * 9.81, "sign"),
    ]
    assert missed("01.3", [(factor * go2.mass, hint) for factor, hint in wrong]) == []


def test_thrusts_by_the_lever_rule_are_right_in_either_shape_and_wrong_ones_get_their_hint(go2: Robot) -> None:
    """Front and rear share the force as the centre of mass has it."""
    state = go2.standing()
    feet = fb.Contacts.points(go2).positions(state) - state.com
    front, rear = abs(feet[0, 0]), abs(feet[2, 0])
    share = np.array([rear, rear, front, front]) / (2 * (front + rear))
    f = 200.0 * share[:, None] * [0.0, 0.0, 1.0]
    assert right("01.4", f) and right("01.4", f.ravel())
    wrong = [
        (-f, "push the robot down"),
        (f.T, "transpose"),
        (f[:3], "should have shape (4, 3)"),
        (2 * f, "add up to (0, 0, 400) N"),
        (f[:, [2, 1, 0]], "add up to (200, 0, 0) N"),
        (f[::-1], "turns the robot"),
        (f * np.nan, "not finite"),
        (None, "no answer yet"),
        ("up", "should be numbers"),
    ]
    assert missed("01.4", wrong) == []
