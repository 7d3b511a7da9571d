"""Lesson 08: its helpers do what they say."""

from __future__ import annotations

import judges
import numpy as np
import pytest

import floatbase as fb
from floatbase.behaviours import support_margin
from floatbase.errors import InputError
from floatbase.lessons.lesson08 import (
    largest_tilt,
    make_controller,
    mean_velocity,
    run_crawl,
    run_go2,
    smallest_support_margin,
    state_with_moved_body,
    uneven_stance,
)

LENGTHS = 1e-9  # m: what Newton's method leaves, and rounding


def test_a_moved_body_keeps_its_feet():
    state = judges.load("go2").standing()
    moved = state_with_moved_body(state, [0.02, -0.03, 0.01])
    contacts = fb.Contacts.points(state.robot)
    assert np.allclose(contacts.positions(moved), contacts.positions(state), atol=LENGTHS)
    assert np.allclose(moved.q[:3] - state.q[:3], [0.02, -0.03, 0.01], atol=LENGTHS)
    with pytest.raises(InputError, match="cannot put its feet"):
        state_with_moved_body(state, [0.0, 0.0, 1.0])


def test_the_uneven_stance_has_one_foot_further_back():
    state = uneven_stance()
    contacts = fb.Contacts.points(state.robot)
    away = contacts.positions(state) - contacts.positions(state.robot.standing())
    assert np.allclose(away, np.outer([0, 0, 0, 1], [-0.06, 0, 0]), atol=LENGTHS)


def test_a_record_has_a_velocity_a_tilt_and_a_support_margin():
    stands = run_go2(judges.controller_of("go2"), 0.3)
    assert np.allclose(mean_velocity(stands, 0.2), 0.0, atol=1e-3) and largest_tilt(stands) < 0.1
    margin = support_margin(stands.com[-1, :2], stands.foot_positions[-1, :, :2])
    assert np.isclose(smallest_support_margin(stands), margin, atol=1e-3)
    crawls = run_crawl(0.25, 0.22, 0.14)
    assert np.isclose(mean_velocity(crawls, 1.88)[0], 0.14, atol=0.01)  # of one period
    assert 1e3 * (crawls.com[-1, 0] - crawls.com[0, 0]) > 600.0
    assert 1e3 * smallest_support_margin(crawls) > 32.0 and crawls.measured[:, 2::3].max() < 80.0


def test_a_push_of_a_run_acts_at_its_time():
    robot = judges.load("go2")
    pushed = run_go2(make_controller(), 0.4, [0.0, 60.0, 0.0], start=0.1)
    (push,) = pushed.pushes
    assert (push.start, push.duration, pushed.outcome) == (0.1, 0.1, "completed")
    assert np.isclose(pushed.time[1], 2e-3) and pushed.robot == robot


# pictures -----------------------------------------------------------------------------------------
