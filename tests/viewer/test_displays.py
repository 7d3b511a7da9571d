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

from floatbase.robots import Robot, State
from floatbase.viewer import Displays, Viewer, Window, displays, wire

from .looks import hue_pixels, picture
from .test_window import commands_in, connect, in_a_loop

HEIGHT = "viewer.scene_tree.find(['meshcat', 'robot', 'root_joint']).object.position.z"
NOTE = "getComputedStyle(document.getElementById('kept')).display != 'none'"


def put(scene: wire.Scene, number: float) -> None:
    scene.put([wire.set_transform("/meshcat/a", np.eye(4) * number)])


def held(scene: wire.Scene | None) -> float:
    """The number put into a scene."""
    assert scene is not None
    return float(scene.commands()["/meshcat/a", "set_transform", ""]["matrix"][0])


def test_a_display_keeps_what_it_showed_before_the_cell_of_the_next_one() -> None:
    scene = wire.Scene()
    shown = Displays(scene)
    put(scene, 1)
    assert (shown.open(), shown.kept(1)) == (1, None)
    put(scene, 2)  # drawn by a cell without a display: the picture goes on
    shown.mark()
    put(scene, 3)  # the next cell draws, and shows
    assert shown.open() == 2
    assert held(shown.kept(1)) == 2
    assert shown.kept(2) is None
    put(scene, 4)
    assert held(shown.kept(1)) == 2


def test_two_displays_in_one_cell_keep_each_its_own() -> None:
    scene = wire.Scene()
    shown = Displays(scene)
    for number in (1, 2, 3):
        put(scene, number)
        shown.open()
    assert [held(shown.kept(number)) for number in (1, 2)] == [1, 2]


def test_only_so_many_pictures_are_kept() -> None:
    scene = wire.Scene()
    shown = Displays(scene)
    for number in range(1, 3 * displays.KEPT):
        put(scene, number)
        shown.open()
    kept = [number for number in range(3 * displays.KEPT) if shown.kept(number) is not None]
    assert kept == list(range(2 * displays.KEPT - 1, 3 * displays.KEPT - 1))


def test_what_a_page_is_told_leads_from_any_scene_to_any_other() -> None:
    one, other = wire.Scene(), wire.Scene()
    for scene, title, moves in ((one, "one", True), (other, "other", False)):
        scene.put([wire.page_command("set_title", text=title), wire.page_command("set_theme", name="light")])
        put(scene, 1)
        if moves:
            scene.put([wire.encode({"type": "set_animation", "path": "", "animations": [1], "options": {}})])
    other.put([wire.delete("/meshcat/gone")])
    there = commands_in(wire.frame(other.instead_of(one)))
    assert [command["type"] for command in there] == ["delete", "set_animation", "set_title", "set_transform"]
    assert there[1]["animations"] == []
    back = commands_in(wire.frame(one.instead_of(other)))
    assert [command["type"] for command in back] == ["delete", "set_title", "set_transform", "set_animation"]
    assert back[3]["animations"] == [1]


def test_a_kept_page_is_sent_nothing_more_and_holds_nobody_up(window: Window) -> None:
    async def tries() -> None:
        window.put([wire.set_transform("/meshcat/a", np.eye(4))])
        address = window.open_display()
        assert address == f"{window.web_url}?display=1"
        window.put([wire.set_transform("/meshcat/a", 2 * np.eye(4))])
        window.open_display()
        client = await connect(window, display=1)
        first = commands_in(await asyncio.wait_for(client.read_message(), 5))
        assert [c["matrix"][0] for c in first if c["type"] == "set_transform"] == [1.0]
        assert first[-1] == {"type": "set_kept", "path": "", "kept": True}
        await client.write_message('{"type": "done"}')
        window.put([wire.set_transform("/meshcat/a", 3 * np.eye(4)), wire.set_transform("/meshcat/b", np.eye(4))])
        window.put([wire.delete("/meshcat/b")])
        with pytest.raises(asyncio.TimeoutError):
            await asyncio.wait_for(client.read_message(), 0.3)
        window.put([wire.delete("/meshcat/b")])
        assert len(window.scene) <= 2
        fresh = await connect(window, display=1)
        await fresh.read_message()
        await fresh.write_message('{"type": "done"}')
        await fresh.write_message('{"type": "live"}')
        live = commands_in(await asyncio.wait_for(fresh.read_message(), 5))
        assert [c["matrix"][0] for c in live if c["type"] == "set_transform"] == [3.0]
        assert live[-1]["kept"] is False

    in_a_loop(tries())


@pytest.mark.parametrize("number", ["", "0", "99", "-1", "x"])
def test_a_display_that_is_none_is_live(window: Window, number: str) -> None:
    async def tries() -> None:
        window.put([wire.set_transform("/meshcat/a", np.eye(4))])
        window.open_display()
        window.open_display()
        client = await connect(window, display=number)
        first = commands_in(await asyncio.wait_for(client.read_message(), 5))
        assert [command["type"] for command in first] == ["set_transform"]

    in_a_loop(tries())


@pytest.fixture
def shell(viewer: Viewer, go2: Robot) -> Iterator[InteractiveShell]:
    """A notebook's shell that knows `view` and, by `at(z)`, go2 with its base at a height."""

    def at(z: float) -> State:
        q = go2.standing().q.copy()
        q[2] = z
        return State(go2, q)

    started = InteractiveShell.instance()
    view = Viewer(go2, height=260)
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
    page.wait_for_timeout(100)
    frame = page.frames[-1]
    frame.wait_for_function("window.viewer && viewer.num_messages_received > 0 && !viewer.needs_render")
    return frame


def stands_at(frame, z: float) -> None:
    frame.wait_for_function(f"Math.abs({HEIGHT} - {z}) < 1e-6")


def test_later_cells_leave_the_pictures_of_earlier_ones_alone(shell: InteractiveShell, notebook) -> None:
    page = notebook
    one = add(page, run(shell, "view.show(at(0.30))._repr_html_()"))
    run(shell, "view.show(at(0.40), title='still the first')")
    stands_at(one, 0.40)  # no newer display: it follows
    one.evaluate("viewer.camera.position.set(1.0, 1.0, 0.5)")
    eye = one.evaluate("viewer.camera.position.toArray()")

    two = add(page, run(shell, "view.show(at(0.50), title='the second')._repr_html_()"))
    stands_at(two, 0.50)
    stands_at(one, 0.40)
    one.wait_for_function(NOTE)
    assert one.evaluate("document.getElementById('title').textContent") == "still the first"
    np.testing.assert_allclose(one.evaluate("viewer.camera.position.toArray()"), eye, atol=1e-9)

    run(shell, "view.show(at(0.60))")
    stands_at(two, 0.60)
    stands_at(one, 0.40)
    assert not two.evaluate(NOTE)
    picture(page, "displays")

    one.evaluate("location.reload()")
    page.wait_for_timeout(300)
    one.wait_for_function("window.viewer && viewer.num_messages_received > 0")
    stands_at(one, 0.40)
    before = one.evaluate("viewer.camera.position.toArray()")
    page.mouse.move(300, 130)
    page.mouse.down()
    page.mouse.move(420, 130, steps=4)
    page.mouse.up()
    assert np.linalg.norm(np.subtract(one.evaluate("viewer.camera.position.toArray()"), before)) > 0.1

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
    assert two.evaluate("getComputedStyle(document.getElementById('player')).display") == "none"
    assert one.evaluate("getComputedStyle(document.getElementById('player')).display") == "flex"
    one.evaluate("viewer.animator.seek(0.5)")
    stands_at(one, 0.35)


def test_a_shell_forgets_a_viewer_that_is_closed(shell: InteractiveShell) -> None:
    hooks = len(shell.events.callbacks["pre_run_cell"])
    run(shell, "type(view)(view.robot)")
    assert len(shell.events.callbacks["pre_run_cell"]) == hooks + 1
    run(shell, "answer.close()")
    assert len(shell.events.callbacks["pre_run_cell"]) == hooks


def test_eighteen_displays_share_the_few_contexts_that_a_browser_has(shell: InteractiveShell, notebook) -> None:
    page = notebook
    said: list[str] = []
    page.on("console", lambda line: said.append(line.text))
    outputs = [run(shell, f"view.show(at({0.3 + 0.01 * i}))._repr_html_()") for i in range(18)]
    page.evaluate("(html) => { document.body.innerHTML = html; }", "".join(outputs))

    def in_sight(top: int) -> list[Any]:
        """The frames at a place of the page, drawn and awake."""
        page.evaluate("(y) => window.scrollTo(0, y)", top)
        page.wait_for_timeout(300)
        seen = []
        for i, frame in enumerate(page.frames[1:]):
            box = frame.frame_element().bounding_box()
            if box["y"] + box["height"] > 20 and box["y"] < 580:
                frame.wait_for_function("window.viewer && viewer.num_messages_received > 0")
                frame.wait_for_function("!viewer.resting() && !viewer.renderer.getContext().isContextLost()")
                frame.wait_for_function("getComputedStyle(viewer.renderer.domElement).visibility == 'visible'")
                stands_at(frame, 0.3 + 0.01 * i)
                seen.append(frame)
        return seen

    tall = page.evaluate("document.body.scrollHeight")
    for top in range(0, tall, 520):
        assert in_sight(top)
    first = in_sight(0)[0]
    page.wait_for_timeout(1500)
    awake = [f for f in page.frames[1:] if f.evaluate("Boolean(window.viewer) && !viewer.resting()")]
    assert len(awake) <= 4
    first.wait_for_function("!viewer.needs_render")
    assert hue_pixels(picture(page, "displays_back_at_the_first"), (0.667, 0.2, 0.467)) > 30  # the centre of mass
    assert not [line for line in said if "Too many active WebGL contexts" in line]
