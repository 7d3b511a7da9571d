"""The live robot used at random: `python benchmarks/live_soak.py`.

A program drags the robot and the view, moves sliders, presses buttons, walks and opens other robots
for ten minutes, in Chromium or Firefox. In the second half, the robot is go2. The table shows
exceptions, pictures per second, falls, and the memory of the browser. `--throttle 4` stops the
browser's processes for three quarters of the time, `--rest` presses nothing, and `--map` computes a
push-recovery map instead. The exit code is 1 after an exception. Firefox draws in 3-D only with a
display, such as that of `xvfb-run`.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from functools import partial
from http.server import ThreadingHTTPServer
from pathlib import Path
from typing import Any

import numpy as np
import psutil
from live import Handler

from floatbase.live import folder as live_folder

SAMPLE = 2.0  # s between two samples of the memory
WARM_UP = 0.6  # fraction of the time after which memory should not grow: the robot is go2 then
SLICE = 0.02  # s, of which a throttled process runs a fraction
PATIENCE = 60.0  # s beyond the time of the run
COMMANDS = {
    "chromium": ["chromium", "--headless", "--no-sandbox", "--use-gl=angle",
                 "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic",
                 "--no-first-run", "--disable-background-networking", "--window-size=1366,768"],
    "firefox": ["firefox-esr", "--no-remote", "--width=1366", "--height=768"],
}  # fmt: skip


def processes(browser: subprocess.Popen[bytes]) -> list[psutil.Process]:
    """The browser and its children that are alive."""
    try:
        first = psutil.Process(browser.pid)
        return [first, *first.children(recursive=True)]
    except psutil.NoSuchProcess:
        return []


def memory(browser: subprocess.Popen[bytes]) -> float:
    """Unique memory of all processes of the browser [MB]."""
    used = 0.0
    for process in processes(browser):
        try:
            used += process.memory_full_info().uss / 1e6
        except psutil.Error:  # it has just ended
            continue
    return used


def throttle(browser: subprocess.Popen[bytes], times: float, end: threading.Event) -> None:
    """Let the browser run for one part in `times` of each slice of time."""

    def each(method: str) -> None:
        for process in running:
            try:
                getattr(process, method)()
            except psutil.Error:
                continue

    while not end.is_set():
        running = processes(browser)
        each("suspend")
        time.sleep(SLICE * (1 - 1 / times))
        each("resume")
        end.wait(SLICE / times)


def use(command: list[str], minutes: float, times: float) -> tuple[Any, np.ndarray]:
    """Open the page, and return what it reports and the memory: time [s] and MB in two columns."""
    Handler.found = None
    browser = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    samples, start, ended = [], time.monotonic(), threading.Event()
    slow = threading.Thread(target=throttle, args=(browser, times, ended))
    try:
        if times > 1:
            time.sleep(5.0)  # the page loads first
            slow.start()
        while Handler.found is None and time.monotonic() < start + 60 * minutes + PATIENCE:
            samples.append((time.monotonic() - start, memory(browser)))
            time.sleep(SAMPLE)
    finally:
        ended.set()
        if times > 1:
            slow.join()
        browser.terminate()
        browser.wait()
    return Handler.found or {"errors": ["The page reported nothing."]}, np.array(samples)


def growth(samples: np.ndarray) -> float:
    """Slope of a straight line through the memory after the warm-up, times its duration [MB]."""
    late = samples[samples[:, 0] > WARM_UP * samples[-1, 0]]
    return float(np.polyfit(*late.T, 1)[0] * np.ptp(late[:, 0]))


def main(arguments: list[str] | None = None) -> int:
    """Run, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--browser", choices=COMMANDS, default="chromium")
    parser.add_argument("--throttle", type=float, default=1.0, metavar="TIMES")
    parser.add_argument("--rest", action="store_true", help="only watch a standing robot")
    parser.add_argument("--map", action="store_true", help="only compute a push-recovery map")
    given = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="floatbase-") as temporary:
        place, profile = Path(temporary) / "live", Path(temporary) / "profile"
        live_folder.write(place)
        shutil.copy(Path(__file__).with_suffix(".html"), place)
        profile.mkdir()
        (profile / "user.js").write_text('user_pref("webgl.force-enabled", true);\n')
        server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Handler, directory=str(place)))
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = (
            f"http://127.0.0.1:{server.server_port}/live_soak.html"
            f"?minutes={given.minutes:g}&seed={given.seed}&rest={int(given.rest)}&map={int(given.map)}"
        )
        own = {"chromium": [f"--user-data-dir={profile}"], "firefox": ["--profile", str(profile)]}
        command = [*COMMANDS[given.browser], *own[given.browser], address]
        found, samples = use(command, given.minutes, given.throttle)
        server.shutdown()
    for key in ("errors", "counts", "outcomes", "pictures", "map"):
        print(f"{key:22} {found.get(key)}")
    rates = found.get("rates") or [0]
    print(f"{'pictures per second':22} median {np.median(rates):.0f}, least {min(rates)}")
    print(f"{'least real-time factor':22} {found.get('least')}")
    print(
        f"{'memory of the browser':22} {samples[-1, 1]:.0f} MB, at most {samples[:, 1].max():.0f}, "
        f"growth after the warm-up {growth(samples):+.0f} MB"
    )
    return 1 if found["errors"] else 0


if __name__ == "__main__":
    sys.exit(main())
