"""Pictures of a state, read from the commands of the scene and not from the code that drew them."""

import dataclasses
import re
from contextlib import closing
from unittest.mock import Mock

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from messages import raises, refused
from numpy.testing import assert_allclose, assert_array_equal

from floatbase.dynamics import Contacts
from floatbase.errors import InputError, ViewerError
from floatbase.robots import State, catalogue, load
from floatbase.simulation import Ground, Simulation
from floatbase.viewer import PRESETS, Item, View, Viewer, shapes
from floatbase.viewer.scene.colours import ALARM, CALM, IDLE, WARNING

from .looks import vertices


def matrices(viewer, start):
    """Return the transforms in the scene by the rest of the path after `start`."""
    return {
        path.removeprefix(start): np.reshape(command["matrix"], (4, 4)).T
        for (path, kind, _), command in viewer.window.scene.commands().items()
        if kind == "set_transform" and path.startswith(start)
    }


def colours(viewer, start):
    """Return the colours set in the scene, without opacity."""
    return {
        path.removeprefix(start).removesuffix("/surface").removesuffix("/sides"): tuple(
            command["value"][:3]
        )
        for (path, _, name), command in viewer.window.scene.commands().items()
        if name == "color" and path.startswith(start)
    }


def paths(viewer):
    return {path for path, kind, _ in viewer.window.scene.commands() if kind == "set_object"}


def test_every_joint_is_where_the_state_says(viewer, go2):
    state = go2.random_state(3)
    viewer.show(state)
    placed = matrices(viewer, "/meshcat/robot/")
    assert len(placed) == go2.model.njoints - 1
    for name, matrix in placed.items():
        assert_allclose(matrix, state.joint_transforms[go2.model.getJointId(name)], atol=1e-6)


@pytest.mark.parametrize("factor", [0.02, 1.0, 7.0])
def test_arrows_start_at_contacts(viewer, standing, contacts, forces, factor):
    viewer.show(standing, contacts, forces=factor * forces, planned=0.5 * factor * forces)
    for kind, share in (("measured", 1.0), ("planned", 0.5)):
        arrows = matrices(viewer, f"/meshcat/{kind}/")
        assert tuple(arrows) == contacts.point_names
        for matrix, force, position in zip(
            arrows.values(), forces, contacts.positions(standing), strict=True
        ):
            expected = viewer.scale * factor * share * force
            assert_allclose(matrix[:3, 2], expected, rtol=1e-5, atol=1e-6)
            assert_allclose(matrix[:3, 3], position, atol=1e-6)


@pytest.mark.parametrize("normal", [(0, 0, 1), (0.3, -0.2, 0.9), (1, 0, 0), (0, 0, -1)])
@pytest.mark.parametrize("mu", [0.2, 0.6, 1.3])
def test_cones_open_by_mu_in_the_scale_of_the_forces(viewer, go2, standing, normal, mu):
    contacts = Contacts.points(go2, mu=mu, normals=normal)
    viewer.show(standing, contacts)
    cones = matrices(viewer, "/meshcat/cone/")
    assert len(cones) == 4
    for matrix, position in zip(cones.values(), contacts.positions(standing), strict=True):
        across, along = np.linalg.norm(matrix[:3, 0]), np.linalg.norm(matrix[:3, 2])
        assert across / along == pytest.approx(mu, rel=1e-5)
        expected = np.asarray(normal) / np.linalg.norm(normal)
        assert_allclose(matrix[:3, 2] / along, expected, atol=1e-6)
        assert_allclose(matrix[:3, 3], position, atol=1e-6)


def test_the_colour_of_a_cone_shows_where_its_force_is(viewer, standing, contacts, forces):
    expected = dict(zip(contacts.point_names, (CALM, WARNING, ALARM, CALM), strict=True))
    upwards = np.tile([0, 0, 30.0], 4)
    for shown in ({"forces": forces}, {"planned": forces}, {"forces": forces, "planned": upwards}):
        viewer.show(standing, contacts, **shown)
        assert colours(viewer, "/meshcat/cone/") == expected, shown
    viewer.show(standing, contacts, forces=-forces)
    assert set(colours(viewer, "/meshcat/cone/").values()) == {ALARM}


@pytest.mark.parametrize("facets", [None, 4])
def test_a_cone_without_a_force_is_grey(go2, standing, contacts, facets):
    up = np.tile([0.0, 0.0, go2.weight / 4], (4, 1))
    few = up * [[1.0], [0.0], [1e-4], [1.0]]  # the second in the air, the third all but
    with closing(Viewer(go2, facets=facets)) as viewer:
        for shown, expected in (
            ({}, 4 * [IDLE]),
            ({"forces": few}, [CALM, IDLE, IDLE, CALM]),
            ({"forces": 0 * up, "planned": up}, 4 * [IDLE]),  # what is measured counts
        ):
            viewer.show(standing, contacts, **shown)
            found = colours(viewer, "/meshcat/cone/")
            assert [found[name] for name in contacts.point_names] == expected


def normal_and_point(viewer):
    """Return the normal of the ground in the scene, and a point on it."""
    ground = matrices(viewer, "/meshcat/ground")[""]
    return ground[:3, 2], ground[:3, 3]


@pytest.mark.parametrize("height", [0.0, 0.3])
def test_the_ground_lies_under_the_contacts_of_a_slope(viewer, go2, height):
    slope = np.array([0.3, -0.15, 1.0]) / np.linalg.norm([0.3, -0.15, 1.0])
    state = Simulation(go2, Ground(normal=slope)).state
    q = state.q.copy()
    q[:3] += height * slope
    state, contacts = State(go2, q), Contacts.points(go2, normals=slope)
    viewer.show(state, contacts, support=True)
    normal, point = normal_and_point(viewer)
    assert_allclose(normal, slope, atol=1e-6)
    shadow = matrices(viewer, "/meshcat/com/")["projection"][:3, 3]
    for position in (*contacts.positions(state), shadow):
        assert normal @ (position - point) == pytest.approx(0.0, abs=0.006)
    corners = vertices(viewer.renderer.picture["support"])
    assert_allclose((corners - point) @ normal, 0.0, atol=0.003)


def test_the_ground_is_level_unless_contacts_lie_on_a_slope(viewer, go2, standing):
    slope = np.array([0.6, 0.0, 0.8])
    ditch = {foot.frame: [0.0, -0.4 if foot.frame[1] == "L" else 0.4, 1.0] for foot in go2.feet}
    # the last is a slope that the feet do not stand on
    for normals in ([0, 0, 1], ditch, [1, 0, 0], slope):
        viewer.show(standing, Contacts.points(go2, normals=normals))
        assert_array_equal(normal_and_point(viewer), [[0, 0, 1], [0, 0, 0]])
    viewer.set_ground(slope)
    viewer.show(standing, Contacts.points(go2))
    assert_allclose(normal_and_point(viewer)[0], slope, atol=1e-6)


def test_only_the_visible_part_of_each_side_of_a_valley_is_drawn(viewer, go2):
    ground = Ground(normal=[[0.0, -0.4, 1.0], [0.1, 0.4, 1.0]], offset=[0.1, 0.0])
    state = Simulation(go2, ground).state
    viewer.set_ground(ground)
    viewer.show(state, Contacts.points(go2), support=True)
    clearances = ground.clearances(vertices(viewer.renderer.picture["ground"]))
    assert_allclose(clearances.min(axis=1), 0.0, atol=1e-5)
    assert np.all(np.sum(clearances < 1e-5, axis=0) > 1000)
    shadow = matrices(viewer, "/meshcat/com/")["projection"][:3, 3]
    assert_allclose(shadow[:2], state.com[:2], atol=1e-6)
    assert ground.clearances(shadow).min() == pytest.approx(0.0, abs=1e-5)


def test_a_wall_is_drawn_above_the_floor_only_and_needs_a_floor(viewer, go2):
    walled = Ground(normal=[[0.0, 0.0, 1.0], [0.0, -1.0, 0.0]], offset=[0.0, -0.5])
    viewer.set_ground(walled)
    viewer.show(go2.standing(), Contacts.points(go2))
    points = vertices(viewer.renderer.picture["ground"])
    on_wall = np.abs(points[:, 1] - 0.5) < 1e-5
    assert np.ptp(points[on_wall, 2]) > 1.0 and points[:, 2].min() > -1e-5
    assert points[:, 1].max() < 0.5 + 1e-5
    with raises(InputError, "ground"):
        viewer.set_ground(Ground(normal=[0.0, 1.0, 0.0]))


def test_boxes_of_the_ground_are_drawn_with_their_sides_and_the_robot_stands_on_them(viewer, go2):
    ground = Ground.stairs(2, 0.1, start=0.0, width=1.0)
    state = Simulation(go2, ground).state
    viewer.set_ground(ground)
    viewer.show(state, Contacts.points(go2), support=True)
    points = vertices(viewer.renderer.picture["terrain/faces"])
    distances = np.abs(ground.clearances(points))
    assert np.all(distances[:, 1:].min(axis=1) < 1e-3), "every vertex lies on a box"
    for bounds in ground.box_bounds:
        low, high = bounds[0:4:2] - 1e-3, bounds[1:4:2] + 1e-3
        heights = points[np.all((points[:, :2] >= low) & (points[:, :2] <= high), axis=1), 2]
        assert heights.min() == pytest.approx(0.0, abs=1e-3)
        assert heights.max() >= bounds[4] - 1e-3
    shadow = matrices(viewer, "/meshcat/com/")["projection"][:3, 3]
    assert shadow[2] == pytest.approx(ground.height(state.com[:2]), abs=1e-5)
    viewer.set_ground(None)
    assert not any(path.startswith("terrain") for path in viewer.show(state).renderer.picture)


def test_polyhedra_highlight_their_active_facets(go2, standing, contacts):
    force = np.tile([0.0, 0.0, 40.0], (4, 1))
    force[0, 0] = 40 * 0.6 * np.cos(np.pi / 4)  # facet 0 looks along x
    force[1, :2] = -40 * 0.6 * np.cos(np.pi / 4)  # the edge between facets 2 and 3
    lit = {"FL_foot/facet 0", "FR_foot/facet 2", "FR_foot/facet 3"}
    with closing(Viewer(go2, facets=4)) as viewer:
        for forces, expected in ((force, lit), (0.5 * force + [0, 0, 20.0], set())):
            viewer.show(standing, contacts, forces=forces)
            facets = {path for path in paths(viewer) if "facet" in path}
            assert facets == {f"/meshcat/cone/{name}" for name in expected}


def test_only_given_items_are_drawn(viewer, standing, contacts, forces):
    viewer.show(standing, com=False)
    bare = paths(viewer)
    viewer.show(standing, contacts, forces=forces, planned=forces, title="full")
    full = paths(viewer)
    for part in ("/measured/", "/planned/", "/surface"):
        assert len([path for path in full if part in path]) == 4
    assert any(path.endswith("/rim") for path in full)  # of the foot whose force is outside
    assert any("/com/" in path for path in full - bare)
    viewer.show(standing, com=False)
    assert paths(viewer) == bare
    assert viewer.window.scene.commands()["/", "set_title", ""]["text"] == ""


def test_showing_twice_sends_nothing(viewer, go2, contacts, forces):
    viewer.show(go2.standing(), contacts, forces=forces, title="twice")
    newest = viewer.window.scene.newest
    viewer.show(go2.standing(), contacts, forces=forces.ravel(), title="twice")
    assert viewer.window.scene.newest == newest


def test_a_change_sends_only_what_changed(viewer, standing, contacts, forces):
    viewer.show(standing, contacts, forces=forces)
    newest = viewer.window.scene.newest
    viewer.show(standing, contacts, forces=forces + [[0, 0, 1.0]] + 0 * forces)
    # four arrows, a cone that is no longer on its surface, and its entry in the legend
    assert viewer.window.scene.newest - newest == 4 + 2


# the same few paths in many spellings, some below others
PARTS = st.lists(st.sampled_from(["a", "b", ""]), min_size=1, max_size=4)
PATHS = PARTS.map("/".join).filter(lambda path: path.strip("/"))
ITEMS = st.builds(
    Item,
    st.sampled_from([shapes.label([0.0, 0.0, 0.0], text, 0.1).shape for text in "xy"]),
    st.sampled_from([np.eye(4), np.diag([2.0, 2.0, 2.0, 1.0])]),
    st.sampled_from([None, (1.0, 0.0, 0.0, 1.0), (0.0, 1.0, 0.0, 0.5)]),
)


def scene_after(pictures):
    with closing(Viewer(load("ur5"))) as viewer:
        for picture in pictures:
            viewer.draw(picture)
        return viewer.window.scene.commands()


@settings(max_examples=30)
@given(st.lists(st.dictionaries(PATHS, ITEMS, max_size=4), min_size=1, max_size=4))
def test_a_scene_shows_the_last_picture_however_paths_are_spelt(pictures):
    assert scene_after(pictures) == scene_after(pictures[-1:])


def test_a_path_without_a_name_is_refused(viewer, standing):
    viewer.show(standing)
    before = viewer.window.scene.commands()
    for path in ("", "/", "//"):
        with raises(InputError, "path"):
            viewer.show(standing, extra={path: shapes.label([0.0, 0.0, 0.0], "x", 0.1)})
    assert viewer.window.scene.commands() == before


def test_an_interrupted_picture_is_drawn_again(viewer, standing, contacts, monkeypatch):
    viewer.show(standing)
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(viewer.window, "put", Mock(side_effect=KeyboardInterrupt))
        viewer.show(standing, contacts)
    viewer.show(standing)
    assert not any("/cone/" in path for path in paths(viewer))
    assert "/meshcat/robot/root_joint" in paths(viewer)


def test_the_scale_bar_is_as_long_as_the_force_on_its_label(viewer, standing, contacts):
    viewer.show(standing, contacts)
    label = viewer.painter.picture(standing, contacts)["scale/label"].shape.name
    force = float(re.fullmatch(r"([\d.]+) N", label)[1])
    assert np.linalg.norm(matrices(viewer, "/meshcat/scale/bar")[""][:3, 2]) == pytest.approx(
        viewer.scale * force, rel=1e-5
    )


def legend(viewer):
    return [text for _, text, _ in viewer.window.scene.commands()["/", "set_legend", ""]["items"]]


def test_the_legend_explains_what_is_shown(viewer, standing, contacts, forces):
    everything = {"planned": forces, "support": True, "ghost": standing}
    viewer.show(standing, contacts, forces, push=("base", [0, 30.0, 0]), **everything)
    kinds = ("force inside", "surface reached", "force outside (rim)")
    cone = [f"friction cone: {kind}" for kind in kinds]
    assert legend(viewer) == [
        "measured force", "planned force", "centre of mass", "push", *cone, "support polygon",
        "desired posture",
    ]  # fmt: skip
    viewer.show(standing, contacts, forces * [0.0, 0.0, 1.0], com=False)
    assert legend(viewer) == ["measured force", cone[0]]
    viewer.show(standing, com=False)
    assert legend(viewer) == []


def test_forces_that_are_not_drawn_still_colour_their_cones(viewer, standing, contacts, forces):
    def cones():
        items = viewer.renderer.picture.items()
        return {path: item.colour for path, item in items if path.startswith("cone/")}

    viewer.show(standing, contacts, forces)
    seen = cones()
    viewer.show(standing, contacts, forces, arrows=False)
    assert cones() == seen and len(set(seen.values())) > 1
    assert not any(path.startswith(("measured", "planned")) for path in viewer.renderer.picture)


def test_a_view_chosen_before_the_first_picture_is_kept(go2, standing):
    def eye(view):
        return list(view.window.scene.commands()["/", "set_camera", ""]["position"])

    view = Viewer(go2).camera("left").show(standing)
    first = eye(view)
    assert first == pytest.approx(eye(view.camera("left")), abs=1e-6)
    assert eye(view.camera("default")) != pytest.approx(first, abs=0.1)
    view.close()


def test_only_a_call_of_camera_moves_the_camera_again(viewer, go2, standing):
    def looked():
        return viewer.window.scene.since(0)[0]

    viewer.show(standing)
    for view in ("front", "front", View(30.0), View(30.0)):
        before = looked()
        viewer.camera(view)
        assert looked() == before + 3  # where from, whether it follows, and the presets there
    before = looked()
    viewer.show(standing)
    assert looked() == before


def test_cones_at_the_corners_of_a_flat_foot_are_small_but_open_by_mu(talos):
    contacts = Contacts.flat_feet(talos, mu=0.7)
    corners = contacts.positions(talos.standing())[:4]
    nearest = min(np.linalg.norm(a - b) for i, a in enumerate(corners) for b in corners[:i])
    with closing(Viewer(talos)) as view:
        view.show(talos.standing(), contacts)
        cones = matrices(view, "/meshcat/cone/")
    assert len(cones) == 8
    for matrix in cones.values():
        across, along = np.linalg.norm(matrix[:3, 0]), np.linalg.norm(matrix[:3, 2])
        assert across < 0.5 * nearest and across / along == pytest.approx(0.7, rel=1e-5)


def test_the_centre_of_mass_is_drawn_where_it_is_and_on_the_ground(viewer, go2):
    state = go2.random_state(1)
    viewer.show(state)
    drawn = matrices(viewer, "/meshcat/com/")
    assert_allclose(drawn["ball"][:3, 3], state.com, atol=1e-6)
    assert_allclose(drawn["projection"][:3, 3], [*state.com[:2], 0.0], atol=1e-6)


def test_every_robot_is_shown_from_every_side_in_a_scale_of_round_numbers():
    for robot in map(load, catalogue()):
        with closing(Viewer(robot)) as viewer:
            viewer.show(robot.standing())
            parts = [path for path in paths(viewer) if "/robot/" in path]
            assert 1 <= len(parts) <= robot.model.njoints, robot.name
            eyes = set()
            for view in PRESETS:
                viewer.camera(view)
                eyes.add(tuple(viewer.window.scene.commands()["/", "set_camera", ""]["position"]))
            assert len(eyes) == len(PRESETS), robot.name
            rounded = float(f"{viewer.scale:.0e}")
            assert f"{rounded:e}"[0] in "125" and rounded == pytest.approx(viewer.scale)


def test_the_name_of_a_robot_is_text_in_the_notebook(go2):
    view = Viewer(dataclasses.replace(go2, name='a "<b>"'))
    assert view.widget().name == 'a "<b>"'
    view.close()
    assert 'title="a &quot;&lt;b&gt;&quot;"' in view._repr_mimebundle_()["text/html"]


def test_wrong_input_is_refused_by_name(viewer, go2, standing, contacts):
    other, locked = load("solo12").standing(), load("go2", locked=["FL_hip_joint"]).standing()
    for wrong, *named in (
        (lambda: viewer.show(other), "go2", "solo12"),
        (lambda: viewer.show(locked), "go2", 12, 11),
        (lambda: viewer.show(standing, ghost=locked), "go2", 12, 11),
        (lambda: viewer.show(standing.q), "state", "State", 19),
        (lambda: viewer.show(standing, forces=np.zeros(12)), "forces", "contacts"),
        (lambda: viewer.show(standing, contacts, np.zeros(9)), "forces", 9, 12),
        (lambda: viewer.show(standing, contacts, planned=np.full(12, np.nan)), "planned", np.nan),
        (lambda: viewer.show(standing, ground_position=[0.0, 1.0]), "ground_position", 3, 2),
        (lambda: viewer.camera("above"), "above", "front"),
        (lambda: viewer.camera(90.0), 90, "View"),
        (lambda: Viewer(go2, background="pink"), "background", "pink", "white", "light", "dark"),
        (lambda: Viewer(go2, ground=[1, 0, 0]), "ground", 1),
        (lambda: Viewer(go2, facets=2), "facets", 2),
    ):
        refused(wrong, InputError, *named)
    viewer.close()
    refused(lambda: viewer.show(standing), ViewerError)
