"""Light and dark: a picture follows the page around it, and everything is visible on both."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from floatbase import Contacts
from floatbase.robots import Robot, State
from floatbase.viewer import Viewer
from floatbase.viewer.scene.colours import BACKGROUNDS, COM, DARK_SHADES, MEASURED, hex_code

from .looks import picture

DRAWN = "window.viewer && viewer.num_messages_received > 0"
DARK = "document.body.classList.contains('dark')"
COLOUR = """(path) => viewer.scene_tree.find([...path.split("/"), "<object>"])
  .object.material.color.getHexString()"""
LATER = "new Promise((done) => setTimeout(done, 800))"
GREY = """() => Math.min(
  ...viewer.scene_tree.find(["meshcat", "label", "FL_foot", "<object>"])
  .object.material.map.image.data.filter((_, i) => i % 2 == 0))"""


@pytest.fixture
def saved(go2: Robot, standing: State, contacts: Contacts, tmp_path: Path) -> Iterator[Path]:
    view = Viewer(go2, facets=4)
    view.show(standing, contacts, forces=[[10.0, 0.0, 40.0]] * 4, labels=True, title="go2 standing")
    yield view.save(tmp_path / "picture.html")
    view.close()


@pytest.mark.front_end
def test_a_picture_is_dark_where_the_words_around_it_are_light(page, saved):
    inside = saved.read_text(encoding="utf-8").replace("&", "&amp;").replace('"', "&quot;")
    frame = f'<iframe srcdoc="{inside}" style="width: 100%; height: 560px; border: 0"></iframe>'
    (saved.parent / "outer.html").write_text(
        f'<body style="color: #222">{frame}</body>', encoding="utf-8"
    )
    page.goto((saved.parent / "outer.html").as_uri())
    inner = page.frames[-1]
    inner.wait_for_function(DRAWN)
    assert not inner.evaluate(DARK)
    seen = {
        part: inner.evaluate(*part)
        for part in ((COLOUR, "meshcat/measured/FL_foot"), (COLOUR, "meshcat/ground"), (GREY,))
    }
    assert f"#{seen[COLOUR, 'meshcat/measured/FL_foot']}" == hex_code(MEASURED).lower()
    page.evaluate("document.body.style.color = '#eee'")
    inner.wait_for_function(f"{DARK} && !viewer.needs_render")
    assert (
        f"#{inner.evaluate(COLOUR, 'meshcat/measured/FL_foot')}"
        == hex_code(DARK_SHADES[MEASURED]).lower()
    )
    assert (
        f"#{inner.evaluate(COLOUR, 'meshcat/ground')}" == hex_code(BACKGROUNDS["dark"][2]).lower()
    )
    assert hex_code(DARK_SHADES[COM]).lower() in inner.evaluate(
        "[...document.querySelectorAll('#lines i')].map((one) => "
        "one.style.color.match(/\\d+/g).map("
        "(x) => Number(x).toString(16).padStart(2, '0')).join(''))"
        ".map((code) => '#' + code)"
    )
    assert picture(page, "dark")[300, 100].max() < 100
    inner.evaluate("() => { document.getElementById('lines').firstChild.marked = true; }")
    page.evaluate("document.body.className = 'busy'")  # as JupyterLab changes it all the time
    inner.evaluate(LATER)
    assert inner.evaluate("document.getElementById('lines').firstChild.marked"), (
        "drawn anew, for nothing"
    )
    page.evaluate("document.body.style.color = '#222'")
    inner.wait_for_function(f"!{DARK} && !viewer.needs_render")
    assert {part: inner.evaluate(*part) for part in seen} == seen
    assert picture(page, "light_again")[300, 100].min() > 180
