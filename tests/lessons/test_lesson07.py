"""Lesson 07: its helpers do what they say."""

from __future__ import annotations

import time

import numpy as np

from floatbase.lessons.lesson03 import standing_go2_eom
from floatbase.lessons.lesson07 import (
    make_controller,
    median_time_ms,
    run_with_push,
    tuned_controller,
)

STATE = standing_go2_eom().state
GO2 = STATE.robot


def test_the_default_gains_are_those_of_the_standing_tasks():
    qp, same = tuned_controller(100, 20, 10, 1e-3).qp(STATE), make_controller().qp(STATE)
    assert np.array_equal(qp.H, same.H) and np.array_equal(qp.g, same.g)


def test_a_push_acts_to_the_left_for_a_tenth_of_a_second():
    record = run_with_push(make_controller(), 30.0, 0.4)
    (push,) = record.pushes
    assert np.array_equal(push.force, [0, 30, 0]) and (push.start, push.duration) == (0.05, 0.1)
    assert record.com[150, 1] - record.com[40, 1] > 1e-3 and record.outcome == "completed"


def test_the_median_time_is_in_milliseconds():
    assert 2.0 <= median_time_ms(lambda: time.sleep(0.002), 3) < 50.0
