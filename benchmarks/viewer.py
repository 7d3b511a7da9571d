"""How long the viewer keeps its caller waiting: `python benchmarks/viewer.py`.

It measures `set_transform` and a full
`show` of go2 with a new state, new measured and planned forces and four cones each time. First
without a page, then with one page of a real browser on the same machine, which draws all the time
(left out without Chromium and playwright). The loop does not pause between calls, so window and
page are as busy as they can be; only the last row draws 30 times a second, as a lesson does. "work"
is the median processor time of the caller's own thread, which other programs on the machine hardly
change.
"""

from __future__ import annotations

import argparse
import os
import platform
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from importlib.metadata import version
from pathlib import Path

import numpy as np

import floatbase as fb
from floatbase.viewer.scene import protocol
from floatbase.viewer.transport.window import Window

TARGETS = {"set_transform": 25.0, "show": 1500.0}  # µs, median
FLAGS = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
]


Row = tuple[
    str, str, np.ndarray
]  # what was called; how; (2, calls), µs: time and work of each call


def timed(call: Callable[[int], object], calls: int, pause: float = 0.0) -> np.ndarray:
    """Time of each call and the work of this thread in it, (2, calls), µs.

    call: called with the number of the call. calls: how many calls. pause: s before each call.
    """
    times = np.empty((2, calls))
    for i in range(calls):
        time.sleep(pause)
        work, start = time.thread_time_ns(), time.perf_counter_ns()
        call(i)
        times[:, i] = time.perf_counter_ns() - start, time.thread_time_ns() - work
    return times / 1e3


def transforms(window: Window, calls: int) -> Iterator[Row]:
    """Moving an object."""
    matrices = np.tile(np.eye(4), (100, 1, 1))
    matrices[:, 0, 3] = np.arange(100)

    def put(i: int) -> None:
        window.put([protocol.set_transform("/meshcat/box", matrices[i % 100])])

    yield "set_transform", "Window.put", timed(put, calls)


def shows(view: fb.Viewer, calls: int, pause: float = 0.0) -> Iterator[Row]:
    """A full picture in which everything is new. The state is made in the call, as a slider's
    callback does, so it counts.
    """
    robot, random = view.robot, np.random.default_rng(0)
    contacts = fb.Contacts.points(robot, 0.6)
    home = robot.standing().q
    for facets in (None, 4) if not pause else (None,):
        view.painter = view.painter.replace(facets=facets)
        places = home + np.hstack(
            [np.zeros((calls, 7)), random.normal(0, 0.03, (calls, robot.nq - 7))]
        )
        lean = random.normal(0, 0.25, (calls, 2, 4, 3)) * [1, 1, 0.3]
        forces = 0.25 * robot.weight * (lean + [0.0, 0.0, 1.0])

        def show(i: int, places: np.ndarray = places, forces: np.ndarray = forces) -> None:
            view.show(
                fb.State(robot, places[i]), contacts, forces[i, 0], forces[i, 1], title=f"{i}"
            )

        what = "cones" if facets is None else f"{facets} facets each"
        yield (
            "show",
            f"forces, planned, {what}" + (", 30 a second" if pause else ""),
            timed(show, calls, pause),
        )


@contextmanager
def a_page(url: str) -> Iterator[bool]:
    """Open a page in a real browser; gives whether there is one."""
    found = (
        shutil.which("chromium")
        or shutil.which("chromium-browser")
        or shutil.which("google-chrome")
    )
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        found = None
    if found is None:
        yield False
        return
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=found, args=FLAGS)
        browser.new_page(viewport={"width": 900, "height": 600}).goto(url)
        yield True
        browser.close()


def machine() -> str:
    """Names and versions of the processor, Python and the packages."""
    cpu = platform.processor() or platform.machine()
    if Path("/proc/cpuinfo").exists():
        names = [
            line.split(":")[1].strip()
            for line in Path("/proc/cpuinfo").read_text().splitlines()
            if "model name" in line
        ]
        cpu = names[0] if names else cpu
    packages = ", ".join(f"{name} {version(name)}" for name in ("tornado", "numpy", "pin"))
    return (
        f"{cpu}, {os.cpu_count()} cores, {platform.system()}; Python "
        f"{platform.python_version()}, {packages}"
    )


def main(arguments: list[str] | None = None) -> int:
    """Print the table. Returns 1 if a median misses its target, else 0."""
    parser = argparse.ArgumentParser(description="Times of the viewer on the Python side.")
    parser.add_argument(
        "--calls", type=int, default=20_000, help="of set_transform; a tenth of it of show (20000)"
    )
    parser.add_argument("--no-page", action="store_true", help="leave the browser out")
    options = parser.parse_args(arguments)
    print(machine())
    print(f"{'':9}{'call':14}{'':43}{'median':>10}{'p99':>10}{'work':>10}{'target':>10}   (µs)")
    missed = False

    def report(page: str, rows: Iterator[Row]) -> None:
        nonlocal missed
        for call, how, times in rows:
            (median, slow), work = np.percentile(times[0], [50, 99]), np.median(times[1])
            missed = missed or median > TARGETS[call]
            verdict = "missed" if median > TARGETS[call] else ""
            print(
                f"{page:9}{call:14}{how:43}{median:10.1f}{slow:10.1f}{work:10.1f}"
                f"{TARGETS[call]:10.0f}  {verdict}",
                flush=True,
            )

    def both(page: str) -> None:
        report(page, transforms(view.window, options.calls))
        report(page, shows(view, max(options.calls // 10, 1)))

    view = fb.Viewer(fb.load("go2"))
    view.show(view.robot.standing())
    try:
        both("no page")
        with nullcontext(False) if options.no_page else a_page(view.url) as there:
            if there:
                while not view.window.n_pages:
                    time.sleep(0.01)
                both("one page")
                report("one page", shows(view, max(options.calls // 100, 1), 1 / 30))
            elif not options.no_page:
                print("one page: left out, no Chromium or no playwright here")
    finally:
        view.close()
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())
