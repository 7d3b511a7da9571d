"""The browser that tests look at pages with: the system's Chromium, where there is one."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from floatbase._browser import browser_path
from floatbase.viewer.web import pages

SCREENSHOTS = Path(__file__).parents[1] / "build" / "screenshots"
CHROMIUM = browser_path()
FLAGS = [
    "--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader", "--disable-quic",
    "--no-first-run", "--disable-background-networking", "--webgl-antialiasing-mode=none",
]  # fmt: skip
AXE = pages.DIST.parent / "node_modules" / "axe-core" / "axe.min.js"
needs_axe = pytest.mark.skipif(
    not AXE.exists(),
    reason="axe-core is not installed: run `npm ci` in floatbase/viewer/web to check the access",
)
needs_chromium = pytest.mark.skipif(
    CHROMIUM is None, reason="no Chromium on this machine: nothing was looked at in a browser"
)


def launched(*flags: str) -> Iterator[Any]:
    """A headless Chromium, closed when the caller has finished. Playwright keeps an event loop
    running in this thread.

    flags: more flags for Chromium.
    """
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if CHROMIUM is None:
        pytest.skip("no Chromium found on the path")
    with playwright.sync_playwright() as started:
        chromium = started.chromium.launch(executable_path=CHROMIUM, args=[*FLAGS, *flags])
        yield chromium
        chromium.close()


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *args: Any) -> None:
        """Say nothing."""


@contextmanager
def served(folder: Path) -> Iterator[str]:
    """The address of a server of this folder, without a slash at the end."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(_Quiet, directory=str(folder)))
    Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        server.server_close()


@pytest.fixture(scope="module")
def browser_of_a_file() -> Iterator[Any]:
    yield from launched()


def barriers(page: Any) -> list[str]:
    """What axe finds in a page and its frames, with all folded parts open: serious or critical."""
    for frame in page.frames:
        frame.evaluate("for (const part of document.querySelectorAll('details')) part.open = true")
        frame.evaluate(AXE.read_text(encoding="utf-8"))
    found = page.evaluate("axe.run({resultTypes: ['violations']})")["violations"]
    return [
        f"{one['impact']}: {one['help']}: {node['html'][:200]}"
        for one in found
        if one["impact"] in ("serious", "critical")
        for node in one["nodes"]
    ]
