"""Lesson 03: the numbers of a motion as bars, non-zero entries of a matrix, and a stiff knee."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

import floatbase as fb
from floatbase._validation import Array
from floatbase.dynamics import FeasibleSpace
from floatbase.lessons import svg
from floatbase.lessons.lesson03.helpers import upright_solo12
from floatbase.linear_algebra import rank
from floatbase.robots import Robot
from floatbase.viewer import Viewer
from floatbase.viewer.scene.colours import GHOST, GREYS, PLANNED, hex_code

GHOST_TIME = 0.25  # s: the ghost shows where an acceleration leads from rest in this time
FULL = (20.0, 20.0, 100.0)  # m/s² or rad/s², N·m, N: values of bars of full length
# px: width of a bar, length of a full bar, and distance of the zero line from the top
BAR, FULL_BAR, ZERO_LINE = 14, 40, 62
LETTER_WIDTH = 7  # px: upper bound of the mean width of a letter in a title
# px: the name of a leg, 11 px high, fits below its three bars; gap between the bars of two legs
BLOCK, GAP = 58, 16

# name, labels of its three numbers, unit
_Blocks: TypeAlias = Sequence[tuple[str, tuple[str, ...], str]]


def show_beta(view: Viewer, space: FeasibleSpace, beta: npt.ArrayLike, cones: bool = True) -> str:
    """Draw (q̈, τ, λ) of a β: forces as arrows, and the motion due to q̈ from rest as a ghost."""
    qdd, tau, forces = space(beta)
    state = space.eom.state
    ghost = state.replace(q=state.integrate(0.5 * GHOST_TIME**2 * qdd), v=np.zeros(space.eom.nv))
    name = "where q̈ leads in a quarter of a second"
    view.show(
        state,
        contacts=space.eom.contacts,
        planned=forces,
        cones=cones,
        ghost=ghost,
        ghost_name=name,
    )
    return motion_bars(qdd, tau, forces)


def motion_bars(
    qdd: npt.ArrayLike,
    tau: npt.ArrayLike,
    forces: npt.ArrayLike,
    full: tuple[float, float, float] = FULL,
) -> str:
    """Draw all numbers of a quadruped's motion as bars, leg by leg."""
    legs = ("front left", "front right", "rear left", "rear right")
    joints, axes = ("hip", "thigh", "knee"), ("x", "y", "z")
    qdd = np.asarray(qdd)
    groups = (  # two groups for q̈: 18 numbers do not fit on a line of a narrow page
        (
            "q̈",
            "m/s², rad/s²",
            GHOST,
            [("base", axes, "m/s²"), ("turning", axes, "rad/s²")],
            qdd[:6],
            full[0],
        ),
        ("q̈", "rad/s²", GHOST, [(leg, joints, "rad/s²") for leg in legs], qdd[6:], full[0]),
        ("τ", "N·m", GREYS[1], [(leg, joints, "N·m") for leg in legs], tau, full[1]),
        ("λ", "N", PLANNED, [(leg, axes, "N") for leg in legs], forces, full[2]),
    )
    drawn = [
        _bar_group(
            f"{name}, ± {most:g} {units}",
            hex_code(colour),
            blocks,
            np.reshape(values, (-1, 3)),
            most,
        )
        for name, units, colour, blocks, values, most in groups
    ]
    return f'<div style="display: flex; flex-wrap: wrap; gap: 10px 16px">{"".join(drawn)}</div>'


def _bar_group(title: str, colour: str, blocks: _Blocks, values: Array, most: float) -> str:
    """Draw the bars of q̈, τ or λ as SVG of a fixed size, which wraps but never shrinks."""
    width, bottom = BLOCK * len(blocks), ZERO_LINE + FULL_BAR
    drawn = svg.element("text", title, y=12, font_size=13)
    drawn += svg.line((0, ZERO_LINE), (width, ZERO_LINE), stroke_opacity="0.5")
    for i, ((block, marks, unit), three) in enumerate(zip(blocks, values, strict=True)):
        drawn += svg.text((BLOCK * (i + 0.5), bottom + 28), block, 11)
        for j, (mark, value) in enumerate(zip(marks, three, strict=True)):
            x = BLOCK * i + BAR * j + GAP // 2
            number = f"{value:.4g}" if abs(value) > 1e-6 * most else "0"
            name = f"{title.split(',')[0]} {block} {mark}: {number} {unit}"
            bar = f"<title>{name}</title>{_bar(x, value / most, colour)}"
            drawn += f"<g>{bar}{svg.text((x + BAR / 2, bottom + 14), mark[0], 11)}</g>"
    wide = max(width, LETTER_WIDTH * len(title))
    style = {"role": "img", "aria_label": title, "font_size": "11", "fill": "currentColor"}
    return svg.element("svg", drawn, width=wide, height=bottom + 32, **style)


def _bar(x: int, part: float, colour: str) -> str:
    """Draw a bar at x, up or down from the zero line, in a column that reacts to the mouse."""
    length = float(min(abs(part), 1.0) * FULL_BAR)
    top, end = (
        (ZERO_LINE - length, ZERO_LINE - FULL_BAR)
        if part > 0
        else (float(ZERO_LINE), ZERO_LINE + FULL_BAR - 3)
    )
    column = {"width": BAR, "height": 2 * FULL_BAR + 16, "fill_opacity": 0}
    drawn = svg.element("rect", x=x, y=ZERO_LINE - FULL_BAR, **column)
    drawn += svg.element("rect", x=x + 1, y=top, width=BAR - 2, height=length, fill=colour)
    too_long = svg.element("rect", x=x + 1, y=end, width=BAR - 2, height=3)
    return drawn + (too_long if abs(part) > 1.0 else "")


def matrix_picture(A: npt.ArrayLike, rows: Mapping[str, int], columns: Mapping[str, int]) -> Figure:
    """Draw the non-zero entries of a matrix, and its singular values beside them."""
    A = np.asarray(A)
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(10, 4.2), layout="constrained", width_ratios=[3, 2]
    )
    size = np.log10(np.maximum(np.abs(A), 1e-12))
    shown = left.imshow(
        np.where(np.abs(A) > 1e-9, size, np.nan), cmap="viridis", aspect="auto", vmin=-3, vmax=1.5
    )
    figure.colorbar(
        shown, ax=left, ticks=[-3, -2, -1, 0, 1], label="magnitude, as a power of ten", shrink=0.8
    )
    _name_blocks(left, rows, columns)
    values = np.linalg.svd(A, compute_uv=False)
    right.semilogy(np.arange(1, len(values) + 1), values, "o", color=hex_code(GREYS[0]))
    right.set(
        xlabel="number",
        ylabel="singular value",
        title=f"{len(values)} singular values, rank {rank(A)}",
    )
    right.grid(alpha=0.3)
    plt.close(figure)
    return figure


def _name_blocks(axes: Any, rows: Mapping[str, int], columns: Mapping[str, int]) -> None:
    for mapping, line, ticks, names in (
        (rows, axes.axhline, axes.set_yticks, axes.set_yticklabels),
        (columns, axes.axvline, axes.set_xticks, axes.set_xticklabels),
    ):
        ends = np.cumsum(list(mapping.values()))
        for end in ends[:-1]:
            line(end - 0.5, color=hex_code(GREYS[0]), linewidth=0.8)
        ticks(ends - np.array(list(mapping.values())) / 2 - 0.5)
        names([f"{name}\n{size}" for name, size in mapping.items()])
    axes.xaxis.tick_top()
    axes.tick_params(length=0)


def show_knee(view: Viewer, robot: Robot, bend: float, wobble: Array) -> str:
    """Draw solo12 standing still, and return the torques that this takes."""
    contacts = fb.Contacts.points(robot)
    eom = fb.equations_of_motion(upright_solo12(robot, bend), contacts)
    forces = np.linalg.lstsq(eom.J[:, :6].T, eom.h[:6], rcond=1e-9)[0] + wobble
    tau = eom.h[6:] - eom.J[:, 6:].T @ forces
    extra = eom.J[:, 6:].T @ wobble
    view.show(eom.state, contacts=contacts, planned=forces, cones=False)
    return (
        f"rank J = <b>{rank(eom.J)}</b>, smallest singular value "
        f"{np.linalg.svd(eom.J)[1][-1]:.3f}; "
        f"torques for the wobble: <b>{np.linalg.norm(extra):.3f} N·m</b>"
        + motion_bars(np.zeros(18), tau, forces, full=(20.0, 2.0, 20.0))
    )
