"""Light and dark: a picture follows the page around it, and what is drawn can be seen on either."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from floatbase import Contacts
from floatbase.robots import Robot, State
from floatbase.viewer import Viewer
from floatbase.viewer.scene.colours import (
    BACKGROUNDS,
    COM,
    DARK_SHADES,
    GREYS,
    LEGEND,
    MEASURED,
    hex_code,
)

from .looks import picture

RGB = tuple[float, float, float]
AS_TEXT = ("push", "multiplier", "zmp")  # drawn in the colour of text
SEEN = 3.0  # contrast that WCAG 2.2 asks for between parts of a picture and what is around them
READ = 4.5  # and for text
DRAWN = "window.viewer && viewer.num_messages_received > 0"
DARK = "document.body.classList.contains('dark')"
COLOUR = """(path) => viewer.scene_tree.find([...path.split("/"), "<object>"]).object.material.color.getHexString()"""
LATER = "new Promise((done) => setTimeout(done, 800))"
GREY = """() => Math.min(...viewer.scene_tree.find(["meshcat", "label", "FL_foot", "<object>"]).object.material.map.image.data
  .filter((_, i) => i % 2 == 0))"""


def contrast(one: RGB, other: RGB) -> float:
    """The contrast of two colours by WCAG 2.2, from 1 to 21."""

    def light(colour: RGB) -> float:
        parts = [x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4 for x in colour]
        return 0.2126 * parts[0] + 0.7152 * parts[1] + 0.0722 * parts[2]

    low, high = sorted((light(one), light(other)))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("background", BACKGROUNDS)
def test_text_is_read_and_what_hides_in_the_dark_has_another_shade_there(background: str) -> None:
    top, bottom, lines, text = BACKGROUNDS[background]
    for paper in (top, bottom):
        assert contrast(text, paper) > READ
        assert contrast(text, paper) > 3.0 * contrast(lines, paper)  # the ground keeps behind
    if background == "dark":
        drawn = {colour for kind, colour, _ in LEGEND if kind not in AS_TEXT} | {
            *GREYS,
            *DARK_SHADES,
        }
        shades = [DARK_SHADES.get(colour, colour) for colour in drawn]
        assert min(contrast(shade, paper) for shade in shades for paper in (top, bottom)) > SEEN
        assert contrast(MEASURED, bottom) < SEEN  # so that the shades are there for something


@pytest.fixture
def saved(go2: Robot, standing: State, contacts: Contacts, tmp_path: Path) -> Iterator[Path]:
    view = Viewer(go2, facets=4)
    view.show(standing, contacts, forces=[[10.0, 0.0, 40.0]] * 4, labels=True, title="go2 standing")
    yield view.save(tmp_path / "picture.html")
    view.close()


@pytest.mark.front_end
def test_a_picture_is_dark_where_the_words_around_it_are_light(page, saved: Path) -> None:
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


@pytest.mark.front_end
def test_a_page_of_its_own_is_as_the_browser_is_and_as_wide_as_a_phone(
    browser, saved: Path
) -> None:
    context = browser.new_context(
        color_scheme="dark", viewport={"width": 390, "height": 800}, is_mobile=True, has_touch=True
    )
    page = context.new_page()
    page.goto(saved.as_uri())
    page.wait_for_function(DRAWN)
    assert page.evaluate(DARK) and page.evaluate("innerWidth") == 390
    context.close()
