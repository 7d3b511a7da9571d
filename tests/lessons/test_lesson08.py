"""Lesson 08: its helpers do what they say."""

import judges
import numpy as np
import pytest

import floatbase as fb
from floatbase.behaviours import support_margin
from floatbase.errors import InputError
from floatbase.lessons.lesson08 import run_go2, smallest_support_margin, state_with_moved_body

LENGTHS = 1e-9  # m: what Newton's method leaves, and rounding


def test_a_moved_body_keeps_its_feet():
    state = judges.load("go2").standing()
    moved = state_with_moved_body(state, [0.02, -0.03, 0.01])
    contacts = fb.Contacts.points(state.robot)
    assert np.allclose(contacts.positions(moved), contacts.positions(state), atol=LENGTHS)
    assert np.allclose(moved.q[:3] - state.q[:3], [0.02, -0.03, 0.01], atol=LENGTHS)
    with pytest.raises(InputError, match="cannot put its feet"):
        state_with_moved_body(state, [0.0, 0.0, 1.0])


def test_the_smallest_support_margin_of_a_robot_that_stands_is_that_of_its_last_state():
    stands = run_go2(judges.controller_of("go2"), 0.3)
    margin = support_margin(stands.com[-1, :2], stands.foot_positions[-1, :, :2])
    assert np.isclose(smallest_support_margin(stands), margin, atol=1e-3)
