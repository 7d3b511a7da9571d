"""The sentence that says what limits the robot."""

from dataclasses import replace

import judges
import numpy as np
import pytest

import floatbase as fb
from floatbase.playground import PERIOD, Session, Settings, limit_text

GO2 = judges.load("go2")


def said(settings=None, force=0.0, duration=0.3):
    """Run the playground's robot, pushed to the left at the end, and return the sentence."""
    settings = settings or Settings()
    session = Session(GO2, settings)
    pushes = [fb.Push([0.0, force, 0.0], start=duration - 0.05)] if force else []
    record = fb.rollout(session.sim, session.controller, duration, pushes, PERIOD)
    return limit_text(record, settings)


@pytest.mark.parametrize(
    ("settings", "force", "sentence"),
    [
        (Settings(), 0.0, "The robot stands: no foot and no motor is at a limit."),
        (Settings(gait="trot"), 0.0, "walks"),
        (Settings(com_shift=(0.0, 0.0, -0.08)), 0.0, "stands"),
        (Settings(assumed_off=("gravity",)), 0.0, "too low"),
        (Settings(torque_fraction=0.12), 0.0, "hip joint"),
        (Settings(friction=(0.3, 0.3)), 90.0, "friction limit"),
        (Settings(friction=(0.7, 0.15)), 60.0, "slipping"),
        (Settings(min_normal_force=30.0), 120.0, "unloaded"),
    ],
)
def test_the_sentence_names_what_limits_the_robot(settings, force, sentence):
    assert sentence in said(settings, force)


def test_a_robot_in_the_air_is_said_to_be_there():
    session = Session(GO2)
    push = fb.Push([0.0, 0.0, 2000.0], start=0.0, duration=0.1)
    record = fb.rollout(session.sim, session.controller, 0.152, [push], PERIOD)
    assert "in the air" in limit_text(record, session.settings)


def test_a_robot_that_stands_far_down_a_slope_is_not_too_low():
    settings = Settings(slope=(3.0, 3.0))
    session, down = Session(GO2, settings), np.deg2rad(3.0)
    record = fb.rollout(session.sim, session.controller, 0.1, control_period=PERIOD)
    q = record.q.copy()
    q[:, [0, 2]] -= 3.0 * np.array([np.cos(down), np.sin(down)])
    assert "stands" in limit_text(replace(record, q=q), settings)
