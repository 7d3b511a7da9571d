"""Facets from rays and vertices from extreme points, also if the set is flat or contains lines."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls
from scipy.spatial import ConvexHull

from floatbase.friction._polytopes import cone_face_matrix, polytope_vertices

seeds = st.integers(0, 100_000)


def made_of(rays, x):
    return bool(nnls(rays, x)[1] < 1e-9 * np.linalg.norm(x))


@settings(max_examples=60)
@given(seeds, st.integers(1, 6), st.integers(1, 12))
def test_rows_hold_for_just_what_the_rays_make(seed, n, N):
    """Any number of rays: too few to span the space, enough, or so many that they span lines.

    They may also span the whole space.
    """
    rng = np.random.default_rng(seed)
    rays = rng.normal(size=(n, N)) + rng.uniform(0, 1.5) * np.eye(n)[:, :1]
    G, E = cone_face_matrix(rays)
    assert len(E) == n - np.linalg.matrix_rank(rays)
    assert np.allclose(E @ rays, 0.0, atol=1e-9)
    assert np.max(G @ rays, initial=0.0) <= 1e-9
    assert np.allclose(np.linalg.norm(G, axis=1), 1.0)
    span = rays @ rng.normal(size=(N, 10))
    for x in span.T:
        assert made_of(rays, x) == bool(np.max(G @ x, initial=0.0) <= 1e-9)


def test_every_row_is_a_facet():
    rays = np.random.default_rng(0).normal(size=(6, 20)) + 2.5 * np.eye(6)[:, :1]
    for row in cone_face_matrix(rays)[0]:
        assert np.linalg.matrix_rank(rays[:, np.abs(row @ rays) < 1e-9]) == 5


def test_a_half_space_has_one_row_and_the_whole_space_none():
    lines = np.array(
        [[1.0, -1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0, 0.0], [0.0, 0.0, 0.0, 0.0, 1.0]]
    )
    G, E = cone_face_matrix(lines)
    assert np.allclose(G, [[0.0, 0.0, -1.0]])
    assert E.shape == (0, 3)
    G, E = cone_face_matrix(np.hstack([np.eye(3), -np.eye(3)]))
    assert G.shape == (0, 3)
    assert E.shape == (0, 3)


def points_of(rng, n, rank):
    """Return random points in R^n that lie in an affine space of dimension rank."""
    return rng.normal(size=(12, rank)) @ rng.normal(size=(rank, n)) + rng.normal(size=n)


@settings(max_examples=60)
@given(seeds, st.integers(2, 3), st.integers(0, 3))
def test_vertices_are_those_of_the_hull_whatever_its_dimension(seed, n, rank):
    rank = min(rank, n)
    points = points_of(np.random.default_rng(seed), n, rank)
    found = polytope_vertices(lambda direction: points[int(np.argmax(points @ direction))], n, 1.0)
    if rank == 0:
        assert np.allclose(found, points[:1])
        return
    basis = np.linalg.svd(points - points[0])[2][:rank].T
    flat = (points - points[0]) @ basis
    ends = {int(np.argmin(flat)), int(np.argmax(flat))}
    expected = ends if rank == 1 else set(ConvexHull(flat).vertices.tolist())
    assert {int(np.argmin(np.linalg.norm(points - x, axis=1))) for x in found} == expected
    assert len(found) == len(expected)


def test_points_on_an_edge_are_no_vertices_and_the_plane_is_walked_counter_clockwise():
    square = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0], [0.0, 1.0]])
    # the worst answer that is allowed: of the extreme points, the one in the middle of the edge
    middle = np.array([0.0, 1e-12, 0.0, 0.0, 0.0, 1e-12])
    found = polytope_vertices(lambda d: square[int(np.argmax(square @ d + middle))], 2, 2.0)
    assert len(found) == 4
    x, y = found.T
    assert 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) == pytest.approx(4.0)
