"""Interaction with the picture: wheel, touch, initial view, keys, hidden parts, reduced motion."""

from contextlib import closing

import numpy as np
import pytest
from browsers import barriers, needs_axe
from numpy.testing import assert_allclose

from floatbase.viewer import Viewer

from .looks import picture

pytestmark = pytest.mark.front_end

CAMERA = "viewer.camera.position.toArray()"
DRAWN = "window.viewer && viewer.num_messages_received > 0"
SCENE = "viewer.scene_tree.children.meshcat.children"


@pytest.fixture
def framed(page, go2, standing, contacts, tmp_path):
    """Open a page that scrolls, with a saved picture in a frame from 300 to 780 pixels."""
    forces = np.tile([5.0, 0.0, 40.0], 4)
    with closing(Viewer(go2, facets=4)) as view:
        view.show(standing, contacts, forces=forces, ghost=standing, title="go2 standing")
        view.save(tmp_path / "picture.html")
    frame = '<iframe src="picture.html" style="width: 100%; height: 480px; border: 0"></iframe>'
    blocks = [f'<div style="height: {height}px"></div>' for height in (300, 2000)]
    (tmp_path / "outer.html").write_text(f'<body style="margin: 0">{frame.join(blocks)}</body>')
    page.set_viewport_size({"width": 900, "height": 800})
    page.goto((tmp_path / "outer.html").as_uri())
    inner = page.frames[-1]
    inner.wait_for_function(DRAWN)
    return page, inner


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

    def click(kind, text):
        nodes = f"[...document.querySelectorAll('#tools {kind}')]"
        inner.evaluate(f"{nodes}.find((one) => one.textContent == '{text}').click()")

    for label in ("feet", "side", "front", "top"):
        click("div button", label)
        assert not np.allclose(inner.evaluate(CAMERA), home), label
    assert inner.evaluate(CAMERA)[1] > 2 * home[1]  # from the top
    parts = {"cones": "cone", "forces": "measured", "robot": "robot", "ghost": "ghost"}
    for name, node in parts.items():
        for is_seen in ("false", "true"):
            click("label", name)
            inner.wait_for_function(f"{SCENE}['{node}'].object.visible == {is_seen}")
    inner.evaluate("document.querySelector('#tools summary').focus()")
    page.keyboard.press("Escape")
    inner.wait_for_function("!document.querySelector('#tools details').open")
    inner.evaluate("document.querySelector('#tools button').click()")
    inner.evaluate("viewer.renderer.domElement.focus()")
    for key in ("ArrowLeft", "+"):
        page.keyboard.press(key)
        inner.wait_for_function(f"Math.abs({CAMERA}[0] - {home[0]}) > 1e-6")
        at = inner.evaluate(CAMERA)
        if key == "+":
            assert np.linalg.norm(at) < np.linalg.norm(home)
        else:
            assert at[1] == pytest.approx(home[1])
        page.keyboard.press("h")
        assert_allclose(inner.evaluate(CAMERA), home, atol=1e-9)
    assert inner.evaluate("viewer.renderer.domElement.getAttribute('aria-label')") == "go2 standing"


def test_the_tab_key_reaches_the_picture_and_shows_that_it_did(framed):
    page, inner = framed
    outlines = []
    for _ in range(8):
        page.keyboard.press("Tab")
        outlines.append(inner.evaluate("getComputedStyle(document.activeElement).outlineWidth"))
        if inner.evaluate("document.activeElement.tagName") == "CANVAS":
            break
    assert inner.evaluate("document.activeElement.tagName") == "CANVAS"
    assert float(outlines[-1].removesuffix("px")) >= 2.0
    home = inner.evaluate(CAMERA)
    page.keyboard.press("ArrowLeft")
    assert not np.allclose(inner.evaluate(CAMERA), home)
    page.keyboard.press("Tab")  # it does not hold the focus
    assert inner.evaluate("document.activeElement.tagName") != "CANVAS"


@needs_axe
def test_a_saved_picture_has_no_serious_barrier(framed):
    page, inner = framed
    page.goto(inner.url)
    page.wait_for_function(DRAWN)
    page.evaluate("document.getElementById('player').style.display = 'flex'")  # of a recording
    assert barriers(page) == []
