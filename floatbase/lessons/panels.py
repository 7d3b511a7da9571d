"""Panels below a live picture: sliders that redraw it, and controls that push a simulated robot.

Nothing here blocks the kernel: a slider calls a fast function, and a simulation has its own thread.
"""

from __future__ import annotations

import html
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import ipywidgets as widgets

from floatbase._locks import InterruptibleLock
from floatbase._validation import (
    as_array,
    as_bool,
    as_instance,
    as_string,
    short_repr,
    signature_error,
)
from floatbase.errors import FloatbaseError, InputError
from floatbase.lessons.slider_samples import DIRECTIONS, precomputed_panel, recorded_pushes
from floatbase.live.settings import SETTINGS, push_settings
from floatbase.robots import Robot
from floatbase.simulation import Controller, LiveSimulation, Push, Rollout, Simulation
from floatbase.viewer import PUSH_DISPLAY_TIME, Viewer, status_message
from floatbase.viewer.export.display_mode import display_mode
from floatbase.viewer.export.recording import joint_limits_at, push_at
from floatbase.viewer.export.thumbnail import panel_bundle
from floatbase.viewer.transport.notebook_events import receive_during_cells

# width below which only the name and the number of a slider are visible
_MIN_SLIDER_WIDTH = "min(340px, 100% - 4px)"
# em: largest mean width of a letter in a slider's name; width of the name on a narrow page
_LETTER_WIDTH, _MAX_NAME_WIDTH = 0.55, 10.4
_RECORDED_PUSHES = (0.3, 0.6, 1.0, 1.5)  # robot weights: the pushes of a static page

# sliders ------------------------------------------------------------------------------------------


class Panel(widgets.VBox):
    """Box of widgets that decides itself what a notebook or the site shows."""

    # ipywidgets 7, which Colab has, would otherwise ignore `_repr_mimebundle_`
    _ipython_display_: Any = None


class SliderPanel(Panel):
    """Live picture with sliders, made by `slider_panel`.

    Parameters
    ----------
    view : Viewer or None
        Viewer of the picture; None if the note contains everything there is to see.
    draw : callable
        Function of the values of the sliders that draws the picture and may return a note.
    sliders : dict of str to FloatSlider
        The sliders by name.
    beside : bool
        Whether the note is to the right of the picture.
    samples : mapping of str to sequence of float
        Values for a static page, as for `slider_panel`.

    Attributes
    ----------
    note : HTML
        The note that explains the present position of the sliders.
    """

    def __init__(
        self,
        view: Viewer | None,
        draw: Callable[..., str | None],
        sliders: dict[str, widgets.FloatSlider],
        beside: bool,
        samples: Mapping[str, Sequence[float]],
    ):
        self._picture = widgets.VBox(layout=_flex_layout(62, 380) if beside else widgets.Layout())
        note = widgets.HTML(layout=_flex_layout(30, 270) if beside else widgets.Layout())
        note.layout.padding = "0 0 0 10px" if beside else None
        row = widgets.HBox([self._picture, note], layout=widgets.Layout(flex_flow="row wrap"))
        top = [note] if view is None else [row] if beside else [self._picture, note]
        super().__init__([*top, *sliders.values()])
        self.view, self.sliders, self.note = view, sliders, note
        self.beside, self.samples = beside, samples
        self._draw = draw
        for slider in sliders.values():
            slider.observe(self._redraw, names="value")
        self._redraw()

    def values(self) -> dict[str, float]:
        """Return the value of each slider, as the slider shows it."""
        return {name: _displayed_value(slider) for name, slider in self.sliders.items()}

    def draw_at(self, values: Mapping[str, float]) -> str:
        """Draw the picture for other values without moving the sliders; return the note as HTML."""
        try:
            return self._draw(**values) or ""
        except FloatbaseError as error:
            return html.escape(str(error))

    def _redraw(self, _: Any = None) -> None:
        self.note.value = self.draw_at(self.values())

    def _repr_mimebundle_(self, **kwargs: Any) -> Any:
        """Return what a notebook shows."""
        if display_mode() == "site":
            return precomputed_panel(self)
        self._picture.children = [self.view.widget()] if self.view else []
        return panel_bundle(self, *self._picture.children)


def _flex_layout(share: int, least: int) -> widgets.Layout:
    """Return the layout of a part of a row that takes a share of the width [%]."""
    return widgets.Layout(flex=f"1 1 {share}%", min_width=f"min({least}px, 100%)")


def slider_panel(
    view: Viewer | None,
    draw: Callable[..., str | None],
    on_release: bool = False,
    beside: bool = False,
    samples: Mapping[str, Sequence[float]] | None = None,
    **ranges: tuple[float, float, float] | tuple[float, float, float, str] | range,
) -> SliderPanel:
    """Return a live picture with one slider for each of `ranges`, in the given order.

    If `draw` raises an error of floatbase, the note shows its message.

    Parameters
    ----------
    view : Viewer or None
        Viewer to draw on; None if the note contains the picture, such as a drawing in the plane.
    draw : callable
        Function called as draw(name=value, …), once at the start and then at every move of a
        slider, in the thread of the kernel. The function receives the values as the sliders show
        them, draws on `view`, and should take a few milliseconds. It may return a note, as HTML or
        plain text.
    on_release : bool, optional
        Whether to call `draw` only when a slider is released, for a function that takes longer.
    beside : bool, optional
        Whether the note is to the right of the picture; by default it is between the picture and
        the sliders.
    samples : mapping of str to sequence of float, optional
        For a slider: the values at which the picture is computed for a static page, which has no
        kernel. By default these are round numbers.
    **ranges : tuple or range
        name=(lowest, first, highest) or name=(lowest, first, highest, unit). "_" in a name is shown
        as a space. The step of a slider is round and reaches all three values. name=range(n) is a
        slider for the integers from 0 to n - 1, starting at 0.

    Returns
    -------
    SliderPanel
        The panel; a notebook displays it as the value of a cell.

    Raises
    ------
    InputError
        If an argument has the wrong type, or if a range is not one of these.
    """
    if view is not None:
        as_instance("view", view, Viewer)
    if error := signature_error(draw, **ranges) if callable(draw) else f"it is {short_repr(draw)}":
        raise InputError(f"draw must be a function of the values of the sliders, but {error}.")
    on_release, beside = as_bool("on_release", on_release), as_bool("beside", beside)
    samples = {} if samples is None else samples
    as_instance("samples", samples, Mapping)  # type: ignore[type-abstract]
    for name, values in samples.items():
        as_array(f"samples of {short_repr(name)}", values, (None,))
    sliders = {name: _range_slider(name, bounds, on_release) for name, bounds in ranges.items()}
    longest = max((len(slider.description) for slider in sliders.values()), default=0)
    for slider in sliders.values():
        slider.style.description_width = (
            f"max(min(12em, 36%), {min(_LETTER_WIDTH * longest, _MAX_NAME_WIDTH):.2f}em)"
        )
    return SliderPanel(view, draw, sliders, beside, samples)


def _range_slider(name: str, bounds: Any, on_release: bool) -> widgets.FloatSlider:
    low, first, high, unit, step = _checked_range(name, bounds)
    text = name.replace("_", " ") + (f" [{unit}]" if unit else "")
    made = labelled_slider(text, low, first, high, step, on_release)
    made.unit = unit  # of a static page's control, which has no caption
    made.layout.width = "80%"
    return made


def _checked_range(name: str, bounds: Any) -> tuple[float, float, float, str, float]:
    """Return lowest, first and highest value, unit and step of a slider's range."""
    if isinstance(bounds, range) and bounds and bounds.step > 0:
        return bounds[0], bounds[0], bounds[-1], "", bounds.step
    if isinstance(bounds, tuple | list) and len(bounds) in (3, 4):
        low, first, high = as_array(f"the range {name}", bounds[:3], (3,)).tolist()
        if low <= first <= high:
            unit = as_string(f"the unit of {name}", bounds[3]) if len(bounds) == 4 else ""
            return low, first, high, unit, _round_step(low, first, high)
    raise InputError(
        f'{name} must be (lowest, first, highest), such as (0, 10, 60), or (0, 10, 60, "N"), or '
        f"range(5), not {short_repr(bounds)}."
    )


def labelled_slider(
    text: str, low: float, first: float, high: float, step: float, on_release: bool = False
) -> widgets.FloatSlider:
    """Return a slider that shows as many decimals as its step."""
    return widgets.FloatSlider(
        value=first,
        min=low,
        max=high,
        step=step,
        description=text,
        readout_format=f".{max(0, -math.floor(math.log10(step)))}f",
        continuous_update=not on_release,
        tooltip=text,
        style={"description_width": "min(8.5em, 42%)"},
        layout=widgets.Layout(width="60%", min_width=_MIN_SLIDER_WIDTH),
    )


def _round_step(*bounds: float) -> float:
    """Return a round slider step that divides the range into at least 50 steps."""
    most = (max(bounds) - min(bounds)) / 50
    power = math.floor(math.log10(most)) if most > 0 else 0
    steps = [float(f"{digit}e{power - i}") for i in range(4) for digit in (5, 2, 1)]
    steps = [step for step in steps if step <= most * (1 + 1e-9)] or [1.0]
    return next(
        (step for step in steps if all(abs(b / step - round(b / step)) < 1e-6 for b in bounds)),
        steps[-1],
    )


def _displayed_value(slider: widgets.FloatSlider) -> float:
    """Return the value as the slider shows it."""
    return float(format(slider.value, slider.readout_format)) + 0.0  # never -0


# pushes -------------------------------------------------------------------------------------------


def live_run(
    sim: Simulation, controller: Controller, view: Viewer, **options: Any
) -> LiveSimulation:
    """Return a live simulation that draws itself into a viewer.

    The arrow of a push stays visible for half a second. Nothing moves before `start` is called.

    Parameters
    ----------
    sim : Simulation
        The simulation.
    controller : callable
        Its controller.
    view : Viewer
        Viewer to draw into.
    **options
        Options of `LiveSimulation`.

    Returns
    -------
    LiveSimulation
        The simulation, paused.

    Raises
    ------
    InputError
        If an argument has the wrong type, or if an option does not exist.
    """
    as_instance("view", view, Viewer)

    def show(record: Rollout) -> None:
        view.show(
            record.final,
            contacts=record.contacts,
            forces=record.measured[-1],
            push=push_at(record, -1, PUSH_DISPLAY_TIME),
            **joint_limits_at(record, -1),
        )

    options = {"push_memory": PUSH_DISPLAY_TIME} | options
    if error := signature_error(LiveSimulation, sim, controller, show, **options):
        raise InputError(f"The options must be those of LiveSimulation, but {error}.")
    return LiveSimulation(sim, controller, show, **options)


def push_sliders(robot: Robot) -> list[widgets.FloatSlider]:
    """Return sliders for the force, the direction and the duration of a push."""
    return [
        labelled_slider(row.label, row.low, row.first, row.high, row.step, on_release=True)
        for row in push_settings(robot.weight).values()
    ]


def push_panel(run: LiveSimulation, view: Viewer) -> widgets.VBox:
    """Return a live picture with controls that push the robot in a horizontal direction.

    The first slider sets the force [N] and pushes when it is released. The others set the
    direction [°] and the duration [s]: 0° is forwards, 90° to the robot's left (+y at the start),
    180° backwards. The button *push* pushes again, and dragging the robot in the picture pushes it
    that way. A push starts the simulation, as *run* does; both first put a fallen robot back on its
    feet. *pause* stops the simulation, and *reset* restores the initial state. The last slider
    slows down time. A line shows the status and why the simulation stopped.

    Parameters
    ----------
    run : LiveSimulation
        Simulation from `live_run`, paused at first.
    view : Viewer
        Viewer that the simulation draws into. It needs its own `Viewer`: the picture stops when
        `view` is displayed again in a later cell.

    Returns
    -------
    VBox
        The panel; a notebook displays it as the value of a cell.

    Raises
    ------
    InputError
        If an argument has the wrong type or is out of range.
    """
    as_instance("run", run, LiveSimulation)
    as_instance("view", view, Viewer)
    force, towards, duration = push_sliders(run.sim.robot)
    row = SETTINGS["speed"]
    speed = labelled_slider(row.label, row.low, row.first, row.high, row.step, on_release=True)
    speed.observe(lambda change: run.set_time_scale(change["new"]), names="value")
    line = _StatusLine(run)

    def push(_: Any = None) -> None:
        if not force.value:
            line.value = "The push is 0 N. Set the force first."
            return
        run.push(Push.horizontal(force.value, towards.value).force, duration.value)
        line.show_status(
            f"pushed with {force.value:.0f} N {_direction_text(towards.value)} "
            f"for {duration.value:g} s"
        )

    def let_go(change: dict[str, Any]) -> None:
        if change["new"]:
            push()

    def dragged(newtons: float, direction: float) -> None:
        towards.value = direction
        if force.value == newtons:
            push()
        else:
            force.value = newtons

    def button(text: str, does: Callable[[], None]) -> widgets.Button:
        def pressed(_: Any) -> None:
            does()
            line.show_status("")

        return _button(text, pressed)

    run.on_status(lambda _: line.show_status())
    force.observe(let_go, names="value")
    view.on_drag(dragged, force.max)
    buttons = [button("run", run.start), button("pause", run.pause), button("reset", run.reset)]
    wrapped = widgets.Layout(flex_flow="row wrap")
    aim, bar = (
        widgets.HBox(parts, layout=wrapped)
        for parts in ([towards, _button("push", push)], [*buttons, line])
    )
    return _PushPanel(run, view, [force, aim, duration, speed, bar])


class _PushPanel(Panel):
    """Live picture with controls that push its robot, made by `push_panel`."""

    def __init__(self, run: LiveSimulation, view: Viewer, rows: Sequence[widgets.Widget]):
        super().__init__([view.widget(), *rows])
        self._run, self._view = run, view

    def _repr_mimebundle_(self, **kwargs: Any) -> Any:
        if display_mode() == "site":
            weight = self._run.sim.robot.weight
            return recorded_pushes(
                {"": (self._view, self._run.sim, self._run.controller)},
                [round(part * weight) for part in _RECORDED_PUSHES],
                list(DIRECTIONS),
            )
        return panel_bundle(self, self.children[0])


class _StatusLine(widgets.Label):
    """Line with the status of a simulation, or the last action while it runs."""

    def __init__(self, run: LiveSimulation):
        super().__init__(value=run.status)
        self._run, self._news, self._telling = run, "", InterruptibleLock()

    def show_status(self, news: str | None = None) -> None:
        """Show the present status."""
        # the lock covers reading the status, so that the last line is never about an earlier one
        with self._telling:
            self._news = self._news if news is None else news
            status = self._run.status
            summary = status_message(status, self._run.reason)
            self.value = self._news if status == "running" and self._news else summary


def _button(text: str, pressed: Callable[[widgets.Button], None]) -> widgets.Button:
    made = widgets.Button(description=text, layout=widgets.Layout(width="6em", flex="0 0 auto"))
    made.on_click(pressed)
    receive_during_cells(made)
    return made


def _direction_text(towards: float) -> str:
    """Return the direction of a push in words, or as an angle if there is no word."""
    angle = round(towards) % 360
    words = {0: "forwards", 90: "to the left", 180: "backwards", 270: "to the right"}
    return words.get(angle, f"towards {angle if angle <= 180 else angle - 360}°")
