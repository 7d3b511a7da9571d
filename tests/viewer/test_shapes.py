"""Markers, props and figures: their numbers, from the items themselves, and their pictures."""

from itertools import combinations, pairwise

import matplotlib.pyplot as plt
import numpy as np
import pytest
from messages import raises, refused
from numpy.testing import assert_allclose

from floatbase.control import WholeBodyController
from floatbase.dynamics import Contacts
from floatbase.errors import InfeasibleError, InputError
from floatbase.friction import FrictionPolyhedron, wrench_set
from floatbase.lessons import FIGURES, props
from floatbase.objectives import CoMTask, standing_tasks
from floatbase.qp import Solution
from floatbase.viewer import markers, shapes
from floatbase.viewer.plots import push_recovery_plots
from floatbase.viewer.scene import geometry
from floatbase.viewer.scene.colours import CONE, GREYS, MEASURED, PLANNED


@pytest.mark.parametrize(
    ("mesh", "volume"),
    [
        (geometry.sphere(1.0), 4 / 3 * np.pi),
        (geometry.cylinder([0, 0, 0], [1, 2, 2], 0.5), 0.75 * np.pi),
        (geometry.surface_of_revolution([(0, 0), (1, 0), (1, 1), (0, 1)]), np.pi),
        (geometry.surface_of_revolution([(0, 0), (1, 1), (0, 1)]), np.pi / 3),
    ],
    ids=["ball", "rod", "cylinder", "cone"],
)
def test_closed_meshes_face_outwards_and_have_their_volume(mesh, volume):
    vertices, faces = mesh
    a, b, c = (vertices[faces[:, i]].astype(float) for i in range(3))
    assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6 == pytest.approx(volume, rel=0.06)


@pytest.mark.parametrize(
    "direction", [(0, 0, 1), (0, 0, -1), (1, 0, 0), (0.6, 0, -0.8), (-0.36, 0.48, 0.8)]
)
def test_rotation_with_z_axis_is_a_rotation_with_that_z_axis(direction):
    turned = geometry.rotation_with_z_axis(direction)
    assert_allclose(turned[:, 2], direction, atol=1e-12)
    assert_allclose(turned @ turned.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(turned) == pytest.approx(1.0)


def test_the_curled_arrow_turns_around_the_moment_with_its_radius():
    moment = np.array([0.1, -0.2, 0.2])
    item = markers.curled_arrow([1.0, 2.0, 3.0], moment)
    assert np.linalg.norm(item.matrix[:3, 2]) == pytest.approx(0.3)
    assert_allclose(item.matrix[:3, 2], moment)
    assert np.linalg.det(item.matrix[:3, :3]) > 0


NAN = float("nan")


@pytest.mark.parametrize(
    "case",
    [
        (lambda: shapes.arrow([0, 0, 0], [0, 0, 0], MEASURED), "arrow"),
        (lambda: shapes.arrow([0, 0, 0], [0, NAN, 1], MEASURED), "vector", NAN),
        (lambda: shapes.arrow([0, 0, 0], [0, 1], MEASURED), "vector", 2, 3),
        (lambda: shapes.arrow([NAN, 0, 0], [0, 0, 1], MEASURED), "position", NAN),
        (lambda: shapes.arrow([0, 0], [0, 0, 1], MEASURED), "position", 2, 3),
        (lambda: shapes.friction_cone([0, 0, 0], [0, 0, 1], 0.0, 1.0, "inside"), "mu", 0),
        (lambda: shapes.friction_cone([0, 0, 0], [0, 0, 1], 0.5, NAN, "inside"), "height", NAN),
        (lambda: shapes.contact_patch([0, 0, 0], [0, 0, 1], -1.0), "radius", -1),
        (lambda: shapes.label([0, 0, 0], "x", 0.0), "height", 0),
        (lambda: shapes.label([0, 0, NAN], "x", 0.1), "position", NAN),
        (lambda: shapes.rod([0, 0, 0], np.eye(3), 0.0, 0.1, MEASURED), "length", 0),
        (lambda: shapes.transform([0, 0, 0], np.eye(3) * NAN), "rotation", NAN),
        (lambda: shapes.flat_polygon([[0, 0, 0], [1, 0, 0]], MEASURED, 0.5), "corners", 2),
        (lambda: markers.curled_arrow([0, 0, 0], [0, 0, 0]), "arrow"),
        (lambda: markers.frame_axes(np.eye(3), 0.1), "pose", 3, 4),
        (lambda: markers.frame_axes(np.eye(4), 0.0), "length", 0),
        (lambda: props.wheel([0, 0, 0], [0, 0, 0], 0.1, 0.0), "axis"),
        (lambda: props.wheel([0, 0, 0], [0, 1, 0], 0.0, 0.0), "radius", 0),
        (lambda: props.turntable([0, 0, 0], 0.0, 0.0), "radius", 0),
        (lambda: props.hydraulic_cylinder([0, 0, 0], [0, 0, 0], (0.1, 0.2)), "cylinder"),
        (lambda: props.hydraulic_cylinder([0, 0, 0], [0, 0, 1], (0.2, 0.1)), "stroke", 0.2, 0.1),
        (lambda: props.wall([0, 0, 0], [0, 0, 1], 1, 1), "normal"),
        (lambda: props.wall([0, 0, 0], [1, 0, 0], 0, 1), "width", 0),
        (lambda: props.bolts([0, 0, 0], 0.0), "radius", 0),
    ],
)
def test_invalid_shapes_are_refused_by_name(case):
    draw, *named = case
    refused(draw, InputError, *named)


def test_a_push_ends_where_it_acts():
    item = markers.push([1.0, 0.0, 0.5], [0.0, 0.2, 0.0], 1.0)
    assert_allclose(item.matrix[:3, 3] + item.matrix[:3, 2], [1.0, 0.0, 0.5])


def test_two_points_have_no_support_polygon():
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0]], dtype=float)
    assert set(markers.support_region(square, 0.0)) == {""}
    assert markers.support_region(square[:2], 0.0) == {}
    assert markers.support_region(np.outer(np.arange(4.0), [1.0, 2.0, 0.0]), 0.0) == {}


def test_a_wheel_that_rolls_forward_turns_its_mark_forward():
    # about +y, a quarter turn takes the mark from the top to the front
    start, quarter = (
        props.wheel([0, 0, 1], [0, 1, 0], 1.0, angle).matrix[:3, 0] for angle in (0.0, np.pi / 2)
    )
    assert_allclose(start, [0, 0, 1], atol=1e-12)
    assert_allclose(quarter, [1, 0, 0], atol=1e-12)


def test_a_turntable_turns_to_the_left_below_its_given_top():
    table = props.turntable([1, 0, 0.5], 0.4, np.pi / 2).matrix
    assert_allclose(table @ [1, 0, 0, 1], [1, 0.4, 0.5, 1], atol=1e-12)
    assert_allclose(table[:3, 2], [0, 0, 0.4], atol=1e-12)


def test_the_cylinders_rod_reaches_its_end_and_its_piston_moves_with_it():
    def middle(length):
        items = props.hydraulic_cylinder([0, 0, 0], [0, 0, length], (0.3, 0.5))
        rod = items["/rod"].matrix
        assert rod[2, 3] + rod[2, 2] == pytest.approx(length)
        assert items["/base chamber"].matrix[2, 2] + items["/rod chamber"].matrix[
            2, 2
        ] == pytest.approx(0.92 * 0.3)
        return float(items["/piston"].matrix[2, 3])

    assert middle(0.45) - middle(0.40) == pytest.approx(0.05)


CONE_KINDS = [CONE[kind] for kind in ("inside", "active", "outside")]


# Machado, Oliveira, Fernandes (2009), severity 1
DEFICIENCIES = {
    "protanopia": np.array(
        [[0.152, 1.053, -0.205], [0.115, 0.786, 0.099], [-0.004, -0.048, 1.052]]
    ),
    "deuteranopia": np.array(
        [[0.367, 0.861, -0.228], [0.280, 0.673, 0.047], [-0.012, 0.043, 0.969]]
    ),
    "tritanopia": np.array(
        [[1.256, -0.077, -0.179], [-0.078, 0.931, 0.148], [0.005, 0.691, 0.304]]
    ),
}


def test_colours_are_distinct_for_colour_blind_readers():
    pairs = [
        (MEASURED, PLANNED), (GREYS[1], PLANNED), *combinations(CONE_KINDS, 2), *pairwise(GREYS)
    ]  # fmt: skip
    for name, deficiency in DEFICIENCIES.items():
        for pair in pairs:
            one, other = (np.clip(deficiency @ colour[:3], 0, 1) for colour in pair)
            assert np.linalg.norm(one - other) > 0.2, name


def test_horizontal_force_limits_are_plotted(standing, contacts):
    plot = push_recovery_plots.plot_horizontal_force_limits
    wrenches = wrench_set(standing, contacts)
    forces = wrenches.max_horizontal_forces(8)[1]
    axis = plot(wrenches, n=8)
    assert_allclose(axis.get_lines()[0].get_ydata(), [*forces, forces[0]])
    plt.close(axis.figure)
    inwards = {name: [0.0, -1.0 if name[1] == "L" else 1.0, 0.1] for name in contacts.names}
    walls = Contacts.points(standing.robot, normals=inwards)
    endless = wrench_set(standing, walls, inner_approximation=False, facets=8)
    refused(lambda: plot(endless, n=8), InputError, "max_normal_force")
    one_foot = wrench_set(standing, contacts.only("FL_foot"))
    refused(lambda: plot(one_foot), InfeasibleError)


@pytest.mark.parametrize(("facets", "turn"), [(4, 0.0), (5, 0.4)])
def test_multipliers_are_at_the_middle_of_their_facets(viewer, go2, standing, facets, turn):
    slopes = {foot.frame: [0.2, -0.1 if foot.frame[1] == "L" else 0.3, 1.0] for foot in go2.feet}
    contacts = Contacts.points(go2, mu=0.6, normals=slopes)
    task = CoMTask(standing.com + [0.0, 0.05, 0.0], acceleration=[4.0, 3.0, 0.0])
    tasks = [task, *standing_tasks(standing)[1:]]
    options = {"facets": facets, "facet_rotation": turn, "min_normal_force": 20.0}
    controller = WholeBodyController(go2, contacts, tasks, backend="reference", **options)
    answer = controller(standing.q, standing.v).solution
    picture = viewer.multiplier_labels(standing, contacts, answer)
    shown = {name: price for name, price in answer.multipliers.items() if "torque" not in name}
    shown = {name: price for name, price in shown.items() if price > 0.01 * max(shown.values())}
    assert {path.removeprefix("multiplier/") for path in picture} == set(shown)
    assert {"friction"} < {name.kind for name in shown}
    height = viewer.painter.cone_height(contacts)
    for name, price in shown.items():
        i = contacts.point_names.index(name.owner)
        expected = contacts.normals[i]
        if name.kind == "friction":
            rays = FrictionPolyhedron(expected, 0.6, facets, facet_rotation=turn).rays
            expected = (rays[name.number - 1] + rays[name.number]) / 3
        label = picture[f"multiplier/{name}"]
        arm = label.matrix[:3, 3] - contacts.positions(standing)[i]
        assert_allclose(arm, height * expected, atol=1e-9)
        assert float(label.shape.name) == pytest.approx(price, rel=0.05)
    with raises(InputError, "contacts", "solution"):
        viewer.multiplier_labels(standing, contacts.only("FL_foot"), answer)


def test_a_relatively_small_multiplier_has_no_label(viewer, standing):
    contacts = Contacts.points(standing.robot)
    qp = WholeBodyController(standing.robot, contacts, standing_tasks(standing)).qp(standing)
    mu = np.zeros(len(qp.G))
    mu[[0, 1, 2]] = 1e4, 90.0, 110.0  # of FL's facets
    picture = viewer.multiplier_labels(
        standing, contacts, Solution(qp, np.zeros(qp.n), mu, "made up")
    )
    assert set(picture) == {"multiplier/FL_foot facet 0", "multiplier/FL_foot facet 2"}


def test_figure_1_adds_up():
    """The force f_c is the sum of the f_i, and the bolts' moment balances the wall's force."""
    right, left = (FIGURES[f"figure_1_{side}"]() for side in ("right", "left"))
    drawn = right.renderer.picture
    feet = [item.matrix[:3, 2] for path, item in drawn.items() if path.startswith("measured/")]
    assert_allclose(drawn["wrench/force"].matrix[:3, 2], np.sum(feet, axis=0), atol=1e-9)
    force, ring = left.renderer.picture["f/wall"].matrix, left.renderer.picture["f/base"].matrix
    balance = -np.cross(force[:3, 3], force[:3, 2])
    cosine = ring[:3, 2] @ balance / (np.linalg.norm(ring[:3, 2]) * np.linalg.norm(balance))
    assert cosine == pytest.approx(1.0)
    right.close(), left.close()


def test_no_path_of_a_picture_lies_below_another(viewer, go2, standing, contacts):
    forces = np.tile([20.0, 0.0, 30.0], (4, 1))
    drawn = viewer.painter.picture(
        standing, contacts, forces, forces, support=True, wrench=np.ones(6),
        push=("base", [0, 9.0, 0]), ghost=standing,
        frames=["base"], labels=True,
    )  # fmt: skip
    paths = sorted(drawn)
    assert not [(a, b) for a in paths for b in paths if b.startswith(a + "/")]
