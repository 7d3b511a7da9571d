"""Look at a whole site in a browser: `python .ci/check_site.py build/site`.

Every page is opened. No page may ask another host for anything, every 3-D scene must draw, and
every control of every panel must change its picture or its note, all without a kernel. Recordings
that a live robot replaces are checked without its script, then every robot must become live. Prints
how long each page's first picture took and what was found.
"""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from browsers import launched, served
from playwright.sync_api import TimeoutError

LIVE_SCRIPT = "**/floatbase-live.js"
WAIT = 60_000  # ms for a picture on a machine that draws by software
# what a scene shows: where everything is, in which colours and shapes, or that nothing is drawn yet
SEEN = """() => {
  if (typeof viewer === "undefined") return null;
  const found = [];
  viewer.scene_tree.find(["meshcat"]).object.traverse((one) => {
    one.updateMatrix();
    const {geometry, material} = one;
    const position = geometry?.attributes?.position;
    found.push(one.name, one.visible, one.matrix.elements.map((x) => x.toFixed(4)).join(),
               material?.color?.getHex(), position?.count, position?.array?.slice(0, 30).join());
  });
  const duration = viewer.animator.duration;
  return duration > 0 ? `plays ${duration}` + found.length : found.join("|");
}"""
# moves a control to its nth place; false where it has none
MOVE = """(one, n) => {
  const range = one.type === "range", select = one.tagName === "SELECT";
  const last = range ? Number(one.max) : select ? one.options.length - 1 : 1;
  if (n > last) return false;
  if (range) one.value = n;
  else if (select) one.selectedIndex = n;
  else one.checked = !one.checked;
  one.dispatchEvent(new Event(range ? "input" : "change", {bubbles: true}));
  return true;
}"""
END = """(one) => {
  if (one.type === "range") one.value = one.max;
  else if (one.tagName === "SELECT") one.selectedIndex = one.options.length - 1;
  one.dispatchEvent(new Event(one.type === "range" ? "input" : "change", {bubbles: true}));
}"""


def faults_of(page: Any, address: str) -> Iterator[str]:
    """What is wrong with a page, and a line on the error stream about what was found."""
    began = time.perf_counter()
    page.goto(address)
    figures, first, moved = page.locator(".floatbase-picture"), 0.0, 0
    for number in range(figures.count()):
        figure = figures.nth(number)
        figure.scroll_into_view_if_needed()
        frames = [handle.content_frame() for handle in _frames(page, figure)]
        for frame in frames:
            frame.wait_for_function(f"({SEEN})()?.length > 20", timeout=WAIT)
        first = first or time.perf_counter() - began
        if figure.get_by_text("cannot be loaded").count():
            yield f"picture {number}: a file is missing"
        controls = figure.locator(".floatbase-controls :is(input, select)")
        for which in range(controls.count()):
            moved += 1
            if not _answers(page, figure, frames, controls, which):
                yield f"picture {number}: control {which} changes nothing"
    print(
        f"{address}: {figures.count()} pictures, {moved} controls, first picture after {first:.1f} "
        f"s",
        file=sys.stderr,
    )


def robot_faults(page: Any, address: str) -> Iterator[str]:
    """Which live robots of a page do not become live."""
    page.goto(address)
    robots = page.locator("floatbase-robot")
    for number in range(robots.count()):
        began = time.perf_counter()
        robots.nth(number).scroll_into_view_if_needed()
        frame = robots.nth(number).locator(":scope > iframe").element_handle(timeout=WAIT)
        try:
            live = "document.body.classList.contains('live')"
            frame.content_frame().wait_for_function(live, timeout=WAIT)
        except TimeoutError:
            yield f"robot {number} is not live"
        print(f"{address}: live after {time.perf_counter() - began:.1f} s", file=sys.stderr)


def _frames(page: Any, figure: Any) -> list[Any]:
    """The frames of a figure's scenes, once there are all of them."""
    scenes = figure.locator(".floatbase-scene > div").count()
    for _ in range(scenes):
        figure.locator("iframe").nth(scenes - 1).wait_for(state="attached", timeout=WAIT)
    return figure.locator("iframe").element_handles()


def _answers(page: Any, figure: Any, frames: list[Any], controls: Any, which: int) -> bool:
    """Whether some place of a control changes what is seen, with the others where they are or at
    their ends.

    The direction of a push, for instance, changes nothing while the push is 0 N.
    """
    if _moves(page, figure, frames, controls.nth(which)):
        return True
    for other in range(controls.count()):
        if other != which:
            controls.nth(other).evaluate(END)
    return _moves(page, figure, frames, controls.nth(which))


def _moves(page: Any, figure: Any, frames: list[Any], control: Any) -> bool:
    control.scroll_into_view_if_needed()

    def seen() -> list[Any]:
        return [
            figure.locator(".floatbase-note").inner_html(),
            *(frame.evaluate(SEEN) for frame in frames),
        ]

    before, place = seen(), 0
    while control.evaluate(MOVE, place):
        for _ in range(20):
            if seen() != before:
                return True
            page.wait_for_timeout(50)
        place += 1
    return False


def main() -> int:
    """The command; 1 when something is wrong."""
    folder, wrong = Path(sys.argv[1]), 0
    pages = [path for path in sorted(folder.rglob("*.html")) if "_static" not in path.parts]
    with served(folder) as address, contextmanager(launched)() as browser:
        elsewhere: list[str] = []
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.on("request", lambda asked: elsewhere.append(asked.url))
        for path in pages:
            there = f"{address}/{path.relative_to(folder).as_posix()}"
            page.route(LIVE_SCRIPT, lambda route: route.abort())
            faults = list(faults_of(page, there))
            page.unroute(LIVE_SCRIPT)
            for fault in faults + list(robot_faults(page, there)):
                wrong += 1
                print(f"{path.relative_to(folder)}: {fault}")
        foreign = {url for url in elsewhere if not url.startswith((address, "data:", "blob:"))}
    for url in foreign:
        print(f"asked for: {url}")
    wrong += len(foreign)
    print(f"{len(pages)} pages: {f'{wrong} faults' if wrong else 'nothing is wrong'}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
