"""Voilà in a real browser: lesson 00 and a playground as a page without code, whose pictures move.

The browser reaches Voilà's own address and nothing else. Its own template asks for icons elsewhere,
and does without them.
"""

from importlib.util import find_spec

import nbformat
import pytest
from browsers import browser_of_a_file, needs_chromium
from labs import (
    HEIGHT,
    LONG,
    WINDOW,
    answers,
    free_ports,
    only,
    picture_in,
    push_panel_of,
    push_until_it_falls,
    screenshot,
    server,
)
from waiting import until

from floatbase.lessons.publish import NOTEBOOKS, read_notebook

SINKS = 0.02  # m: by 49 mm, where the robot carries half its mass more than its controller knows
PLAYGROUND = 'from floatbase.playground import playground\nplayground("go2")'
ICONS = "/@fortawesome/"
MASS = "viewer.gui_controllers['mass [%] reality']"

pytestmark = [
    pytest.mark.front_end,
    needs_chromium,
    pytest.mark.skipif(find_spec("voila") is None, reason="Voilà is not installed"),
    pytest.mark.timeout(600),
]


@pytest.fixture(scope="module")
def voila(tmp_path_factory):
    """The address of a Voilà that serves lesson 00 with a playground at its end."""
    home = tmp_path_factory.mktemp("voila")
    lesson = read_notebook(NOTEBOOKS / "00_start_here.ipynb")
    lesson.cells.append(nbformat.v4.new_code_cell(PLAYGROUND))
    nbformat.write(lesson, home / "lesson.ipynb")
    (port,) = free_ports(1)
    options = ["--no-browser", f"--port={port}", "--Voila.ip=127.0.0.1"]
    with server(["voila", "lesson.ipynb", *options], home) as (started, log):
        until(lambda: answers(port) or started.poll() is not None)
        assert started.poll() is None, log.read_text()
        yield f"http://127.0.0.1:{port}"


browser = browser_of_a_file


def test_the_pictures_of_a_page_without_code_move(voila, browser):
    page = browser.new_page(**WINDOW)
    page.set_default_timeout(1000 * LONG)
    strangers = only(page, voila)
    try:
        page.goto(voila, wait_until="commit")
        push_until_it_falls(page, push_panel_of(page), "00_voila")
        field = picture_in(page.locator(".jp-Cell", has=page.locator("iframe")).last)
        field.wait_for_function(MASS)
        standing = field.evaluate(HEIGHT)
        field.evaluate(f"{MASS}.setValue(150)")  # unknown to the controller
        field.wait_for_function(f"({HEIGHT})() < {standing - SINKS}")
        assert [url for url in strangers if ICONS not in url] == []
        assert page.get_by_text("Traceback").count() == 0
    finally:
        screenshot(page, "00_voila_end")
        page.close()
