"""Interaction with the picture: wheel, touch, initial view, keys, hidden parts, reduced motion."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from floatbase import Contacts
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
    """Open a page that scrolls, with a saved picture in a frame from 300 to 780 pixels."""
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


def test_the_wheel_scrolls_the_page_until_the_reader_clicks_into_the_picture(framed):
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
    assert_allclose(inner.evaluate(CAMERA), home, atol=1e-9)
    page.mouse.click(450, 500)
    page.mouse.wheel(0, 120)
    inner.wait_for_function(f"{CAMERA}[0] != {home[0]}")
    assert page.evaluate("scrollY") == 0
    page.keyboard.press("Escape")
    page.mouse.wheel(0, 120)
    page.wait_for_function("scrollY > 60")


def test_views_parts_and_keys(framed):
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
        assert_allclose(inner.evaluate(CAMERA), home, atol=1e-9)
    assert inner.evaluate("viewer.renderer.domElement.getAttribute('aria-label')") == "go2 standing"
