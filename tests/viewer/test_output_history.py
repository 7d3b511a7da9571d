"""A viewer that a notebook shows several times: the newest display is live, earlier ones keep the
picture they had.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from IPython.core.interactiveshell import InteractiveShell
from waiting import until

from floatbase.robots import Robot, State
from floatbase.viewer import Viewer
from floatbase.viewer.scene import protocol
from floatbase.viewer.scene.colours import COM
from floatbase.viewer.transport.window import Window

from .looks import CONTEXTS, DRAWN, EYE, hue_pixels, picture
from .notebook import Client, Notebook

HEIGHT = "viewer.scene_tree.find(['meshcat', 'robot', 'root_joint']).object.position.z"
NOTE = "getComputedStyle(document.getElementById('kept')).display != 'none'"
PLAYER = "getComputedStyle(document.getElementById('player')).display"
FLOATS = 1e-6  # m: the page has heights in single precision


def put(window: Window, number: float) -> None:
    window.put([protocol.set_transform("/meshcat/a", np.eye(4) * number)])


def number_in(commands: list[dict]) -> float:
    """The number that was put."""
    (number,) = (command["matrix"][0] for command in commands if command["type"] == "set_transform")
    return float(number)


def is_kept(commands: list[dict]) -> bool:
    return commands[-1] == {"type": "set_frozen", "path": "", "frozen": True}


def display(window: Window) -> Any:
    return window.widget("a", 170)


def shown(widget: Any) -> tuple[float, bool]:
    """The number that a display shows, and whether it keeps an earlier picture."""
    frame = Client(widget).commands()
    return number_in(frame), is_kept(frame)


def test_displays_in_one_cell_keep_each_its_own_and_only_the_last_twenty(window: Window) -> None:
    widgets = []
    for number in range(1, 31):
        put(window, number)
        widgets.append(display(window))
    live = (30.0, False)
    assert [shown(widget) for widget in widgets] == 9 * [live] + [
        (float(n), True) for n in range(10, 30)
    ] + [live]


def test_a_page_is_told_what_leads_from_one_scene_to_another(window: Window) -> None:
    window.put(
        [
            protocol.page_command("set_title", text="one"),
            protocol.page_command("set_theme", name="light"),
        ]
    )
    put(window, 1)
    client = Client(display(window))
    assert number_in(client.commands()) == 1
    window.put([protocol.page_command("set_title", text="other"), protocol.delete("/meshcat/gone")])
    window.put(
        [protocol.encode({"type": "set_animation", "path": "", "animations": [1], "options": {}})]
    )
    window.put([protocol.set_follow("last", np.zeros(3), np.zeros(3), smooth=True)])
    while not any(command["type"] == "set_follow" for command in client.commands()):
        pass
    display(window)
    back = client.commands()
    assert [command["type"] for command in back] == [
        "delete",
        "set_animation",
        "set_title",
        "set_transform",
        "set_frozen",
    ]
    assert (back[1]["animations"], back[2]["text"], back[4]["frozen"]) == ([], "one", True)
    client.make_live()
    there = client.commands()
    kinds = ["delete", "set_transform", "set_title", "set_animation", "set_follow", "set_frozen"]
    assert [command["type"] for command in there] == kinds
    assert (there[2]["text"], there[3]["animations"], there[5]["frozen"]) == ("other", [1], False)


def test_a_kept_page_is_sent_nothing_more_and_holds_nobody_up(window: Window) -> None:
    put(window, 1)
    first = display(window)
    put(window, 2)
    display(window)
    client = Client(first)
    assert number_in(client.commands()) == 1
    put(window, 3)
    window.put([protocol.set_transform("/meshcat/b", np.eye(4))])
    window.put([protocol.delete("/meshcat/b")])
    assert client.hears_nothing()
    window.put([protocol.delete("/meshcat/b")])
    assert len(window.scene) <= 2
    fresh = Client(first, "another")
    assert is_kept(fresh.commands())
    fresh.make_live()
    live = fresh.commands()
    assert number_in(live) == 3 and live[-1]["frozen"] is False


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


@pytest.fixture
def notebook(page) -> Iterator[Notebook]:
    """A notebook whose outputs are in the page."""
    page.set_viewport_size({"width": 450, "height": 400})
    opened = Notebook()
    page.goto(opened.url)
    page.wait_for_function("window.started")
    yield opened
    page.goto("about:blank")
    opened.close()


def run(shell: InteractiveShell, code: str) -> Any:
    """The value of a cell's expression."""
    shell.run_cell(f"answer = {code}", store_history=True).raise_error()
    return shell.user_ns["answer"]


def add(notebook: Notebook, page, widget: Any) -> Any:
    """Put an output below the others, and return its frame once it has drawn."""
    frame = notebook.show(page, widget)
    frame.wait_for_function(DRAWN)
    return frame


def stands_at(frame, z: float) -> None:
    frame.wait_for_function(f"{DRAWN} && Math.abs({HEIGHT} - {z}) < {FLOATS}")


@pytest.mark.front_end
def test_later_cells_leave_the_pictures_of_earlier_ones_alone(
    shell: InteractiveShell, notebook: Notebook, page
) -> None:
    one = add(notebook, page, run(shell, "view.show(at(0.30)).widget()"))
    run(shell, "view.show(at(0.40), title='still the first')")
    stands_at(one, 0.40)  # no newer display: it follows
    one.evaluate("viewer.camera.position.set(1.0, 1.0, 0.5)")
    eye = one.evaluate(EYE)

    two = add(notebook, page, run(shell, "view.show(at(0.50), title='the second').widget()"))
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


@pytest.mark.front_end
def test_an_animation_stays_one_when_the_next_cell_shows_something_else(
    shell: InteractiveShell, notebook: Notebook, page
) -> None:
    run(shell, "[view.painter.picture(at(z)) for z in (0.3, 0.4)]")
    one = add(
        notebook, page, run(shell, "view.play_pictures([0.0, 1.0], answer, paused=True).widget()")
    )
    two = add(notebook, page, run(shell, "view.show(at(0.50)).widget()"))
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


@pytest.mark.front_end
def test_many_displays_share_the_few_contexts_that_a_browser_has(
    shell: InteractiveShell, notebook: Notebook, page
) -> None:
    page.set_viewport_size({"width": 450, "height": 200})
    heard: list[str] = []
    page.on("console", lambda line: heard.append(line.text))
    heights = [0.3 + 0.01 * i for i in range(CONTEXTS + 2)]
    outputs = [run(shell, f"view.show(at({z})).widget()") for z in heights]
    for output in outputs:
        notebook.show(page, output)
    frames = page.locator("iframe").element_handles()

    def look_at(i: int) -> None:
        """Wait until display i is drawn and awake."""
        frame = frames[i].content_frame()
        frame.wait_for_function(DRAWN)
        frame.wait_for_function(
            "!viewer.resting() && !viewer.renderer.getContext().isContextLost()"
        )
        frame.wait_for_function(
            "getComputedStyle(viewer.renderer.domElement).visibility == 'visible'"
        )
        stands_at(frame, heights[i])

    def until_only_those_in_sight_are_awake() -> None:
        awake = "Boolean(window.viewer) && !viewer.resting()"
        until(
            lambda: (
                page.wait_for_timeout(20)
                or sum(f.content_frame().evaluate(awake) for f in frames) <= 2
            )
        )

    for i in (*range(0, len(heights), 2), 0):  # two in sight, and two that have just left it
        frames[i].evaluate("(frame) => frame.scrollIntoView()")
        look_at(i), look_at(i + 1)
        until_only_those_in_sight_are_awake()
    assert hue_pixels(picture(page, "displays_back_at_the_first"), COM) > 15
    assert not [line for line in heard if "Too many active WebGL contexts" in line]
