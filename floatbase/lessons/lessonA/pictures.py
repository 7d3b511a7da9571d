"""Lesson A: a puck on a turntable, a tumbling robot, errors against speed, and travelling feet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

import floatbase as fb
from floatbase._validation import Array
from floatbase.dynamics import bias_forces, view_from_rotating_frame
from floatbase.lessons import props, svg
from floatbase.lessons.judges import format_vector
from floatbase.simulation import Rollout
from floatbase.viewer import Picture, View, Viewer, shapes
from floatbase.viewer.scene.colours import GREYS, hex_code

TABLE_RADIUS, TABLE_HEIGHT = 1.0, 0.3  # m: radius of the turntable, and height of its top
START = np.array([-0.7, 0.3, 0.0])  # m: initial position of the puck relative to the axis
# x to the right, y away from the viewer, as in the rider's drawing
TABLE_VIEW = View(-90.0, 48.0, 1.0, around=((0.0, 0.0, 0.2), 1.0))
PIECES = 24  # of a drawn path
SIDE = 250  # pixels of a drawing
ACCELERATION_SCALE = 0.05  # m drawn for 1 m/s²
FORCE_SCALE = 0.003  # m drawn for 1 N of a fictitious force
SIDE_VIEW = View(62.0, 12.0, 1.0, around=((0.0, 0.0, 0.62), 0.5))
FEET_VIEW = View(62.0, 24.0, 1.0, around=((0.0, 0.0, 0.16), 0.44))
MIN_ROD_LENGTH = 1e-3  # m: a shorter rod is not drawn
PIN_DISTANCE = 0.05  # m: from a foot to its pin, away from the robot, where it is visible
FRAME_RATE = 10  # pictures per second of the travelling feet


def show_turntable(view: Viewer, omega: float, speed: float, time: float) -> str:
    """Draw a puck that slides straight over a turning table and leaves a chalk line on it."""
    times = np.linspace(0.0, max(time, 1e-3), PIECES + 1)
    seen = view_from_rotating_frame(times, [0.0, 0.0, omega], START, [speed, 0.0, 0.0])
    top = np.array([0.0, 0.0, TABLE_HEIGHT])
    straight = START + np.outer(times, [speed, 0.0, 0.0])
    chalk = seen.position @ seen.rotation[-1].T  # where the table has carried the chalk line by now
    picture = view.painter.ground_only() | {
        "table": props.turntable(top, TABLE_RADIUS, omega * time)
    }
    picture |= _path("chalk", chalk + top + [0.0, 0.0, 0.006], 0.012, GREYS[0])
    picture |= _path("way", straight + top + [0.0, 0.0, 0.05], 0.006, GREYS[1])
    puck = straight[-1] + top
    picture["puck"] = shapes.rod(puck, np.eye(3), 0.05, 0.055, GREYS[0])
    view.draw(picture)
    return _riders_drawing(seen.position, seen.centrifugal[-1], seen.coriolis[-1])


def _path(name: str, points: Array, radius: float, colour: tuple[float, float, float]) -> Picture:
    """Return rods that connect points in the world frame [m]."""
    return {
        f"{name}/{i}": props.rod_between(a, b, radius, colour)
        for i, (a, b) in enumerate(pairwise(points))
        if _are_apart(a, b)
    }


def _are_apart(a: Array, b: Array) -> bool:
    return bool(np.linalg.norm(b - a) > MIN_ROD_LENGTH / 10)


def _riders_drawing(position: Array, centrifugal: Array, coriolis: Array) -> str:
    """Draw the path, shape (n, 3) [m], and the final accelerations [m/s²] from above, as SVG."""
    half, scale = SIDE / 2, 0.95 * SIDE / (2 * TABLE_RADIUS)

    def seen(points: Array) -> Array:
        return half + scale * np.asarray(points)[..., :2] * [1.0, -1.0]

    middle, grey = (half, half), hex_code(GREYS[1])
    drawn = svg.circle(middle, scale * TABLE_RADIUS, fill="none", stroke="currentColor")
    drawn += svg.line(middle, seen(np.array([0.95 * TABLE_RADIUS, 0.0])), stroke_width=3)
    drawn += svg.polyline(seen(position), stroke=grey, stroke_width=3)
    drawn += svg.circle(seen(position[-1]), 7)
    for acceleration, dashes in ((centrifugal, "4 3"), (coriolis, "")):
        drawn += _arrow(
            seen(position[-1]), seen(position[-1] + ACCELERATION_SCALE * acceleration), dashes
        )
    sizes = [float(np.linalg.norm(each)) for each in (centrifugal, coriolis)]
    words = (
        "what the rider sees",
        f"dashed: centrifugal, {sizes[0]:.1f} m/s²",
        f"solid: Coriolis, {sizes[1]:.1f} m/s²",
    )
    for i, word in enumerate(words):
        drawn += svg.text((half, SIDE + 40 + 18 * i), word)
    return svg.drawing(drawn, 300, f"-25 -30 300 {SIDE + 18 * len(words) + 65}")


def _arrow(start: Array, end: Array, dashes: str) -> str:
    """Draw a line with a tip [px]; nothing if it would be shorter than its tip."""
    way = end - start
    length = float(np.linalg.norm(way))
    if length < 6.0:
        return ""
    along, aside = way / length, np.array([-way[1], way[0]]) / length
    corners = [end, end - 9.0 * along + 4.5 * aside, end - 9.0 * along - 4.5 * aside]
    shaft = svg.line(start, end - 8.0 * along, stroke_width=2, stroke_dasharray=dashes)
    return shaft + svg.polygon(np.array(corners))


def show_tumble(view: Viewer, glide: float, spin: float) -> str:
    """Draw a robot in the air that moves to its left and turns, and its fictitious base force."""
    robot = view.robot
    q, v = robot.standing().q.copy(), np.zeros(robot.nv)
    q[2] += 0.25
    v[1], v[5] = glide, spin
    state = fb.State(robot, q, v)
    parts = {axes: bias_forces(state, axes=axes).fictitious for axes in ("base", "world")}
    picture = view.painter.picture(state, com=False)
    base = state.frame_pose("base").translation + [0.0, 0.0, 0.1]
    for (name, h), colour, lift in zip(
        parts.items(), (GREYS[0], GREYS[2]), (0.06, 0.0), strict=True
    ):
        tip = FORCE_SCALE * h[:3]
        if np.linalg.norm(tip) > MIN_ROD_LENGTH:
            picture[f"called/{name}"] = shapes.arrow(
                base + [0.0, 0.0, lift], tip, colour, view.painter.size
            )
            text_at = (
                base + tip + np.array([0.0, 0.0, lift + 0.05]) + 0.12 * tip / np.linalg.norm(tip)
            )
            picture[f"label/{name}"] = shapes.label(text_at, f"{name}'s axes", 0.05, plate=False)
    view.draw(picture)
    places = [_falling(state, h, axes) for axes, h in parts.items()]
    forces = " N, ".join(
        f"in the {axes}'s axes {format_vector(h[:3])}" for axes, h in parts.items()
    )
    apart = float(np.linalg.norm(places[0] - places[1]))
    return f"{forces} N; the base's acceleration in the world by both: {apart:.1f} m/s² apart"


def _falling(state: fb.State, fictitious: Array, axes: str) -> Array:
    """Return the base's acceleration in the world frame, shape (3,) [m/s²]."""
    R = state.frame_pose("base").rotation
    if axes == "base":
        return np.asarray(
            R @ (np.linalg.solve(state.M, -fictitious)[:3] + np.cross(state.v[3:6], state.v[:3]))
        )
    T = np.eye(state.robot.nv)
    T[:3, :3] = T[3:6, 3:6] = R.T
    return np.asarray(np.linalg.solve(T.T @ state.M @ T, -fictitious)[:3])


def plot_errors(speeds: Sequence[float], errors: Mapping[str, Sequence[float]]) -> Axes:
    """Plot errors against speed on logarithmic axes, with the mean slope of each curve."""
    _, axis = plt.subplots(figsize=(7, 3.4), layout="constrained")
    for (name, curve), colour, style in zip(
        errors.items(), GREYS, ("o-", "s--", "^:"), strict=False
    ):
        slope = np.log(curve[-1] / curve[0]) / np.log(speeds[-1] / speeds[0])
        axis.loglog(
            speeds,
            curve,
            style,
            color=hex_code(colour),
            linewidth=2.0,
            label=f"{name}: slope {abs(slope):.1f}",
        )
    axis.set_xticks(speeds, [f"{speed:g}" for speed in speeds])
    axis.minorticks_off()
    axis.set(xlabel="speed (1: figure of eight in 6 s)", ylabel="tool error [mm]", ylim=(1e-2, 1e2))
    axis.grid(alpha=0.25)
    axis.legend(fontsize="small", loc="center left", bbox_to_anchor=(1.0, 0.5))
    return axis


def play_travelling_feet(view: Viewer, record: Rollout, speed: float = 4.0) -> Viewer:
    """Play a robot whose feet travel, with a pin at each foot's first position."""
    contacts = record.contacts
    home = contacts.positions(record.state(0))
    rows = np.arange(
        0, len(record), max(1, round(1.0 / FRAME_RATE / (record.time[1] - record.time[0])))
    )

    def picture(i: int) -> Picture:
        state = record.state(i)
        drawn = view.painter.picture(state, com=False)
        for j, (a, b) in enumerate(zip(home, contacts.positions(state), strict=True)):
            pin = np.array([a[0] + np.sign(a[0]) * PIN_DISTANCE, a[1], 0.006])
            drawn[f"pin/{j}"] = shapes.rod(pin, np.eye(3), 0.05, 0.004, GREYS[0])
            beside = np.array([pin[0], b[1], pin[2]])
            if _are_apart(pin, beside):
                drawn[f"way/{j}"] = props.rod_between(pin, beside, 0.006, GREYS[0])
        return drawn

    view.play_pictures(record.time[rows], [picture(int(i)) for i in rows], speed=speed)
    return view.camera(FEET_VIEW)
