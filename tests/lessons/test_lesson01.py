"""Lesson 01: its experiments are what they say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hints import right

import floatbase as fb
from floatbase.lessons import joint_servo, lesson01
from floatbase.robots import PLATE_SIZE, Foot, Robot, with_floating_base

WIDE_ENOUGH = 0.6596  # m: by hand, 2 (120 N · 0.6340 m / 205.95 N - 0.0396 m)


@pytest.fixture(scope="module")
def arm() -> Robot:
    return fb.load("ur5", posture=lesson01.PRESSING_POSTURE)


@pytest.fixture(scope="module")
def go2() -> Robot:
    return fb.load("go2")


def test_a_servo_follows_its_path_at_its_ends(arm: Robot) -> None:
    state = with_floating_base(arm).standing()
    path = lesson01.joint_turn(joint=2, angle=0.7, duration=1.5)
    assert np.allclose(path(0.0), 0.0)
    assert np.allclose(path(9.0), 0.7 * np.eye(6)[2])
    circle = lesson01.joint_circle(0, 1, 1.0, 2.0)
    assert np.allclose(circle(2.0), 0.0)
    assert not np.allclose(circle(1.0), 0.0)
    servo = joint_servo(state, np.arange(6.0), path, stiffness=10.0, damping=0.0)
    assert np.allclose(servo(state.q, state.v, 9.0).tau, np.arange(6.0) + 7.0 * np.eye(6)[2])


def test_a_servo_turns_joints_without_limits_back_too() -> None:
    state = fb.load("kinova").standing()  # three of its joints are (cos, sin) in q
    turned = state.integrate(0.1 * np.eye(6)[0])
    assert np.allclose(joint_servo(state)(turned, state.v, 0.0).tau, -10.0 * np.eye(6)[0])


@pytest.mark.parametrize("thrust", [30.0, -30.0])
def test_thrusters_are_drawn_below_the_feet_where_no_leg_hides_them(
    go2: Robot, thrust: float
) -> None:
    view, contacts = fb.Viewer(go2, scale=0.003), fb.Contacts.points(go2)
    try:
        sliders = lesson01.thruster_panel(view, go2.standing(), contacts).sliders
        sliders["left_feet"].value = sliders["right_feet"].value = thrust
        arrows = [view.renderer.picture[f"thrust/{name}"].matrix for name in contacts.names]
        for arrow, foot in zip(arrows, contacts.positions(go2.standing()), strict=True):
            ends = arrow[2, 3], arrow[2, 3] + arrow[2, 2]
            assert ends[1] - ends[0] == pytest.approx(0.003 * thrust)
            assert max(ends) == pytest.approx(foot[2])
    finally:
        view.close()


@pytest.fixture(scope="module")
def pressing(arm: Robot) -> Robot:
    """The arm on its plate."""
    return with_floating_base(arm, plate=True)


def outcome(pressing: Robot, width: float, press: float) -> str:
    """How two seconds of pressing end on a plate of that width, m, on the physics engine."""
    corners = [
        [x * width / 2, y * width / 2, -PLATE_SIZE[1]]
        for x, y in ((1, 1), (1, -1), (-1, -1), (-1, 1))
    ]
    robot = replace(pressing, feet=(Foot(pressing.base, corners=np.array(corners)),))
    state, force = robot.standing(), np.array([-press, 0.0, 0.0])
    hold = (state.h - state.frame_jacobian("tool0")[:3].T @ force)[6:]
    servo = joint_servo(state, hold, stiffness=400.0, damping=40.0)
    return fb.rollout(fb.Simulation(robot), servo, 2.0, [fb.Push(force, 0.0, 2.0, "tool0")]).outcome


def test_the_centre_of_mass_leaves_every_point_of_the_base(go2: Robot) -> None:
    view = fb.Viewer(go2)
    try:
        panel = lesson01.com_panel(view, go2.standing())
        slider = panel.sliders["swing_forwards"]
        seen = []
        for swung in (slider.min, slider.max):
            slider.value = swung
            seen.append((view.renderer.picture, panel.note.value))
        (back, note), (forth, other_note) = seen
        np.testing.assert_array_equal(back["axes/axes"].matrix, forth["axes/axes"].matrix)
        assert (forth["com/ball"].matrix - back["com/ball"].matrix)[
            0, 3
        ] > 0.02 and note != other_note
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


@pytest.mark.parametrize(("part", "expected"), [(0.97, "fell"), (1.03, "completed")])
def test_the_right_width_of_the_plate_is_the_one_from_which_on_the_engine_lets_the_arm_stand(
    pressing: Robot, part: float, expected: str
) -> None:
    assert right("01.3", WIDE_ENOUGH)
    assert outcome(pressing, part * WIDE_ENOUGH, 120.0) == expected
