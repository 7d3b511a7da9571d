"""The picture among other things: wheel and finger, the way home, keys, parts that hide, motion
that some cannot bear.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from floatbase import Contacts, Simulation, rollout
from floatbase.robots import Robot, State
from floatbase.viewer import Viewer

from .looks import picture

pytestmark = pytest.mark.front_end

CAMERA = "viewer.camera.position.toArray()"
DRAWN = "window.viewer && viewer.num_messages_received > 0"
SCENE = "viewer.scene_tree.children.meshcat.children"


@pytest.fixture
def framed(
    page, go2: Robot, standing: State, contacts: Contacts, tmp_path: Path
) -> Iterator[tuple]:
    """A page that scrolls, and its frame, with a saved picture, from 300 to 780 pixels."""
    view = Viewer(go2, facets=4)
    view.show(
        standing,
        contacts,
        forces=np.tile([5.0, 0.0, 40.0], 4),
        ghost=standing,
        title="go2 standing",
    )
    view.save(tmp_path / "picture.html")
    view.close()
    outer = tmp_path / "outer.html"
    frame = '<iframe src="picture.html" style="width: 100%; height: 480px; border: 0"></iframe>'
    outer.write_text(
        f'<body style="margin: 0"><div style="height: 300px"></div>{frame}<div style="height: '
        f'2000px"></div>'
    )
    page.set_viewport_size({"width": 900, "height": 800})
    page.goto(outer.as_uri())
    inner = page.frames[-1]
    inner.wait_for_function(DRAWN)
    yield page, inner
    page.goto("about:blank")


def test_the_wheel_scrolls_the_page_until_the_reader_clicks_into_the_picture(framed) -> None:
    page, inner = framed
    home = inner.evaluate(CAMERA)
    page.mouse.move(450, 500)
    page.mouse.wheel(0, 120)
    page.wait_for_function("scrollY > 60")
    assert inner.evaluate(CAMERA) == home
    page.evaluate("scrollTo(0, 0)")
    page.keyboard.down("Control")
    page.mouse.wheel(0, 120)
    page.keyboard.up("Control")
    inner.wait_for_function(f"{CAMERA}[0] != {home[0]}")
    inner.evaluate("document.querySelector('#tools button').click()")
    np.testing.assert_allclose(inner.evaluate(CAMERA), home, atol=1e-9)
    page.mouse.click(450, 500)
    page.mouse.wheel(0, 120)
    inner.wait_for_function(f"{CAMERA}[0] != {home[0]}")
    assert page.evaluate("scrollY") == 0
    page.keyboard.press("Escape")
    page.mouse.wheel(0, 120)
    page.wait_for_function("scrollY > 60")


def test_a_finger_pans_the_page(browser, framed) -> None:
    outer = framed[0].url
    context = browser.new_context(viewport={"width": 390, "height": 800}, has_touch=True)
    page = context.new_page()
    page.goto(outer)
    page.frames[-1].wait_for_function(DRAWN)
    touch = context.new_cdp_session(page)
    touch.send(
        "Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": 200, "y": 600}]}
    )
    for i in range(1, 20):
        touch.send(
            "Input.dispatchTouchEvent",
            {"type": "touchMove", "touchPoints": [{"x": 200, "y": 600 - 10 * i}]},
        )
        page.wait_for_timeout(16)
    touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    page.wait_for_function("scrollY > 60")
    picture(page, "phone")
    context.close()


def test_views_parts_and_keys(framed) -> None:
    page, inner = framed
    home = inner.evaluate(CAMERA)
    inner.evaluate("document.querySelector('#tools details').open = true")
    picture(page, "tools")
    for label in ("feet", "side", "front", "top"):
        inner.evaluate(
            "(label) => [...document.querySelectorAll('#tools div button')].find((one) => "
            "one.textContent == label).click()",
            label,
        )
        assert not np.allclose(inner.evaluate(CAMERA), home), label
    assert inner.evaluate(CAMERA)[1] > 2 * home[1]  # from the top
    for name, node in (
        ("cones", "cone"),
        ("forces", "measured"),
        ("robot", "robot"),
        ("ghost", "ghost"),
    ):
        press = (
            "(name) => [...document.querySelectorAll('#tools label')].find((one) => "
            "one.textContent == name).click()"
        )
        for is_seen in (False, True):
            inner.evaluate(press, name)
            inner.wait_for_function(f"{SCENE}['{node}'].object.visible == {str(is_seen).lower()}")
    inner.evaluate("document.querySelector('#tools summary').focus()")
    page.keyboard.press("Escape")
    inner.wait_for_function("!document.querySelector('#tools details').open")
    inner.evaluate("document.querySelector('#tools button').click()")
    inner.evaluate("viewer.renderer.domElement.focus()")
    far = np.linalg.norm(home)
    for key, changes in (
        ("ArrowLeft", lambda at: at[1] == pytest.approx(home[1])),
        ("+", lambda at: np.linalg.norm(at) < far),
    ):
        page.keyboard.press(key)
        inner.wait_for_function(
            f"JSON.stringify({CAMERA}) != '{inner.evaluate(f'JSON.stringify({home})')}'"
        )
        assert changes(inner.evaluate(CAMERA)), key
        page.keyboard.press("h")
        np.testing.assert_allclose(inner.evaluate(CAMERA), home, atol=1e-9)
    assert inner.evaluate("viewer.renderer.domElement.getAttribute('aria-label')") == "go2 standing"


def test_a_recording_waits_for_who_asked_for_less_motion(
    browser, go2: Robot, tmp_path: Path
) -> None:
    view = Viewer(go2)
    controller = lambda q, v, t: type("Limp", (), {"tau": np.zeros(12)})()  # noqa: E731
    view.play(rollout(Simulation(go2), controller, 0.1))
    view.save(tmp_path / "record.html")
    view.close()
    for motion in ("reduce", "no-preference"):
        context = browser.new_context(reduced_motion=motion)
        page = context.new_page()
        page.goto((tmp_path / "record.html").as_uri())
        page.wait_for_function(DRAWN)
        assert page.evaluate("viewer.animator.playing") == (motion != "reduce")
        context.close()


def test_a_page_whose_viewer_has_closed_says_what_it_was_told_to(
    page, go2: Robot, standing: State
) -> None:
    view = Viewer(go2)
    view.show(standing)
    view.set_disconnect_message("Start it again with\npython -m floatbase view go2")
    page.goto(view.url)
    page.wait_for_function(DRAWN)
    assert not page.locator("#notice").is_visible()
    view.close()
    page.wait_for_selector("#notice", state="visible")
    assert page.inner_text("#notice") == "Start it again with\npython -m floatbase view go2"


def test_labels_keep_their_size_in_a_small_window(framed) -> None:
    page, inner = framed
    tall = (
        "viewer.scene_tree.find(['meshcat', 'scale', 'label', '<object>']).object.scale.y * "
        "viewer.camera.zoom"
    )
    before = inner.evaluate(tall)
    page.set_viewport_size({"width": 390, "height": 800})
    inner.wait_for_function("viewer.camera.zoom < 0.8 && !viewer.needs_render")
    assert inner.evaluate(tall) == pytest.approx(before)
