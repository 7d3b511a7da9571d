"""Panels under a live picture: sliders that redraw it, and a handle that pushes the robot of a run
in the background.

Nothing here waits: a slider calls a quick function, a run has a thread of its own, and so the
kernel stays free.
"""

from __future__ import annotations

import html
import math
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import ipywidgets as widgets

from floatbase.errors import FloatbaseError
from floatbase.lessons.slider_samples import DIRECTIONS, precomputed_panel, recorded_pushes
from floatbase.simulation import Controller, LiveSimulation, Rollout, Simulation
from floatbase.viewer import PUSH_DISPLAY_TIME, Viewer, status_message
from floatbase.viewer.export.display_mode import display_mode
from floatbase.viewer.export.recording import push_at
from floatbase.viewer.export.thumbnail import with_thumbnail
from floatbase.viewer.transport.notebook_events import receive_during_cells

# width below which nothing of a slider is left but its name and its number
_MIN_SLIDER_WIDTH = "min(340px, 100% - 4px)"
_LETTER_WIDTH, _MAX_NAME_WIDTH = (
    0.55,
    10.4,
)  # em: of a letter of a slider's name, at most on average; of a name where the page is narrow

# sliders ------------------------------------------------------------------------------------------


class SliderPanel(widgets.VBox):
    """A live picture with sliders, as `slider_panel` makes it.

    view: the `Viewer` of the picture, None where the note has all there is to see. sliders: the
        slider of each name. note: the
    HTML that tells what a position means. beside: whether it stands beside the picture. samples: as
    for `slider_panel`.
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
        self.view, self.sliders, self.note, self.beside, self.samples = (
            view,
            sliders,
            note,
            beside,
            samples,
        )
        self._draw = draw
        for slider in sliders.values():
            slider.observe(self._redraw, names="value")
        self._redraw()

    def values(self) -> dict[str, float]:
        """The value of each slider, as it shows it."""
        return {name: _displayed_value(slider) for name, slider in self.sliders.items()}

    def draw_at(self, values: Mapping[str, float]) -> str:
        """Draw the picture for these values of the sliders, which stay where they are; the note,
        HTML.
        """
        try:
            return self._draw(**values) or ""
        except FloatbaseError as error:
            return html.escape(str(error))

    def _redraw(self, _: Any = None) -> None:
        self.note.value = self.draw_at(self.values())

    def _repr_mimebundle_(self, **kwargs: Any) -> Any:
        """The picture is put in only here: by now the camera has been placed, and a still picture
        keeps that view.
        """
        if display_mode() == "site":
            return precomputed_panel(self)
        self._picture.children = [self.view.widget()] if self.view else []
        return with_thumbnail(super()._repr_mimebundle_(**kwargs), *self._picture.children)


def _flex_layout(share: int, least: int) -> widgets.Layout:
    """A part of a row that takes its share of the width, %, and a line of its own where that is
    less than `least` pixels.
    """
    return widgets.Layout(flex=f"1 1 {share}%", min_width=f"min({least}px, 100%)")


def slider_panel(
    view: Viewer | None,
    draw: Callable[..., str | None],
    on_release: bool = False,
    beside: bool = False,
    samples: Mapping[str, Sequence[float]] | None = None,
    **ranges: tuple[float, float, float] | tuple[float, float, float, str] | range,
) -> SliderPanel:
    """The live picture of `view` with one slider for each of `ranges`, in the order in which they
    are given.

    view: the `Viewer` that is drawn on; None where the note holds the picture, as one in the plane.
    draw: called once at first and at every move as draw(name=value, …), with the values as they are
        shown, in the kernel's thread; it draws on `view` and should take a few milliseconds. It may
        return a note, HTML or plain text.
    on_release: call `draw` only when a slider is let go, for a function that takes longer.
    beside: the note stands to the right of the picture; otherwise between the picture and the
        sliders.
    samples: name -> values at which the picture is computed for a site, where no kernel draws;
        round ones by default.
    ranges: name=(lowest, first, highest) or name=(lowest, first, highest, unit). "_" in a name
        shows as a blank. The step of a slider is round and meets all three. name=range(n) is a
        slider of whole numbers, 0 to n - 1, that begins at 0.

    Where `draw` raises an error of the package, its text is the note.
    """
    sliders = {name: _range_slider(name, bounds, on_release) for name, bounds in ranges.items()}
    longest = max((len(slider.description) for slider in sliders.values()), default=0)
    for slider in sliders.values():
        slider.style.description_width = (
            f"max(min(12em, 36%), {min(_LETTER_WIDTH * longest, _MAX_NAME_WIDTH):.2f}em)"
        )
    return SliderPanel(view, draw, sliders, beside, samples or {})


def _range_slider(name: str, bounds: Any, on_release: bool) -> widgets.FloatSlider:
    whole = isinstance(bounds, range)
    low, first, high, *unit = (bounds[0], bounds[0], bounds[-1]) if whole else bounds
    text = " ".join([name.replace("_", " "), *(f"[{part}]" for part in unit if part)])
    made = _slider(
        text, low, first, high, bounds.step if whole else _round_step(low, first, high), on_release
    )
    made.layout.width = "80%"
    return made


def _slider(
    text: str, low: float, first: float, high: float, step: float, on_release: bool
) -> widgets.FloatSlider:
    """A slider that shows as many digits as its step has. on_release: it tells its value only when
    it is let go.
    """
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
    """The largest of 1, 2 or 5 times a power of ten that divides all bounds, with at least 50 steps
    from lowest to highest.

    Where none does, because a bound is not round itself, one that is too fine for that to be seen.
    """
    most = (max(bounds) - min(bounds)) / 50
    power = math.floor(math.log10(most)) if most > 0 else 0
    steps = [float(f"{digit}e{power - i}") for i in range(4) for digit in (5, 2, 1)]
    steps = [step for step in steps if step <= most * (1 + 1e-9)] or [1.0]
    return next(
        (step for step in steps if all(abs(b / step - round(b / step)) < 1e-6 for b in bounds)),
        steps[-1],
    )


def _displayed_value(slider: widgets.FloatSlider) -> float:
    """The value as the slider shows it: a browser's sum of steps may be off in the last digits."""
    return float(format(slider.value, slider.readout_format)) + 0.0  # without a minus before a zero


# pushes -------------------------------------------------------------------------------------------


def live_run(
    sim: Simulation, controller: Controller, view: Viewer, **options: Any
) -> LiveSimulation:
    """A run in the background that draws itself into `view`; a push stays as an arrow for half a
    second.

    options: as for `LiveSimulation`. Nothing moves before `start`.
    """

    def show(record: Rollout) -> None:
        view.show(
            record.final,
            contacts=record.contacts,
            forces=record.measured[-1],
            push=push_at(record, -1, PUSH_DISPLAY_TIME),
        )

    return LiveSimulation(sim, controller, show, push_memory=PUSH_DISPLAY_TIME, **options)


def push_panel(run: LiveSimulation, view: Viewer, max_force: float = 60.0) -> widgets.VBox:
    """The live picture with a handle to push the robot in any horizontal direction, for 0.1 s at a
    time.

    run: as `live_run` returns it, paused at first.
    view: the viewer that it draws into. Give it a `Viewer` of its own: the picture stops when
        `view` is displayed again in a later cell.
    max_force: the largest push, N.

    The first slider sets the force, N, and pushes when it is released. The second sets the
    direction in degrees: 0 is forwards, 90 to the robot's left (+y, where it begins), 180
    backwards. The button *push* pushes again. A push starts the run, as *run* does; both first put
    a fallen robot back on its feet. *pause* stops the run, *reset* restores the start and both
    sliders. The third slider slows time down. A line shows the status and what stopped the run.
    """
    force = _slider("push [N]", -max_force, 0.0, max_force, 5.0, on_release=True)
    towards = _slider("towards [°]", -180.0, 90.0, 180.0, 15.0, on_release=True)
    speed = _slider("slow motion [×]", 0.05, 1.0, 1.0, 0.05, on_release=False)
    speed.observe(lambda change: run.set_time_scale(change["new"]), names="value")
    line = _StatusLine(run)

    def push(_: Any = None) -> None:
        if not force.value:
            line.value = "a push of 0 N: set how hard first"
            return
        run.push(_horizontal_force(force.value, towards.value))
        line.show_status(
            f"pushed with {abs(force.value):.0f} N {_direction_text(force.value, towards.value)} "
            f"for 0.1 s"
        )

    def let_go(change: dict[str, Any]) -> None:
        if change["new"]:
            push()

    def reset() -> None:
        force.value, towards.value = 0.0, 90.0
        run.reset()

    def button(text: str, does: Callable[[], None]) -> widgets.Button:
        def pressed(_: Any) -> None:
            does()
            line.show_status("")

        return _button(text, pressed)

    run.on_status(lambda _: line.show_status())
    force.observe(let_go, names="value")
    buttons = [button("run", run.start), button("pause", run.pause), button("reset", reset)]
    wrapped = widgets.Layout(flex_flow="row wrap")
    aim, bar = (
        widgets.HBox(parts, layout=wrapped)
        for parts in ([towards, _button("push", push)], [*buttons, line])
    )
    rows = [force, aim, speed, bar]
    return _PushPanel(run, view, max_force, rows)


class _PushPanel(widgets.VBox):
    """A live picture with what pushes its robot, as `push_panel` makes it."""

    def __init__(
        self, run: LiveSimulation, view: Viewer, max_force: float, rows: Sequence[widgets.Widget]
    ):
        super().__init__([view.widget(), *rows])
        self._run, self._view, self._max_force = run, view, max_force

    def _repr_mimebundle_(self, **kwargs: Any) -> Any:
        if display_mode() == "site":
            forces = [self._max_force * part / 4 for part in (1, 2, 3, 4)]
            return recorded_pushes(
                {"": (self._view, self._run.sim, self._run.controller)}, forces, list(DIRECTIONS)
            )
        return with_thumbnail(super()._repr_mimebundle_(**kwargs), self.children[0])


class _StatusLine(widgets.Label):
    """What a run does: its status, or what was last done to it while it runs. Told from the
    kernel's thread and the run's.
    """

    def __init__(self, run: LiveSimulation):
        super().__init__(value=run.status)
        self._run, self._news, self._telling = run, "", threading.Lock()

    def show_status(self, news: str | None = None) -> None:
        """Show the present status; `news` stands in its place while the run goes on, "" for none,
        None for the last.
        """
        with (
            self._telling
        ):  # the status is read in here, so that the last line is never about an earlier one
            self._news = self._news if news is None else news
            status = self._run.status
            told = status_message(status, self._run.reason)
            self.value = self._news if status == "running" and self._news else told


def _button(text: str, pressed: Callable[[widgets.Button], None]) -> widgets.Button:
    made = widgets.Button(description=text, layout=widgets.Layout(width="6em", flex="0 0 auto"))
    made.on_click(pressed)
    receive_during_cells(made)
    return made


def _horizontal_force(force: float, towards: float) -> list[float]:
    """A force of `force` N towards so many degrees, shape (3,), world."""
    angle = math.radians(towards)
    return [force * math.cos(angle), force * math.sin(angle), 0.0]


def _direction_text(force: float, towards: float) -> str:
    """Where a push goes, in words where there is a word."""
    angle = round(towards + (180.0 if force < 0 else 0.0)) % 360
    words = {0: "forwards", 90: "to the left", 180: "backwards", 270: "to the right"}
    return words.get(angle, f"towards {angle if angle <= 180 else angle - 360}°")
