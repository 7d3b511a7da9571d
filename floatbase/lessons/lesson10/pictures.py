"""Lesson 10: the stances of gaits, and curves over time."""

from __future__ import annotations

from collections.abc import Mapping
from io import StringIO

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from floatbase.behaviours import Gait
from floatbase.viewer.scene.colours import COM, GREYS, LIMIT, MEASURED, hex_code

_LOOKS = ("-", GREYS[0]), ("--", MEASURED), (":", COM), ("-.", LIMIT)


def plot_stances(gaits: Mapping[str, Gait], seconds: float) -> Figure:
    """Plot when each foot stands, one row of bars for each foot."""
    times = np.arange(0.0, seconds, 0.005)
    figure, axes = plt.subplots(
        len(gaits), figsize=(6.5, 3.2), sharex=True, layout="constrained", squeeze=False
    )
    for ax, (name, gait) in zip(axes[:, 0], gaits.items(), strict=True):
        for i, foot in enumerate(gait.feet):
            stands = [gait.swing_at(foot, t) is None for t in times.tolist()]
            ax.fill_between(times, i - 0.4, i + 0.4, where=stands, color=hex_code(GREYS[1]))
        ax.set_yticks(range(len(gait.feet)), [foot[:2] for foot in gait.feet])
        ax.set_title(name, fontsize="medium")
    axes[-1, 0].set_xlabel("time [s]")
    plt.close(figure)
    return figure


def plot_curves(
    curves: Mapping[str, tuple[npt.ArrayLike, npt.ArrayLike]], ylabel: str, lim: tuple[float, float]
) -> Figure:
    """Plot curves over time; each has its times [s] and its values."""
    figure, ax = plt.subplots(figsize=(6.5, 3.2), layout="constrained")
    for (label, (times, values)), (style, colour) in zip(curves.items(), _LOOKS, strict=False):
        ax.plot(times, values, style, color=hex_code(colour), label=label)
    ax.set(xlabel="time [s]", ylabel=ylabel, ylim=lim)
    ax.legend(fontsize="small")
    ax.grid(alpha=0.3)
    plt.close(figure)
    return figure


def as_svg(figure: Figure) -> str:
    """Return a figure as text, for the note of a slider."""
    drawn = StringIO()
    figure.savefig(drawn, format="svg")
    narrow = '<svg style="max-width: 100%; height: auto"'  # for a narrow page
    return narrow + drawn.getvalue().partition("<svg")[2]
