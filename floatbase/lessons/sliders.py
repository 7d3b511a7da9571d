"""Controls that notebooks share. They call into a run that lives in a thread of its own, so the kernel stays free."""

from __future__ import annotations

from typing import Any

import ipywidgets as widgets

from floatbase.simulation.live import Live
from floatbase.simulation.physics import Simulation
from floatbase.simulation.rollout import Controller, Rollout
from floatbase.viewer.scene import Viewer


def live(sim: Simulation, controller: Controller, view: Viewer, **options: Any) -> Live:
    """A background run that draws itself into `view`; options as for `Live`. Nothing moves before `start`."""

    def show(record: Rollout) -> None:
        last = record.final
        view.show(last, contacts=record.contacts, forces=record.measured[-1])

    return Live(sim, controller, show, **options)


def push_panel(run: Live, most: float = 60.0) -> widgets.VBox:
    """A slider for a sideways push in N, which acts for 0.1 s when it is let go, with buttons to run, pause and reset.

    Moving the slider starts the run when it is paused.
    """
    force = widgets.FloatSlider(
        value=0.0,
        min=-most,
        max=most,
        step=5.0,
        description="push [N]",
        continuous_update=False,
        readout_format=".0f",
        layout=widgets.Layout(width="60%"),
    )
    status = widgets.Label(value=run.status)
    start, pause, reset = (widgets.Button(description=text) for text in ("run", "pause", "reset"))

    def act(then: Any) -> Any:
        def handler(_: Any) -> None:
            then()
            status.value = run.status

        return handler

    def pushed(change: Any) -> None:
        if change["new"]:
            run.start()
            run.push([0.0, change["new"], 0.0])
            status.value = f"pushed with {change['new']:.0f} N for 0.1 s"

    force.observe(pushed, names="value")
    start.on_click(act(run.start))
    pause.on_click(act(run.pause))
    reset.on_click(act(run.reset))
    return widgets.VBox([force, widgets.HBox([start, pause, reset, status])])
