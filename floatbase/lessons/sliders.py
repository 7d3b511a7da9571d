"""Controls that notebooks share. They call into a run that lives in a thread of its own, so the kernel stays free."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from typing import Any

import ipywidgets as widgets

from floatbase.simulation import SEEN, Controller, Live, Rollout, Simulation, advice
from floatbase.viewer import Viewer, push_at


def live(sim: Simulation, controller: Controller, view: Viewer, **options: Any) -> Live:
    """A background run that draws itself into `view`, a push as an arrow for half a second; options as for `Live`. Nothing
    moves before `start`."""

    def show(record: Rollout) -> None:
        view.show(record.final, contacts=record.contacts, forces=record.measured[-1], push=push_at(record, -1, SEEN))

    return Live(sim, controller, show, **options)


def push_panel(run: Live, view: Viewer, most: float = 60.0) -> widgets.VBox:
    """The live picture with a handle to push the robot in any horizontal direction, for 0.1 s at a time.

    The first slider says how hard, N, and pushes when it is let go; the second says where to, in degrees: 0 forwards, 90 to
    the robot's left (+y, where it begins), 180 backwards; the button *push* pushes once more. The run starts paused: a push
    starts it, as *run* does, and either puts a fallen robot back on its feet first. *pause* stops it, *reset* begins anew with
    both sliders where they began. A line says what happens, and what stopped the run. Nothing here waits. The picture goes on
    as long as `view` is not displayed again below: give an interactive part a `Viewer` of its own.
    """
    force = _slider("push [N]", 0.0, -most, most, 5.0)
    towards = _slider("towards [°]", 90.0, -180.0, 180.0, 15.0)
    line = _Line(run)

    def push(_: Any = None) -> None:
        if not force.value:
            line.value = "a push of 0 N: set how hard first"
            return
        run.push(_horizontal(force.value, towards.value))
        line.tell(f"pushed with {abs(force.value):.0f} N {_direction(force.value, towards.value)} for 0.1 s")

    def let_go(change: dict[str, Any]) -> None:
        if change["new"]:
            push()

    def reset() -> None:
        force.value, towards.value = 0.0, 90.0
        run.reset()

    def button(text: str, does: Callable[[], None]) -> widgets.Button:
        def pressed(_: Any) -> None:
            does()
            line.tell("")

        return _button(text, pressed)

    run.on_status(lambda _: line.tell())
    force.observe(let_go, names="value")
    buttons = [button("run", run.start), button("pause", run.pause), button("reset", reset)]
    picture = widgets.HTML(view._repr_html_(), layout=widgets.Layout(width="auto"))
    return widgets.VBox([picture, force, widgets.HBox([towards, _button("push", push)]), widgets.HBox([*buttons, line])])


class _Line(widgets.Label):
    """What a run does: its status, or what was last done to it while it runs. Told from the kernel's thread and the run's."""

    def __init__(self, run: Live):
        super().__init__(value=run.status)
        self._run, self._news, self._telling = run, "", threading.Lock()

    def tell(self, news: str | None = None) -> None:
        """Show the present status; `news` stands in its place while the run goes on, "" for none, None for the last."""
        with self._telling:  # the status is read in here, so that the last line is never about an earlier one
            self._news = self._news if news is None else news
            status = self._run.status
            self.value = self._news if status == "running" and self._news else advice(status)


def _slider(text: str, value: float, low: float, high: float, step: float) -> widgets.FloatSlider:
    """A slider that tells its value when it is let go."""
    return widgets.FloatSlider(
        value=value,
        min=low,
        max=high,
        step=step,
        description=text,
        continuous_update=False,
        readout_format=".0f",
        layout=widgets.Layout(width="60%"),
    )


def _button(text: str, pressed: Callable[[widgets.Button], None]) -> widgets.Button:
    made = widgets.Button(description=text, layout=widgets.Layout(width="6em"))
    made.on_click(pressed)
    return made


def _horizontal(force: float, towards: float) -> list[float]:
    """A force of `force` N, shape (3,), world, towards so many degrees."""
    angle = math.radians(towards)
    return [force * math.cos(angle), force * math.sin(angle), 0.0]


def _direction(force: float, towards: float) -> str:
    """Where a push goes, in words where there is a word."""
    angle = round(towards + (180.0 if force < 0 else 0.0)) % 360
    words = {0: "forwards", 90: "to the left", 180: "backwards", 270: "to the right"}
    return words.get(angle, f"towards {angle if angle <= 180 else angle - 360}°")
