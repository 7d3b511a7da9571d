"""Lesson 08: support triangles, a falling pendulum, footholds, and two robots to push."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import Any

import ipywidgets as widgets
import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from IPython.display import HTML
from matplotlib.figure import Figure

import floatbase as fb
from floatbase.behaviours import capture_point, neutral_point, support_margin
from floatbase.lessons import props
from floatbase.lessons.lesson06 import region_picture
from floatbase.lessons.lesson08.helpers import state_with_moved_body
from floatbase.lessons.panels import Panel, live_run, push_sliders
from floatbase.lessons.slider_samples import recorded_pushes
from floatbase.simulation import LiveSimulation
from floatbase.viewer import Picture, Viewer, shapes, status_message
from floatbase.viewer.export.display_mode import display_mode
from floatbase.viewer.export.thumbnail import panel_bundle
from floatbase.viewer.scene.colours import GREYS, hex_code

_VERTICAL = np.array([0.0, 0.0, 1.0])
_SIZES = {"foothold": 0.03, "point": 0.012}  # m: radii of patches on the ground
_FIRST_PUSH = 200.0  # N
_PATCH_HEIGHT = 0.003  # m above the ground, so that its lines do not flicker
# N: both withstand the first, only stepping withstands the second; stepping withstands the third to
# the side only
_RECORDED_PUSHES = (150.0, 250.0, 350.0)
# one below the other on a narrow page
_HALF_WIDTH = widgets.Layout(flex="1 1 45%", min_width="min(260px, 100%)")


def plot_support_triangles(state: fb.State, contacts: fb.Contacts, *lifted: str) -> HTML:
    """Draw from above the centre of mass, and where it may be while a foot is lifted."""
    feet = contacts.positions(state)
    drawn = ""
    for foot in lifted:
        stand = contacts.without(foot).positions(state)[:, :2]
        picture = region_picture(state, feet, stand)
        drawn += f'<div style="text-align: center"><b>without {foot}</b><br>{picture}</div>'
    return HTML(f'<div style="display: flex; flex-wrap: wrap; gap: 2em">{drawn}</div>')


def plot_pendulum_fall(time: npt.ArrayLike, away: npt.ArrayLike, omega: float) -> Figure:
    """Plot how far a centre of mass falls from the line between two feet, and a pendulum."""
    t, d = np.asarray(time), np.asarray(away)
    figure, ax = plt.subplots(figsize=(6.5, 3.2), layout="constrained")
    ax.plot(t, 1e3 * d, color=hex_code(GREYS[0]), linewidth=2, label="MuJoCo")
    ax.plot(
        t,
        1e3 * d[0] * np.cosh(omega * t),
        "--",
        color=hex_code(GREYS[1]),
        linewidth=2,
        label="pendulum, d cosh ωt",
    )
    ax.set(xlabel="time [s]", ylabel="distance from the line [mm]", ylim=(0, None))
    ax.grid(alpha=0.3)
    ax.legend()
    plt.close(figure)
    return figure


def show_shifted_loads(
    view: Viewer, state: fb.State, lifted: str, back: float, right: float
) -> str:
    """Move the body while all feet stay, and show the loads of three feet at rest."""
    moved = state_with_moved_body(state, [-back / 1000, -right / 1000, 0.0])
    stand = fb.Contacts.points(state.robot).without(lifted)
    feet = stand.positions(moved)[:, :2]
    moments = np.vstack([np.ones(3), feet.T])
    loads = np.linalg.solve(moments, state.robot.weight * np.array([1.0, *moved.com[:2]]))
    view.show(moved, stand, planned=np.outer(loads, _VERTICAL), cones=False, support=True)
    told = ", ".join(f"{name[:2]} {n:.0f} N" for name, n in zip(stand.names, loads, strict=True))
    margin = 1000 * support_margin(moved.com[:2], feet)
    return f"{told}; {abs(margin):.1f} mm {'inside' if margin >= 0.0 else 'outside'}"


def show_foothold(view: Viewer, state: fb.State, speed: float, time: float, ahead: float) -> str:
    """Mark where two feet land for a given step, with the capture and the neutral point."""
    contacts = fb.Contacts.points(state.robot)
    feet = dict(zip(contacts.names, contacts.positions(state)[:, :2], strict=True))
    c, middle = state.com[:2], np.mean(list(feet.values()), axis=0)
    omega = math.sqrt(state.robot.gravity / state.com[2])
    p, v = c + [ahead, 0.0], np.array([speed, 0.0])
    under = {foot: p + feet[foot] - middle for foot in ("FL_foot", "RR_foot")}
    known = {"ξ": capture_point(c, v, omega), "v T / 2": neutral_point(c, v, time)}
    view.show(state, contacts, cones=False, extra=foothold_marks(view, under | known))
    told = ", ".join(f"{name} {1000 * (point - c)[0]:.0f} mm" for name, point in known.items())
    return f"step {1000 * ahead:.0f} mm, {told}"


def foothold_marks(view: Viewer, places: Mapping[str, npt.ArrayLike]) -> Picture:
    """Return marks on the ground: a patch for a foot, a label for any other name."""
    feet = {foot.frame for foot in view.robot.feet}
    picture: Picture = {}
    aside = np.array([0.0, 0.13, 0.02])  # of the first label; the next one is on the other side
    for name, place in places.items():
        at = np.array([*np.asarray(place, dtype=np.float64)[:2], _PATCH_HEIGHT])
        foot = name in feet
        picture[f"place/{name}"] = shapes.contact_patch(
            at, _VERTICAL, _SIZES["foothold" if foot else "point"]
        )
        if not foot:
            picture[f"label/{name}"] = shapes.label(at + aside, name, 0.035)
            aside = aside * [1.0, -1.0, 1.0]
    ends = [
        np.array([*np.asarray(places[name], dtype=np.float64)[:2], _PATCH_HEIGHT])
        for name in places
        if name in feet
    ]
    if len(ends) == 2:
        picture["line"] = props.rod_between(ends[0], ends[1], _PATCH_HEIGHT, GREYS[1])
    return picture


class PushComparison(Panel):
    """Robots side by side, each with its own controller, pushed by the same sliders."""

    def __init__(self, controllers: Mapping[str, Any]):
        self.views = {
            title: fb.Viewer(one.robot, height=300, follow=True)
            for title, one in controllers.items()
        }
        self.runs: dict[str, LiveSimulation] = {}
        self.lines = {title: widgets.Label() for title in controllers}  # empty until a run ends
        for title, one in controllers.items():
            sim = fb.Simulation(one.robot)
            self.views[title].show(sim.state, contacts=sim.feet, cones=False)
            self.runs[title] = live_run(sim, one, self.views[title])
            self.runs[title].on_status(partial(self._tell, title))
        self.sliders = push_sliders(next(iter(controllers.values())).robot)
        self.sliders[0].value = _FIRST_PUSH
        self.push_button = widgets.Button(description="push both")
        self.reset_button = widgets.Button(description="reset")
        self.push_button.on_click(lambda _: self.push())
        self.reset_button.on_click(lambda _: self.reset())
        self._pictures = {title: widgets.VBox() for title in controllers}
        columns = [
            widgets.VBox(
                [widgets.HTML(f"<b>{title}</b>"), self._pictures[title], self.lines[title]],
                layout=_HALF_WIDTH,
            )
            for title in controllers
        ]
        buttons = widgets.HBox([self.push_button, self.reset_button])
        row = widgets.HBox(columns, layout=widgets.Layout(flex_flow="row wrap"))
        super().__init__([row, *self.sliders, buttons])

    def push(self) -> None:
        """Push all robots now."""
        force, towards, duration = (slider.value for slider in self.sliders)
        push = fb.Push.horizontal(force, towards)
        for run in self.runs.values():
            run.push(push.force, duration)

    def reset(self) -> None:
        """Put all robots back on their feet."""
        for run in self.runs.values():
            run.reset()

    def _tell(self, title: str, status: str) -> None:
        goes_on = status in ("paused", "running")  # the pictures show it
        self.lines[title].value = "" if goes_on else status_message(status, self.runs[title].reason)

    def close(self) -> None:
        """Stop the simulations and close the pictures."""
        for run in self.runs.values():
            run.close()
        for view in self.views.values():
            view.close()
        super().close()

    def _repr_mimebundle_(self, **kwargs: Any) -> Any:
        """Return what a notebook shows."""
        if display_mode() == "site":
            titles = {
                title: (self.views[title], run.sim, run.controller)
                for title, run in self.runs.items()
            }
            return recorded_pushes(titles, _RECORDED_PUSHES, ["forwards", "to the left"])
        for title, picture in self._pictures.items():
            picture.children = [self.views[title].widget()]
        return panel_bundle(self, *(picture.children[0] for picture in self._pictures.values()))
