"""Lesson 01: its experiments are what they say, and wrong answers get the hint that fits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hints import missed, right

import floatbase as fb
from floatbase.lessons import joint_servo, lesson01
from floatbase.robots import PLATE, Foot, Robot, unbolted

F_R = np.array([-60.0, 0.0, 0.0])
WIDE_ENOUGH = 0.6596  # m: by hand, 2 (120 N · 0.6340 m / 205.95 N - 0.0396 m)


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


@pytest.fixture(scope="module")
def pressing(arm: Robot) -> Robot:
    """The arm on its plate."""
    return unbolted(arm, plate=True)


def outcome(pressing: Robot, width: float, press: float) -> str:
    """How two seconds of pressing end on a plate of that width, m, on the physics engine."""
    corners = [[x * width / 2, y * width / 2, -PLATE[1]] for x, y in ((1, 1), (1, -1), (-1, -1), (-1, 1))]
    robot = replace(pressing, feet=(Foot(pressing.base, corners=np.array(corners)),))
    state, force = robot.standing(), np.array([-press, 0.0, 0.0])
    hold = (state.h - state.frame_jacobian("tool0")[:3].T @ force)[6:]
    servo = joint_servo(state, hold, stiffness=400.0, damping=40.0)
    return fb.rollout(fb.Simulation(robot), servo, 2.0, [fb.Push(force, 0.0, 2.0, "tool0")]).outcome


def test_the_smallest_robot_is_newtons_law() -> None:
    box = fb.load_urdf(lesson01.LIFT, floating=False).standing()
    assert (box.M.item(), box.h.item()) == pytest.approx((5.0, 5.0 * 9.81))


def test_the_centre_of_mass_leaves_every_point_of_the_base(go2: Robot) -> None:
    view = fb.Viewer(go2)
    try:
        panel = lesson01.centre_panel(view, go2.standing())
        slider = panel.sliders["swing_forwards"]
        seen = []
        for swung in (slider.min, slider.max):
            slider.value = swung
            seen.append((view.canvas.picture, panel.note.value))
        (back, note), (forth, other_note) = seen
        np.testing.assert_array_equal(back["axes/axes"].matrix, forth["axes/axes"].matrix)
        assert (forth["com/ball"].matrix - back["com/ball"].matrix)[0, 3] > 0.02 and note != other_note
        assert "ground" not in back
    finally:
        view.close()


def test_the_pressing_panel_names_the_busiest_motor_and_its_limit(arm: Robot) -> None:
    view = fb.Viewer(arm, scale=0.005)
    try:
        panel = lesson01.pressing_panel(view, arm.standing())
        panel.sliders["press"].value = 120.0
        assert "busiest motor: wrist_1_joint, 11 of 28 N·m" in panel.note.value
        panel.sliders["press"].value = 0.0
        assert "wall on tool <b>0 N</b>, bolts on base <b>0 N</b>" in panel.note.value
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


def test_wrong_widths_of_the_plate_get_their_hint(pressing: Robot) -> None:
    state = pressing.standing()
    height, ahead = state.point("tool0")[2], state.com[0]
    holds = pressing.weight * (ahead + PLATE[0] / 2) / height
    wrong = [
        (WIDE_ENOUGH / 2, "as far to the front"),
        (2 * (120 * (height - PLATE[1]) / pressing.weight - ahead), "from there, not from the base"),
        (2 * 120 * height / pressing.weight, "not above the middle"),
        (2 * (120 * height / pressing.weight + ahead), "is that good or bad"),
        (PLATE[0], "with 120 N it tips"),
        (PLATE[0] * 120 / holds, "in proportion"),
        (2 * (60 * height / pressing.weight - ahead), "holds 60 N"),
        (2 * (120 * height / pressing.mass - ahead), "one more factor"),
        (2 * (pressing.weight * height / 120 - ahead), "exchanged"),
        (-WIDE_ENOUGH, "sign"),
        (2 * (120 * 0.63 / 206 - 0.04), "Nearly"),  # with the numbers of the text
        (1e3 * WIDE_ENOUGH, "Neither right"),
        ([WIDE_ENOUGH, WIDE_ENOUGH], "one number"),
        (None, "no answer yet"),
    ]
    assert missed("01.5", wrong) == []


@pytest.mark.parametrize(("part", "expected"), [(0.97, "fell"), (1.03, "completed")])
def test_the_right_width_of_the_plate_is_the_one_from_which_on_the_engine_lets_the_arm_stand(
    pressing: Robot, part: float, expected: str
) -> None:
    assert right("01.5", WIDE_ENOUGH)
    assert outcome(pressing, part * WIDE_ENOUGH, 120.0) == expected
