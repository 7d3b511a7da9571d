"""Lesson 02: pictures of (4), of contacts with and without b, and of a wheel that parks."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

import floatbase as fb
from floatbase._validation import Array
from floatbase.dynamics import EquationsOfMotion
from floatbase.lessons import props, svg
from floatbase.lessons.judges import format_vector
from floatbase.lessons.lesson02.helpers import DISC_RADIUS, parking_states, rolling_wheel
from floatbase.lessons.panels import SliderPanel, slider_panel
from floatbase.robots import Robot
from floatbase.simulation import Rollout
from floatbase.viewer import Picture, View, Viewer, markers, prefixed, shapes
from floatbase.viewer.scene.colours import COM, GREYS, PLANNED, hex_code

MOMENT_SCALE = 0.01  # m drawn for a newton metre


def draw_equation(eom: EquationsOfMotion) -> Figure:
    """Draw (4) to scale for four point feet: the non-zero entries of M, h, S and Jᵀ."""
    feet = [str(name).split("_")[0] for name in eom.contacts.names]
    # middle of each leg's joints, and of each foot's force
    in_threes = 3.0 * np.arange(len(feet)) + 1.0
    parts = [
        ("M q̈", eom.M, 6.0),
        ("+ h", eom.h[:, None], None),
        ("= S τ", eom.S, 0.0),
        ("+ Jᵀ λ", eom.J.T, 0.0),
    ]
    widths = [max(part.shape[1], 1.6) for _, part, _ in parts]
    figure, axes = plt.subplots(1, 4, figsize=(9.5, 3.7), width_ratios=widths, layout="constrained")
    for axis, (name, part, first) in zip(axes, parts, strict=True):
        filled = np.abs(part) > 1e-9 * np.abs(part).max()
        axis.imshow(np.where(filled, 1.0, 0.0), cmap="Greys", vmin=0.0, vmax=2.0, aspect="equal")
        axis.axhline(5.5, color=hex_code(GREYS[0]), linewidth=2.0)
        axis.set_title(name, fontsize=14)
        axis.set(xlabel=f"{part.shape[0]} × {part.shape[1]}", xticks=[], yticks=[])
        if first is not None:
            axis.set_xticks(in_threes + first, feet, fontsize="small")
    axes[0].set_xticks([2.5, *(in_threes + 6.0)], ["base", *feet], fontsize="small")
    axes[0].set_yticks([2.5, *(in_threes + 6.0)], ["base", *feet], fontsize="small")
    return figure


def force_panel(view: Viewer, state: fb.State, contacts: fb.Contacts, foot: str) -> SliderPanel:
    """Return a panel with sliders for a force at one foot."""
    J = fb.equations_of_motion(state, contacts).J[contacts.force_slice(foot)]
    base = state.frame_pose("base")
    leg = [i for i, name in enumerate(state.robot.joint_names) if name.startswith(foot[:2])]
    where = list(contacts.names).index(foot)

    def draw(forwards: float, up: float) -> str:
        force = np.array([forwards, 0.0, up])
        generalized = J.T @ force
        f, moment = base.rotation @ generalized[:3], base.rotation @ generalized[3:6]
        forces = np.zeros((len(contacts), 3))
        forces[where] = force
        size, scale = view.painter.size, view.scale
        drawn = markers.wrench(base.translation, scale * f, MOMENT_SCALE * moment, size)
        extra: Picture = {}
        if np.linalg.norm(force) > 1e-6:
            extra = prefixed("base", drawn)
            # above the arrow and above the trunk
            lift = np.maximum(scale * f, [-np.inf, -np.inf, 0.1])
            above = base.translation + lift + [0.0, 0.0, 0.04]
            extra["label/base"] = shapes.label(above, "on the base", 0.028)
            ahead = state.point(foot) + [0.14, 0.0, -0.06]  # neither leg nor arrow comes here
            extra["label/foot"] = shapes.label(ahead, "on the foot", 0.028)
        picture = view.painter.picture(
            state, contacts, planned=forces, com=False, cones=False, extra=extra
        )
        view.draw({path.replace("planned/", "force/"): item for path, item in picture.items()})
        torques = ", ".join(f"{x + 0.0:.1f}" for x in np.round(generalized[6:][leg], 1))
        rest = np.delete(generalized[6:], leg)
        return (
            f"base rows: force {format_vector(generalized[:3])} N, moment "
            f"{format_vector(generalized[3:6], 1)} N·m; "
            f"joints of this leg {torques} N·m; all other joints {np.abs(rest).max():.0f}"
        )

    view.add_legend_entry("force", PLANNED, "force on the foot")
    view.add_legend_entry("base", COM, "force and moment on the base")
    panel = slider_panel(view, draw, forwards=(-40.0, 0.0, 40.0, "N"), up=(0.0, 60.0, 80.0, "N"))
    view.camera(View(76.0, 14.0, 1.0, around=((0.0, 0.0, 0.31), 0.47)))
    return panel


def play_tool_comparison(view: Viewer, without_b: Rollout, with_b: Rollout) -> Viewer:
    """Play the arm without b, and the arm with b as a ghost."""
    home, colour = without_b.state(0).point("tool0"), view.painter.text_colour
    pin = {"home/pin": shapes.rod(home, np.eye(3), 0.24, 0.005, colour)}
    pin["home/name"] = shapes.label(home + [0.0, 0.0, 0.27], "home", 0.035, colour)
    rows = np.linspace(0, len(with_b) - 1, 30).astype(int)
    view.add_legend_entry("way", GREYS[2], "from home to the tool")
    pictures = []
    for i in rows:
        drawn = view.painter.picture(without_b.state(i), com=False, ghost=with_b.state(i)) | pin
        tool = without_b.state(i).point("tool0")
        if np.linalg.norm(tool - home) > 2e-3:
            drawn["way"] = props.rod_between(home, tool, 0.012, GREYS[2])  # the arm is dark
        pictures.append(drawn)
    view.play_pictures(without_b.time[rows], pictures, speed=0.1, ghost_name="with b")
    return view.camera(View(66.0, 14.0, 1.0, around=((0.24, 0.1, 0.62), 0.32)))


def stabilization_panel(distances: Callable[[float], Array], timestep: float) -> SliderPanel:
    """Return a panel with a slider for α: distances(α) of the worst foot from its pin [mm]."""
    without = distances(0.0)
    wide, high, top = 420, 180, 1.1 * without.max()  # px, px, mm

    def curve(distance: Array, **style: str | float) -> str:
        across = np.linspace(0, wide, len(distance))
        up = high * (1 - np.clip(distance / top, -0.1, 1.1))
        return svg.polyline(np.column_stack([across, up]), **style)

    def draw(α: float) -> str:
        distance = distances(α)
        drawn = svg.line((0, high), (wide, high)) + svg.line((0, 0), (0, high))
        drawn += curve(without, stroke=hex_code(GREYS[2]), stroke_dasharray="6 4")
        drawn += curve(distance, stroke="currentColor", stroke_width=2)
        words = f"distance of the worst foot, up to {top:.0f} mm, in 0.2 s; dashed: α = 0"
        note = f"α dt = {α * timestep:.2f}: {distance[-1]:.2g} mm at the end"
        return svg.captioned(drawn, (wide, high), 10, words, note)

    return slider_panel(None, draw, α=(0.0, 50.0, 210.0, "1/s"))


def parking_panel(view: Viewer, robot: Robot) -> SliderPanel:
    """Return a panel with sliders for a parking disc: how far it rolls and turns, and the time."""

    def draw(distance: float, angle: float, time: float) -> str:
        states = parking_states(robot, distance, angle)
        picture = view.painter.ground_only()
        corners = [rolling_wheel().positions(state)[0] for state in states[::20]]
        for i, (a, b) in enumerate(pairwise(corners)):
            if np.linalg.norm(b - a) > 1e-6:
                picture[f"way/{i}"] = props.rod_between(a, b, 0.006, view.painter.text_colour)
        now = states[min(round(time * 20), len(states) - 1)]
        picture["wheel/now"] = _disc_picture(now, distance, time)
        ends = {"start": corners[0], "end": corners[-1]}
        if np.linalg.norm(corners[-1] - corners[0]) < 0.1:
            ends = {"start and end": corners[0]}
        for name, at in ends.items():
            on_top = at + [0.0, 0.0, 0.002]
            picture[f"mark/{name}"] = shapes.contact_patch(on_top, [0.0, 0.0, 1.0], 0.035)
            picture[f"name/{name}"] = shapes.label(at + [-0.12, -0.13, 0.0], name, 0.05)
        view.draw(picture)
        gone = states[-1].q[:2] - states[0].q[:2]
        slip = max(float(np.abs(rolling_wheel().slip(state)).max()) for state in states)
        return (
            f"at the end: {gone[0]:+.2f} m ahead, <b>{gone[1]:+.2f} m to the left</b>, heading as "
            f"before; "
            f"largest slip on the way {abs(slip):.3f} m/s"
        )

    distance, angle, time = (0.0, 0.5, 1.0, "m"), (-1.5, -0.7, 1.5, "rad"), (0.0, 1.5, 4.0, "s")
    panel = slider_panel(view, draw, distance=distance, angle=angle, time=time)
    view.camera(View(-115.0, 32.0, 1.0, around=((0.4, -0.1, 0.1), 0.85)))
    return panel


def _disc_picture(state: fb.State, distance: float, time: float) -> shapes.Item:
    """Return the parking disc at a time [s], with spokes that show how far it has rolled."""
    legs = np.clip(time - np.arange(4), 0.0, 1.0)
    rolled = distance / DISC_RADIUS * (legs[0] - legs[2])
    return props.wheel(
        state.q[:3], state.frame_pose("disc").rotation[:, 1], DISC_RADIUS, rolled, width=0.05
    )
