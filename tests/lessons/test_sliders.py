"""The push panel: a handle with a direction, and a line that says what happens, clicked or not."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import ipywidgets as widgets
import numpy as np
import pytest

import floatbase as fb
from floatbase.lessons import live, push_panel
from floatbase.simulation import Live


class Panel:
    """What a reader can touch of a push panel, and the run behind it."""

    def __init__(self, robot: fb.Robot):
        controller = fb.WholeBodyController(robot, fb.Contacts.points(robot), fb.standing_tasks(robot.standing()))
        self.view = fb.Viewer(robot)
        self.run: Live = live(fb.Simulation(robot), controller, self.view)
        _, self.force, row, buttons = push_panel(self.run, self.view, most=600.0).children
        self.towards, self.push = row.children
        self.line = buttons.children[-1]
        self.buttons: dict[str, widgets.Button] = {b.description: b for b in buttons.children[:-1]}

    @property
    def arrow(self) -> np.ndarray | None:
        """Direction of the push in the picture, shape (3,), m."""
        item = self.view.canvas.picture.get("push")
        return None if item is None else np.array(item.matrix[:3, 2])


@pytest.fixture
def panel() -> Iterator[Panel]:
    made = Panel(fb.load("go2"))
    yield made
    made.run.close()
    made.view.close()


def until(condition: Callable[[], bool], seconds: float = 15.0) -> None:
    stop = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < stop, "waited in vain"
        time.sleep(0.01)


@pytest.mark.parametrize(
    ("force", "towards", "way", "words"),
    [
        (40.0, 90.0, (0, 1, 0), "pushed with 40 N to the left for 0.1 s"),
        (-40.0, 90.0, (0, -1, 0), "pushed with 40 N to the right for 0.1 s"),
        (30.0, 0.0, (1, 0, 0), "pushed with 30 N forwards for 0.1 s"),
        (30.0, -180.0, (-1, 0, 0), "pushed with 30 N backwards for 0.1 s"),
        (30.0, 30.0, (np.sqrt(0.75), 0.5, 0), "pushed with 30 N towards 30° for 0.1 s"),
    ],
)
def test_the_handle_pushes_where_it_points_and_the_arrow_stays_to_be_seen(
    panel: Panel, force: float, towards: float, way: tuple[float, ...], words: str
) -> None:
    panel.towards.value = towards
    panel.force.value = force
    assert panel.line.value == words
    assert panel.run.status == "running"
    until(lambda: panel.arrow is not None)
    start = time.monotonic()
    arrow = panel.arrow
    assert arrow is not None
    np.testing.assert_allclose(arrow, panel.view.scale * abs(force) * np.array(way), atol=1e-9)
    until(lambda: panel.arrow is None)
    assert time.monotonic() - start > 0.3


def test_the_button_pushes_again_and_says_when_there_is_nothing_to_push_with(panel: Panel) -> None:
    panel.push.click()
    assert panel.line.value == "a push of 0 N: set how hard first"
    assert panel.run.status == "paused"
    panel.force.value = 20.0
    until(lambda: panel.arrow is not None)
    until(lambda: panel.arrow is None)
    panel.push.click()
    until(lambda: panel.arrow is not None)


def test_a_fall_is_told_without_a_click_and_reset_puts_the_handle_back(panel: Panel) -> None:
    panel.towards.value = 60.0
    panel.force.value = 600.0
    until(lambda: panel.line.value == "fell: press reset, or push again")
    panel.buttons["reset"].click()
    assert (panel.force.value, panel.towards.value, panel.line.value) == (0.0, 90.0, "running")
    until(lambda: panel.run.sim.time > 0.1 and panel.arrow is None)
    assert panel.run.status == "running"
    panel.buttons["pause"].click()
    assert panel.line.value == "paused"
    panel.buttons["run"].click()
    assert panel.line.value == "running"


def test_a_push_after_a_fall_always_pushes(panel: Panel) -> None:
    told = "pushed with 600 N towards 60° for 0.1 s"
    panel.towards.value = 60.0
    panel.force.value = 600.0
    for _ in range(6):
        until(lambda: panel.line.value == "fell: press reset, or push again")
        panel.push.click()
        assert panel.line.value == told
        assert panel.run.status == "running"


def test_a_reset_shows_what_the_run_does_and_no_old_word(panel: Panel) -> None:
    panel.force.value = 20.0
    assert panel.line.value.startswith("pushed with")
    panel.buttons["reset"].click()
    assert panel.line.value == "running"
    panel.push.click()
    assert panel.line.value == "a push of 0 N: set how hard first"
    panel.buttons["reset"].click()
    assert panel.line.value == "running"
