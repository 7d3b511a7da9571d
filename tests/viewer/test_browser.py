"""A real browser looks at the page. Screenshots go to build/screenshots."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from floatbase.dynamics import Contacts
from floatbase.robots import Robot, State, catalogue, load
from floatbase.viewer import ALARM, CALM, COM, MEASURED, WARNING, X_AXIS, Viewer, Window, wire

from .looks import WHERE, hue_pixels, picture, settle


def test_robot_arrows_and_cones_are_in_the_page(
    page, viewer: Viewer, go2: Robot, standing: State, contacts: Contacts, forces: np.ndarray
) -> None:
    viewer.show(standing, contacts, forces=forces, title="go2 stands")
    page.goto(viewer.url)
    settle(page, viewer)
    tree = page.evaluate(
        "Object.fromEntries(Object.entries(viewer.scene_tree.children.meshcat.children)"
        ".map(([name, node]) => [name, Object.keys(node.children).length]))"
    )
    assert tree["robot"] == 13
    assert tree["measured"] == tree["cone"] == tree["patch"] == 4
    for name, position in zip(contacts.point_names, contacts.positions(standing), strict=True):
        np.testing.assert_allclose(page.evaluate(WHERE, f"meshcat/measured/{name}"), position, atol=1e-5)
    assert page.evaluate("document.getElementById('title').textContent") == "go2 stands"
    image = picture(page, "go2_standing")
    for colour in (MEASURED, CALM, WARNING, ALARM, COM):
        assert hue_pixels(image, colour) > 100
    background = image[5, 300]
    robot_rows, robot_columns = np.nonzero(np.abs(image - background).sum(axis=2) > 150)
    assert np.ptp(robot_columns) > 300 and np.ptp(robot_rows) > 250


def test_the_page_follows_and_forgets(page, viewer: Viewer, standing: State, contacts: Contacts, forces: np.ndarray) -> None:
    viewer.show(standing, contacts, forces=forces)
    page.goto(viewer.url)
    settle(page, viewer)
    viewer.show(standing, com=False)
    page.wait_for_function("Object.keys(viewer.scene_tree.children.meshcat.children.measured.children).length == 0")
    page.wait_for_function("!viewer.needs_render")
    image = picture(page, "go2_bare")
    for colour in (MEASURED, WARNING, ALARM, COM):
        assert hue_pixels(image, colour) < 30


def test_the_page_comes_back_when_the_window_does(page, go2: Robot) -> None:
    first = Window()
    page.goto(first.web_url)
    first.wait()
    first.close()
    page.wait_for_function("getComputedStyle(document.getElementById('notice')).display == 'block'")
    with Window(port=first.port) as second:
        second.put([wire.page_command("set_title", text="back again")])
        second.wait(timeout=10)
        assert second.browsers == 1
        page.wait_for_function("document.getElementById('title').textContent == 'back again'")
        assert page.evaluate("getComputedStyle(document.getElementById('notice')).display") == "none"


def test_pushes_and_frames_are_seen_through_the_robot_and_its_ghost(page, viewer: Viewer, go2: Robot, standing: State) -> None:
    page.goto(viewer.url)
    q = standing.q.copy()
    q[2] += 0.05
    seen = []
    for ghost in (None, State(go2, q)):
        for name, parts in (("push", {"push": ("base", [0.0, 60.0, 0.0])}), ("frame", {"frames": ["base"]})):
            shots = []
            for title, more in ((f"no {name}", {}), (name, parts)):
                viewer.show(standing, com=False, ghost=ghost, title=title, **more)
                page.wait_for_function(f"document.querySelector('#title').textContent == '{title}' && !viewer.needs_render")
                shots.append(picture(page, f"{title}{' and ghost' if ghost else ''}".replace(" ", "_")))
            before, after = shots
            seen.append(dark_pixels(after - before, after) if name == "push" else hue_pixels(after, X_AXIS))
    assert seen[0] > 200 and seen[2] > 0.9 * seen[0]
    assert seen[1] > 50 and seen[3] > 0.9 * seen[1]


def test_the_camera_moves_when_it_is_called_and_not_when_a_picture_is_drawn(page, viewer: Viewer, standing: State) -> None:
    eye = "viewer.camera.position.toArray()"

    def told(title: str) -> list[float]:
        """Where the page looks from once it has the title."""
        viewer.show(standing, title=title)
        page.wait_for_function(f"document.querySelector('#title').textContent == '{title}' && !viewer.needs_render")
        return page.evaluate(eye)

    viewer.show(standing).camera("front")
    page.goto(viewer.url)
    settle(page, viewer)
    front = page.evaluate(eye)
    page.mouse.move(450, 200)
    page.mouse.down()
    page.mouse.move(600, 260, steps=4)
    page.mouse.up()
    turned = page.evaluate(eye)
    assert np.linalg.norm(np.subtract(turned, front)) > 0.3
    np.testing.assert_allclose(told("turned by the reader"), turned, atol=1e-6)
    viewer.camera("front")
    np.testing.assert_allclose(told("front again"), front, atol=1e-6)
    viewer.camera("left")
    left = told("left")
    page.reload()
    settle(page, viewer)
    np.testing.assert_allclose(page.evaluate(eye), left, atol=1e-6)


NO_WEBGL = """const get = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
  return kind.includes("webgl") ? null : get.call(this, kind, ...more);
};"""


@pytest.mark.parametrize("kind", ["live", "file"])
def test_a_page_without_webgl_says_so(page, viewer: Viewer, standing: State, tmp_path: Path, kind: str) -> None:
    viewer.show(standing)
    page.add_init_script(NO_WEBGL)
    page.goto(viewer.url if kind == "live" else viewer.save(tmp_path / "scene.html").as_uri())
    page.wait_for_function("getComputedStyle(document.getElementById('notice')).display == 'block'")
    assert "needs WebGL" in page.inner_text("#notice") and "Switch on hardware acceleration" in page.inner_text("#notice")
    picture(page, f"no_webgl_{kind}")


def test_a_file_that_the_browser_cannot_unpack_says_so(page, viewer: Viewer, standing: State, tmp_path: Path) -> None:
    viewer.show(standing)
    page.add_init_script("delete window.DecompressionStream")
    page.goto(viewer.save(tmp_path / "scene.html").as_uri())
    page.wait_for_function("getComputedStyle(document.getElementById('notice')).display == 'block'")
    assert "too old to open" in page.inner_text("#notice") and "Firefox from 113" in page.inner_text("#notice")
    picture(page, "no_unpacking")


@pytest.mark.parametrize("background", ["light", "dark"])
def test_a_push_on_a_robot_of_its_own_colour_has_an_outline(page, background: str) -> None:
    robot = load("go2" if background == "dark" else "solo12")
    viewer = Viewer(robot, background=background)
    page.goto(viewer.url)
    shots = []
    for title, push in (("no push", None), ("push", ("base", [0.0, 0.5 * robot.weight, 0.0]))):
        viewer.show(robot.standing(), com=False, push=push, title=title)
        page.wait_for_function(f"document.querySelector('#title').textContent == '{title}' && !viewer.needs_render")
        shots.append(picture(page, f"{title}_on_{background}".replace(" ", "_")))
    viewer.close()
    before, after = (shot[60:330].mean(axis=2) for shot in shots)
    assert np.sum((after > 220) & (after - before > 60)) > 100  # what is light in it
    assert np.sum((after < 70) & (before - after > 60)) > 100  # what is dark


def dark_pixels(change: np.ndarray, image: np.ndarray) -> int:
    """How many pixels have become dark where the robot's body is: not those of the scale bar."""
    return int(np.sum(((change.max(axis=2) < -40) & (image.max(axis=2) < 70))[:330]))


def test_get_image_is_the_picture_in_the_page(page, viewer: Viewer, standing: State) -> None:
    from concurrent.futures import ThreadPoolExecutor

    viewer.show(standing)
    page.goto(viewer.url)
    settle(page, viewer)
    with ThreadPoolExecutor(1) as pool:
        asked = pool.submit(viewer.window.get_image)
        while not asked.done():
            page.wait_for_timeout(10)
    image = asked.result()
    assert image.size == (900, 600)
    assert hue_pixels(np.asarray(image.convert("RGB")).astype(int), COM) > 50


@pytest.mark.parametrize("background", ["white", "light", "dark"])
def test_backgrounds(page, go2: Robot, standing: State, background: str) -> None:
    viewer = Viewer(go2, background=background)
    viewer.show(standing, title=background)
    page.goto(viewer.url)
    settle(page, viewer)
    corner = picture(page, f"background_{background}")[590, 5]
    assert (corner.mean() > 200) == (background != "dark")
    viewer.close()


@pytest.mark.parametrize("name", catalogue())
def test_every_robot_is_in_the_page(page, name: str) -> None:
    robot = load(name)
    viewer = Viewer(robot, background="white")
    viewer.show(robot.standing(), com=False)
    page.goto(viewer.url)
    settle(page, viewer)
    parts = page.evaluate("Object.keys(viewer.scene_tree.children.meshcat.children.robot.children).length")
    assert parts == len([path for path in viewer.canvas.picture if path.startswith("robot/")])
    rows, columns = np.nonzero(np.abs(picture(page, f"robot_{name}") - 255).sum(axis=2) > 150)
    assert np.ptp(rows) > 0.45 * 600 or np.ptp(columns) > 0.45 * 900
    viewer.close()
