"""JupyterLab with a lesson in a real browser: run it, move its sliders, push its robot."""

import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from browsers import SCREENSHOTS

from floatbase.lessons.lab import SETTINGS

IDLE = {"towards [°]", "duration [s]"}  # sliders of the next push, which show nothing by themselves
WINDOW: dict[str, Any] = {
    "viewport": {"width": 1100, "height": 800},
    "device_scale_factor": 0.5,
}  # a processor draws it
LONG = 90.0  # s that a busy machine may take for anything; nothing is taken for absent earlier

NOTEBOOK = "jupyterapp.shell.currentWidget"
KERNEL_CONNECTED = (
    f"() => {NOTEBOOK}?.sessionContext?.session?.kernel?.connectionStatus === 'connected'"
)
KERNEL = f"{NOTEBOOK}.sessionContext.session.kernel"
# longer than anything here waits
WORK = f"""() => {{
  window.works = true;
  const request = {KERNEL}.requestExecute({{code: "import time; time.sleep(300)"}});
  request.done.finally(() => {{ window.works = false; }});
}}"""
CELLS = f"{NOTEBOOK}.content.widgets.map(w => w.model).filter(m => m.type === 'code')"
FIRST_RAN = f"() => {CELLS}[0].executionCount !== null"
ALL_RAN = f"() => {CELLS}.every(m => m.executionCount !== null && m.executionState !== 'running')"
ERRORS = (
    f"() => {CELLS}.flatMap(m => m.outputs.toJSON()).filter(o => o.output_type === "
    f"'error').map(o => o.evalue)"
)
# marks every slider with the number of its cell and its own, and every such cell; the names of the
# sliders, cell by cell
SLIDERS = f"""() => {{
  const found = {{}};
  {NOTEBOOK}.content.widgets.forEach((cell, i) => {{
    cell.node.querySelectorAll(".widget-slider").forEach((slider, j) => {{
      cell.node.dataset.cell = i;
      slider.querySelector(".noUi-handle").dataset.slider = `${{i}}-${{j}}`;
      (found[i] ??= []).push(slider.querySelector(".widget-label").textContent);
    }});
  }});
  return found;
}}"""
# what a panel says, its sliders aside
SAID = """(cell) =>
  [...cell.querySelectorAll(".jp-OutputArea .widget-html, .jp-OutputArea .widget-label")]
  .filter((part) => !part.closest(".widget-slider") && !part.querySelector("iframe"))
  .map((part) => part.innerHTML).join("|")"""
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
DRAWN = "() => window.viewer?.num_messages_received > 0"


@contextmanager
def server(command: list[str], home: Path) -> Iterator[tuple[subprocess.Popen[bytes], Path]]:
    """A program of Jupyter that serves from this home, and its log."""
    own = dict.fromkeys(("JUPYTER_CONFIG_DIR", "JUPYTER_DATA_DIR", "HOME"), str(home))
    own["JUPYTER_CONFIG_PATH"] = str(SETTINGS)
    log = home / "server.log"
    with log.open("w") as sink:
        started = subprocess.Popen(
            [sys.executable, "-m", *command], env=os.environ | own, cwd=home,
            stdout=sink, stderr=subprocess.STDOUT, start_new_session=True,
        )  # fmt: skip
    try:
        yield started, log
    finally:
        os.killpg(started.pid, signal.SIGTERM)
        started.wait(timeout=20)


def only(page: Any, address: str) -> list[str]:
    """Let a page reach this address alone; what else it asks for, as it does so."""
    strangers: list[str] = []

    def judge(route: Any) -> None:
        url = route.request.url
        if url.startswith(f"{address}/"):
            route.continue_()
        else:
            strangers.append(url)
            route.abort()

    def told(socket: Any) -> None:
        if not socket.url.startswith(f"{address}/".replace("http", "ws")):
            strangers.append(socket.url)

    page.route(lambda url: url.startswith(("http:", "https:")), judge)
    page.on("websocket", told)
    return strangers


def lesson_opened(page: Any) -> None:
    """Wait until the page shows a lesson whose kernel answers."""
    page.wait_for_selector(".jp-Notebook .jp-CodeCell")
    page.wait_for_function(f"() => window.jupyterapp?.shell && {NOTEBOOK}?.content")
    page.wait_for_function(KERNEL_CONNECTED)


def run_all(page: Any) -> None:
    """Run all cells; a kernel that is still starting drops the wish, so it is said again until the
    first cell ran.
    """
    for _ in range(6):
        page.evaluate("() => { window.jupyterapp.commands.execute('notebook:run-all-cells'); }")
        for _ in range(30):
            time.sleep(0.5)
            if page.evaluate(FIRST_RAN):
                return
    raise AssertionError("the kernel ran no cell")


def ran_without_error(page: Any) -> None:
    """Wait until all cells have run, and look whether one failed."""
    page.wait_for_function(ALL_RAN)
    assert page.evaluate(ERRORS) == []


def answers_to_sliders(page: Any, name: str, most: int | None = None) -> set[str]:
    """Move the sliders of a lesson: each must change its picture or what its panel says, and each
    picture must move.

    most: how many sliders of each panel to move, from the first on; None for all.
    Returns what moved in the pictures, such as "robot", "ghost" and "planned".
    """
    panels, moved = page.evaluate(SLIDERS), set[str]()
    assert panels
    idle = {
        slider
        for cell, sliders in panels.items()
        for slider in _idle_sliders(page, name, cell, sliders[:most], moved)
    }
    assert not idle, f"{name}: these sliders change nothing: {sorted(idle)}"
    return moved


def _idle_sliders(
    page: Any, name: str, number: str, sliders: list[str], moved: set[str]
) -> list[str]:
    """Names of the sliders of a cell that change neither its picture nor what it says; what moves
    is added to `moved`.
    """
    cell = page.locator(f'[data-cell="{number}"]')
    page.evaluate(f"(number) => {NOTEBOOK}.content.scrollToItem(number, 'smart')", int(number))
    frame = picture_in(cell)
    idle, start = [], frame.evaluate(SCENE)
    for i, slider in enumerate(sliders):
        if slider in IDLE:
            continue
        before = frame.evaluate(SCENE), cell.evaluate(SAID)
        _move(page, page.locator(f'[data-slider="{number}-{i}"]'))
        after = once_new(lambda: (frame.evaluate(SCENE), cell.evaluate(SAID)), before)
        idle += [slider] if after == before else []
    # what the panel says may be there before the picture
    end = once_new(lambda: frame.evaluate(SCENE), start)
    cell.locator("iframe").first.evaluate("(frame) => frame.scrollIntoView()")
    screenshot(page, f"{name.split('_')[0]}_panel_{number}")
    assert end != start, f"{name}, cell {number}: no slider moves the picture"
    moved |= _changed(start, end)
    return idle


def _changed(before: str, after: str) -> set[str]:
    """The parts of the picture that are not where they were."""
    lines = set(before.splitlines()) ^ set(after.splitlines())
    return set(re.findall(r"^[^ ]*/meshcat/([^/ ]+)", "\n".join(lines), re.M))


def picture_in(cell: Any) -> Any:
    """The frame of the first picture of a cell, once it is drawn."""
    cell.locator("iframe").first.scroll_into_view_if_needed()
    frame = cell.locator("iframe").first.element_handle().content_frame()
    frame.wait_for_function(DRAWN, timeout=1000 * LONG)
    return frame


def push_panel_of(page: Any) -> Any:
    """The cell of the first lesson with the robot that can be pushed."""
    panel = page.locator(".jp-Cell", has=page.get_by_role("button", name="push", exact=True)).first
    panel.scroll_into_view_if_needed()
    return panel


def push_until_it_falls(page: Any, panel: Any, name: str) -> None:
    """Push the robot of a panel as hard as the panel can, until the picture shows it on the ground.

    panel: what holds the picture, the slider of the push, and the button. name: of the screenshot.
    """
    from playwright.sync_api import Error

    frame = picture_in(panel)
    standing = frame.evaluate(HEIGHT)
    panel.locator(".widget-slider .noUi-handle").first.focus()
    page.keyboard.press("End")
    fallen, until = f"({HEIGHT})() < {0.6 * standing}", time.monotonic() + LONG
    while not frame.evaluate(fallen):
        assert time.monotonic() < until, (
            f"it does not fall: {frame.evaluate(HEIGHT)} m, {panel.inner_text()}"
        )
        with suppress(Error):  # it stood that push
            frame.wait_for_function(fallen, timeout=8000)
            break
        panel.get_by_role("button", name="push", exact=True).click()
    screenshot(page, f"{name}_fallen")


def is_heard_while_the_kernel_works(page: Any, panel: Any) -> None:
    """Put the fallen robot of a panel back on its feet while the kernel runs something else."""
    frame = picture_in(panel)
    lying = frame.evaluate(HEIGHT)
    page.evaluate(WORK)
    panel.get_by_role("button", name="reset", exact=True).click()
    frame.wait_for_function(f"({HEIGHT})() > {1.5 * lying}")
    assert page.evaluate("works")
    page.evaluate(f"() => {{ {KERNEL}.interrupt(); }}")


def _move(page: Any, handle: Any) -> None:
    """Move a slider by its keys, the way that is open."""
    handle.scroll_into_view_if_needed()
    now, most = (float(handle.get_attribute(f"aria-value{name}")) for name in ("now", "max"))
    handle.focus()
    for _ in range(4):
        page.keyboard.press("ArrowRight" if now < most else "ArrowLeft")


def once_new(look: Callable[[], Any], before: Any) -> Any:
    """What is seen once it differs from `before`; the same as ever when it never does."""
    until = time.monotonic() + LONG
    while (seen := look()) == before and time.monotonic() < until:
        time.sleep(0.1)
    return seen


def address_in(log: Path, words: str = "") -> str:
    """Where a server listens, once its log says so, behind these words."""
    for _ in range(300):
        found = re.search(rf"{words}(http://127\.0\.0\.1:\d+)", log.read_text())
        if found:
            return found.group(1)
        time.sleep(0.2)
    raise AssertionError(f"no server started:\n{log.read_text()}")


def free_ports(n: int) -> list[int]:
    """Ports that nothing listens on now."""
    with ExitStack() as open_ones:
        sockets = [open_ones.enter_context(socket.socket()) for _ in range(n)]
        for one in sockets:
            one.bind(("127.0.0.1", 0))
        return [one.getsockname()[1] for one in sockets]


def answers(port: int) -> bool:
    """Whether something listens there."""
    with socket.socket() as one:
        return one.connect_ex(("127.0.0.1", port)) == 0


def screenshot(page: Any, name: str) -> None:
    SCREENSHOTS.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=str(SCREENSHOTS / f"lesson_{name}.png"))
