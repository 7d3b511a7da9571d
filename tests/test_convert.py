"""`jupyter nbconvert --to html` of a lesson that was run: every picture is there, without any other
host.
"""

import shutil
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest
from browsers import browser_of_a_file, needs_chromium

from floatbase.lessons.publish import NOTEBOOKS

NAME = "03_feasible_space"
# as README says: nbconvert stores the widgets' state, and a page that has it loads their code from
# another host
WITHOUT_STATE = "--ClearMetadataPreprocessor.enabled=True"
WIDTHS = "() => [...document.images].map((image) => image.complete ? image.naturalWidth : 0)"

pytestmark = [pytest.mark.front_end, needs_chromium, pytest.mark.timeout(600)]
browser = browser_of_a_file


def converted(lesson, to, *options):
    command = [sys.executable, "-m", "nbconvert", "--to", to, *options, str(lesson)]
    subprocess.run(command, check=True, capture_output=True, timeout=500)


def test_every_picture_of_a_converted_lesson_is_there(tmp_path, browser):
    lesson = Path(shutil.copy(NOTEBOOKS / f"{NAME}.ipynb", tmp_path))
    converted(lesson, "notebook", "--execute", "--inplace")
    notebook = nbformat.read(lesson, 4)
    assert "widgets" in notebook.metadata
    pictures = [
        (cell.source, output)
        for cell in notebook.cells
        for output in cell.get("outputs", ())
        if "image/png" in output.get("data", {})
    ]
    converted(lesson, "html", WITHOUT_STATE)
    page, strangers = browser.new_page(), []

    def block(route):
        strangers.append(route.request.url)
        route.abort()

    page.route(lambda url: not url.startswith(("file:", "data:", "blob:")), block)
    page.goto(lesson.with_suffix(".html").as_uri())
    widths = page.evaluate(WIDTHS)
    assert len(widths) == len(pictures) >= 3 and min(widths) > 0
    assert not [url for url in strangers if "widget" in url or "unpkg" in url]
    page.close()
