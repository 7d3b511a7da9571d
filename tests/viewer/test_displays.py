"""A viewer that a notebook shows several times: the newest display is live, earlier ones keep the picture they had."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import numpy as np
import pytest
from IPython.core.interactiveshell import InteractiveShell
from waiting import PATIENCE, until

from floatbase.robots import Robot, State
from floatbase.viewer import COM, Viewer, Window, wire

from .looks import CONTEXTS, DRAWN, EYE, hue_pixels, picture
from .test_window import commands_in, connect, in_a_loop

HEIGHT = "viewer.scene_tree.find(['meshcat', 'robot', 'root_joint']).object.position.z"
NOTE = "getComputedStyle(document.getElementById('kept')).display != 'none'"
PLAYER = "getComputedStyle(document.getElementById('player')).display"
FLOATS = 1e-6  # m: the page has heights in single precision

SILENCE = 0.3  # s without a message


def put(window: Window, number: float) -> None:
    window.put([wire.set_transform("/meshcat/a", np.eye(4) * number)])


class Client:
    """A page of a display, as the window sees it."""

    def __init__(self, connection: Any):
        self._connection = connection

    async def commands(self) -> list[dict]:
        """The commands of the next frame, which is taken as drawn."""
        frame = await asyncio.wait_for(self._connection.read_message(), PATIENCE)
        await self._connection.write_message('{"type": "done"}')
        return commands_in(frame)

    async def make_live(self) -> None:
        await self._connection.write_message('{"type": "live"}')

    async def hears_nothing(self) -> bool:
        try:
            await asyncio.wait_for(self._connection.read_message(), SILENCE)
        except TimeoutError:
            return True
        return False


def number_in(commands: list[dict]) -> float:
    """The number that was put."""
    (number,) = (command["matrix"][0] for command in commands if command["type"] == "set_transform")
    return float(number)


def is_kept(commands: list[dict]) -> bool:
    return commands[-1] == {"type": "set_kept", "path": "", "kept": True}


def shown(window: Window, *displays: int | str) -> list[tuple[float, bool]]:
    """For each display the number that it shows, and whether it keeps an earlier picture."""

    async def look() -> list[tuple[float, bool]]:
        frames = [await Client(await connect(window, display=display)).commands() for display in displays]
        return [(number_in(frame), is_kept(frame)) for frame in frames]

    return in_a_loop(look())


def test_displays_in_one_cell_keep_each_its_own_and_only_the_last_twenty(window: Window) -> None:
    for number in range(1, 31):
        put(window, number)
        assert window.open_display() == f"{window.web_url}?display={number}"
    live = (30.0, False)
    assert shown(window, *range(1, 31)) == 9 * [live] + [(float(n), True) for n in range(10, 30)] + [live]
    assert shown(window, "", "0", "99", "-1", "x") == 5 * [live]  # displays that are none


def test_a_page_is_told_what_leads_from_one_scene_to_another(window: Window) -> None:
    async def tries() -> None:
        window.put([wire.page_command("set_title", text="one"), wire.page_command("set_theme", name="light")])
        put(window, 1)
        window.open_display()
        client = Client(await connect(window, display=1))
        assert number_in(await client.commands()) == 1
        window.put([wire.page_command("set_title", text="other"), wire.delete("/meshcat/gone")])
        window.put([wire.encode({"type": "set_animation", "path": "", "animations": [1], "options": {}})])
        window.put([wire.set_follow("last", np.zeros(3), np.zeros(3), smooth=True)])
        while not any(command["type"] == "set_follow" for command in await client.commands()):
            pass
        window.open_display()
        back = await client.commands()
        assert [command["type"] for command in back] == ["delete", "set_animation", "set_title", "set_transform", "set_kept"]
        assert (back[1]["animations"], back[2]["text"], back[4]["kept"]) == ([], "one", True)
        await client.make_live()
        there = await client.commands()
        kinds = ["delete", "set_transform", "set_title", "set_animation", "set_follow", "set_kept"]
        assert [command["type"] for command in there] == kinds
        assert (there[2]["text"], there[3]["animations"], there[5]["kept"]) == ("other", [1], False)

    in_a_loop(tries())


def test_a_kept_page_is_sent_nothing_more_and_holds_nobody_up(window: Window) -> None:
    async def tries() -> None:
        put(window, 1)
        window.open_display()
        put(window, 2)
        window.open_display()
        client = Client(await connect(window, display=1))
        assert number_in(await client.commands()) == 1
        put(window, 3)
        window.put([wire.set_transform("/meshcat/b", np.eye(4))])
        window.put([wire.delete("/meshcat/b")])
        assert await client.hears_nothing()
        window.put([wire.delete("/meshcat/b")])
        assert len(window.scene) <= 2
        fresh = Client(await connect(window, display=1))
        assert is_kept(await fresh.commands())
        await fresh.make_live()
        live = await fresh.commands()
        assert number_in(live) == 3 and live[-1]["kept"] is False

    in_a_loop(tries())


@pytest.fixture
def shell(go2: Robot) -> Iterator[InteractiveShell]:
    """A notebook's shell that knows `view` and, by `at(z)`, go2 with its base at a height."""

    def at(z: float) -> State:
        q = go2.standing().q.copy()
        q[2] = z
        return State(go2, q)

    started = InteractiveShell.instance()
    view = Viewer(go2, height=170)
    started.user_ns.update(view=view, at=at)
    yield started
    view.close()
    InteractiveShell.clear_instance()


class _Empty(BaseHTTPRequestHandler):
    """Answers with a page that has nothing in it."""

    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(b"<!DOCTYPE html><html><body></body></html>")

    def log_message(self, *_: object) -> None:
        """Say nothing."""


@pytest.fixture
def notebook(page) -> Iterator[Any]:
    """An empty page of another server on this machine, as Jupyter's."""
    page.set_viewport_size({"width": 450, "height": 400})
    with ThreadingHTTPServer(("127.0.0.1", 0), _Empty) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        page.goto(f"http://127.0.0.1:{server.server_port}/")
        yield page
        page.goto("about:blank")
        server.shutdown()


def run(shell: InteractiveShell, code: str) -> Any:
    """The value of a cell's expression."""
    shell.run_cell(f"answer = {code}", store_history=True).raise_error()
    return shell.user_ns["answer"]


def add(page, html: str) -> Any:
    """Put an output below the others, and return its frame once it has drawn."""
    page.evaluate("(html) => document.body.insertAdjacentHTML('beforeend', html)", html)
    frame = page.locator("iframe").last.element_handle().content_frame()
    frame.wait_for_function(DRAWN)
    return frame


def stands_at(frame, z: float) -> None:
    frame.wait_for_function(f"{DRAWN} && Math.abs({HEIGHT} - {z}) < {FLOATS}")


def test_later_cells_leave_the_pictures_of_earlier_ones_alone(shell: InteractiveShell, notebook) -> None:
    page = notebook
    one = add(page, run(shell, "view.show(at(0.30))._repr_html_()"))
    run(shell, "view.show(at(0.40), title='still the first')")
    stands_at(one, 0.40)  # no newer display: it follows
    one.evaluate("viewer.camera.position.set(1.0, 1.0, 0.5)")
    eye = one.evaluate(EYE)

    two = add(page, run(shell, "view.show(at(0.50), title='the second')._repr_html_()"))
    stands_at(two, 0.50)
    stands_at(one, 0.40)
    one.wait_for_function(NOTE)
    assert one.evaluate("document.getElementById('title').textContent") == "still the first"
    np.testing.assert_allclose(one.evaluate(EYE), eye, atol=1e-9)

    run(shell, "view.show(at(0.60))")
    stands_at(two, 0.60)
    stands_at(one, 0.40)
    assert not two.evaluate(NOTE)
    picture(page, "displays")

    one.evaluate("window.old = true, location.reload()")
    one.wait_for_function("!window.old")
    stands_at(one, 0.40)
    before = one.evaluate(EYE)
    page.mouse.move(200, 90)
    page.mouse.down()
    page.mouse.move(280, 90, steps=4)
    page.mouse.up()
    assert np.linalg.norm(np.subtract(one.evaluate(EYE), before)) > 0.1

    one.click("#kept button")
    stands_at(one, 0.60)
    one.wait_for_function(f"!({NOTE})")
    run(shell, "view.show(at(0.35))")
    for frame in (one, two):
        stands_at(frame, 0.35)


def test_an_animation_stays_one_when_the_next_cell_shows_something_else(shell: InteractiveShell, notebook) -> None:
    page = notebook
    run(shell, "[view.painter.picture(at(z)) for z in (0.3, 0.4)]")
    one = add(page, run(shell, "view.play_pictures([0.0, 1.0], answer, paused=True)._repr_html_()"))
    two = add(page, run(shell, "view.show(at(0.50))._repr_html_()"))
    stands_at(two, 0.50)
    one.wait_for_function(NOTE)
    assert (one.evaluate(PLAYER), two.evaluate(PLAYER)) == ("flex", "none")
    one.evaluate("viewer.animator.seek(0.5)")
    stands_at(one, 0.35)


def test_a_shell_forgets_a_viewer_that_is_closed(shell: InteractiveShell) -> None:
    hooks = len(shell.events.callbacks["pre_run_cell"])
    run(shell, "type(view)(view.robot)")
    assert len(shell.events.callbacks["pre_run_cell"]) == hooks + 1
    run(shell, "answer.close()")
    assert len(shell.events.callbacks["pre_run_cell"]) == hooks


def test_many_displays_share_the_few_contexts_that_a_browser_has(shell: InteractiveShell, notebook) -> None:
    page = notebook
    page.set_viewport_size({"width": 450, "height": 200})
    heard: list[str] = []
    page.on("console", lambda line: heard.append(line.text))
    heights = [0.3 + 0.01 * i for i in range(CONTEXTS + 2)]
    outputs = [run(shell, f"view.show(at({z}))._repr_html_()") for z in heights]
    page.evaluate("(html) => { document.body.innerHTML = html; }", "".join(outputs))
    frames = page.locator("iframe").element_handles()

    def look_at(i: int) -> None:
        """Wait until display i is drawn and awake."""
        frame = frames[i].content_frame()
        frame.wait_for_function(DRAWN)
        frame.wait_for_function("!viewer.resting() && !viewer.renderer.getContext().isContextLost()")
        frame.wait_for_function("getComputedStyle(viewer.renderer.domElement).visibility == 'visible'")
        stands_at(frame, heights[i])

    def until_only_those_in_sight_are_awake() -> None:
        awake = "Boolean(window.viewer) && !viewer.resting()"
        until(lambda: page.wait_for_timeout(20) or sum(f.content_frame().evaluate(awake) for f in frames) <= 2)

    for i in (*range(0, len(heights), 2), 0):  # two in sight, and two that have just left it
        frames[i].evaluate("(frame) => frame.scrollIntoView()")
        look_at(i), look_at(i + 1)
        until_only_those_in_sight_are_awake()
    assert hue_pixels(picture(page, "displays_back_at_the_first"), COM) > 15
    assert not [line for line in heard if "Too many active WebGL contexts" in line]
