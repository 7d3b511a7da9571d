"""The polyhedron that stands in for the friction cone: inside or outside, for any normal."""

from __future__ import annotations

import judges
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from floatbase.friction import FrictionPolyhedron, tangents

seeds = st.integers(0, 100_000)
facets = st.integers(3, 24)
mus = st.floats(0.05, 3.0)


def any_normal(seed: int) -> np.ndarray:
    raw = np.random.default_rng(seed).normal(size=3)
    return raw / np.linalg.norm(raw)


def slips(force: np.ndarray, normal: np.ndarray, mu: float) -> float:
    """α∥ - μ α⊥ of (28), N: how far a force is outside the exact cone."""
    pressing = float(normal @ force)
    return float(np.linalg.norm(force - pressing * normal)) - mu * pressing


@given(seeds, facets, mus)
def test_every_force_of_the_inner_polyhedron_lies_in_the_exact_cone(seed: int, n: int, mu: float) -> None:
    rng, normal = np.random.default_rng(seed), any_normal(seed)
    cone = FrictionPolyhedron(normal, mu, n)
    for weights in rng.exponential(size=(20, n)):
        force = cone.rays.T @ weights
        assert slips(force, normal, mu) <= 1e-9 * np.linalg.norm(force)
        assert cone.margin(force) >= -1e-9 * np.linalg.norm(force)


@given(seeds, facets, mus)
def test_every_force_of_the_exact_cone_lies_in_the_outer_polyhedron(seed: int, n: int, mu: float) -> None:
    rng, normal = np.random.default_rng(seed), any_normal(seed)
    cone, (t1, t2) = FrictionPolyhedron(normal, mu, n, inside=False), tangents(normal)
    for angle, part in zip(rng.uniform(0, 2 * np.pi, 50), rng.uniform(0, 1, 50), strict=True):
        force = normal + part * mu * (np.cos(angle) * t1 + np.sin(angle) * t2)
        assert cone.margin(force) >= -1e-12


@given(seeds, facets, mus, st.booleans())
def test_rays_are_edges_on_two_facets_with_a_normal_part_of_one(seed: int, n: int, mu: float, inside: bool) -> None:
    cone = FrictionPolyhedron(any_normal(seed), mu, n, inside)
    slack = cone.rows @ cone.rays.T
    assert np.all(slack <= 1e-9)
    assert np.all(np.sum(np.abs(slack) < 1e-9, axis=0) == 2)
    assert np.allclose(cone.rays @ cone.normal, 1.0)


@given(seeds, facets, mus)
def test_the_inner_polyhedron_reaches_mu_at_its_edges_and_loses_cos_pi_over_n_between(seed: int, n: int, mu: float) -> None:
    normal = any_normal(seed)
    inner, outer = FrictionPolyhedron(normal, mu, n), FrictionPolyhedron(normal, mu, n, inside=False)
    for ray in inner.rays:
        assert slips(ray, normal, mu) == pytest.approx(0.0, abs=1e-9)
    for direction in inner.rows + inner.mu_facet * normal:
        assert np.linalg.norm(direction) == pytest.approx(1.0)
        assert inner.margin(normal + mu * np.cos(np.pi / n) * direction) == pytest.approx(0.0, abs=1e-9)
        assert outer.margin(normal + mu * direction) == pytest.approx(0.0, abs=1e-9)


def test_the_margin_is_the_force_that_may_be_added_along_the_nearest_facet() -> None:
    cone = FrictionPolyhedron([0.0, 0.0, 1.0], 0.5, 4, inside=False)
    assert cone.margin([0.0, 0.0, 10.0]) == pytest.approx(5.0)
    assert cone.margin([3.0, 0.0, 10.0]) == pytest.approx(2.0)
    assert cone.margin([0.0, -7.0, 10.0]) == pytest.approx(-2.0)
    assert cone.margin([0.0, 0.0, -1.0]) < 0


def test_rows_keep_the_force_from_pulling() -> None:
    for n in (3, 4, 8):
        cone = FrictionPolyhedron([0.0, 0.0, 1.0], 0.7, n)
        assert np.max(cone.rows @ [0.1, 0.2, -1.0]) > 0
        assert np.allclose(cone.rows.mean(axis=0), [0.0, 0.0, -cone.mu_facet])


def test_facet_0_looks_along_the_worlds_x_and_the_next_one_along_y() -> None:
    cone = FrictionPolyhedron([0.0, 0.0, 1.0], 1.0, 4, inside=False)
    assert np.allclose(cone.rows[0], [1.0, 0.0, -1.0])
    assert np.allclose(cone.rows[1], [0.0, 1.0, -1.0])


@given(seeds)
def test_tangents_are_right_handed_with_the_normal(seed: int) -> None:
    normal = any_normal(seed)
    t1, t2 = tangents(normal)
    assert np.allclose(np.cross(t1, t2), normal, atol=1e-12)
    assert np.allclose([t1 @ t1, t2 @ t2, t1 @ t2, t1 @ normal], [1.0, 1.0, 0.0, 0.0], atol=1e-12)


@given(seeds, facets, mus)
def test_turning_the_ground_turns_the_cone_with_it(seed: int, n: int, mu: float) -> None:
    """Facets may start elsewhere, so what is compared is the exact cone that the polyhedra touch."""
    flat, tilted = FrictionPolyhedron([0.0, 0.0, 1.0], mu, n), FrictionPolyhedron(any_normal(seed), mu, n)
    for one, other in zip(flat.rays, tilted.rays, strict=True):
        assert np.linalg.norm(one) == pytest.approx(np.linalg.norm(other))
        assert one @ flat.normal == pytest.approx(other @ tilted.normal)


def test_many_facets_close_the_gap_to_the_cone() -> None:
    normal = judges.random_normals(1, 0)[0]
    t1, t2 = tangents(normal)
    edge = normal + 0.7 * (np.cos(0.3) * t1 + np.sin(0.3) * t2)
    gaps = [abs(FrictionPolyhedron(normal, 0.7, n).margin(edge)) for n in (64, 256, 1024)]
    assert gaps[-1] < 1e-5
    assert all(gap <= 0.7 * (1 - np.cos(np.pi / n)) + 1e-12 for gap, n in zip(gaps, (64, 256, 1024), strict=True))
