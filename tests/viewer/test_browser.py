"""A real browser looks at the page. Screenshots go to build/screenshots."""

from __future__ import annotations

from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import judges
import numpy as np
import pytest

from floatbase.dynamics import Contacts
from floatbase.robots import Robot, State, catalogue, load
from floatbase.simulation import Simulation, rollout
from floatbase.viewer import Viewer
from floatbase.viewer.scene import protocol
from floatbase.viewer.scene.colours import ALARM, CALM, COM, MEASURED, WARNING, X_AXIS
from floatbase.viewer.transport.window import Window

from .looks import EYE, SMALL, WHERE, Screen, hue_pixels, picture, settle

NOTICE = "getComputedStyle(document.getElementById('notice')).display"
# of 600 x 400 pixels
LIGHT, DARK, CHANGE = (
    220,
    70,
    60,
)  # brightness of 255 of a push's arrow or outline, and its least difference to what it hides


def test_a_page_has_what_is_shown(
    page, viewer: Viewer, standing: State, contacts: Contacts, forces: np.ndarray
) -> None:
    viewer.show(standing, contacts, forces=forces, title="go2 stands")
    page.goto(viewer.url)
    settle(page, "go2 stands")
    tree = page.evaluate(
        "Object.fromEntries(Object.entries(viewer.scene_tree.children.meshcat.children)"
        ".map(([name, node]) => [name, Object.keys(node.children).length]))"
    )
    assert tree["robot"] == 13
    assert tree["measured"] == tree["cone"] == tree["patch"] == 4
    for name, position in zip(contacts.point_names, contacts.positions(standing), strict=True):
        np.testing.assert_allclose(
            page.evaluate(WHERE, f"meshcat/measured/{name}"), position, atol=1e-5
        )
    image = picture(page, "go2_standing")
    for colour in (MEASURED, CALM, WARNING, ALARM, COM):
        assert hue_pixels(image, colour) > 100
    background = image[5, 300]
    robot_rows, robot_columns = np.nonzero(np.abs(image - background).sum(axis=2) > 150)
    assert np.ptp(robot_columns) > 300 and np.ptp(robot_rows) > 250

    viewer.show(standing, com=False, title="bare")
    settle(page, "bare")
    assert (
        page.evaluate("Object.keys(viewer.scene_tree.children.meshcat.children.measured.children)")
        == []
    )
    image = picture(page, "go2_bare")
    for colour in (MEASURED, WARNING, ALARM, COM):
        assert hue_pixels(image, colour) < 30


@pytest.mark.front_end
def test_get_image_is_the_picture_in_the_page(page, viewer: Viewer, standing: State) -> None:
    page.set_viewport_size(SMALL)
    viewer.show(standing)
    page.goto(viewer.url)
    settle(page)
    with ThreadPoolExecutor(1) as pool:
        answer = pool.submit(viewer.window.get_image, 60.0)
        while not answer.done():
            page.wait_for_timeout(10)
    image = answer.result()
    assert image.size == tuple(SMALL.values())
    assert hue_pixels(np.asarray(image.convert("RGB")).astype(int), COM) > 12


@pytest.mark.front_end
def test_the_page_comes_back_when_the_window_does(page) -> None:
    first = Window()
    page.goto(first.web_url)
    first.wait()
    first.close()
    page.wait_for_function(f"{NOTICE} == 'block'")
    with Window(port=first.port) as second:
        second.put([protocol.page_command("set_title", text="back again")])
        second.wait()
        assert second.n_pages == 1
        settle(page, "back again")
        assert page.evaluate(NOTICE) == "none"


@pytest.mark.front_end
def test_pushes_and_frames_are_seen_through_the_robot_and_its_ghost(
    page, viewer: Viewer, go2: Robot, standing: State
) -> None:
    page.set_viewport_size({"width": 600, "height": 400})
    page.goto(viewer.url)
    q = standing.q.copy()
    q[2] += 0.05
    seen = []
    for ghost in (None, State(go2, q)):
        shots = []
        for title, parts in (
            ("bare", {}),
            ("push", {"push": ("base", [0.0, 60.0, 0.0])}),
            ("frame", {"frames": ["base"]}),
        ):
            viewer.show(standing, com=False, ghost=ghost, title=title, **parts)
            settle(page, title)
            shots.append(picture(page, f"{title}_and_ghost" if ghost else title))
        bare, push, frame = shots
        darker = (push - bare).max(axis=2) < -40
        seen.append(
            (np.sum((darker & (push.max(axis=2) < DARK))[:220]), hue_pixels(frame, X_AXIS))
        )  # above the scale bar
    (push, axes), (push_and_ghost, axes_and_ghost) = seen
    assert push > 90 and push_and_ghost > 0.9 * push
    assert axes > 22 and axes_and_ghost > 0.9 * axes


@pytest.mark.front_end
def test_a_push_on_a_robot_of_its_own_colour_has_an_outline(screen: Screen) -> None:
    screen.page.set_viewport_size({"width": 600, "height": 400})
    for background, name in (("light", "solo12"), ("dark", "go2")):
        robot = load(name)
        viewer, shots = Viewer(robot, background=background), []
        for title, push in (("no push", None), ("push", ("base", [0.0, 0.5 * robot.weight, 0.0]))):
            viewer.show(robot.standing(), com=False, push=push, title=title)
            screen.show(viewer)
            shots.append(picture(screen.page, f"{title}_on_{background}".replace(" ", "_")))
        viewer.close()
        before, after = (shot[40:220].mean(axis=2) for shot in shots)
        assert np.sum((after > LIGHT) & (after - before > CHANGE)) > 45, background
        assert np.sum((after < DARK) & (before - after > CHANGE)) > 45, background


@pytest.mark.front_end
def test_the_camera_moves_when_it_is_called_and_not_when_a_picture_is_drawn(
    page, viewer: Viewer, standing: State
) -> None:
    def eye_at(title: str) -> list[float]:
        """Where the page looks from once it has the title."""
        viewer.show(standing, title=title)
        settle(page, title)
        return page.evaluate(EYE)

    page.set_viewport_size(SMALL)
    viewer.show(standing).camera("front")
    page.goto(viewer.url)
    settle(page)
    front = page.evaluate(EYE)
    page.mouse.move(225, 100)
    page.mouse.down()
    page.mouse.move(300, 130, steps=4)
    page.mouse.up()
    turned = page.evaluate(EYE)
    assert np.linalg.norm(np.subtract(turned, front)) > 0.3
    np.testing.assert_allclose(eye_at("turned by the reader"), turned, atol=1e-6)
    viewer.camera("front")
    np.testing.assert_allclose(eye_at("front again"), front, atol=1e-6)
    viewer.camera("left")
    left = eye_at("left")
    page.reload()
    settle(page, "left")
    np.testing.assert_allclose(page.evaluate(EYE), left, atol=1e-6)


LINES = "getComputedStyle(document.getElementById('lines')).visibility == 'visible'"
FOLDED = "document.getElementById('legend').classList.contains('folded')"
BOX = """(selector) => {
  const {left, top, right, bottom} = document.querySelector(selector).getBoundingClientRect();
  return {left, top, right, bottom};
}"""
# how many of the robot's vertices lie behind the legend
HIDDEN = """() => {
  const {left, top, right, bottom} = document.getElementById("lines").getBoundingClientRect();
  const at = new MeshCat.THREE.Vector3();
  let n = 0, hidden = 0;
  viewer.scene_tree.find(["meshcat", "robot"]).object.traverse(({geometry, matrixWorld}) => {
    const points = geometry?.attributes.position;
    for (let i = 0; i < (points?.count ?? 0); i++) {
      at.fromBufferAttribute(points, i).applyMatrix4(matrixWorld).project(viewer.camera);
      const x = (1 + at.x) * innerWidth / 2, y = (1 - at.y) * innerHeight / 2;
      hidden += x > left && x < right && y > top && y < bottom;
      n++;
    }
  });
  return [n, hidden];
}"""


@pytest.mark.front_end
def test_a_legend_never_hides_the_robot_and_is_folded_where_it_would(
    page, viewer: Viewer, standing: State, contacts: Contacts, forces: np.ndarray
) -> None:
    viewer.show(standing, contacts, forces, forces, support=True, ghost=standing, title="legend")
    page.goto(viewer.url)
    settle(page, "legend")
    beside, above = (
        ((1000, 480, False), (1300, 240, False)),
        ((420, 360, True), (590, 360, True), (1300, 160, True)),
    )
    for width, height, folded in (*beside, *above):
        page.set_viewport_size({"width": width, "height": height})
        page.wait_for_function(f"{FOLDED} == {str(folded).lower()}")
        settle(page)
        picture(page, f"legend_{width}_{height}")
        vertices, hidden = page.evaluate(HIDDEN)
        assert vertices > 1000
        assert folded or not hidden, (width, height)
        assert hidden or width > 420  # there it would cover the robot, were it open
    viewer.show(standing, contacts, com=False, cones=False, planned=forces, title="one line")
    settle(page, "one line")
    page.set_viewport_size({"width": 640, "height": 360})
    page.wait_for_function(f"!{FOLDED} && {LINES}")  # a short one fits beside
    assert page.evaluate(HIDDEN)[1] == 0
    viewer.show(standing, com=False, title="nothing")
    settle(page, "nothing")
    page.set_viewport_size(SMALL)
    assert not page.evaluate(FOLDED)  # no button for nothing


@pytest.mark.front_end
@pytest.mark.parametrize("background", ["light", "dark"])
def test_a_folded_legend_opens_by_mouse_and_by_keyboard(
    browser, go2: Robot, standing: State, background: str
) -> None:
    viewer = Viewer(go2, background=background)
    viewer.show(standing, ghost=standing, title="folded")
    page = browser.new_page(viewport=SMALL)
    page.goto(viewer.url)
    settle(page, "folded")
    button = page.locator("#legend button")

    def is_open() -> bool:
        assert button.get_attribute("aria-expanded") == str(page.evaluate(LINES)).lower()
        return page.evaluate(LINES)

    assert button.is_visible() and not is_open()
    button.hover()
    assert is_open()
    picture(page, f"legend_open_{background}")
    page.mouse.move(400, 20)
    assert not is_open()
    button.click()
    page.mouse.move(400, 20)
    assert is_open()  # a click keeps it
    button.click()
    page.mouse.move(400, 20)
    button.blur()
    assert not is_open()
    button.focus()
    assert is_open()
    page.keyboard.press("Escape")
    assert not is_open()
    page.keyboard.press("Enter")
    button.blur()
    assert is_open()
    page.close()
    viewer.close()


@pytest.mark.front_end
def test_a_folded_legend_leaves_room_for_the_player_of_a_recording(
    browser, viewer: Viewer, tmp_path: Path
) -> None:
    viewer.play(rollout(Simulation(viewer.robot), judges.limp, 0.05))
    page = browser.new_page()
    page.goto(viewer.save(tmp_path / "record.html").as_uri())
    for width in (270, 340, 420, 700):
        page.set_viewport_size({"width": width, "height": 300})
        page.wait_for_function(f"window.viewer && viewer.num_messages_received > 0 && {FOLDED}")
        button, player = (page.evaluate(BOX, name) for name in ("#legend button", "#player"))
        assert player["right"] < width, width
        assert button["right"] < player["left"] or (
            button["bottom"] <= player["top"] and width < 340
        ), width
        picture(page, f"record_{width}")
    page.close()


NAMES = ('<img src=x onerror="hit = true">', "x<y & z > w", "&amp;", "__proto__", 'it\'s \\ "so" τ')
LABELS = (
    "[...document.querySelectorAll('#panel .row > span, #panel .buttons "
    "button')].map((label) => label.textContent)"
)
VALUES = (
    "Object.values(viewer.gui_controllers).map((one) => one.getValue()).filter((value) => "
    "typeof value != 'function')"
)


@pytest.mark.front_end
def test_controls_have_any_name_and_the_same_values_in_every_page(
    page, browser, viewer: Viewer
) -> None:
    heard: defaultdict[str, list[object]] = defaultdict(list)
    for name in NAMES:
        viewer.add_slider(name, heard[name].append, 0.0, -1.0, 1.0)
        viewer.add_checkbox(f"box {name}", heard[f"box {name}"].append, True)
        viewer.add_button(
            f"button {name}", lambda name=name: heard[f"button {name}"].append("pressed")
        )
    names = [text for name in NAMES for text in (name, f"box {name}", f"button {name}")]
    page.goto(viewer.url)
    page.wait_for_function(
        f"window.viewer && Object.keys(viewer.gui_controllers).length == {len(names)}"
    )
    other = browser.new_page(viewport=SMALL)
    other.goto(viewer.url)
    other.wait_for_function(
        f"window.viewer && Object.keys(viewer.gui_controllers).length == {len(names)}"
    )
    assert [label for label in page.evaluate(LABELS) if label in names] == names
    for name in NAMES:
        page.evaluate("(name) => viewer.gui_controllers[name].setValue(0.5)", name)
        other.evaluate("(name) => viewer.gui_controllers[`box ${name}`].setValue(false)", name)
        page.evaluate("(name) => viewer.gui_controllers[`button ${name}`].fire()", name)
    page.evaluate("(name) => viewer.gui_controllers[name].setValue(-0.25)", NAMES[0])
    now = f"JSON.stringify({VALUES})"
    present = "[-0.25,false" + ",0.5,false" * (len(NAMES) - 1) + "]"
    for one in (page, other):
        one.wait_for_function(f"{now} == '{present}'")
        assert one.evaluate("window.hit") is None
    page.reload()
    page.wait_for_function(f"window.viewer && {now} == '{present}'")
    viewer.add_slider(
        NAMES[0], heard[NAMES[0]].append, 1.0, -1.0, 1.0
    )  # made again, as a cell that is run again does
    other.wait_for_function(f"{VALUES}[0] == 1")
    other.close()
    picture(page, "controls")
    first, *rest = NAMES
    assert heard[first] == [0.5, -0.25] and all(heard[name] == [0.5] for name in rest)
    assert all(
        heard[f"box {name}"] == [False] and heard[f"button {name}"] == ["pressed"] for name in NAMES
    )


def test_backgrounds(screen: Screen, go2: Robot, standing: State) -> None:
    screen.page.set_viewport_size(SMALL)
    for background in ("white", "light", "dark"):
        viewer = Viewer(go2, background=background)
        viewer.show(standing, title=background)
        screen.show(viewer)
        viewer.close()
        corner = picture(screen.page, f"background_{background}")[295, 5]
        assert (corner.mean() > 200) == (background != "dark"), background


@pytest.mark.front_end
def test_every_robot_is_in_the_page(screen: Screen) -> None:
    screen.page.set_viewport_size(SMALL)
    for name in catalogue():
        robot = load(name)
        viewer = Viewer(robot, background="white")
        viewer.show(robot.standing(), com=False)
        screen.show(viewer)
        viewer.close()
        parts = screen.page.evaluate(
            "Object.keys(viewer.scene_tree.children.meshcat.children.robot.children).length"
        )
        assert parts == len(
            [path for path in viewer.renderer.picture if path.startswith("robot/")]
        ), name
        rows, columns = np.nonzero(
            np.abs(picture(screen.page, f"robot_{name}") - 255).sum(axis=2) > 150
        )
        assert np.ptp(rows) > 0.45 * 300 or np.ptp(columns) > 0.45 * 450, name


NO_WEBGL = """const get = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
  return kind.includes("webgl") ? null : get.call(this, kind, ...more);
};"""


@pytest.mark.front_end
@pytest.mark.parametrize(
    ("lacks", "pages", "words"),
    [
        (NO_WEBGL, ("live", "file"), ("needs WebGL", "Switch on hardware acceleration")),
        ("delete window.DecompressionStream", ("file",), ("too old to open", "Firefox from 113")),
    ],
    ids=["WebGL", "DecompressionStream"],
)
def test_a_page_says_what_its_browser_lacks(
    browser,
    viewer: Viewer,
    standing: State,
    tmp_path: Path,
    lacks: str,
    pages: tuple[str, ...],
    words: tuple[str, ...],
) -> None:
    viewer.show(standing)
    addresses = {"live": viewer.url, "file": viewer.save(tmp_path / "scene.html").as_uri()}
    page = browser.new_page(viewport=SMALL)
    page.add_init_script(lacks)
    for kind in pages:
        page.goto(addresses[kind])
        page.wait_for_function(f"{NOTICE} == 'block'")
        notice = page.inner_text("#notice")
        assert [word for word in words if word not in notice] == [], kind
    picture(page, "a_browser_that_lacks_something")
    page.close()
