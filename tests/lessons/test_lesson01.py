"""Lesson 01: its experiments are what they say."""

from dataclasses import replace

import numpy as np
import pytest
from hints import right

import floatbase as fb
from floatbase.lessons import joint_servo, lesson01
from floatbase.robots import PLATE_SIZE, Foot, with_floating_base

WIDE_ENOUGH = 0.6596  # m: by hand, 2 (120 N · 0.6340 m / 205.95 N - 0.0396 m)


@pytest.fixture(scope="module")
def arm():
    return fb.load("ur5", posture=lesson01.PRESSING_POSTURE)


def test_a_servo_turns_back_joints_without_limits():
    state = fb.load("kinova").standing()  # three of its joints are (cos, sin) in q
    turned = state.integrate(0.1 * np.eye(6)[0])
    assert np.allclose(joint_servo(state)(turned, state.v, 0.0).tau, -10.0 * np.eye(6)[0])


@pytest.fixture(scope="module")
def pressing(arm):
    """The arm on its plate."""
    return with_floating_base(arm, plate=True)


def outcome(pressing, width, press):
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


@pytest.mark.parametrize(("part", "expected"), [(0.97, "fell"), (1.03, "completed")])
def test_the_arm_stands_on_a_wide_plate_and_falls_from_a_narrow_one(pressing, part, expected):
    assert right("01.3", WIDE_ENOUGH)
    assert outcome(pressing, part * WIDE_ENOUGH, 120.0) == expected
