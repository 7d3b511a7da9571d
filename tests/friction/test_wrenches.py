"""Wrenches of a stance against cvxpy, linear programs over rows and rays, and brute force."""

from functools import cache
from itertools import count

import cvxpy as cp
import judges
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from messages import raises, refused
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

import floatbase as fb
from floatbase.dynamics import LinearConstraint
from floatbase.errors import InfeasibleError, InputError
from floatbase.friction import FrictionPolyhedron, WrenchSet, wrench_set
from floatbase.objectives import com_wrench_map

seeds = st.integers(0, 100_000)
UP = np.array([0.0, 0.0, 1.0])
STANCES = [("go2", 4), ("go2", 3), ("go2", 2), ("go2", 1), ("talos", 2), ("talos", 1)]


@cache
def stance(name, feet, tilt=0.0):
    """Return a robot standing on its first feet, each on its own slope if tilt > 0."""
    robot = judges.load(name)
    kind = fb.Contacts.flat_feet if name in judges.FLAT else fb.Contacts.points
    frames = [foot.frame for foot in robot.feet][:feet]
    normals = judges.random_normals(feet, 7, tilt) if tilt else None
    return robot.standing(), kind(robot, 0.6, frames, normals)


def of(points, normals, mu=0.7, n=4, inside=True, limit=np.inf):
    """Return the set of contact points without a robot, with weight 100 N, about the origin."""
    cones = tuple(
        FrictionPolyhedron(normal, mu, n, inside) for normal in np.asarray(normals, dtype=float)
    )
    limits = np.broadcast_to(limit, len(cones))
    return WrenchSet(np.asarray(points), cones, np.zeros(3), 100.0, limits)


def feet_on_slopes(seed, n=4, facets=4, inside=True):
    """Return feet about a metre apart, some higher than others, each on its own slope."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-0.5, 0.5, (n, 3))
    return of(points, judges.random_normals(n, seed, 0.8), 0.6, facets, inside)


def random_wrenches(wrenches, n, seed):
    """Return sums of forces in the cones, so inside the set; perturb all but the first quarter.

    The perturbations grow with the index.
    """
    rng = np.random.default_rng(seed)
    inside = wrenches.rays @ rng.exponential(30.0, (wrenches.rays.shape[1], n))
    push = rng.normal(size=(6, n)) * np.maximum(np.linspace(-2.0, 8.0, n), 0.0)
    return (inside + push * np.array([60.0] * 3 + [15.0] * 3)[:, None]).T


class Judge:
    """(20)(21)(28) in cvxpy: how far inside its cone every force can be, for four facets."""

    def __init__(self, points, normals, mu, exact):
        forces = cp.Variable((len(points), 3))
        self.about, self.wrench = cp.Parameter(3), cp.Parameter(6)
        self.t = cp.Variable()
        moment = [
            cp.sum([self._cross(x - self.about, forces[i])[j] for i, x in enumerate(points)])
            for j in range(3)
        ]
        rows = [cp.sum(forces, axis=0) == self.wrench[:3], cp.hstack(moment) == self.wrench[3:]]
        for i, n in enumerate(normals):
            x = np.array([1.0, 0.0, 0.0]) - n * n[0]
            x /= np.linalg.norm(x)
            y = np.cross(n, x)
            press, slide = forces[i] @ n, cp.hstack([forces[i] @ x, forces[i] @ y])
            limit = mu * press if exact else mu / np.sqrt(2) * press
            rows.append((cp.norm(slide) if exact else cp.max(cp.abs(slide))) <= limit - self.t)
        self.problem = cp.Problem(cp.Maximize(self.t), rows)

    @staticmethod
    def _cross(a, b):
        return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]

    def margin(self, about, wrench):
        self.about.value, self.wrench.value = about, wrench
        self.problem.solve(solver=cp.CLARABEL)
        infeasible = self.problem.status in ("infeasible", "infeasible_inaccurate")
        return -np.inf if infeasible else float(self.t.value)


@pytest.mark.parametrize("tilt", [0.0, 0.5])
@pytest.mark.parametrize(("name", "feet"), STANCES)
def test_membership_and_margin_are_what_cvxpy_finds(name, feet, tilt):
    state, contacts = stance(name, feet, tilt)
    wrenches = wrench_set(state, contacts)
    judge = Judge(contacts.positions(state), contacts.normals, 0.6, exact=False)
    found = []
    for w in random_wrenches(wrenches, 16, seed=feet):
        # the equalities exclude what the stance cannot produce at all; cvxpy decides the rest
        E = wrenches.equalities
        w = w - np.linalg.pinv(E) @ E @ w if len(E) else w
        expected = judge.margin(state.com, w)
        assert wrenches.margin(w) == pytest.approx(expected, abs=2e-5 * np.linalg.norm(w))
        if abs(expected) > 1e-3:
            assert wrenches.contains(w) == (expected > 0)
            found.append(expected > 0)
    assert 2 <= sum(found) <= len(found) - 2


@pytest.mark.parametrize(("name", "feet"), [("go2", 4), ("talos", 2)])
def test_the_exact_cones_wrenches_lie_between_those_of_inner_and_outer_polyhedra(name, feet):
    state, contacts = stance(name, feet, 0.5)
    judge = Judge(contacts.positions(state), contacts.normals, 0.6, exact=True)
    inner = wrench_set(state, contacts, facets=6)
    outer = wrench_set(state, contacts, facets=6, inner_approximation=False)
    for w in random_wrenches(inner, 16, seed=3):
        exact = judge.margin(state.com, w)
        assert inner.margin(w) < 1e-4 or exact > -1e-4
        assert exact < 1e-4 or outer.margin(w) > -1e-4


def test_rays_are_what_the_centroidal_maps_make_of_the_friction_rays():
    state, contacts = stance("go2", 3, 0.5)
    wrenches = wrench_set(state, contacts, facets=5)
    G = com_wrench_map(state, contacts).A
    for i, cone in enumerate(wrenches.cones):
        forces = np.zeros((9, 5))
        forces[3 * i : 3 * i + 3] = cone.rays.T
        assert np.allclose(wrenches.rays[:, 5 * i : 5 * i + 5], G @ forces)


@pytest.mark.parametrize("facets", [4, 7])
@pytest.mark.parametrize(("name", "feet"), STANCES)
def test_rows_and_rays_describe_the_same_wrenches(name, feet, facets):
    state, contacts = stance(name, feet, 0.4)
    wrenches = wrench_set(state, contacts, facets=facets)
    rows, E, rays = wrenches.face_matrix, wrenches.equalities, wrenches.rays
    assert np.max(rows @ rays) <= 1e-9
    assert np.max(np.abs(E @ rays), initial=0.0) <= 1e-9
    scale = np.repeat([1.0, wrenches.max_lever_arm], 3)
    assert np.allclose(np.linalg.norm(rows * scale, axis=1), 1.0)
    # conversely, the rays reach the extreme point that the rows allow in any direction
    rng = np.random.default_rng(feet)
    inwards = rays.sum(axis=1)
    for _ in range(8):
        cost = -rng.normal(size=6) / scale
        G, h = np.vstack([rows, inwards / scale**2]), np.append(np.zeros(len(rows)), 100.0)
        best = linprog(cost, G, h, E, np.zeros(len(E)), (None, None))
        assert best.status == 0
        assert wrenches.contains(best.x, tolerance=1e-5)


@pytest.mark.parametrize(("feet", "missing"), [(1, 3), (2, 1), (3, 0), (4, 0)])
def test_one_foot_lacks_three_dimensions_and_two_lack_the_twist_about_their_line(feet, missing):
    state, contacts = stance("go2", feet)
    wrenches = wrench_set(state, contacts)
    assert len(wrenches.equalities) == missing
    if feet == 2:
        a, b = wrenches.points
        # (a - b) · (τ + (x_c - a) × f): the moment about the line through a and b
        about_line = np.concatenate([np.cross(a - b, wrenches.reference_point - a), a - b])
        row = wrenches.equalities[0]
        both = np.vstack([row / np.linalg.norm(row), about_line])
        assert np.linalg.matrix_rank(both, tol=1e-9) == 1
        assert wrenches.margin(np.concatenate([np.zeros(3), a - b])) == -np.inf


def test_a_margin_is_reached_by_forces_and_grows_with_the_wrench():
    state, contacts = stance("go2", 4)
    wrenches = wrench_set(state, contacts)
    carrying = np.array([0.0, 0.0, state.robot.weight, 0.0, 0.0, 0.0])
    assert wrenches.margin(3.0 * carrying) == pytest.approx(3.0 * wrenches.margin(carrying))
    # the lever arms determine how front and rear pair share the weight; the pair with less load has
    # the smaller margin
    x = wrenches.points[:, 0] - state.com[0]
    lightest = 0.5 * state.robot.weight * min(x[0], -x[2]) / (x[0] - x[2])
    assert wrenches.margin(carrying) == pytest.approx(lightest * 0.6 / np.sqrt(2))
    assert wrenches.margin(np.zeros(6)) == pytest.approx(0.0, abs=1e-9)
    assert wrenches.margin(-carrying) < 0


# limits on the normal force


def test_limits_make_the_set_bounded():
    state, contacts = stance("go2", 4, 0.4)
    limited = wrench_set(state, contacts, max_normal_force=[50.0, 60.0, 70.0, 80.0])
    for direction in np.random.default_rng(0).normal(size=(20, 6)):
        sums = np.kron(np.eye(4), np.ones(4))
        c, limits = -(direction @ limited.rays), limited.max_normal_force
        best = linprog(c, sums, limits, bounds=(0, None))
        assert limited.contains(limited.rays @ best.x, tolerance=1e-5)
        assert not limited.contains(limited.rays @ best.x + 0.1 * direction) or best.fun == 0


def test_the_maximum_scaling_is_where_membership_ends():
    state, contacts = stance("talos", 2, 0.3)
    wrenches = wrench_set(state, contacts, max_normal_force=400.0)
    start = wrenches.rays @ np.full(wrenches.rays.shape[1], 30.0)
    for direction in np.random.default_rng(1).normal(size=(10, 6)):
        far = wrenches.max_scaling(direction, start)
        assert 0 < far < np.inf
        assert wrenches.contains(start + (far - 1e-3) * direction)
        assert not wrenches.contains(start + (far + 1e-2) * direction)
        assert wrenches.max_scaling(5.0 * direction, start) == pytest.approx(far / 5.0, rel=1e-6)


def test_the_largest_push_from_the_side_on_level_ground_is_mu_times_the_weight():
    """If the CoM is at ground level, only friction limits the push."""
    points = [[0.3, 0.2, 0.0], [0.3, -0.2, 0.0], [-0.3, 0.2, 0.0], [-0.3, -0.2, 0.0]]
    wrenches = of(points, [UP] * 4, 0.5, 4, inside=False)
    carrying = [0.0, 0.0, 100.0, 0.0, 0.0, 0.0]
    assert wrenches.max_scaling([1.0, 0.0, 0.0, 0.0, 0.0, 0.0], carrying) == pytest.approx(50.0)
    assert wrenches.max_scaling([0.0, 0.0, 1.0, 0.0, 0.0, 0.0], carrying) == np.inf
    assert wrenches.max_scaling([0.0, 0.0, -1.0, 0.0, 0.0, 0.0], carrying) == pytest.approx(100.0)
    upwards, tilting = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 3.0, 0.0]
    assert wrenches.max_scaling(upwards, tilting) == np.inf
    with raises(InfeasibleError, "start", "direction"):
        wrenches.max_scaling([1.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0, 0.0, 0.0])


def test_a_facet_or_a_lever_ends_the_horizontal_reach_of_go2(standing):
    """A facet allows μ cos(π/n), an edge μ.

    If edges face the push, it is limited when the outer feet carry everything.
    """
    contacts = fb.Contacts.points(standing.robot, mu=0.7)
    feet, com = contacts.positions(standing), standing.com
    rear, half = (com[0] - feet[:, 0].min()) / com[2], feet[:, 1].max() / com[2]
    facet = 0.7 * np.cos(np.pi / 4)
    for facets, turn, forwards, diagonally, sideways in (
        (4, 0.0, facet, 0.7, facet),  # facets face forwards
        (4, np.pi / 4, rear, facet, half),  # edges do
        (16, 0.0, rear, 0.7 * np.cos(np.pi / 16), half),
    ):
        wrenches = wrench_set(standing, contacts, facets=facets, facet_rotation=turn)
        angles, forces = wrenches.max_horizontal_forces(8)
        assert np.allclose(angles, np.pi / 4 * np.arange(8))
        expected = [forwards, diagonally, sideways, sideways, diagonally]
        assert forces[[0, 1, 2, 6, 7]] / wrenches.weight == pytest.approx(expected, rel=1e-6)


# where a robot can stand


def counter_clockwise(polygon):
    x, y = polygon.T
    return float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) > 0


def depth(polygon, at):
    """Return how far inside a counter-clockwise polygon a point is, m."""
    edges = np.roll(polygon, -1, axis=0) - polygon
    inwards = np.column_stack([-edges[:, 1], edges[:, 0]]) / np.linalg.norm(edges, axis=1)[:, None]
    return float(np.min(np.sum(inwards * (at - polygon), axis=1)))


@pytest.mark.parametrize("mu", [0.05, 0.7])
@pytest.mark.parametrize(
    ("name", "feet"), [("go2", 4), ("go2", 3), ("solo8", 4), ("talos", 2), ("talos", 1)]
)
def test_on_level_ground_the_support_region_is_the_hull_of_the_feet(name, feet, mu):
    robot, state = judges.load(name), judges.load(name).standing()
    contacts = judges.stance(robot, mu).only(*[foot.frame for foot in robot.feet][:feet])
    region = wrench_set(state, contacts).support_region()
    places = contacts.positions(state)[:, :2]
    assert len(region) == (3 if feet == 3 else 4)
    assert counter_clockwise(region)
    assert max(np.min(np.linalg.norm(places - corner, axis=1)) for corner in region) < 1e-9
    assert min(depth(region, place) for place in places) > -1e-9


@settings(max_examples=25)
@given(seeds, st.integers(1, 8))
def test_on_level_ground_this_holds_for_feet_anywhere(seed, feet):
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.uniform(-1, 1, (feet, 2)) + 5.0, np.full(feet, 0.3)])
    region = of(points, [UP] * feet, mu=rng.uniform(0.05, 1)).support_region()
    hull = points[ConvexHull(points[:, :2]).vertices, :2] if feet > 2 else points[:, :2]
    assert region.shape == hull.shape
    assert max(np.min(np.linalg.norm(hull - corner, axis=1)) for corner in region) < 1e-8


@pytest.mark.parametrize("seed", [1, 2])
def test_on_slopes_the_support_region_is_what_a_grid_of_cvxpy_problems_finds(seed):
    wrenches = next(
        feet for feet in map(feet_on_slopes, count(100 * seed)) if len(feet.support_region()) > 2
    )
    region = wrenches.support_region()
    normals = np.array([cone.normal for cone in wrenches.cones])
    judge = Judge(wrenches.points, normals, 0.6, exact=False)
    low, high = region.min(axis=0), region.max(axis=0)
    margin = 0.2 * (high - low)
    seen = set()
    for x in np.linspace(low[0] - margin[0], high[0] + margin[0], 9):
        for y in np.linspace(low[1] - margin[1], high[1] + margin[1], 9):
            inside = depth(region, np.array([x, y]))
            if abs(inside) > 1e-3:
                weight = np.array([0.0, 0.0, 100.0, 0.0, 0.0, 0.0])
                held = judge.margin(np.array([x, y, 0.8]), weight) > 0
                assert held == (inside > 0)
                seen.add(held)
    assert seen == {True, False}


def test_too_steep_a_slope_carries_nothing():
    for angle, stands in ((np.arctan(0.4) - 1e-3, True), (np.arctan(0.4) + 1e-3, False)):
        normals = [[np.sin(angle), 0.0, np.cos(angle)]] * 3
        points = [[0.0, 0.0, 0.0], [1.0, 0.0, -np.tan(angle)], [0.0, 1.0, 0.0]]
        region = of(points, normals, 0.4, inside=False).support_region()
        assert region.shape == ((3, 2) if stands else (0, 2))


def test_limits_on_the_normal_force_cut_the_corners_off():
    square = np.array([[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0]])
    region = of(square, [UP] * 4, limit=50.0).support_region()
    expected = {(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)}
    assert {tuple(np.round(corner, 9)) for corner in region} == expected
    assert of(square, [UP] * 4, limit=20.0).support_region().shape == (0, 2)


def test_walls_that_face_each_other_can_be_squeezed_without_end():
    points = [[0.5, 0.0, 0.0], [-0.5, 0.0, 0.0], [0.5, 1.0, 0.0]]
    chimney = of(points, [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]], 0.5)
    assert chimney.margin([0.0, 0.0, 100.0, 0.0, 0.0, 0.0]) == np.inf
    refused(chimney.support_region, InputError, "max_normal_force")
    limited = of(chimney.points, [cone.normal for cone in chimney.cones], 0.5, limit=400.0)
    assert limited.contains([0.0, 0.0, 100.0, 0.0, 0.0, 0.0])
    assert len(limited.support_region()) >= 3


def test_a_grip_from_all_sides_makes_every_wrench():
    directions = np.vstack([np.eye(3), -np.eye(3)])
    grip = of(directions, -directions, 0.7)
    assert grip.face_matrix.shape == (0, 6) and grip.equalities.shape == (0, 6)
    assert all(grip.margin(w) == np.inf for w in np.random.default_rng(0).normal(size=(5, 6)))


# frames


# input


def test_contacts_that_make_no_set_of_wrenches_are_refused():
    state, contacts = stance("go2", 4)
    rope = LinearConstraint("rope", 1, lambda s, t: (np.eye(1, s.robot.nv), np.zeros(1)))
    for call, *named in (
        (lambda: wrench_set(state, fb.Contacts.none()),),
        (lambda: wrench_set(state, contacts + fb.Contacts([rope])), "rope"),
        (lambda: wrench_set(state, contacts, facets=2), "facets", 2),
        (lambda: wrench_set(state, contacts, max_normal_force=0.0), "max_normal_force", 4),
        (lambda: wrench_set(state, contacts, max_normal_force=9.0).face_matrix, "face_matrix"),
        (lambda: wrench_set(state, contacts).margin(np.zeros(3)), "wrench", 3, 6),
        (lambda: wrench_set(state, contacts).max_scaling([np.nan] * 6), "direction", np.nan),
        (lambda: wrench_set(state, contacts).max_scaling(np.zeros(6)), "direction"),
        (lambda: wrench_set(state, contacts).max_horizontal_forces(0), "n", 0),
        (lambda: WrenchSet(np.zeros((2, 3)), (), np.zeros(3), 1.0, np.ones(2)), "cones", 2),
    ):
        refused(call, InputError, *named)
