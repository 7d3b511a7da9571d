"""Panels: sliders show the numbers that are computed with, and pushes follow the handle."""

import asyncio
import json
import sys
import time
from unittest.mock import Mock

import ipywidgets
import numpy as np
import pytest
import tornado.websocket
from IPython.core.formatters import DisplayFormatter
from panels import RANGES
from waiting import until

import floatbase as fb
from floatbase.lessons import lessonC, live_run, push_panel, slider_panel
from floatbase.lessons.slider_samples import panel_samples
from floatbase.live.settings import SETTINGS

WIDGET = "application/vnd.jupyter.widget-view+json"


@pytest.fixture(scope="module")
def view():
    made = fb.Viewer(fb.load("ur5"))
    yield made
    made.close()


def slider_of(view, low, first, high):
    """The slider of a panel that has one, and the values that its picture was drawn for."""
    drawn = []
    return slider_panel(view, lambda x: drawn.append(x), x=(low, first, high)).sliders["x"], drawn


@pytest.mark.parametrize(("low", "first", "high", "step"), RANGES)
def test_a_slider_shows_the_numbers_that_are_computed_with(view, low, first, high, step):
    slider, drawn = slider_of(view, low, first, high)
    assert slider.step == pytest.approx(step, rel=1e-12)
    for bound in (low, first, high):
        assert (bound - low) / step == pytest.approx(round((bound - low) / step), abs=1e-6)
        assert float(format(bound, slider.readout_format)) == bound
    assert drawn == [first]
    for i in range(60):
        slider.value = min(low + i * slider.step, high)  # as a browser adds them up
        shown = format(slider.value, slider.readout_format)
        assert format(drawn[-1], slider.readout_format) == shown
        assert drawn[-1] == round(drawn[-1], 4)
    assert len(drawn) > 50


def test_bounds_that_are_not_round_get_a_fine_step(view):
    slider, drawn = slider_of(view, 0.0, 2.0 / 3.0, 3.14159)
    assert slider.step <= 1e-4
    assert drawn[0] == pytest.approx(2.0 / 3.0, abs=1e-4)


def test_a_range_may_have_no_width(view):
    assert slider_of(view, 2.0, 2.0, 2.0)[1] == [2.0]


def test_a_slider_names_its_unit_and_the_note_shows_errors(view):
    def draw(push_force):
        if push_force:
            raise fb.FloatbaseError("too hard")
        return f"<b>{push_force:.0f}</b>"

    panel = slider_panel(view, draw, push_force=(0.0, 0.0, 60.0, "N"))
    slider = panel.sliders["push_force"]
    assert (slider.description, panel.note.value) == ("push force [N]", "<b>0</b>")
    slider.value = 20.0
    assert panel.note.value == "too hard"
    slider.value = 0.0
    assert panel.note.value == "<b>0</b>"


@pytest.mark.parametrize("beside", [False, True])
def test_a_displayed_panel_holds_its_picture(view, beside):
    panel = slider_panel(view, lambda x: None, beside=beside, x=(0.0, 1.0, 2.0))
    picture = (panel.children[0].children if beside else panel.children)[0]
    assert picture.children == ()
    data, _ = panel._repr_mimebundle_()
    assert picture.children[0].name == view.robot.name and "image/png" in data


def test_a_panel_shows_its_picture_with_the_older_widgets_of_colab(view, monkeypatch):
    """ipywidgets 7 displays a widget by another method, and Colab loads our code if it is asked."""
    output = Mock(_widgets=Mock(_installed_url="https://example.org/manager.js"))
    monkeypatch.setitem(sys.modules, "google.colab.output", output)
    monkeypatch.setattr(ipywidgets.Widget, "_ipython_display_", Mock(), raising=False)
    monkeypatch.setattr("anywidget._util.enable_custom_widget_manager_once", Mock())
    panels = slider_panel(view, lambda x: None, x=(0.0, 1.0, 2.0)), lessonC.ActiveSetGame()
    for panel in panels:
        data, metadata = DisplayFormatter().format(panel)
        assert data[WIDGET]["model_id"] == panel.model_id
        has_picture = panel is panels[0]
        assert ("image/png" in data) == ("colab" in metadata.get(WIDGET, {})) == has_picture


def test_a_slider_of_integers_has_only_integers():
    panel = slider_panel(None, lambda rounds: f"{rounds:g}", rounds=range(31))
    slider = panel.sliders["rounds"]
    assert (slider.min, slider.value, slider.max, slider.step) == (0, 0, 30, 1)
    assert slider.readout_format == ".0f"
    assert {value % 1 for value in panel_samples(panel)["rounds"]} == {0.0}


def test_a_panel_without_a_view_shows_the_result_of_its_function():
    panel = slider_panel(None, lambda x: f"<img alt='{x:.1f}'>", x=(0.0, 1.0, 2.0))
    panel._repr_mimebundle_()
    assert panel.view is None and panel.children == (panel.note, panel.sliders["x"])
    panel.sliders["x"].value = 2.0
    assert panel.note.value == "<img alt='2.0'>"


class Pushed:
    """What a reader can touch of a push panel, and the run behind it."""

    def __init__(self, robot):
        contacts, tasks = fb.Contacts.points(robot), fb.standing_tasks(robot.standing())
        controller = fb.WholeBodyController(robot, contacts, tasks)
        self.view = fb.Viewer(robot)
        self.sim = fb.Simulation(robot)
        self.run = live_run(self.sim, controller, self.view)
        panel = push_panel(self.run, self.view)
        _, self.force, row, self.duration, self.speed, buttons = panel.children
        self.towards, self.push = row.children
        self.line = buttons.children[-1]
        self.buttons = {b.description: b for b in buttons.children[:-1]}

    @property
    def arrow(self):
        """Direction of the push in the picture, shape (3,), m."""
        item = self.view.renderer.picture.get("push")
        return None if item is None else np.array(item.matrix[:3, 2])


def test_a_push_panel_has_the_words_of_the_table_of_controls(panel):
    push = SETTINGS["push"].of_weight(panel.sim.robot.weight)
    rows = [push, *(SETTINGS[key] for key in ("towards", "duration", "speed"))]
    sliders = panel.force, panel.towards, panel.duration, panel.speed
    for slider, row in zip(sliders, rows, strict=True):
        assert (slider.description, slider.step) == (row.label, row.step)
        assert (slider.min, slider.max, slider.value) == (row.low, row.high, row.first)
    shown = {slider.description for slider in sliders} | {*panel.buttons, panel.push.description}
    assert shown == {row.label for row in SETTINGS.values() if "lesson" in row.places}


@pytest.fixture
def panel():
    made = Pushed(fb.load("go2"))
    yield made
    made.run.close()
    made.view.close()


@pytest.mark.parametrize(
    ("force", "towards", "way", "words"),
    [
        (40.0, -90.0, (0, -1, 0), "pushed with 40 N to the right for 0.1 s"),
        (30.0, 30.0, (np.sqrt(0.75), 0.5, 0), "pushed with 30 N towards 30° for 0.1 s"),
    ],
)
def test_a_push_has_the_direction_of_the_handle(panel, force, towards, way, words):
    panel.towards.value = towards
    start = time.monotonic()
    panel.force.value = force
    assert panel.line.value == words and panel.run.status == "running"
    until(lambda: panel.arrow is not None)
    np.testing.assert_allclose(
        panel.arrow, panel.view.scale * abs(force) * np.array(way), atol=1e-9
    )
    until(lambda: panel.arrow is None)
    assert time.monotonic() - start > 0.3


def test_the_button_pushes_again_and_refuses_a_push_of_zero(panel):
    panel.force.value = 0.0
    panel.push.click()
    assert panel.line.value == "The push is 0 N. Set the force first."
    assert panel.run.status == "paused"
    panel.buttons["reset"].click()
    assert panel.line.value == "running"
    panel.force.value = 20.0
    until(lambda: panel.arrow is not None)
    until(lambda: panel.arrow is None)
    panel.push.click()
    until(lambda: panel.arrow is not None)


def test_dragging_the_robot_sets_the_sliders_and_pushes_each_time(panel):
    async def drag(newtons: float, towards: float) -> None:
        url = panel.view.window.web_url.replace("http", "ws") + "socket"
        client = await tornado.websocket.websocket_connect(url)
        for name, value in {"towards [°]": towards, "push [N]": newtons}.items():
            message = {"type": "control", "name": name, "value": value}
            await client.write_message(json.dumps(message))
        while panel.arrow is None:
            await asyncio.sleep(0.01)
        client.close()

    for _ in range(2):
        asyncio.run(asyncio.wait_for(drag(40.0, 30.0), 20.0))
        assert (panel.towards.value, panel.force.value) == (30.0, 40.0)
        assert panel.line.value == "pushed with 40 N towards 30° for 0.1 s"
        until(lambda: panel.arrow is None)


def test_a_fall_is_reported_and_reset_ends_it(panel):
    panel.towards.value, panel.duration.value = 60.0, 0.2
    panel.force.value = 300.0
    assert panel.line.value == "pushed with 300 N towards 60° for 0.2 s"
    until(lambda: panel.line.value == "fell: press reset, or push again")
    panel.buttons["reset"].click()
    assert panel.line.value == "running"
    until(lambda: panel.run.sim.time > 0.1 and panel.arrow is None)
    assert panel.run.status == "running"
    panel.buttons["pause"].click()
    assert panel.line.value == "paused"
    panel.buttons["run"].click()
    assert panel.line.value == "running"


def test_a_push_after_a_fall_starts_the_run_again(panel):
    told = "pushed with 390 N towards 60° for 0.1 s"
    panel.towards.value = 60.0
    panel.force.value = 390.0
    for _ in range(3):
        until(lambda: panel.line.value == "fell: press reset, or push again")
        panel.push.click()
        assert panel.line.value == told and panel.run.status == "running"


def test_time_can_be_slowed_down(panel):
    panel.speed.value = 0.1
    panel.run.start()
    until(lambda: panel.sim.time > 0.05)
    begin, clock = panel.sim.time, time.monotonic()
    until(lambda: time.monotonic() - clock > 1.0)
    assert panel.sim.time - begin < 0.5  # a tenth of real time, on a machine however slow
