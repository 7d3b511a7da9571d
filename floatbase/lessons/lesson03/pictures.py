"""Lesson 03, The space of possible motions: all numbers of a motion as bars, where a matrix is not zero, a stiff knee."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

import floatbase as fb
from floatbase._arrays import Array
from floatbase.dynamics import FeasibleSpace
from floatbase.lessons.lesson03.helpers import upright
from floatbase.linear_algebra import rank
from floatbase.robots import Robot
from floatbase.viewer import Viewer

GHOST_TIME = 0.25  # s: the veil shows where an acceleration leads in this time from rest
FULL = (20.0, 20.0, 100.0)  # m/s² or rad/s², N·m, N: bars of full length


def show_beta(view: Viewer, space: FeasibleSpace, beta: npt.ArrayLike, cones: bool = True) -> str:
    """Draw (q̈, τ, λ) of a β, shape (dimension,): forces as arrows, where q̈ leads from rest as a veil.

    cones: also the friction cones around the forces.

    Returns all the numbers as bars, SVG.
    """
    qdd, tau, forces = space(beta)
    state = space.eom.state
    ghost = state.replace(q=state.integrate(0.5 * GHOST_TIME**2 * qdd), v=np.zeros(space.eom.nv))
    name = "where q̈ leads in a quarter of a second"
    view.show(state, contacts=space.eom.contacts, planned=forces, cones=cones, ghost=ghost, ghost_name=name)
    return bars(qdd, tau, forces)


def bars(qdd: npt.ArrayLike, tau: npt.ArrayLike, forces: npt.ArrayLike, full: tuple[float, float, float] = FULL) -> str:
    """All numbers of a quadruped's motion as bars, SVG, leg by leg.

    qdd: shape (18,), m/s² and rad/s².
    tau: shape (12,), N·m.
    forces: shape (12,), N.
    full: what a bar of full length means for each of the three; longer ones get a dark end.
    """
    legs = ("front left", "front right", "rear left", "rear right")
    groups = (
        ("q̈", "m/s², rad/s²", "#7A86A8", ("base x y z", "turning", *legs)),
        ("τ", "N·m", "#E69F00", legs),
        ("λ", "N", "#0072B2", legs),
    )
    parts, x = [], 10
    for (name, unit, colour, blocks), values, most in zip(groups, (qdd, tau, forces), full, strict=True):
        parts.append(f'<text x="{x}" y="12" font-size="11" fill="#222">{name}, ± {most:g} {unit}</text>')
        parts.append(f'<line x1="{x}" y1="60" x2="{x + 12 * np.size(values) + 5 * len(blocks) - 8}" y2="60" stroke="#888"/>')
        for block, three in zip(blocks, np.reshape(values, (-1, 3)), strict=True):
            parts.append(f'<text x="{x + 17}" y="112" font-size="7" fill="#444" text-anchor="middle">{block}</text>')
            for value in three:
                parts += _bar(x, float(value) / most, colour)
                x += 12
            x += 5
        x += 20
    return f'<svg width="{1.45 * x:.0f}" style="max-width: 100%" viewBox="0 0 {x} 118">{"".join(parts)}</svg>'


def _bar(x: float, part: float, colour: str) -> list[str]:
    """A bar at x, up or down from the middle; part: of the full length."""
    length = min(abs(part), 1.0) * 40
    top = 60 - length if part > 0 else 60
    drawn = [f'<rect x="{x}" y="{top:.1f}" width="9" height="{length:.1f}" fill="{colour}"/>']
    if length == 40:
        drawn.append(f'<rect x="{x}" y="{20 if part > 0 else 97}" width="9" height="3" fill="#222"/>')
    return drawn


def matrix_picture(A: npt.ArrayLike, rows: Mapping[str, int], columns: Mapping[str, int]) -> Figure:
    """Where a matrix is not zero, and beside it its singular values.

    rows, columns: the blocks of A in order, name -> size.
    """
    A = np.asarray(A)
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained", width_ratios=[3, 2])
    size = np.log10(np.maximum(np.abs(A), 1e-12))
    shown = left.imshow(np.where(np.abs(A) > 1e-9, size, np.nan), cmap="viridis", aspect="auto", vmin=-3, vmax=1.5)
    figure.colorbar(shown, ax=left, ticks=[-3, -2, -1, 0, 1], label="size, as a power of ten", shrink=0.8)
    _name_blocks(left, rows, columns)
    values = np.linalg.svd(A, compute_uv=False)
    right.semilogy(np.arange(1, len(values) + 1), values, "o", color="#0072B2")
    right.set(xlabel="number", ylabel="singular value", title=f"{len(values)} singular values, rank {rank(A)}")
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
            line(end - 0.5, color="#222", linewidth=0.8)
        ticks(ends - np.array(list(mapping.values())) / 2 - 0.5)
        names([f"{name}\n{size}" for name, size in mapping.items()])
    axes.xaxis.tick_top()
    axes.tick_params(length=0)


def show_knee(view: Viewer, robot: Robot, bend: float, wobble: Array) -> str:
    """Draw solo12 standing still and return what that takes, HTML.

    bend: of every knee, rad. wobble: internal forces to add to those that carry the weight, shape (12,), N, world.
    """
    contacts = fb.Contacts.points(robot)
    eom = fb.equations_of_motion(upright(robot, bend), contacts)
    forces = np.linalg.lstsq(eom.J[:, :6].T, eom.h[:6], rcond=1e-9)[0] + wobble
    tau = eom.h[6:] - eom.J[:, 6:].T @ forces
    extra = eom.J[:, 6:].T @ wobble
    view.show(eom.state, contacts=contacts, planned=forces, cones=False)
    return (
        f"rank J = <b>{rank(eom.J)}</b>, smallest singular value {np.linalg.svd(eom.J)[1][-1]:.3f}; "
        f"torques for the wobble: <b>{np.linalg.norm(extra):.3f} N·m</b>"
        + "<br>"
        + bars(np.zeros(18), tau, forces, full=(20.0, 2.0, 20.0))
    )
