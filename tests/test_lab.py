"""JupyterLab in a real browser: lesson 00 runs, the robot is in the page, a slider moves it."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import nbformat
import pytest

from floatbase.lessons.notebooks import FOLDER, read, without_outputs

LESSON = "00_start_here.ipynb"
ROOT = Path(__file__).parents[1]
SCREENSHOTS = ROOT / "build" / "screenshots"
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
FLAGS = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
]

pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine: the lesson was not looked at in a browser"),
    pytest.mark.timeout(300),
]

# names of everything in the scene below a path
NAMES = """() => {
  const found = [];
  const walk = (node, path) => {
    found.push(path);
    for (const child of node.children || []) if (child.name) walk(child, path + "/" + child.name);
  };
  walk(viewer.scene, "");
  return found;
}"""
KERNEL_CONNECTED = "() => jupyterapp.shell.currentWidget?.sessionContext?.session?.kernel?.connectionStatus === 'connected'"
CELLS = "jupyterapp.shell.currentWidget.content.widgets.map(w => w.model).filter(m => m.type === 'code')"
FIRST_RAN = f"() => {CELLS}[0].executionCount !== null"
ALL_RAN = f"() => {CELLS}.every(m => m.executionCount !== null && m.executionState !== 'running')"
ERRORS = f"() => {CELLS}.flatMap(m => m.outputs.toJSON()).filter(o => o.output_type === 'error').map(o => o.evalue)"
BASE = "() => viewer.scene_tree.find(['meshcat', 'robot', 'root_joint']).object.matrix.elements.slice(12, 15)"


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """JupyterLab on a copy of the lessons; the address of lesson 00."""
    lessons = tmp_path_factory.mktemp("lessons")
    notebook = without_outputs(read(FOLDER / LESSON))  # so that what is seen was made here
    nbformat.write(notebook, lessons / LESSON)
    home = tmp_path_factory.mktemp("home")
    environment = {**os.environ, "JUPYTER_CONFIG_DIR": str(home), "JUPYTER_DATA_DIR": str(home), "HOME": str(home)}
    log = home / "server.log"
    with log.open("w") as sink:
        server = subprocess.Popen(
            [
                *(sys.executable, "-m", "jupyterlab", "--no-browser", "--ip=127.0.0.1", "--port=0", "--allow-root"),
                *("--IdentityProvider.token=a-test", "--LabApp.expose_app_in_browser=True", "--LabApp.news_url=None"),
                str(lessons),
            ],
            env=environment,
            stdout=sink,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    try:
        yield f"{_address(log)}/lab/tree/{LESSON}?token=a-test"
    finally:
        os.killpg(server.pid, signal.SIGTERM)
        server.wait(timeout=20)


def _address(log: Path) -> str:
    """Where the server listens, once it says so."""
    for _ in range(300):
        found = re.search(r"http://127\.0\.0\.1:\d+", log.read_text())
        if found:
            return found.group()
        time.sleep(0.2)
    raise AssertionError(f"JupyterLab did not start:\n{log.read_text()}")


def _run_all(page: Any) -> None:
    """Run all cells; a kernel that is still starting drops the wish, so it is said again until the first cell ran."""
    for _ in range(6):
        page.evaluate("() => { window.jupyterapp.commands.execute('notebook:run-all-cells'); }")
        for _ in range(15):
            time.sleep(1.0)
            if page.evaluate(FIRST_RAN):
                return
    raise AssertionError("the kernel ran no cell")


def test_lesson_00_shows_a_robot_that_answers_to_a_slider(lab: str) -> None:
    from playwright.sync_api import sync_playwright

    SCREENSHOTS.mkdir(parents=True, exist_ok=True)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        page = browser.new_page(viewport={"width": 1300, "height": 900})
        page.goto(lab)
        page.wait_for_selector(".jp-Notebook .jp-CodeCell", timeout=90_000)
        page.wait_for_function("() => window.jupyterapp !== undefined", timeout=30_000)
        page.wait_for_function(KERNEL_CONNECTED, timeout=90_000)
        _run_all(page)
        try:
            page.wait_for_function(ALL_RAN, timeout=120_000)
        finally:
            page.screenshot(path=str(SCREENSHOTS / "lesson_00_end.png"))
        assert page.evaluate(ERRORS) == []

        page.locator(".jp-Notebook iframe").first.scroll_into_view_if_needed()
        time.sleep(4)
        page.screenshot(path=str(SCREENSHOTS / "lesson_00_top.png"))
        frames = [frame for frame in page.frames if frame.url.startswith("http://127.0.0.1") and "/lab" not in frame.url]
        assert frames, "no picture in the page"
        names = frames[0].evaluate(NAMES)
        for kind in ("measured", "cone"):
            feet = {name.split(f"/{kind}/")[1].split("/")[0] for name in names if f"/{kind}/" in name}
            assert len(feet) == 4, (kind, feet)
        assert sum("/robot/" in name for name in names) >= 13

        handle = page.locator(".jp-Notebook .noUi-handle").first
        handle.scroll_into_view_if_needed()
        time.sleep(1)  # pages out of sight sleep; this one wakes up
        before = [frame.evaluate(BASE) for frame in frames]
        handle.focus()
        for _ in range(6):
            page.keyboard.press("ArrowRight")
        moved = 0.0
        for _ in range(30):
            time.sleep(0.1)
            moved = max([moved] + [abs(f.evaluate(BASE)[1] - b[1]) for f, b in zip(frames, before, strict=True)])
        page.screenshot(path=str(SCREENSHOTS / "lesson_00_push.png"))
        browser.close()
    assert moved > 0.002, "the slider moved nothing"
