"""Lessons as HTML pages: whole in one file, drawn without network, few pictures at a time."""

from __future__ import annotations

import base64
import io
import re
import runpy
import sys
from pathlib import Path
from typing import Any

import nbformat
import numpy as np
import pytest
from browsers import SCREENSHOTS, browser_of_a_file, needs_chromium
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook
from PIL import Image

import floatbase as fb
from floatbase.errors import ViewerError
from floatbase.lessons.publish import FOLDER, pages, prose, read
from floatbase.viewer import page as viewer_page

TEXT = r"""# 07 · A page

In `$HOME`, $J^T \lambda$ enters

$$S\,\tau = \begin{bmatrix} 0 \\ 0 \\ I \end{bmatrix} \tau \tag{3}$$

| name | what it is |
|---|---|
| `S` | see [the next](08_next.ipynb) |
"""
ROBOT = """import sys

import floatbase as fb
import numpy as np

robot = fb.load("go2")
state, contacts = robot.standing(), fb.Contacts.points(robot)
print("standing", "<still>")
sys.stderr.write("com" + "piling")
"""
STILL = "fb.Viewer(robot, height=200).show(state, contacts)"
MOVING = """from floatbase.lessons import ConstantTorques

fb.Viewer(robot, height=200).play(fb.rollout(fb.Simulation(robot), ConstantTorques(np.zeros(12)), 0.1), paused=True)
"""
SLIDER = """from floatbase.lessons import slider_panel

view = fb.Viewer(robot, height=200)
slider_panel(view, lambda up: view.show(state, title="moved") and f"up <b>{up:.0f}</b>", up=(-2, 1, 4, "m"))
"""
CURVE = """import matplotlib.pyplot as plt

plt.plot([1, 2]);
"""
PREDICT = 'from floatbase.lessons import predict\npredict("07.a", ..., unit="mm")'
CLAIMS = "# claims of the text above\nassert state.com[2] > 0.2"
CHECK = 'from floatbase.lessons import check\ncheck("00.1", 100.0)'


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of a lesson with everything that lessons have; two of its pictures are alike."""
    folder = tmp_path_factory.mktemp("lessons")
    cells: list[Any] = [new_markdown_cell(TEXT)]
    cells += [new_code_cell(code) for code in (ROBOT, STILL, STILL, MOVING, SLIDER, CURVE)]
    cells += [new_code_cell(PREDICT, metadata={"tags": ["predict"], "prediction": "07.a"})]
    cells += [new_code_cell(CLAIMS, metadata={"tags": ["claims"], "jupyter": {"source_hidden": True}})]
    cells += [new_code_cell("total = 100.0", metadata={"exercise": "00.1", "tags": ["exercise"]})]
    cells += [new_code_cell(CHECK, metadata={"tags": ["check"]})]
    nbformat.write(new_notebook(cells=cells), folder / "07_page.ipynb")
    nbformat.write(new_notebook(cells=[new_markdown_cell("# 08 · Next")]), folder / "08_next.ipynb")
    return pages.build(folder / "07_page.ipynb", folder / "pages")


def test_a_page_is_one_small_file_that_asks_nobody_for_anything(built: Path) -> None:
    text = built.read_text(encoding="utf-8")
    assert list(built.parent.iterdir()) == [built]
    assert not re.search(r'(src|href)="(?!data:|08_next\.html)', text)
    still = fb.Viewer(fb.load("go2"))
    still.show(still.robot.standing(), fb.Contacts.points(still.robot))
    alone = len(still.static_html())
    still.close()
    assert built.stat().st_size < 1.4 * alone  # viewer and meshes once, though there are four pictures


def test_a_page_says_what_the_lesson_says_and_what_a_slider_does(built: Path) -> None:
    text = built.read_text(encoding="utf-8")
    assert "<title>07 · A page</title>" in text
    assert '<a rel="next" href="08_next.html">08 · Next →</a>' in text
    assert '<a href="08_next.html">the next</a>' in text
    assert "standing &lt;still&gt;" in text
    assert "<code>$HOME</code>" in text
    assert 'class="number">(3)<' in text
    assert text.count('<figure class="scene"') == 4
    assert "up <b>1</b>" in text
    assert "answers to the slider <b>up [m]</b>, from −2 to 4 (here 1)" in text
    assert 'class="figure"' in text
    assert "total = " not in text and 'class="cell exercise"' in text  # coloured, so in parts
    assert "skipped" not in text and text.count('class="cell exercise"') == 2  # a question to answer, too
    assert text.count("<details") == 1 and text.index("<summary") < text.index("# claims of the text above")
    assert "compiling" not in text  # what this run alone had to say
    assert "Not yet" not in text and "FLOATBASE" not in text and "retina" not in text


browser = browser_of_a_file


@needs_chromium
def test_a_page_is_whole_in_a_browser_without_network(built: Path, browser: Any) -> None:
    page = browser.new_page(viewport={"width": 800, "height": 500})
    said: list[str] = []
    requested: list[str] = []
    page.on("console", lambda line: said.append(line.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("request", lambda request: requested.append(request.url))
    page.context.set_offline(True)
    page.goto(built.as_uri())

    bracket, letter = (page.locator(f"math {what}").first.bounding_box() for what in ("mo:text-is('[')", "mtd"))
    assert bracket["height"] > 2.5 * letter["height"]  # it grows around three rows
    places = page.locator("figure.scene")
    for i in range(places.count()):
        places.nth(i).scroll_into_view_if_needed()
        places.nth(i).locator("img").wait_for(state="attached", timeout=30_000)
        assert page.locator("figure.scene iframe").count() <= 3  # a browser draws about 16 at once
    inside = page.frames[-1]
    assert inside.evaluate("viewer.scene_tree.find(['meshcat', 'robot', 'root_joint']).object.children.length") > 0
    assert inside.evaluate("document.getElementById('title').textContent") == "moved"
    SCREENSHOTS.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=str(SCREENSHOTS / "lesson_page.png"))
    for still in page.locator("figure.scene img").all():
        data = base64.b64decode(still.get_attribute("src").split(",")[1])
        picture = np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(int)
        assert np.std(picture) > 10  # a robot on a light ground, not an empty canvas
    assert said == []
    assert [url for url in requested if not url.startswith(("file:", "data:", "blob:", "about:"))] == []
    page.close()


@needs_chromium
def test_a_page_fits_a_phone(built: Path, browser: Any) -> None:
    page = browser.new_page(viewport={"width": 360, "height": 640})
    page.goto(built.as_uri())
    assert page.evaluate("document.documentElement.scrollWidth") == 360
    assert page.locator("figure.scene").first.bounding_box()["height"] < 300
    page.close()


def test_every_text_of_the_course_becomes_html() -> None:
    lessons = {other.stem for other in (*FOLDER.glob("*.ipynb"), *FOLDER.glob("*.md"))}
    for cell in (cell for path in sorted(FOLDER.glob("*.ipynb")) for cell in read(path).cells):
        if cell.cell_type == "markdown":
            text = prose.to_html(cell.source)
            plain = re.sub(r"<code>.*?</code>|<div class=\"code\">.*?</div>", "", text, flags=re.DOTALL)
            assert "$" not in plain and "KEPT" not in plain and "\\" not in re.sub(r"<annotation.*?</annotation>", "", plain)
            assert set(re.findall(r'href="([^":]*)\.html"', text)) <= lessons
            assert plain.count('class="number"') == cell.source.count("\\tag{")


def test_a_file_page_gives_back_its_scene_and_other_texts_hold_none() -> None:
    commands = [b"first", b"", b"second"]
    assert viewer_page.scene_in(viewer_page.file_page(commands)) == commands
    with pytest.raises(ViewerError, match="contains no scene"):
        viewer_page.scene_in("<html></html>")


def test_a_lesson_that_is_not_there_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["publish", "pages", str(tmp_path / "no.ipynb"), "--to", str(tmp_path)])
    with pytest.raises(SystemExit):
        runpy.run_module("floatbase.lessons.publish", run_name="__main__")
    assert "there is no lesson" in capsys.readouterr().err
