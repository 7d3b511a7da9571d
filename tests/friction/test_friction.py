"""Components of a force, the exact cone, its projection, and the facets and edges of polyhedra."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from messages import refused
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from floatbase.errors import InputError
from floatbase.friction import FrictionCone, FrictionPolyhedron, decompose, tangents

UP = np.array([0.0, 0.0, 1.0])

seeds = st.integers(0, 100_000)
facets = st.integers(3, 32)
mus = st.floats(0.05, 3.0)


def any_normal(rng):
    raw = rng.normal(size=3)
    return raw / np.linalg.norm(raw)


def any_force(rng):
    """Return a force of any direction, from 1 mN to 10 kN."""
    return rng.normal(size=3) * 10.0 ** rng.uniform(-3, 4)


@given(seeds)
def test_the_two_parts_of_figure_3_add_up_and_are_at_right_angles(seed):
    rng = np.random.default_rng(seed)
    n, f = any_normal(rng), any_force(rng)
    parts, size = decompose(f, 3.0 * n), np.linalg.norm(f)
    P = np.outer(n, n)
    assert np.allclose(parts.f_perp, P @ f, rtol=0, atol=1e-12 * size)
    assert np.allclose(parts.f_par, (np.eye(3) - P) @ f, rtol=0, atol=1e-12 * size)
    assert np.allclose(parts.f_perp + parts.f_par, f, rtol=0, atol=1e-15 * size)
    assert abs(parts.f_perp @ parts.f_par) <= 1e-12 * size**2
    assert parts.alpha_perp**2 + parts.alpha_par**2 == pytest.approx(size**2)
    assert parts.alpha_par >= 0


def test_the_cone_opens_by_arctan_mu():
    cone = FrictionCone(UP, 1.0)
    assert cone.angle == pytest.approx(np.pi / 4)
    for angle, held in ((cone.angle - 1e-6, True), (cone.angle + 1e-6, False)):
        assert cone.contains(10.0 * np.array([np.sin(angle), 0.0, np.cos(angle)])) is held


@given(seeds, mus)
def test_the_margin_is_the_tangential_force_that_may_be_added_before_the_foot_slips(seed, mu):
    rng = np.random.default_rng(seed)
    cone = FrictionCone(any_normal(rng), mu)
    f = cone.normal * rng.uniform(1, 100) + 0.9 * mu * rng.uniform(-0.7, 0.7, 2) @ tangents(
        cone.normal
    )
    margin, parts = cone.margin(f), decompose(f, cone.normal)
    outwards = parts.f_par / parts.alpha_par
    assert margin > 0
    assert cone.margin(f + margin * outwards) == pytest.approx(0.0, abs=1e-9)
    # its distance from the surface: a step at a right angle to the surface line that lies next
    nearest = f + margin / (1 + mu**2) * (outwards - mu * cone.normal)
    assert cone.margin(nearest) == pytest.approx(0.0, abs=1e-9)
    assert np.linalg.norm(nearest - f) == pytest.approx(margin / np.sqrt(1 + mu**2))


def test_the_tolerance_is_in_newton():
    cone = FrictionCone(UP, 0.5)
    polyhedron = FrictionPolyhedron(UP, 0.5, 4, inner_approximation=False)
    slipping = [50.02, 0.0, 100.0]
    for shape in (cone, polyhedron):
        assert not shape.contains(slipping)
        assert not shape.contains(slipping, tolerance=0.019)
        assert shape.contains(slipping, tolerance=0.021)


@given(seeds, facets, mus, st.booleans())
def test_the_area_ratio_follows_the_number_of_facets(seed, n, mu, inside):
    polyhedron = FrictionPolyhedron(any_normal(np.random.default_rng(seed)), mu, n, inside)
    corners = polyhedron.rays - polyhedron.normal
    turns = np.cross(corners, np.roll(corners, -1, axis=0)) @ polyhedron.normal
    assert 0.5 * np.sum(turns) / (np.pi * mu**2) == pytest.approx(polyhedron.area_ratio)


def test_four_facets_keep_64_percent_of_the_cone_and_sixteen_97():
    for inside, expected in ((True, [0.64, 0.90, 0.97]), (False, [1.27, 1.05, 1.01])):
        cones = [FrictionPolyhedron(UP, 0.7, n, inside) for n in (4, 8, 16)]
        assert [round(cone.area_ratio, 2) for cone in cones] == expected


@settings(max_examples=25)
@given(seeds, facets, mus, st.booleans())
def test_rows_and_rays_describe_the_same_set(seed, n, mu, inside):
    """The largest force in any direction is the same over the rows and over the rays.

    The set is cut off at normal component 1.
    """
    rng = np.random.default_rng(seed)
    polyhedron = FrictionPolyhedron(any_normal(rng), mu, n, inside)
    for direction in rng.normal(size=(4, 3)):
        rows = np.vstack([polyhedron.face_matrix, polyhedron.normal])
        best = linprog(-direction, rows, np.append(np.zeros(n), 1.0), bounds=(None, None))
        assert -best.fun == pytest.approx(max(0.0, np.max(polyhedron.rays @ direction)), abs=1e-9)


def test_a_ray_lies_on_the_two_facets_beside_it_and_a_force_in_the_middle_on_none():
    polyhedron = FrictionPolyhedron([0.2, -0.3, 0.9], 0.7, 5)
    assert np.allclose(polyhedron.rays @ polyhedron.normal, 1.0)
    for i, ray in enumerate(polyhedron.rays):
        assert set(polyhedron.active_facets(100.0 * ray)) == {i, (i + 1) % 5}
    for force in (polyhedron.normal, np.zeros(3), -polyhedron.normal):
        assert polyhedron.active_facets(force) == ()


def test_the_status_changes_at_the_friction_limit():
    cone = FrictionCone(UP, 0.6)
    for slide, status in ((0.0, "inside"), (5.8, "inside"), (6.0, "active"), (6.2, "outside")):
        for angle in np.linspace(0, 2 * np.pi, 7):
            assert cone.status([slide * np.cos(angle), slide * np.sin(angle), 10.0]) == status
    assert cone.status(-UP) == "outside"


def test_an_inside_polyhedron_is_left_before_the_cone_and_an_outside_one_after_it():
    force = [5.0, 0.0, 10.0]
    inner = FrictionPolyhedron(UP, 0.6, 4, inner_approximation=True)
    outer = FrictionPolyhedron(UP, 0.6, 4, inner_approximation=False)
    found = [cone.status(force) for cone in (inner, FrictionCone(UP, 0.6), outer)]
    assert found == ["outside", "inside", "inside"]
    assert (inner.active_facets(force), outer.active_facets(force)) == ((0,), ())


def slips(force, normal, mu):
    """Return α∥ - μ α⊥ of (28) in N: how far a force lies outside the exact cone."""
    pressing = float(normal @ force)
    return float(np.linalg.norm(force - pressing * normal)) - mu * pressing


@given(seeds, facets, mus)
def test_the_inner_polyhedron_reaches_mu_at_its_edges_and_loses_cos_pi_over_n_between(seed, n, mu):
    normal = any_normal(np.random.default_rng(seed))
    inner = FrictionPolyhedron(normal, mu, n)
    outer = FrictionPolyhedron(normal, mu, n, inner_approximation=False)
    for ray in inner.rays:
        assert slips(ray, normal, mu) == pytest.approx(0.0, abs=1e-9)
    for direction in inner.face_matrix + inner.mu_facet * normal:
        assert np.linalg.norm(direction) == pytest.approx(1.0)
        between = normal + mu * np.cos(np.pi / n) * direction
        assert inner.margin(between) == pytest.approx(0.0, abs=1e-9)
        assert outer.margin(normal + mu * direction) == pytest.approx(0.0, abs=1e-9)


def test_the_margin_is_the_force_that_may_be_added_along_the_nearest_facet():
    cone = FrictionPolyhedron([0.0, 0.0, 1.0], 0.5, 4, inner_approximation=False)
    assert cone.margin([0.0, 0.0, 10.0]) == pytest.approx(5.0)
    assert cone.margin([3.0, 0.0, 10.0]) == pytest.approx(2.0)
    assert cone.margin([0.0, -7.0, 10.0]) == pytest.approx(-2.0)
    assert cone.margin([0.0, 0.0, -1.0]) < 0


def test_facet_0_looks_along_the_worlds_x_and_the_next_one_along_y():
    cone = FrictionPolyhedron([0.0, 0.0, 1.0], 1.0, 4, inner_approximation=False)
    assert np.allclose(cone.face_matrix[0], [1.0, 0.0, -1.0])
    assert np.allclose(cone.face_matrix[1], [0.0, 1.0, -1.0])


@given(seeds, facets, mus, st.booleans(), st.floats(-10.0, 10.0))
def test_turned_facets_are_the_facets_turned_about_the_normal(seed, n, mu, inside, turn):
    normal = any_normal(np.random.default_rng(seed))
    turned, straight = (FrictionPolyhedron(normal, mu, n, inside, angle) for angle in (turn, 0.0))
    about = Rotation.from_rotvec(turn * normal).as_matrix()
    size = 1.0 + mu
    assert np.allclose(turned.face_matrix, straight.face_matrix @ about.T, rtol=0, atol=1e-9 * size)
    expected = straight.rays @ about.T
    assert np.allclose(turned.rays, expected, rtol=0, atol=1e-9 * size / np.cos(np.pi / n))
    whole = FrictionPolyhedron(normal, mu, n, inside, turn + 2 * np.pi / n)
    next_faces = np.roll(turned.face_matrix, -1, axis=0)
    assert np.allclose(next_faces, whole.face_matrix, rtol=0, atol=1e-9 * size)


@given(seeds)
def test_tangents_are_right_handed_with_the_normal(seed):
    normal = any_normal(np.random.default_rng(seed))
    t1, t2 = tangents(normal)
    assert np.allclose(np.cross(t1, t2), normal, atol=1e-12)
    assert np.allclose([t1 @ t1, t2 @ t2, t1 @ t2, t1 @ normal], [1.0, 1.0, 0.0, 0.0], atol=1e-12)


@given(seeds, facets, mus, st.booleans())
def test_a_projection_is_the_nearest_point_of_the_cone(seed, n, mu, inside):
    """Moreau: three conditions make p the nearest point.

    p in K, (f - p) · p = 0, and (f - p) · k ≤ 0 for all k in K.
    """
    rng = np.random.default_rng(seed)
    polyhedron = FrictionPolyhedron(any_normal(rng), mu, n, inside)
    f = any_force(rng)
    size = float(np.linalg.norm(f))
    for shape in (FrictionCone(polyhedron.normal, mu), polyhedron):
        p = shape.project(f)
        assert shape.contains(p, tolerance=1e-12 * size)
        assert np.allclose(shape.project(p), p, rtol=0, atol=1e-13 * size)
        assert abs((f - p) @ p) <= 1e-12 * size**2
    assert np.max(polyhedron.rays @ (f - p)) <= 1e-12 * size * (1 + mu)
    rest = decompose(f - shape.project(f), polyhedron.normal)
    gone = decompose(f - FrictionCone(polyhedron.normal, mu).project(f), polyhedron.normal)
    assert mu * gone.alpha_par + gone.alpha_perp <= 1e-12 * size
    assert rest.alpha_perp <= 1e-12 * size  # the part that is removed never pushes


@pytest.mark.parametrize(
    "case",
    [
        (lambda: FrictionCone(UP, 0.0), "mu", 0),
        (lambda: FrictionCone(np.zeros(3), 0.7), "normal"),
        (lambda: FrictionPolyhedron(UP, 0.0), "mu", 0),
        (lambda: FrictionPolyhedron(np.zeros(3), 0.7), "normal"),
        (lambda: FrictionPolyhedron(UP, 0.7, 2), "facets", 2, 3),
        (lambda: FrictionPolyhedron(UP, 0.7, 4.5), "facets", 4.5),
    ],
)  # fmt: skip
def test_bad_input_is_refused_by_name(case):
    call, *named = case
    refused(call, InputError, *named)
