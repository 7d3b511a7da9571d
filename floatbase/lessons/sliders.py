"""Controls that notebooks share. They call into a run that lives in a thread of its own, so the kernel stays free."""

from __future__ import annotations

from collections.abc import Callable
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


def push_panel(run: Live, view: Viewer, most: float = 60.0) -> widgets.VBox:
    """The live picture with a slider for a sideways push, N, along +y, which acts for 0.1 s when the slider is let go.

    Moving the slider starts the run when it is paused; buttons run, pause and reset it. Nothing here waits.
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

    def button(text: str, then: Callable[[], None]) -> widgets.Button:
        def act(_: widgets.Button) -> None:
            then()
            status.value = run.status

        made = widgets.Button(description=text, layout=widgets.Layout(width="6em"))
        made.on_click(act)
        return made

    def pushed(change: dict[str, Any]) -> None:
        if change["new"]:
            run.start()
            run.push([0.0, change["new"], 0.0])
            status.value = f"pushed with {change['new']:.0f} N for 0.1 s"

    force.observe(pushed, names="value")
    buttons = [button("run", run.start), button("pause", run.pause), button("reset", run.reset)]
    picture = widgets.HTML(view._repr_html_(), layout=widgets.Layout(width="100%"))
    return widgets.VBox([picture, force, widgets.HBox([*buttons, status])])
