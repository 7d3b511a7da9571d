"""The page in a real browser. Screenshots go to build/screenshots."""

from collections import defaultdict

import numpy as np
import pytest
from numpy.testing import assert_allclose
from waiting import until

from floatbase.viewer.scene import protocol
from floatbase.viewer.scene.colours import ALARM, CALM, COM, MEASURED, WARNING
from floatbase.viewer.transport.window import Window

from .looks import SMALL, WHERE, hue_pixels, picture, settle

NOTICE = "getComputedStyle(document.getElementById('notice')).display"


def test_a_page_has_what_is_shown(page, viewer, standing, contacts, forces):
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
        assert_allclose(page.evaluate(WHERE, f"meshcat/measured/{name}"), position, atol=1e-5)
    image = picture(page, "go2_standing")
    for colour in (MEASURED, CALM, WARNING, ALARM, COM):
        assert hue_pixels(image, colour) > 100
    robot = np.nonzero(np.abs(image - image[5, 300]).sum(axis=2) > 150)  # not the background
    assert np.ptp(robot[1]) > 300 and np.ptp(robot[0]) > 250

    viewer.show(standing, com=False, title="bare")
    settle(page, "bare")
    measured = "viewer.scene_tree.find(['meshcat', 'measured'])"
    assert page.evaluate(f"Object.keys({measured}.children)") == []
    page.wait_for_timeout(1500)  # the legend keeps an entry for a second
    image = picture(page, "go2_bare")
    for colour in (MEASURED, WARNING, ALARM, COM):
        assert hue_pixels(image, colour) < 30


@pytest.mark.front_end
def test_the_page_comes_back_when_the_window_does(page):
    first = Window()
    page.goto(first.web_url)
    until(lambda: first.n_pages == 1)
    first.close()
    page.wait_for_function(f"{NOTICE} == 'block'")
    with Window(port=first.port) as second:
        second.put([protocol.page_command("set_title", text="back again")])
        until(lambda: second.n_pages == 1)
        settle(page, "back again")
        assert page.evaluate(NOTICE) == "none"


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
def test_controls_have_any_name_and_the_same_values_in_every_page(page, browser, viewer):
    heard = defaultdict(list)
    for name in NAMES:
        box, button = f"box {name}", f"button {name}"
        viewer.add_slider(name, heard[name].append, 0.0, -1.0, 1.0)
        viewer.add_checkbox(box, heard[box].append, True)
        viewer.add_button(button, lambda button=button: heard[button].append("pressed"))
    names = [text for name in NAMES for text in (name, f"box {name}", f"button {name}")]
    other = browser.new_page(viewport=SMALL)
    n_controls = "window.viewer && Object.keys(viewer.gui_controllers).length"
    for one in (page, other):
        one.goto(viewer.url)
        one.wait_for_function(f"{n_controls} == {len(names)}")
    # buttons come first in the panel
    assert sorted(label for label in page.evaluate(LABELS) if label in names) == sorted(names)
    for name in NAMES:
        page.evaluate("(name) => viewer.gui_controllers[name].setValue(0.5)", name)
        other.evaluate("(name) => viewer.gui_controllers[`box ${name}`].setValue(false)", name)
        page.evaluate("(name) => viewer.gui_controllers[`button ${name}`].fire()", name)
    now = f"JSON.stringify({VALUES})"
    present = "[" + ",".join(["0.5,false"] * len(NAMES)) + "]"
    for one in (page, other):
        one.wait_for_function(f"{now} == '{present}'")
        assert one.evaluate("window.hit") is None
    page.wait_for_function("location.hash.includes('0.5')")
    page.reload()
    page.wait_for_function(f"window.viewer && {now} == '{present}'")
    # made again, as a cell that is run again does
    viewer.add_slider(NAMES[0], heard[NAMES[0]].append, 1.0, -1.0, 1.0)
    other.wait_for_function(f"{VALUES}[0] == 1")
    other.close()
    for name in NAMES:
        assert heard[name] == [0.5] and heard[f"box {name}"] == [False]
        assert heard[f"button {name}"] == ["pressed"]


NO_WEBGL = """const get = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
  return kind.includes("webgl") ? null : get.call(this, kind, ...more);
};"""


@pytest.mark.front_end
@pytest.mark.parametrize(
    ("lacks", "pages", "words"),
    [
        (NO_WEBGL, ("live", "file"), ("needs WebGL", "Switch on hardware acceleration")),
        ("delete window.DecompressionStream", ("file",), ("too old to open", "Firefox 113")),
    ],
    ids=["WebGL", "DecompressionStream"],
)
def test_pages_name_what_browsers_lack(browser, viewer, standing, tmp_path, lacks, pages, words):
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
