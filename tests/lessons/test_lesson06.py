"""Lesson 06: its helpers do what they say."""

import numpy as np
import pytest

import floatbase as fb
from floatbase.errors import InputError
from floatbase.friction import FrictionPolyhedron
from floatbase.lessons.lesson06 import constrained_minimizer, state_with_feet_at

UP = np.array([0.0, 0.0, 1.0])
LENGTHS = 1e-9  # m: what Newton's method leaves, and rounding
SOLVED = 1e-5  # N: what the QP solver leaves in rows of forces up to 200 N


def test_the_constrained_minimum_is_the_projection_onto_the_polyhedron():
    cost = fb.Quadratic.from_residual(np.eye(3), [3.0, 0.0, 1.0])
    rows = FrictionPolyhedron(UP, 0.5, 4).face_matrix
    found = constrained_minimizer(cost, rows)
    assert np.allclose(found, FrictionPolyhedron(UP, 0.5, 4).project([3.0, 0.0, 1.0]), atol=SOLVED)
    wide = FrictionPolyhedron(UP, 5.0, 4).face_matrix
    assert np.allclose(constrained_minimizer(cost, wide), [3.0, 0.0, 1.0], atol=SOLVED)


def test_feet_reach_their_positions_or_an_error_is_raised(go2, standing):
    shift = [0.02, 0.01, 0.03]
    places = {foot.frame: standing.point(foot.frame) + shift for foot in go2.feet}
    reached = state_with_feet_at(go2, standing.q[:3], places)
    for name, place in places.items():
        assert np.allclose(reached.point(name), place, atol=LENGTHS)
    with pytest.raises(InputError, match="cannot put its feet"):
        state_with_feet_at(go2, standing.q[:3] + [0.0, 0.0, 1.0], places)


def test_the_constrained_minimum_accepts_any_limits():
    cost = fb.Quadratic.from_residual(np.eye(2), [3.0, 4.0])
    found = constrained_minimizer(cost, np.eye(2), [-1.0, 5.0])
    assert np.allclose(found, [-1.0, 4.0], atol=SOLVED)
    assert np.allclose(constrained_minimizer(cost, np.eye(2), 2.0), [2.0, 2.0], atol=SOLVED)
