"""The image of a picture in a notebook: drawn without a browser, it shows the same as the page."""

import base64
import io
from contextlib import closing

import msgpack
import numpy as np
import pytest
from PIL import Image

from floatbase.robots import State, load
from floatbase.simulation import Ground
from floatbase.viewer import Viewer, shapes
from floatbase.viewer.export.thumbnail import with_thumbnail
from floatbase.viewer.scene.colours import ALARM, CALM, COM, MEASURED
from floatbase.viewer.scene.ground import displacement

from .looks import hue_pixels

KB = 1000


def image(viewer):
    """The image of a display, (height, width, 3)."""
    data, _ = viewer._repr_mimebundle_()
    opened = Image.open(io.BytesIO(base64.b64decode(data["image/png"])))
    return np.asarray(opened.convert("RGB")).astype(int)


def differing(one, other):
    """How many pixels differ to the eye."""
    return int((np.abs(one - other).max(axis=2) > 24).sum())


def test_the_image_shows_all_of_the_scene_and_a_legend(viewer, standing, contacts, forces):
    empty = image(viewer)
    robot = image(viewer.show(standing, com=False))
    assert differing(empty, robot) > 0.05 * robot[..., 0].size
    full = image(viewer.show(standing, contacts, forces, support=True, labels=True, title="title"))
    for colour in (COM, MEASURED, CALM, ALARM):
        assert hue_pixels(full, colour) > hue_pixels(robot, colour) + 50
    lower_left = np.s_[full.shape[0] // 2 :, : full.shape[1] // 4]
    assert differing(full[lower_left], robot[lower_left]) > 500


def test_near_objects_hide_far_ones(viewer):
    viewer.show(viewer.robot.standing(), com=False)
    viewer.camera("front")
    red, blue = (0.9, 0.1, 0.1), (0.1, 0.1, 0.9)
    near = shapes.rod([0.5, 0.0, 0.2], np.eye(3), 0.2, 0.08, blue)
    images = []
    for radius in (0.08, 0.4):
        far = shapes.rod([-0.5, 0.0, 0.2], np.eye(3), 0.2, radius, red)
        viewer.draw({"far": far, "near": near})
        images.append(image(viewer))
    hidden, beside = images
    assert hue_pixels(hidden, red) < 0.05 * hue_pixels(beside, red)
    assert hue_pixels(hidden, blue) > 500


def test_the_image_of_a_robot_is_small():
    with closing(Viewer(load("talos"))) as viewer:
        data, _ = viewer.show(viewer.robot.standing())._repr_mimebundle_()
    assert 5 * KB < len(data["image/png"]) < 80 * KB


def test_the_image_goes_with_a_robot_that_is_followed(go2, standing):
    down = np.array([np.cos(0.4), 0.0, -np.sin(0.4)])
    q = standing.q.copy()
    q[:3] += 2.5 * down  # a whole jump of the grid, down the slope
    with closing(Viewer(go2, ground=[-down[2], 0.0, down[0]], follow=True)) as viewer:
        at_home = image(viewer.show(standing))
        away = image(viewer.show(State(go2, q)))
    assert differing(at_home, away) < 0.02 * away[..., 0].size


def test_the_camera_rises_with_a_robot_on_stairs_and_does_not_jump_at_an_edge(viewer, standing):
    ground = Ground.stairs(2, 0.1, start=0.25, run=0.5)
    viewer.set_ground(ground)
    drawn, start = viewer.painter.drawn_ground, standing.com
    path = np.arange(0.0, 2.5, 0.01)
    rises = [displacement(drawn, start, start + [x, 0.0, 0.0])[2] for x in path]
    assert rises[0] == 0.0
    assert rises[-1] == pytest.approx(ground.height([2.4, 0.0]), abs=1e-9)
    assert np.abs(np.diff(rises)).max() < 0.005


def test_another_ground_moves_the_camera_with_the_next_picture_only(go2, standing):
    viewer = Viewer(go2, follow=True)
    q = standing.q.copy()
    q[0] += 2.5
    viewer.show(standing).show(State(go2, q))
    before = viewer.window.scene.newest
    viewer.set_ground([-0.3, 0.0, 1.0])
    assert viewer.window.scene.newest == before
    q[2] += 2.5 * 0.3
    raised = viewer.show(State(go2, q)).window.scene.since(before)[1]
    assert sum(msgpack.unpackb(command)["type"] == "set_ground" for command in raised) == 1
    viewer.close()


def test_several_pictures_of_a_panel_are_one_image(viewer, standing):
    viewer.show(standing)
    one, two = viewer.widget(), viewer.widget()
    data, _ = with_thumbnail(({}, {}), one, two)
    both = Image.open(io.BytesIO(base64.b64decode(data["image/png"])))
    assert both.width == 2 * Image.open(io.BytesIO(one.thumbnail)).width
    assert with_thumbnail(({"text/plain": "x"}, {})) == ({"text/plain": "x"}, {})


def test_of_a_panel_without_a_kernel_the_copy_of_its_scene_is_kept(viewer, standing, monkeypatch):
    monkeypatch.setenv("FLOATBASE_VIEWER", "static")
    copy = viewer.show(standing).widget()
    assert "<iframe" in copy.value
    expected = ({"text/plain": "x", "text/html": copy.value}, {})
    assert with_thumbnail(({"text/plain": "x"}, {}), copy) == expected
