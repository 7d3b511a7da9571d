"""Lesson B: a cylinder with its valve and crank, torques on the bench, and sway of go2."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from floatbase._validation import Array
from floatbase.actuators import VACUUM, Hydraulics
from floatbase.lessons import props, svg
from floatbase.lessons.lessonB.helpers import Bench, BenchSample, hold_then_turn, run_force_loop
from floatbase.lessons.rounding import rounded
from floatbase.simulation import Rollout
from floatbase.viewer import View, Viewer, prefixed, shapes
from floatbase.viewer.scene.colours import GREYS, hex_code

BAR = 1e5  # Pa
DRAWING_SCALE = 3.0  # enlargement of the crank and its cylinder
JOINT = np.array([0.0, 0.0, 0.35])  # m: position of the joint in the picture
BEND = np.deg2rad(115.0)  # rad: between crank and shank, which are one piece of steel
SHANK_LENGTH = 0.35  # m
JOINT_VIEW = View(-90.0, 4.0, 1.0, around=((0.05, 0.0, 0.55), 0.62))
DASHES = ("-", "--", ":", "-.")
# px: width and height of a plot in the panel, and space on its left and below it
WIDTH, HEIGHT, LEFT, GAP = 620.0, 150.0, 58.0, 34.0
RUN_DURATION = 0.4  # s: duration of the run in the panel


def draw_cylinder(u: float) -> str:
    """Draw a cylinder whose valve joins one chamber to the supply and the other to the tank."""
    top, bottom, left, right, piston = 40.0, 120.0, 60.0, 420.0, 230.0
    thick = {"stroke_width": "2.5"}
    body = {"fill": "none", "stroke": "currentColor", **thick}
    dark = hex_code(GREYS[1])
    chambers = ((left, piston, "A", u > 0.0), (piston + 16, right, "B", u < 0.0))
    drawn = ""
    for start, end, name, supplied in chambers:
        corners = np.array([[start, top], [end, top], [end, bottom], [start, bottom]])
        opacity = "0.45" if supplied else "0.12" if u else "0.25"
        drawn += svg.polygon(corners, fill=dark, opacity=opacity)
        drawn += svg.text(((start + end) / 2, top + 24), name, 16)
    corners = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
    drawn += svg.polygon(corners, **body)
    middle = (top + bottom) / 2
    for start, end, half in ((piston, piston + 16, 39.0), (piston + 16, right + 90, 9.0)):
        low, high = middle - half, middle + half
        corners = np.array([[start, low], [end, low], [end, high], [start, high]])
        drawn += svg.polygon(corners, fill=hex_code(GREYS[2]), stroke="currentColor")
    drawn += svg.text((piston + 8, top - 10), "piston") + svg.text((right + 60, middle - 18), "rod")
    low, supply, tank = 190.0, 140.0, 330.0  # the valve's box, and where its lines begin below
    box = np.array([[100.0, low], [370.0, low], [370.0, low + 70], [100.0, low + 70]])
    drawn += svg.polygon(box, **body) + svg.text((390, low + 40), "valve", anchor="start")
    ports = {"A": 140.0, "B": 330.0}
    for x in ports.values():
        drawn += svg.line((x, bottom), (x, low), **thick)
    for x, name in ((supply, "supply, 160 bar"), (tank, "tank, 2 bar")):
        drawn += svg.line((x, low + 70), (x, low + 110), **thick) + svg.text((x, low + 128), name)
    opened = {"A": supply, "B": tank} if u > 0.0 else {"A": tank, "B": supply} if u < 0.0 else {}
    width = {"stroke_width": f"{1.0 + 7.0 * abs(u):.1f}"}
    for name, x in opened.items():
        drawn += svg.line((ports[name], low), (x, low + 70), **width)
    for x in () if opened else (*ports.values(), supply, tank):
        y = low if x in ports.values() else low + 70
        drawn += svg.line((x - 12, y), (x + 12, y), stroke_width="5")
    picture = svg.drawing(drawn, 560, "40 10 500 320")
    if not opened:
        return f"{picture}<div>u = 0: the valve is shut, and the oil is trapped</div>"
    first, second, way = ("A", "B", "out") if u > 0.0 else ("B", "A", "in")
    return (
        f"{picture}<div>u = {u:.2f}: oil flows from the supply into {first}, and from {second} to "
        f"the tank; the rod is pushed <b>{way}</b></div>"
    )


def show_crank(view: Viewer, angle: float, torque: float) -> str:
    """Draw the cylinder of a knee with its chambers A and B, enlarged three times."""
    bench = Bench(lambda t: (np.deg2rad(angle), 0.0))
    gamma = np.arccos(bench.crank / bench.base) + bench.angle
    foot = JOINT + [0.0, 0.0, DRAWING_SCALE * bench.base]
    end = JOINT + DRAWING_SCALE * bench.crank * _towards(gamma)
    shortest, longest = bench.base - bench.crank, bench.base + bench.crank
    stroke = DRAWING_SCALE * shortest, DRAWING_SCALE * longest
    least, most = bench.torque_range()
    a, b = _pressures(bench, min(most, max(least, torque)))
    supply = bench.hydraulics.supply_pressure
    picture = view.painter.ground_only() | prefixed(
        "cylinder", props.hydraulic_cylinder(foot, end, stroke, (a / supply, b / supply))
    )
    beside = np.cross([0.0, 1.0, 0.0], end - foot) / np.linalg.norm(end - foot)
    for name, chamber in (("A", "base chamber"), ("B", "rod chamber")):
        filled = picture[f"cylinder/{chamber}"].matrix
        picture[f"chamber {name}"] = shapes.label(
            filled[:3, 3] + 0.5 * filled[:3, 2] - 0.09 * beside, name, 0.04
        )
    for name, start, tip, radius in (
        ("thigh", JOINT, foot, 0.012),
        ("crank", JOINT, end, 0.016),
        ("shank", JOINT, JOINT + SHANK_LENGTH * _towards(gamma + BEND), 0.02),
    ):
        aside = np.array([0.0, 0.09 if name == "thigh" else 0.0, 0.0])  # behind the cylinder
        picture[name] = props.rod_between(start + aside, tip + aside, radius, GREYS[1])
    picture["joint"] = props.rod_between(
        JOINT + [0.0, -0.05, 0.0], JOINT + [0.0, 0.11, 0.0], 0.028, GREYS[0]
    )
    view.draw(picture)
    summary = (
        f"lever <b>{rounded(1000 * bench.lever, 'mm', floor=0.05)}</b>; possible: "
        f"{least:.0f} to {most:.0f} N·m; "
    )
    if not least <= torque <= most:
        return f"{summary}<b>{torque:.0f} N·m is more than the supply allows here</b>"
    return f"{summary}for {torque:.0f} N·m <b>A {a / BAR:.0f} bar, B {b / BAR:.0f} bar</b>"


def _towards(gamma: float) -> Array:
    """Return the unit vector, shape (3,), at an angle from straight up in the picture."""
    return np.array([np.sin(gamma), 0.0, np.cos(gamma)])


def _pressures(bench: Bench, torque: float) -> tuple[float, float]:
    """Return the pressures of both chambers for a torque [Pa]."""
    lines = bench.hydraulics.supply_pressure + bench.hydraulics.tank_pressure
    force = torque / bench.lever if abs(bench.lever) > 1e-6 else 0.0
    a = (force + bench.ring_area * lines) / (bench.piston_area + bench.ring_area)
    return a, lines - a


def plot_torques(runs: Mapping[str, Sequence[BenchSample]], wanted: float = 12.0) -> Axes:
    """Plot torques on the bench over time, with a thin line at the desired torque."""
    axis = _axes("time [ms]", "torque at the joint [N·m]")
    axis.axhline(wanted, color=hex_code(GREYS[2]), linewidth=1.0)
    for i, (name, rows) in enumerate(runs.items()):
        times, torques = [1000 * row.time for row in rows], [row.torque for row in rows]
        _plot_curve(axis, i, times, torques, name)
    _add_legend(axis)
    return axis


def plot_com_sway(records: Mapping[str, Rollout], side: float = 1.0) -> Axes:
    """Plot how far the centre of mass has moved sideways, since the start of each record."""
    axis = _axes("time [s]", f"CoM shift to the {'left' if side > 0 else 'right'} [mm]")
    for i, (name, record) in enumerate(records.items()):
        gone = 1000 * side * (record.com - record.com[0])[:, 1]
        _plot_curve(axis, i, record.time - record.time[0], gone, name)
    axis.axhline(0.0, color=hex_code(GREYS[2]), linewidth=1.0)
    _add_legend(axis)
    return axis


def _axes(x: str, y: str) -> Axes:
    _, axis = plt.subplots(figsize=(8, 3.2), layout="constrained")
    axis.set(xlabel=x, ylabel=y)
    axis.grid(alpha=0.25)
    return axis


def _plot_curve(axis: Axes, i: int, x: npt.ArrayLike, y: npt.ArrayLike, name: str) -> None:
    """Plot curve number i with its own dashes and shade."""
    color = hex_code(GREYS[i % 3])
    axis.plot(x, y, DASHES[i % 4], color=color, linewidth=1.8, label=name)


def _add_legend(axis: Axes) -> None:
    axis.legend(fontsize="small", loc="center left", bbox_to_anchor=(1.0, 0.5))


def show_torque_step(bandwidth: float, supply: float, turning: float) -> str:
    """Draw the response of the force loop of floatbase on the bench."""
    hydraulics = replace(Hydraulics(), supply_pressure=supply * BAR)
    rows = run_force_loop(
        Bench(hold_then_turn(turning), hydraulics=hydraulics), bandwidth, RUN_DURATION
    )
    torques = [row.torque for row in rows]
    low, high = np.floor(min(torques) / 20 + 0.02), np.ceil(max(torques) / 20)
    ticks = 20 * np.linspace(low, high, round(high - low) + 1)
    drawn = _strip(0.0, "torque [N·m]", ticks, {"wanted": [12.0] * len(rows), "got": torques})
    pressures = {
        "A": [row.pressure_a / BAR for row in rows],
        "B": [row.pressure_b / BAR for row in rows],
    }
    drawn += _strip(HEIGHT + GAP, "pressure [bar]", np.linspace(0.0, 200.0, 5), pressures)
    boiling = sum(min(row.pressure_a, row.pressure_b) <= VACUUM for row in rows)
    reached = next((row.time for row in rows if abs(row.torque - 12.0) < 0.6), None)
    late = (
        "12 N·m is not reached"
        if reached is None
        else f"12 N·m ± 5 % after <b>{1000 * reached:.0f} ms</b>"
    )
    boils = f"<b>the oil boils for {boiling} ms</b>" if boiling else "the oil does not boil"
    picture = svg.drawing(drawn, WIDTH, f"0 -8 {WIDTH} {2 * HEIGHT + 2 * GAP}")
    return (
        f"{picture}<div>{late}; while it turns, {min(torques[150:]):.1f} to "
        f"{max(torques[150:]):.1f} N·m; {boils}</div>"
    )


def _strip(top: float, title: str, ticks: Array, curves: Mapping[str, Sequence[float]]) -> str:
    """Draw two curves over the time of the panel: the first dashed, the last solid and dark."""
    right, low, high = WIDTH - 70.0, ticks[0], ticks[-1]

    def x(t: float) -> float:
        return LEFT + (right - LEFT) * t / RUN_DURATION

    def y(value: float) -> float:
        return float(top + HEIGHT * (high - value) / (high - low))

    drawn = svg.upright_text((14, top + HEIGHT / 2), title, 12)
    for value in ticks:
        drawn += svg.line((LEFT, y(value)), (right, y(value)), opacity="0.15")
        drawn += svg.text((LEFT - 6, y(value) + 4), f"{value:.0f}", 11, "end")
    for t in np.linspace(0.0, RUN_DURATION, 5):
        drawn += svg.text((x(t), top + HEIGHT + 15), f"{1000 * t:.0f} ms", 11)
    heights = [y(values[-1]) for values in curves.values()]
    if abs(heights[0] - heights[1]) < 12.0:  # names must not overlap
        up = 1.0 if heights[0] > heights[1] else -1.0
        middle = sum(heights) / 2
        heights = [middle + 7.0 * up, middle - 7.0 * up]
    for (name, values), at, dash, grey in zip(
        curves.items(), heights, ("5 4", ""), (GREYS[2], GREYS[1]), strict=True
    ):
        points = np.array([(x(1e-3 * i), y(value)) for i, value in enumerate(values)])
        style = {"stroke_width": "2.5", "stroke_dasharray": dash}
        drawn += svg.polyline(points, stroke=hex_code(grey), **style)
        drawn += svg.text((right + 6, at + 4), name, 12, "start")
    return drawn
