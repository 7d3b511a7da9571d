"""Plots of quadratic programs in the plane agree with their constraints and costs."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from messages import raises

from floatbase.errors import InfeasibleError, InputError, UnknownNameError
from floatbase.lessons import qp_plots
from floatbase.lessons.lessonC import table_top
from floatbase.qp import QP, solve

BOX = (-3.0, 3.0, -2.0, 3.0)
NONE = np.zeros((0, 2)), np.zeros(0)


def qp_of(H, g, G, h):
    """A QP of two variables without equalities."""
    G = np.reshape(G, (-1, 2))
    return QP(np.asarray(H), np.asarray(g), *NONE, G, np.asarray(h))


def random_qp(seed):
    rng = np.random.default_rng(seed)
    rows = int(rng.integers(1, 7))
    g, G, h = rng.normal(size=2), rng.normal(size=(rows, 2)), rng.uniform(-0.3, 2.0, rows)
    return QP(np.eye(2), g, *NONE, G, h)


@pytest.mark.parametrize("seed", range(20))
def test_the_feasible_polygon_is_the_part_of_the_box_within_the_constraints(seed):
    qp = random_qp(seed)
    corners = qp_plots.feasible_polygon(qp, BOX)
    assert np.all(corners @ qp.G.T <= qp.h + 1e-9)
    sides = np.roll(corners, -1, axis=0) - corners
    for point in np.random.default_rng(seed).uniform([BOX[0], BOX[2]], [BOX[1], BOX[3]], (200, 2)):
        inside = bool(np.all(qp.G @ point <= qp.h))
        to = point - corners
        turns = sides[:, 0] * to[:, 1] - sides[:, 1] * to[:, 0]  # all to the left of the sides
        assert inside == (len(corners) > 2 and bool(np.all(turns >= 0.0)))


def test_infeasible_constraints_have_no_polygon():
    qp = qp_of(np.eye(2), [0, 0], [[1, 0], [-1, 0]], [-1, -1])
    assert len(qp_plots.feasible_polygon(qp, BOX)) == 0


@pytest.mark.parametrize("seed", range(20))
def test_normals_times_multipliers_add_up_to_the_negative_gradient(seed):
    qp = random_qp(seed)
    try:
        x = solve(qp).x
    except InfeasibleError:
        pytest.skip("no feasible point")
    axis = qp_plots.plot_optimum(qp, BOX)
    *normals, gradient = [text for text in axis.texts if text.arrow_patch is not None]
    ends = [np.array([arrow.xyann, arrow.xy]) for arrow in normals]
    tip = ends[-1][1] if ends else x
    assert np.allclose(gradient.xyann, x) and np.allclose(gradient.xy, tip, atol=1e-6)
    for (start, _), (_, end) in zip(ends[1:], ends, strict=False):
        assert np.allclose(start, end)
    plt.close("all")


def test_a_level_curve_has_one_value_of_the_cost():
    H = np.array([[2.0, 0.5], [0.5, 1.0]])
    flat = qp_of(np.diag([1.0, 0.0]), [0.0, 0.0], [], [])
    for qp in (qp_of(H, [1.0, -0.5], [], []), table_top(), flat):
        axis = qp_plots.plot(qp, BOX)
        curves = [path for path in axis.collections[0].get_paths() if len(path.vertices)]
        spread = [np.ptp([qp.objective(point) for point in path.vertices]) for path in curves]
        assert len(curves) >= 5
        high = max(qp.objective(point) for path in curves for point in path.vertices)
        assert max(spread) < 0.05 * (1.0 + abs(high))
    plt.close("all")


def test_only_problems_in_the_plane_are_accepted():
    with raises(InputError, "QP", 3):
        none = np.zeros((0, 3)), np.zeros(0)
        qp_plots.plot(QP(np.eye(3), np.zeros(3), *none, *none))
    with raises(InputError, "QP", 2, 1):
        qp_plots.plot(QP(np.eye(2), np.zeros(2), np.eye(1, 2), np.zeros(1), *NONE))
    with raises(UnknownNameError, "tabel", "table"):
        qp_plots.plot(table_top(), working_set=["tabel"])
    with raises(InputError, "box", 1, -1, 0, 2):
        qp_plots.plot(table_top(), (1.0, -1.0, 0.0, 2.0))
