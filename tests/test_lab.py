"""JupyterLab in a real browser: two lessons run without an error, and each of their pictures answers to its sliders.

The browser reaches JupyterLab's own address and nothing else, as that of a reader whose kernel is on another machine.
What JupyterLab saves of a lesson that was only run and looked at does not count as a learner's writing.

What the lessons compute is test_notebooks' business, what all other sliders do is tests/lessons': both need no browser.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import nbformat
import pytest
from browsers import SCREENSHOTS, browser_of_a_file, needs_chromium

from floatbase.lessons.publish import FOLDER, MINE, prepare, read

LESSONS = ("00_start_here", "03_feasible_space")  # a robot that is simulated under the page; panels of many sliders
IDLE = {"towards [°]"}  # sliders that show nothing by themselves: this one aims the next push
LONG = 90.0  # s that a busy machine may take for anything; nothing is taken for absent earlier

pytestmark = [needs_chromium, pytest.mark.timeout(600)]

NOTEBOOK = "jupyterapp.shell.currentWidget"
KERNEL_CONNECTED = f"() => {NOTEBOOK}?.sessionContext?.session?.kernel?.connectionStatus === 'connected'"
CELLS = f"{NOTEBOOK}.content.widgets.map(w => w.model).filter(m => m.type === 'code')"
FIRST_RAN = f"() => {CELLS}[0].executionCount !== null"
ALL_RAN = f"() => {CELLS}.every(m => m.executionCount !== null && m.executionState !== 'running')"
ERRORS = f"() => {CELLS}.flatMap(m => m.outputs.toJSON()).filter(o => o.output_type === 'error').map(o => o.evalue)"
# marks every slider with the number of its cell and its own, and every such cell; the names of the sliders, cell by cell
SLIDERS = f"""() => {{
  const found = {{}};
  {NOTEBOOK}.content.widgets.forEach((cell, i) => cell.node.querySelectorAll(".widget-slider").forEach((slider, j) => {{
    cell.node.dataset.cell = i;
    slider.querySelector(".noUi-handle").dataset.slider = `${{i}}-${{j}}`;
    (found[i] ??= []).push(slider.querySelector(".widget-label").textContent);
  }}));
  return found;
}}"""
# what a panel says, its sliders aside
SAID = """(cell) => [...cell.querySelectorAll(".jp-OutputArea .widget-html, .jp-OutputArea .widget-label")]
  .filter((part) => !part.closest(".widget-slider") && !part.querySelector("iframe")).map((part) => part.innerHTML).join("|")"""
# the scene of a page, to the millimetre: every node with its place, and whether it is seen
SCENE = """() => {
  const found = [];
  const walk = (node, path) => {
    found.push([path, node.visible, ...node.matrix.elements.map((x) => x.toFixed(3))].join(" "));
    for (const child of node.children || []) walk(child, path + "/" + child.name);
  };
  walk(viewer.scene, "");
  return found.join("\\n");
}"""


# m, of the robot's base
HEIGHT = "() => viewer.scene_tree.find(['meshcat', 'robot', 'root_joint']).object.position.z"
# what a reader may press; none of it is writing
LOOKS = (
    "notebook:hide-all-cell-code", "notebook:hide-all-cell-outputs", "notebook:enable-output-scrolling",
    "notebook:collapse-all-headings", "notebook:insert-cell-below",
)  # fmt: skip
SAVE = f"""async () => {{
  for (const name of {list(LOOKS)}) await window.jupyterapp.commands.execute(name);
  await {NOTEBOOK}.context.save();
}}"""
# settings of JupyterLab that make it save more than by default
SETTINGS = {
    "@jupyterlab/notebook-extension/tracker": {"recordTiming": True},
    "@jupyter-widgets/jupyterlab-manager/plugin": {"saveState": True},
}


@pytest.fixture(scope="module")
def course(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A course of these lessons, prepared for a learner: without outputs, so that what is seen was made here."""
    folder = tmp_path_factory.mktemp("course")
    for name in LESSONS:
        shutil.copy(FOLDER / f"{name}.ipynb", folder)
    prepare(folder)
    return folder


@pytest.fixture(scope="module")
def lab(course: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a JupyterLab for that learner."""
    home = tmp_path_factory.mktemp("home")
    for name, setting in SETTINGS.items():
        place = home / "lab" / "user-settings" / f"{name}.jupyterlab-settings"
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(json.dumps(setting))
    environment = {**os.environ, "JUPYTER_CONFIG_DIR": str(home), "JUPYTER_DATA_DIR": str(home), "HOME": str(home)}
    log = home / "server.log"
    with log.open("w") as sink:
        server = subprocess.Popen(
            [
                *(sys.executable, "-m", "jupyterlab", "--no-browser", "--ip=127.0.0.1", "--port=0", "--allow-root"),
                *("--IdentityProvider.token=a-test", "--LabApp.expose_app_in_browser=True", "--LabApp.news_url=None"),
                str(course),
            ],
            env=environment,
            stdout=sink,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    try:
        yield _address(log)
    finally:
        os.killpg(server.pid, signal.SIGTERM)
        server.wait(timeout=20)


browser = browser_of_a_file


@pytest.mark.parametrize("name", LESSONS)
def test_a_lesson_runs_its_pictures_answer_to_their_sliders_and_nothing_of_it_counts_as_writing(
    lab: str, course: Path, browser: Any, name: str
) -> None:
    page = browser.new_page(viewport={"width": 1100, "height": 800})
    page.set_default_timeout(1000 * LONG)
    strangers = _only(page, lab)
    try:
        page.goto(f"{lab}/lab/workspaces/{name}/tree/{MINE}/{name}.ipynb?token=a-test")
        page.wait_for_selector(".jp-Notebook .jp-CodeCell")
        page.wait_for_function(f"() => window.jupyterapp?.shell && {NOTEBOOK}?.content")
        page.wait_for_function(KERNEL_CONNECTED)
        _run_all(page)
        page.wait_for_function(ALL_RAN)
        assert page.evaluate(ERRORS) == []
        panels = page.evaluate(SLIDERS)
        idle = {slider for cell, sliders in panels.items() for slider in _idle_sliders(page, name, cell, sliders)}
        assert not idle, f"{name}: these sliders change nothing: {sorted(idle)}"
        assert panels
        if name == LESSONS[0]:
            _push_until_it_falls(page)
        assert strangers == []
        page.evaluate(SAVE)
        _change(course / f"{name}.ipynb")
        assert prepare(course) == [f"{name}.ipynb: updated"]
    finally:
        _picture(page, name, "end")
        page.evaluate("() => window.jupyterapp?.serviceManager.sessions.shutdownAll()")
        page.close()


def _idle_sliders(page: Any, name: str, number: str, sliders: list[str]) -> list[str]:
    """Names of the sliders of a cell that change neither its picture nor what it says; one at least must move the picture."""
    cell = page.locator(f'[data-cell="{number}"]')
    page.evaluate(f"(number) => {NOTEBOOK}.content.scrollToItem(number, 'smart')", int(number))
    cell.locator("iframe").first.scroll_into_view_if_needed()
    frame = cell.locator("iframe").first.element_handle().content_frame()
    frame.wait_for_function("() => window.viewer?.num_messages_received > 0", timeout=1000 * LONG)
    idle, start = [], frame.evaluate(SCENE)
    for i, slider in enumerate(sliders):
        if slider in IDLE:
            continue
        before = frame.evaluate(SCENE), cell.evaluate(SAID)
        _move(page, page.locator(f'[data-slider="{number}-{i}"]'))
        after = _once_new(lambda: (frame.evaluate(SCENE), cell.evaluate(SAID)), before)
        idle += [slider] if after == before else []
    moved = _once_new(lambda: frame.evaluate(SCENE), start) != start  # what the panel says may be there before the picture
    _picture(page, name, f"panel_{number}")
    assert moved, f"{name}, cell {number}: no slider moves the picture"
    return idle


def _only(page: Any, address: str) -> list[str]:
    """Let a page reach this address alone; what else it asks for, as it does so."""
    strangers: list[str] = []

    def judge(route: Any) -> None:
        url = route.request.url
        if url.startswith(address):
            route.continue_()
        else:
            strangers.append(url)
            route.abort()

    def told(socket: Any) -> None:
        if not socket.url.startswith(address.replace("http", "ws")):
            strangers.append(socket.url)

    page.route(lambda url: url.startswith(("http:", "https:")), judge)
    page.on("websocket", told)
    return strangers


def _push_until_it_falls(page: Any) -> None:
    """Push the robot of the first lesson as hard as the panel can, until the picture shows it on the ground."""
    from playwright.sync_api import Error

    panel = page.locator(".jp-Cell", has=page.get_by_role("button", name="push", exact=True)).first
    panel.scroll_into_view_if_needed()
    frame = panel.locator("iframe").first.element_handle().content_frame()
    frame.wait_for_function("() => window.viewer?.num_messages_received > 0", timeout=1000 * LONG)
    standing = frame.evaluate(HEIGHT)
    panel.locator(".widget-slider .noUi-handle").first.focus()
    page.keyboard.press("End")
    fallen, until = f"({HEIGHT})() < {0.6 * standing}", time.monotonic() + LONG
    while not frame.evaluate(fallen):
        assert time.monotonic() < until, f"it does not fall: {frame.evaluate(HEIGHT)} m, {panel.inner_text()}"
        with suppress(Error):  # it stood that push
            frame.wait_for_function(fallen, timeout=8000)
            break
        panel.get_by_role("button", name="push", exact=True).click()
    _picture(page, "00", "fallen")


def _move(page: Any, handle: Any) -> None:
    """Move a slider by its keys, the way that is open."""
    handle.scroll_into_view_if_needed()
    now, most = (float(handle.get_attribute(f"aria-value{name}")) for name in ("now", "max"))
    handle.focus()
    for _ in range(4):
        page.keyboard.press("ArrowRight" if now < most else "ArrowLeft")


def _once_new(look: Callable[[], Any], before: Any) -> Any:
    """What is seen once it differs from `before`; the same as ever when it never does."""
    until = time.monotonic() + LONG
    while (seen := look()) == before and time.monotonic() < until:
        time.sleep(0.1)
    return seen


def _run_all(page: Any) -> None:
    """Run all cells; a kernel that is still starting drops the wish, so it is said again until the first cell ran."""
    for _ in range(6):
        page.evaluate("() => { window.jupyterapp.commands.execute('notebook:run-all-cells'); }")
        for _ in range(30):
            time.sleep(0.5)
            if page.evaluate(FIRST_RAN):
                return
    raise AssertionError("the kernel ran no cell")


def _change(lesson: Path) -> None:
    notebook = read(lesson)
    notebook.cells[0].source += "."
    nbformat.write(notebook, lesson)


def _picture(page: Any, name: str, part: str) -> None:
    SCREENSHOTS.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=str(SCREENSHOTS / f"lesson_{name.split('_')[0]}_{part}.png"))


def _address(log: Path) -> str:
    """Where the server listens, once it says so."""
    for _ in range(300):
        found = re.search(r"http://127\.0\.0\.1:\d+", log.read_text())
        if found:
            return found.group()
        time.sleep(0.2)
    raise AssertionError(f"JupyterLab did not start:\n{log.read_text()}")
