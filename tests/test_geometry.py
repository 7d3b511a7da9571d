"""Shared geometry, against finite differences, samples and Pinocchio."""

import numpy as np
import pinocchio as pin
import pytest

from floatbase._geometry import convex_hull, distance_to_polygon, minimum_jerk, rotation_z

SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])


def test_the_rotation_about_z_is_the_exponential_of_its_angle():
    assert np.allclose(rotation_z(0.3), pin.exp3(np.array([0.0, 0.0, 0.3])), atol=1e-15)


def test_minimum_jerk_has_the_derivatives_that_it_gives_and_rests_at_both_ends():
    step = 1e-5
    for s in (0.1, 0.5, 0.8):
        before, here, after = (minimum_jerk(s + side * step) for side in (-1.0, 0.0, 1.0))
        for order in (1, 2):
            slope = (after[order - 1] - before[order - 1]) / (2.0 * step)
            assert here[order] == pytest.approx(slope, abs=1e-7)
    assert minimum_jerk(-1.0) == minimum_jerk(0.0) == (0.0, 0.0, 0.0)
    assert minimum_jerk(2.0) == minimum_jerk(1.0) == (1.0, 0.0, 0.0)


def test_distances_from_a_polygon_are_those_from_samples_of_its_border():
    rng = np.random.default_rng(0)
    points = rng.uniform(-1.0, 3.0, (200, 2))
    share = np.linspace(0.0, 1.0, 1001)[:, None]
    border = np.concatenate(
        [a + share * (b - a) for a, b in zip(SQUARE, np.roll(SQUARE, -1, axis=0), strict=True)]
    )
    nearest = np.linalg.norm(points[:, None] - border, axis=2).min(axis=1)
    inside = np.all((points >= 0.0) & (points <= 2.0), axis=1)
    expected = np.where(inside, nearest, -nearest)
    assert np.allclose(distance_to_polygon(points, SQUARE), expected, atol=1e-3)
    assert float(distance_to_polygon(np.array([0.0, 1.0]), np.array([[-1.0, 0], [1.0, 0]]))) == -1.0
    assert float(distance_to_polygon(np.array([3.0, 4.0]), np.zeros((1, 2)))) == -5.0


def test_a_hull_has_the_corners_alone_counter_clockwise():
    points = np.vstack([SQUARE, [[1.0, 1.0], [1.0, 0.0], [0.5, 1.5]]])
    hull = convex_hull(points[::-1])
    assert {tuple(corner) for corner in hull} == {tuple(corner) for corner in SQUARE}
    edges = np.roll(hull, -1, axis=0) - hull
    following = np.roll(edges, -1, axis=0)
    assert np.all(edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0] > 0.0)
    expected = [[0, 0], [1, 1]]
    assert np.array_equal(convex_hull(np.array([[1.0, 1.0], [0.0, 0.0], [0.5, 0.5]])), expected)
    assert np.array_equal(convex_hull(np.ones((3, 2))), [[1, 1]])
