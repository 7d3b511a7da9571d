"""Drawing into the page of a stock meshcat server."""

import base64
import re
from itertools import count

import meshcat
import msgpack
import numpy as np
import pytest
from example_robot_data import load as load_example
from meshcat.geometry import Box
from messages import raises
from numpy.testing import assert_allclose
from pinocchio.visualize import MeshcatVisualizer
from waiting import until

import floatbase as fb
from floatbase.errors import InputError, ViewerError

from .looks import SMALL, WHERE, eventually

STORED = re.compile(r'octet-binary;base64,([^"]+)"')
ROOT = "/meshcat/floatbase"


@pytest.fixture
def vis():
    opened = meshcat.Visualizer()
    opened["theirs"].set_object(Box([0.1, 0.2, 0.3]))
    yield opened
    opened.window.server_proc.kill()
    opened.window.server_proc.wait()


@pytest.fixture
def view(go2, vis):
    opened = fb.Viewer(go2, meshcat=vis)
    yield opened
    opened.close()


def stored(vis, kind, root=ROOT):
    """Return the commands of a kind that the server sends to a page that opens now."""
    scene = [msgpack.unpackb(base64.b64decode(x)) for x in STORED.findall(vis.static_html())]
    of_kind = [one for one in scene if one["type"] == kind and one["path"].startswith(root)]
    return [one | {"path": one["path"].removeprefix(root)} for one in of_kind]


def matrices(vis, root=ROOT):
    return {one["path"]: one["matrix"] for one in stored(vis, "set_transform", root)}


def base_x(vis):
    """Return where the server has the robot, or nowhere."""
    return matrices(vis).get("/robot/root_joint", [np.nan] * 13)[12]


def moved(state, x):
    return state.replace(q=state.q + np.eye(len(state.q))[0] * x)


def test_a_stock_server_has_the_same_picture_below_a_path_of_its_own(
    view, vis, go2, standing, contacts, forces
):
    theirs = stored(vis, "set_object", "/meshcat/theirs")
    left = fb.Viewer(go2, meshcat=vis["left"])
    left.show(moved(standing, 1.0), contacts, forces)
    left.close()
    view.show(standing, contacts, forces, labels=True, title="in our own page only")
    drawn = view.renderer.picture
    until(lambda: len(matrices(vis)) == len(drawn))
    for path, matrix in matrices(vis).items():
        assert_allclose(np.reshape(matrix, (4, 4)).T, drawn[path[1:]].matrix, atol=1e-6)
    shapes = {one["path"][1:]: one["object"] for one in stored(vis, "set_object")}
    assert shapes.keys() == drawn.keys()
    assert shapes["label/FL_foot"]["images"][0]["url"]["data"].data
    assert {x["path"][1:]: tuple(x["value"]) for x in stored(vis, "set_property")} == {
        path: pytest.approx(item.colour) for path, item in drawn.items() if item.colour
    }
    view.show(standing, contacts, forces, com=False, robot=False)
    until(lambda: not {"/com/ball", "/robot/root_joint"} & matrices(vis).keys())
    assert stored(vis, "set_object", "/meshcat/theirs") == theirs
    assert matrices(vis, "/meshcat/left/floatbase")["/robot/root_joint"][12] == 1.0


def test_a_servers_scene_does_not_grow_while_colours_change(view, vis, standing, contacts, forces):
    view.show(standing, contacts, forces)
    until(lambda: len(stored(vis, "set_property")) == 4)
    for k in range(6):
        view.show(moved(standing, k), contacts, forces * [0.1 + 3 * (k % 2), 1, 1])
        until(lambda k=k: base_x(vis) == k)
    colours = {x["path"][1:]: pytest.approx(x["value"]) for x in stored(vis, "set_property")}
    assert len(stored(vis, "set_property")) == 4
    assert colours == {path: list(view.renderer.picture[path].colour) for path in colours}


def test_the_last_picture_arrives_however_fast_pictures_are_drawn(view, vis, standing):
    for k in range(400):
        view.show(moved(standing, k))
    view.close()
    assert base_x(vis) == 399.0


def test_a_run_plays_at_its_speed_until_the_next_picture(view, vis, go2, standing, contacts):
    controller = fb.WholeBodyController(go2, contacts, fb.standing_tasks(standing))
    push = fb.Push([0.0, 60.0, 0.0], start=0.05, duration=0.1)
    run = fb.rollout(fb.Simulation(go2), controller, 0.2, pushes=[push])
    ball = fb.viewer.shapes.centre_of_mass([0.0, 0.0, 0.0], 0.0, 1.0)["/ball"]
    view.play_pictures([0.0, 1.0], [{"ball": ball}, {}])
    until(lambda: stored(vis, "set_animation"))
    view.play(run, speed=0.5)
    until(
        lambda: "/push" in matrices(vis) and len(stored(vis, "set_animation")[0]["animations"]) > 1
    )
    (animation,) = stored(vis, "set_animation", "")
    paths = {clip["path"].removeprefix(ROOT) for clip in animation["animations"]}
    assert {"/robot/root_joint", "/push"} <= paths <= matrices(vis).keys()
    assert {clip["clip"]["fps"] for clip in animation["animations"]} == {0.5}
    last = list(STORED.findall(vis.static_html()))[-1]  # after the objects that it animates
    assert msgpack.unpackb(base64.b64decode(last))["type"] == "set_animation"
    view.show(moved(standing, 2.0))
    until(lambda: base_x(vis) == 2.0)
    assert stored(vis, "set_animation")[0]["animations"] == []


def test_a_server_that_waits_for_a_browser_is_no_failure_and_one_that_has_ended_is(
    view, vis, standing
):
    view.show(moved(standing, 1.0))
    until(lambda: base_x(vis) == 1.0)  # it is connected
    vis.window.zmq_socket.send(b"wait")  # as `vis.wait()` does, which returns when a page opens
    view.show(moved(standing, 2.0))
    vis.window.server_proc.kill()
    steps = count(3.0)
    with raises(ViewerError, vis.window.zmq_url):
        until(lambda: not view.show(moved(standing, next(steps))))


def test_what_is_no_visualizer_is_refused(go2):
    for wrong in ("tcp://127.0.0.1:6000", meshcat.Visualizer, 6000):
        with raises(InputError, "meshcat", "Visualizer"):
            fb.Viewer(go2, meshcat=wrong)


@pytest.mark.front_end
def test_forces_are_at_the_feet_of_pinocchios_robot_and_runs_play_in_a_browser(
    tab, view, vis, standing, contacts, forces
):
    example = load_example("go2")
    viz = MeshcatVisualizer(example.model, example.collision_model, example.visual_model)
    viz.initViewer(viewer=vis, loadModel=True)
    viz.display(standing.q)
    view.show(standing, contacts, forces, robot=False)
    tab.set_viewport_size(SMALL)
    tab.goto(vis.url())
    number = "Object.keys(viewer.scene_tree.find(['meshcat', 'floatbase', 'measured']).children)"
    eventually(tab, lambda: len(tab.evaluate(number)) == 4)
    for name, position in zip(contacts.point_names, contacts.positions(standing), strict=True):
        drawn = tab.evaluate(WHERE, f"meshcat/floatbase/measured/{name}")
        assert_allclose(drawn, position, atol=1e-5)
    foot = tab.evaluate(WHERE, "meshcat/pinocchio/visuals/FL_foot_0")
    assert_allclose(foot, standing.frame_pose("FL_foot").translation, atol=1e-5)

    pictures = [view.painter.picture(moved(standing, x), labels=True) for x in (0.0, 1.0)]
    view.play_pictures([0.0, 1.0], pictures, speed=0.5)
    for _ in range(2):  # a page that is open, and one that opens later
        eventually(tab, lambda: tab.evaluate("viewer.animator.playing && viewer.animator.time > 0"))
        assert tab.evaluate("viewer.animator.duration") == pytest.approx(2.0)
        at = f"viewer.animator.pause(); ({WHERE})('meshcat/floatbase/robot/root_joint')[0]"
        eventually(tab, lambda at=at: 0.0 < tab.evaluate(at) < 1.0)
        tab.reload()
