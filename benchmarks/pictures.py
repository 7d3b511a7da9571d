"""Pictures per second of a live robot in a browser that draws without a graphics card.

    python benchmarks/pictures.py FOLDER

FOLDER is that of `python -m floatbase.lessons.publish live --to FOLDER`. The robot trots, so that
every picture differs from the one before it.
"""

import sys
import time
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

import psutil
from playwright.sync_api import sync_playwright

from floatbase._browser import browser_path

SIZES = ((800, 600, 1.0), (1366, 768, 1.0), (390, 844, 3.0))  # pixels, and pixels per pixel
FLAGS = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
WARM_UP, DURATION = 8.0, 12.0  # s
COUNT = """() => {
  const render = viewer.render.bind(viewer);
  window.pictures = 0;
  viewer.render = () => { window.pictures++; render(); };
}"""
STATE = "() => [window.pictures, floatbaseLive.frame().time, viewer.renderer.getPixelRatio()]"


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *args: Any) -> None:
        """Say nothing."""


def drawing_time() -> float:
    """Return the processor seconds of the browser's process that draws."""
    processes = psutil.Process().children(recursive=True)
    drawing = [one.cpu_times() for one in processes if "--type=gpu-process" in one.cmdline()]
    return sum(times.user + times.system for times in drawing)


def measure(folder: Path) -> None:
    """Measure and print each size."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(_Quiet, directory=str(folder)))
    Thread(target=server.serve_forever, daemon=True).start()
    with sync_playwright() as playwright:
        for width, height, ratio in SIZES:
            browser = playwright.chromium.launch(executable_path=browser_path(), args=list(FLAGS))
            page = browser.new_page(
                viewport={"width": width, "height": height}, device_scale_factor=ratio
            )
            page.goto(f"http://127.0.0.1:{server.server_port}/robot.html?gait=trot&panel=0")
            page.wait_for_selector("body.live", timeout=60_000)
            page.wait_for_timeout(1e3 * WARM_UP)
            page.evaluate(COUNT)
            pictures, simulated, _ = page.evaluate(STATE)
            begun, before = time.perf_counter(), drawing_time()
            page.wait_for_timeout(1e3 * DURATION)
            worked, elapsed = drawing_time() - before, time.perf_counter() - begun
            drawn, now, drawn_ratio = page.evaluate(STATE)
            count = drawn - pictures
            print(
                f"{width} x {height} at {ratio:g}: {count / elapsed:4.1f} pictures/s, "
                f"{(now - simulated) / elapsed:.2f} x real time, "
                f"{1e3 * worked / max(count, 1):4.0f} ms of processor time to draw one "
                f"(ratio {drawn_ratio:g}), load {psutil.getloadavg()[0]:.0f}",
                flush=True,
            )
            browser.close()
    server.shutdown()


if __name__ == "__main__":
    measure(Path(sys.argv[1]))
