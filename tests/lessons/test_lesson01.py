"""Lesson 01: its experiments are what they say, and wrong answers get the hint that fits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from panels import assert_a_slider_redraws

import floatbase as fb
from floatbase.lessons import check, lesson01
from floatbase.robots import Robot

F_R = np.array([-60.0, 0.0, 0.0])


@pytest.fixture(autouse=True)
def no_progress_of_a_learner_is_touched(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("floatbase.lessons.progress.record", lambda *_: None)


@pytest.fixture(scope="module")
def arm() -> Robot:
    return fb.load("ur5", posture=lesson01.PRESSING)


@pytest.fixture(scope="module")
def go2() -> Robot:
    return fb.load("go2")


def test_the_arm_without_bolts_is_the_same_arm(arm: Robot) -> None:
    cut = lesson01.unbolted(arm)
    assert cut.joint_names == arm.joint_names
    state, free = arm.standing(), cut.standing()
    assert np.allclose(free.M[6:, 6:], state.M)
    assert np.allclose(free.h[6:], state.h)
    assert np.allclose(free.point("tool0") - free.point("base_link"), state.point("tool0") - state.point("base_link"))
    assert cut.mass == pytest.approx(arm.mass)


def test_momentum_is_mass_times_velocity_and_its_rate_is_the_weight(go2: Robot) -> None:
    state = go2.random_state(3)
    assert np.allclose(lesson01.momentum(state)[:3], go2.mass * state.com_velocity)
    qdd = np.linalg.solve(state.M, go2.S @ np.arange(12.0) - state.h)
    rate = lesson01.momentum_rate(state, qdd)
    assert np.allclose(rate, [0, 0, -go2.weight, 0, 0, 0], atol=1e-8)


def test_a_servo_follows_its_path_at_its_ends(arm: Robot) -> None:
    state = lesson01.unbolted(arm).standing()
    path = lesson01.turn(joint=2, angle=0.7, duration=1.5)
    assert np.allclose(path(0.0), 0.0)
    assert np.allclose(path(9.0), 0.7 * np.eye(6)[2])
    circle = lesson01.wave(0, 1, 1.0, 2.0)
    assert np.allclose(circle(2.0), 0.0)
    assert not np.allclose(circle(1.0), 0.0)
    servo = lesson01.joint_servo(state, np.arange(6.0), path, stiffness=10.0, damping=0.0)
    assert np.allclose(servo(state.q, state.v, 9.0).tau, np.arange(6.0) + 7.0 * np.eye(6)[2])


def test_sliders_of_every_picture_redraw_it(arm: Robot, go2: Robot) -> None:
    contacts = fb.Contacts.points(go2)
    for robot, panel in (
        (arm, lambda view: lesson01.pressing_panel(view, arm.standing())),
        (go2, lambda view: lesson01.stance_panel(view, go2.standing(), contacts)),
        (go2, lambda view: lesson01.thruster_panel(view, go2.standing(), contacts)),
    ):
        assert_a_slider_redraws(robot, panel)


@pytest.mark.parametrize("thrust", [30.0, -30.0])
def test_thrusters_are_drawn_below_the_feet_where_no_leg_hides_them(go2: Robot, thrust: float) -> None:
    view, contacts = fb.Viewer(go2, scale=0.003), fb.Contacts.points(go2)
    try:
        left, right, _ = lesson01.thruster_panel(view, go2.standing(), contacts).children[2:]
        left.value = right.value = thrust
        arrows = [view.canvas.picture[f"thrust/{name}"].matrix for name in contacts.names]
        for arrow, foot in zip(arrows, contacts.positions(go2.standing()), strict=True):
            ends = arrow[2, 3], arrow[2, 3] + arrow[2, 2]
            assert ends[1] - ends[0] == pytest.approx(0.003 * thrust)
            assert max(ends) == pytest.approx(foot[2])
    finally:
        view.close()


def hint(name: str, answer: Any) -> str:
    verdict = check(name, answer)
    assert not verdict.right
    return verdict.text


TOOL = np.array([0.37177285, 0.10915, 0.60402121])


@pytest.mark.parametrize(
    ("answer", "text"),
    [
        (np.cross(TOOL, F_R), "the wall's own moment"),
        (-F_R, "needs a lever"),
        (F_R, "f_r itself"),
        (np.zeros(3), "nobody answers"),
        (None, "no answer yet"),
        (np.zeros((3, 1)), r"shape (3, 1)"),
        (np.full(3, np.nan), "not finite"),
        (np.ones(3), "Neither right"),
    ],
)
def test_wrong_moments_of_the_bolts_get_their_hint(answer: Any, text: str) -> None:
    state = fb.load("ur5", posture=lesson01.PRESSING).standing()
    assert np.allclose(TOOL, state.point("tool0"), atol=1e-4)
    assert text in hint("01.1", answer)


def test_a_moment_about_the_centre_of_mass_and_one_with_the_weight_are_recognised() -> None:
    state = lesson01.unbolted(fb.load("ur5", posture=lesson01.PRESSING)).standing()
    whole = state.h[:6] - (state.frame_jacobian("tool0")[:3].T @ F_R)[:6]
    assert "weight's moment" in hint("01.1", whole[3:])
    assert "about the centre of mass" in hint("01.1", -np.cross(state.point("tool0") - state.com, F_R))


@pytest.mark.parametrize(
    ("answer", "text"),
    [
        (np.eye(8), "How many rows does a base add"),
        (np.vstack([np.zeros((6, 8)), np.eye(8)]).T, "transpose"),
        (np.vstack([np.eye(8), np.zeros((6, 8))]), "base comes first"),
        (-np.vstack([np.zeros((6, 8)), np.eye(8)]), "sign"),
        (np.vstack([np.zeros((1, 8)), np.eye(8)]), "more than one row"),
        (np.vstack([np.zeros((7, 8)), np.eye(8)]), "quaternion"),
        (None, "no answer yet"),
        (np.zeros(3), "shape (3,)"),
    ],
)
def test_wrong_actuation_matrices_get_their_hint(answer: Any, text: str) -> None:
    assert text in hint("01.2", answer)


@pytest.mark.parametrize(
    ("factor", "text"),
    [
        (9.81, "has to come from friction"),
        (0.7, "one more factor"),
        (0.7 * 9.81 / 4, "one foot"),
        (4 * 0.7 * 9.81, "one weight"),
        (9.81 / 0.7, "does not divide"),
        (0.7 * 9.81 / np.sqrt(2), "the round cone"),
        (0.7 * 0.7 * 9.81, "μ, once"),
        (-0.7 * 9.81, "sign"),
    ],
)
def test_wrong_friction_bounds_get_their_hint(factor: float, text: str, go2: Robot) -> None:
    assert text in hint("01.3", factor * go2.mass)


def balanced(go2: Robot) -> np.ndarray:
    """Thrusts that do it, by levers: front and rear share the force as the centre of mass has it."""
    state = go2.standing()
    feet = fb.Contacts.points(go2).positions(state) - state.com
    front, rear = abs(feet[0, 0]), abs(feet[2, 0])
    share = np.array([rear, rear, front, front]) / (2 * (front + rear))
    return 200.0 * share[:, None] * [0.0, 0.0, 1.0]


def test_thrusts_by_the_lever_rule_are_right_in_either_shape(go2: Robot) -> None:
    assert check("01.4", balanced(go2)).right
    assert check("01.4", balanced(go2).ravel()).right


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda f: -f, "push the robot down"),
        (lambda f: f.T, "transpose"),
        (lambda f: f[:3], "shape (3, 3)"),
        (lambda f: 2 * f, "add up to (0, 0, 400) N"),
        (lambda f: f[:, [2, 1, 0]], "add up to (200, 0, 0) N"),
        (lambda f: f[::-1], "turns the robot"),
        (lambda f: f * np.nan, "not finite"),
        (lambda f: None, "no answer yet"),
        (lambda f: "up", "should be numbers"),
    ],
)
def test_wrong_thrusts_get_their_hint(change: Any, text: str, go2: Robot) -> None:
    assert text in hint("01.4", change(balanced(go2)))


def test_a_slider_names_its_unit(arm: Robot) -> None:
    view = fb.Viewer(arm)
    try:
        assert lesson01.pressing_panel(view, arm.standing()).children[2].description == "press [N]"
    finally:
        view.close()


def test_half_a_lever_products_and_matrices_of_another_robot_get_their_hint(go2: Robot) -> None:
    tool = fb.load("ur5", posture=lesson01.PRESSING).standing().point("tool0")
    assert "to the side" in hint("01.1", [0.0, 60.0 * tool[2], 0.0])
    assert "cross product" in hint("01.1", tool * F_R)
    assert "S of go2" in hint("01.2", go2.S)
    assert "no motor" in hint("01.2", np.zeros((14, 8)))
