"""Light and dark: a picture follows the page around it, and everything is visible on both."""

import pytest

from floatbase.viewer import Viewer
from floatbase.viewer.scene.colours import BACKGROUNDS, DARK_SHADES, MEASURED, hex_code

from .looks import picture

DRAWN = "window.viewer && viewer.num_messages_received > 0"
DARK = "document.body.classList.contains('dark')"
COLOUR = """(path) => '#' + viewer.scene_tree.find([...path.split("/"), "<object>"])
  .object.material.color.getHexString()"""


@pytest.fixture
def saved(go2, standing, contacts, tmp_path):
    view = Viewer(go2, facets=4)
    view.show(standing, contacts, forces=[[10.0, 0.0, 40.0]] * 4, labels=True, title="go2 standing")
    yield view.save(tmp_path / "picture.html")
    view.close()


@pytest.mark.front_end
def test_a_picture_is_dark_where_the_words_around_it_are_light(page, saved):
    inside = saved.read_text(encoding="utf-8").replace("&", "&amp;").replace('"', "&quot;")
    frame = f'<iframe srcdoc="{inside}" style="width: 100%; height: 560px; border: 0"></iframe>'
    outer = saved.parent / "outer.html"
    outer.write_text(f'<body style="color: #222">{frame}</body>', encoding="utf-8")
    page.goto(outer.as_uri())
    inner = page.frames[-1]
    inner.wait_for_function(DRAWN)
    assert not inner.evaluate(DARK)

    def colours():
        paths = ("meshcat/measured/FL_foot", "meshcat/ground")
        return [inner.evaluate(COLOUR, path) for path in paths]

    light = colours()
    assert light[0] == hex_code(MEASURED).lower()
    page.evaluate("document.body.style.color = '#eee'")
    inner.wait_for_function(f"{DARK} && !viewer.needs_render")
    dark = (DARK_SHADES[MEASURED], BACKGROUNDS["dark"][2])
    assert colours() == [hex_code(colour).lower() for colour in dark]
    assert picture(page, "dark")[300, 100].max() < 100
    page.evaluate("document.body.style.color = '#222'")
    inner.wait_for_function(f"!{DARK} && !viewer.needs_render")
    assert colours() == light
    assert picture(page, "light_again")[300, 100].min() > 180
