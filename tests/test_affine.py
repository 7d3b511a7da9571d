"""Properties of `Affine` and `Quadratic`: composition, stacking, pullback, minimization."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from messages import refused

import floatbase as fb
from floatbase.errors import InputError

seeds = st.integers(0, 100_000)
sizes = st.integers(1, 5)


def affine(rng, n_out, n_in):
    return fb.Affine(rng.normal(size=(n_out, n_in)), rng.normal(size=n_out))


def quadratic(rng, n):
    root = rng.normal(size=(n, n))
    return fb.Quadratic(root @ root.T + 0.1 * np.eye(n), rng.normal(size=n), float(rng.normal()))


@given(seeds, sizes, sizes, sizes, sizes)
def test_composition_is_one_map_after_the_other_and_associative(seed, a, b, c, d):
    rng = np.random.default_rng(seed)
    f, g, h, x = affine(rng, a, b), affine(rng, b, c), affine(rng, c, d), rng.normal(size=d)
    assert np.allclose((f @ g @ h)(x), f(g(h(x))))
    left, right = (f @ g) @ h, f @ (g @ h)
    assert np.allclose(left.A, right.A)
    assert np.allclose(left.b, right.b)


@given(seeds, sizes, sizes)
def test_the_identity_changes_nothing_and_a_constant_forgets_its_input(seed, m, n):
    rng = np.random.default_rng(seed)
    f, x = affine(rng, m, n), rng.normal(size=n)
    assert np.allclose((fb.Affine.identity(m) @ f)(x), f(x))
    assert np.allclose((f @ fb.Affine.identity(n))(x), f(x))
    b = rng.normal(size=m)
    assert np.array_equal(fb.Affine.constant(b, n)(x), b)
    A = rng.normal(size=(m, n))
    assert np.allclose(fb.Affine.linear(A)(x), A @ x)


@given(seeds, sizes, sizes)
def test_sums_and_multiples_of_maps_are_those_of_their_values(seed, m, n):
    rng = np.random.default_rng(seed)
    f, g, x, c = affine(rng, m, n), affine(rng, m, n), rng.normal(size=n), rng.normal(size=m)
    assert np.allclose((f + g)(x), f(x) + g(x))
    assert np.allclose((f - g)(x), f(x) - g(x))
    assert np.allclose((f + c)(x), f(x) + c)
    assert np.allclose((f - c)(x), f(x) - c)
    assert np.allclose((-f)(x), -f(x))


@pytest.mark.parametrize("scale", [3, 3.0, np.float64(3.0), np.float32(3.0), np.int64(3)])
def test_any_real_number_scales_maps_and_costs(scale):
    rng = np.random.default_rng(0)
    f, cost, x = affine(rng, 2, 3), quadratic(rng, 3), rng.normal(size=3)
    assert isinstance(scale * f, fb.Affine)
    assert np.allclose((scale * f)(x), 3.0 * f(x))
    assert isinstance(scale * cost, fb.Quadratic)
    assert (scale * cost)(x) == pytest.approx(3.0 * cost(x))


@given(seeds, sizes, sizes, sizes)
def test_stacked_maps_keep_their_blocks_under_composition_and_sums(seed, a, b, n):
    rng = np.random.default_rng(seed)
    f, g, inner = affine(rng, a, n), affine(rng, b, n), affine(rng, n, 2)
    both, x, y = fb.Affine.stack(tau=f, forces=g), rng.normal(size=n), rng.normal(size=2)
    assert np.allclose(both(x), np.concatenate([f(x), g(x)]))
    assert np.array_equal(both["tau"](x), f(x))
    assert np.array_equal(both["forces"](x), g(x))
    assert np.allclose((both @ inner)["forces"](y), g(inner(y)))
    assert np.allclose((2.0 * both + np.ones(a + b))["tau"](x), 2.0 * f(x) + 1.0)


@given(seeds, sizes, sizes)
def test_a_map_takes_many_points_side_by_side(seed, m, n):
    rng = np.random.default_rng(seed)
    f, points = affine(rng, m, n), rng.normal(size=(n, 7))
    assert np.allclose(f(points), np.column_stack([f(x) for x in points.T]))


@given(seeds, sizes, sizes)
def test_a_pullback_is_the_cost_of_the_mapped_point(seed, m, n):
    rng = np.random.default_rng(seed)
    cost, f, x = quadratic(rng, m), affine(rng, m, n), rng.normal(size=n)
    assert cost.pullback(f)(x) == pytest.approx(cost(f(x)), rel=1e-9, abs=1e-9)
    assert np.allclose(cost.pullback(f).gradient(x), f.A.T @ cost.gradient(f(x)))


@given(seeds, sizes, sizes)
def test_the_cost_of_a_residual_is_half_its_weighted_square(seed, m, n):
    rng = np.random.default_rng(seed)
    f, x, r = affine(rng, m, n), rng.normal(size=n), rng.normal(size=m)
    expected = 0.5 * 2.0 * np.sum((f.A @ x - r) ** 2)
    assert fb.Quadratic.from_residual(f.A, r, 2.0)(x) == pytest.approx(expected, rel=1e-9, abs=1e-9)


@given(seeds, sizes)
def test_the_gradient_is_the_slope_of_the_cost(seed, n):
    rng = np.random.default_rng(seed)
    cost, x, step = quadratic(rng, n), rng.normal(size=n), 1e-5
    slope = [(cost(x + step * e) - cost(x - step * e)) / (2 * step) for e in np.eye(n)]
    assert np.allclose(cost.gradient(x), slope, atol=1e-6)


@given(seeds, sizes)
def test_no_point_costs_less_than_the_minimizer(seed, n):
    rng = np.random.default_rng(seed)
    cost = quadratic(rng, n)
    best = cost.minimizer()
    assert np.allclose(cost.gradient(best), 0.0, atol=1e-8)
    assert all(cost(best + rng.normal(size=n)) > cost(best) for _ in range(10))


@given(seeds, st.integers(1, 3), st.integers(4, 6))
def test_among_many_minimizers_the_smallest_is_given(seed, m, n):
    rng = np.random.default_rng(seed)
    A, r = rng.normal(size=(m, n)), rng.normal(size=m)
    expected = np.linalg.lstsq(A, r)[0]
    assert np.allclose(fb.Quadratic.from_residual(A, r).minimizer(), expected, atol=1e-6)


@pytest.mark.parametrize(("curvature", "counts"), [(1e-10, True), (1e-13, False)])
def test_what_counts_as_curvature_is_decided_in_one_place(curvature, counts):
    """A direction with at most 1e-12 of the largest curvature is flat, for the full minimum and for
    a partial one.
    """
    cost = fb.Quadratic(np.diag([1.0, curvature]), np.array([0.0, -curvature]))
    over = cost.argmin_over(np.array([[0.0], [1.0]]))
    assert np.allclose(cost.minimizer(), [0.0, float(counts)])
    assert np.allclose(cost.argmin_over(np.eye(2))([3.0, 4.0]), [0.0, 1.0 if counts else 4.0])
    # on its own, this curvature is the largest one
    assert np.allclose(over([3.0, 4.0]), [3.0, 1.0])


def test_a_partial_minimum_is_the_least_of_all_points_that_keep_the_rest():
    rng = np.random.default_rng(0)
    cost, N = quadratic(rng, 5), np.linalg.qr(rng.normal(size=(5, 2)))[0]
    best, x = cost.argmin_over(N), rng.normal(size=5)
    assert np.allclose(N @ (N.T @ (best(x) - x)), best(x) - x)
    assert all(cost(x + N @ z) >= cost(best(x)) for z in rng.normal(size=(20, 2)))
    assert np.allclose(best(best(x)), best(x))


@given(seeds, sizes, sizes)
def test_constants_and_numbers_may_stand_on_either_side_of_a_map(seed, m, n):
    rng = np.random.default_rng(seed)
    f = fb.Affine(rng.normal(size=(m, n)), rng.normal(size=m), {"all": slice(0, m)})
    x, b, B = rng.normal(size=n), rng.normal(size=m), rng.normal(size=(2, m))
    assert np.allclose((f * 2.0)(x), 2.0 * f(x))
    assert np.allclose((np.float64(3.0) * f)(x), 3.0 * f(x))
    assert np.allclose((b + f)(x), b + f(x))
    assert np.allclose((b - f)(x), b - f(x))
    assert np.allclose((list(b) + f)(x), b + f(x))
    assert np.allclose((B @ f)(x), B @ f(x))
    assert (b + f).blocks == (f * 2).blocks == f.blocks
    cost = quadratic(rng, n)
    assert (cost * 2.0)(x) == pytest.approx(2.0 * cost(x))


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda f: f * np.ones(2), (2,)),
        (lambda f: np.ones(2) * f, (2,)),
        (lambda f: f * f, ("Affine",)),
        (lambda f: np.nan * f, (np.nan,)),
        (lambda f: np.ones(3) + f, (3, 2)),
        (lambda f: f @ np.ones(2), ()),
        (lambda f: np.ones((2, 3)) @ f, (2, 3)),
        (lambda f: "2" * fb.Quadratic.zero(2), (2,)),
    ],
)
def test_sums_and_products_that_mean_nothing_are_refused(make, named):
    refused(lambda: make(fb.Affine.identity(2)), InputError, *named)


def test_a_cost_that_falls_for_ever_has_no_minimum():
    flat = fb.Quadratic(np.diag([1.0, 0.0]), np.array([1.0, 0.5]))
    refused(flat.minimizer, InputError)
    saddle = fb.Quadratic(np.diag([1.0, -1.0]), np.zeros(2))
    refused(saddle.minimizer, InputError, -1)
    assert np.array_equal(fb.Quadratic.zero(2).minimizer(), [0.0, 0.0])


def test_the_matrix_of_a_cost_is_made_symmetric_without_changing_the_cost():
    H = np.array([[1.0, 4.0], [0.0, 2.0]])
    x = np.array([1.0, -2.0])
    cost = fb.Quadratic(H, np.zeros(2))
    assert np.array_equal(cost.H, cost.H.T)
    assert cost(x) == pytest.approx(0.5 * x @ H @ x)


def test_values_share_no_array_with_what_they_were_made_of_and_keep_their_blocks():
    A, b = np.eye(2), np.zeros(2)
    f = fb.Affine(A, b)
    A[0, 0] = b[0] = 9.0
    assert np.array_equal(f([1.0, 1.0]), [1.0, 1.0])
    with pytest.raises(TypeError):
        f.blocks["tau"] = slice(0, 1)
    A, b = f
    assert A is f.A
    assert b is f.b


@pytest.mark.parametrize(
    "case",
    [
        (lambda: fb.Affine.identity(2)([1.0]), "x", 1, 2),
        (lambda: fb.Affine.identity(2) @ fb.Affine.identity(3), 3, 2),
        (lambda: fb.Affine.identity(2) + fb.Affine.identity(3), 2, 3),
        (lambda: fb.Affine.identity(2) + np.ones(1), 1, 2),
        (lambda: fb.Affine.stack(a=fb.Affine.identity(2), b=fb.Affine.identity(3)), "a", 2, "b",
            3),
        (lambda: fb.Affine.stack(),),
        (lambda: fb.Affine.stack(tau=fb.Affine.identity(1))["toe"], "toe", "tau"),
        (lambda: fb.Quadratic.zero(2) + fb.Quadratic.zero(3), 2, 3),
        (lambda: fb.Quadratic.zero(2).pullback(fb.Affine.identity(3)), 3, 2),
    ],
)  # fmt: skip
def test_shapes_that_do_not_fit_are_named(case):
    call, *named = case
    refused(call, InputError, *named)
