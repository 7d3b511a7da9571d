"""Lesson 08: its helpers do what they say."""

import numpy as np
import pytest

import floatbase as fb
from floatbase.errors import InputError
from floatbase.lessons.lesson08 import state_with_moved_body

LENGTHS = 1e-9  # m: what Newton's method leaves, and rounding


def test_a_moved_body_keeps_its_feet(standing):
    moved = state_with_moved_body(standing, [0.02, -0.03, 0.01])
    contacts = fb.Contacts.points(standing.robot)
    assert np.allclose(contacts.positions(moved), contacts.positions(standing), atol=LENGTHS)
    assert np.allclose(moved.q[:3] - standing.q[:3], [0.02, -0.03, 0.01], atol=LENGTHS)
    with pytest.raises(InputError, match="cannot put its feet"):
        state_with_moved_body(standing, [0.0, 0.0, 1.0])
