"""How long a picture in JupyterLab is behind a slider:
`python benchmarks/latency.py [another copy of the project …]`.

A notebook with one `slider_panel` of go2 runs in a real JupyterLab and a real browser, once for
this copy of the project and once for each other one, and their sliders are moved by turns, a few
moves each. Told are the times from the key that moves the slider to the frame in the page, and to
the picture drawn from it, as medians and as ratios to the first copy: on a machine with other work
only these say much.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import nbformat
import numpy as np
from viewer import FLAGS, machine

TURN = 10  # moves of one copy before the next one's turn
# s from move to move: so that each is on its own, also where a processor draws and needs half a
# second for it
REST = 1.0
LONGEST = 180  # s until a notebook has run
CELL = """
import floatbase as fb
from floatbase.lessons.panels import slider_panel
robot = fb.load("go2")
view, contacts, state = fb.Viewer(robot), fb.Contacts.points(robot, 0.6), robot.standing()
def draw(lean):
    forces = [[lean, 0.0, robot.weight / 4]] * 4
    view.show(state, contacts, forces, title=f"{lean:.0f} N")
    return f"{lean:.0f} N"
slider_panel(view, draw, lean=(-20.0, 0.0, 20.0, "N"))
"""
NOTEBOOK = "jupyterapp.shell.currentWidget"
READY = (
    f"() => window.jupyterapp?.shell && "
    f"{NOTEBOOK}?.sessionContext?.session?.kernel?.connectionStatus === 'connected'"
)
KEYS = """() => { window.keys = []; window.addEventListener("keydown",
  () => keys.push(performance.timeOrigin + performance.now()), true); }"""
FRAMES = """() => {
  let n = viewer.num_messages_received, waits = false;
  const now = () => performance.timeOrigin + performance.now(), render = viewer.render.bind(viewer);
  window.frames_at = [], window.drawn_at = [];
  const put = (number) => { n = number; waits = true; frames_at.push(now()); };
  Object.defineProperty(viewer, "num_messages_received", {get: () => n, set: put});
  viewer.render = () => { render(); if (waits) drawn_at.push(now()); waits = false; };
}"""


@contextmanager
def lab(copy: Path) -> Iterator[str]:
    """The address of a JupyterLab whose kernels use a copy of the project, in a folder with the
    notebook.
    """
    with tempfile.TemporaryDirectory() as home:
        cell = nbformat.v4.new_code_cell(CELL)
        kernel = {"kernelspec": {"name": "python3", "display_name": "Python 3"}}
        nbformat.write(
            nbformat.v4.new_notebook(cells=[cell], metadata=kernel), Path(home) / "slider.ipynb"
        )
        places = dict.fromkeys(("JUPYTER_CONFIG_DIR", "JUPYTER_DATA_DIR", "HOME"), home)
        command = [
            sys.executable,
            "-m",
            "jupyterlab",
            "--no-browser",
            "--ip=127.0.0.1",
            "--port=0",
            "--allow-root",
        ]
        command += [
            "--IdentityProvider.token=t",
            "--LabApp.expose_app_in_browser=True",
            "--LabApp.news_url=None",
            home,
        ]
        log = Path(home) / "log"
        with log.open("w") as sink:
            environment = {**os.environ, **places, "PYTHONPATH": str(copy)}
            server = subprocess.Popen(
                command, env=environment, stdout=sink, stderr=sink, start_new_session=True, cwd=home
            )
        try:
            while not (found := re.search(r"http://127\.0\.0\.1:\d+", log.read_text())):
                time.sleep(0.2)
            yield found.group()
        finally:
            os.killpg(server.pid, signal.SIGTERM)
            server.wait()


def opened(browser: Any, address: str) -> tuple[Any, Any]:
    """The page of a notebook that has run and the frame of its picture, both noting times."""
    page = browser.new_page(viewport={"width": 1100, "height": 900})
    page.set_default_timeout(1000 * LONGEST)
    page.goto(f"{address}/lab/tree/slider.ipynb?token=t")
    page.wait_for_selector(".jp-Notebook .jp-CodeCell")
    page.wait_for_function(READY)
    while not page.locator(
        ".jp-OutputArea iframe"
    ).count():  # a kernel that is still starting drops the wish
        page.evaluate("() => { window.jupyterapp.commands.execute('notebook:run-all-cells'); }")
        time.sleep(8)
    frame = page.locator(".jp-OutputArea iframe").first.element_handle().content_frame()
    frame.wait_for_function("() => window.viewer?.num_messages_received > 0")
    frame.evaluate(FRAMES)
    page.evaluate(KEYS)
    return page, frame


def move(page: Any, frame: Any, number: int) -> tuple[float, float, int]:
    """ms from a key to the frame, and to the picture, and how many frames there were."""
    frame.evaluate("() => { frames_at.length = drawn_at.length = 0; }")
    page.evaluate("() => { keys.length = 0; }")
    page.locator(".noUi-handle").first.focus()
    page.keyboard.press("ArrowRight" if number // 20 % 2 else "ArrowLeft")
    frame.wait_for_function("() => drawn_at.length > 0")
    time.sleep(REST)
    (key,), (frames, drawn) = page.evaluate("keys"), frame.evaluate("() => [frames_at, drawn_at]")
    return frames[0] - key, drawn[0] - key, len(frames)


def main(arguments: list[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("copies", nargs="*", type=Path, help="other copies of the project")
    parser.add_argument("--moves", type=int, default=60, help="of each copy's slider (60)")
    options = parser.parse_args(arguments)
    from playwright.sync_api import sync_playwright

    copies = [Path(__file__).resolve().parents[1], *options.copies]
    print(machine())
    times: dict[Path, list[tuple[float, float, int]]] = {copy: [] for copy in copies}
    with ExitStack() as stack:
        addresses = [stack.enter_context(lab(copy.resolve())) for copy in copies]
        browser = stack.enter_context(sync_playwright()).chromium.launch(
            executable_path=shutil.which("chromium"), args=FLAGS
        )
        pages = [opened(browser, address) for address in addresses]
        for turn in range(-(-options.moves // TURN)):
            for copy, (page, frame) in zip(copies, pages, strict=True):
                page.bring_to_front()
                times[copy] += [move(page, frame, turn * TURN + i) for i in range(TURN)]
        browser.close()
    first = np.median(times[copies[0]], axis=0)
    for copy in copies:
        frame, drawn, frames = np.median(times[copy], axis=0)
        ratios = json.dumps([round(float(x), 2) for x in (frame / first[0], drawn / first[1])])
        print(
            f"{copy.name:20} frame after {frame:6.1f} ms, picture after {drawn:6.1f} ms, frames "
            f"{frames:g}, ratios {ratios}"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
