"""Lesson 07: iterations of a solver, displacements of the centre of mass, and multipliers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from floatbase.lessons.rounding import rounded
from floatbase.qp import Solution
from floatbase.simulation import Rollout
from floatbase.viewer.scene.colours import GREYS, hex_code

_STYLES = ("-", "--", ":")
_MAX_LISTED = 4  # constraints that a note lists


def plot_rounds(ms: npt.ArrayLike, rounds: Mapping[str, Sequence[int]]) -> Figure:
    """Plot the iterations of the active-set method in each control step.

    Parameters
    ----------
    ms : array_like, shape (n,)
        Time of each control step since the push began [ms].
    rounds : mapping of str to sequence of int
        For each way to start the solver: its iterations, n numbers.

    Returns
    -------
    Figure
        The figure.
    """
    figure, ax = plt.subplots(figsize=(6.5, 3.2), layout="constrained")
    for (name, numbers), colour, style in zip(rounds.items(), GREYS[:2], _STYLES, strict=False):
        ax.plot(ms, numbers, style, color=hex_code(colour), label=name, linewidth=2)
    ax.set(
        xlabel="time since the push began [ms]",
        ylabel="iterations per control step",
        ylim=(0, None),
    )
    ax.grid(alpha=0.3)
    ax.legend()
    plt.close(figure)
    return figure


def plot_com_distance(records: Mapping[str, Rollout]) -> Figure:
    """Plot how far the centre of mass and the feet are from their initial positions.

    For the feet, the largest displacement is plotted.

    Parameters
    ----------
    records : mapping of str to Rollout
        The records by name.

    Returns
    -------
    Figure
        The figure.
    """
    figure, axes = plt.subplots(1, 2, figsize=(8.5, 3.2), layout="constrained")
    for (name, record), colour, style in zip(records.items(), GREYS, _STYLES, strict=False):
        feet = np.linalg.norm(record.foot_positions - record.foot_positions[0], axis=2).max(axis=1)
        com = np.linalg.norm((record.com - record.com[0])[:, :2], axis=1)
        for ax, away in zip(axes, (com, feet), strict=True):
            ax.plot(record.time, 1e3 * away, style, color=hex_code(colour), label=name, linewidth=2)
    for ax, title in zip(
        axes, ("displacement of the CoM [mm]", "largest foot displacement [mm]"), strict=True
    ):
        ax.set(xlabel="time [s]", title=title, ylim=(0, None))
        ax.grid(alpha=0.3)
    axes[0].legend()
    plt.close(figure)
    return figure


def multiplier_text(solution: Solution) -> str:
    """Return the active constraints with their multipliers, largest first, as a line of text."""
    prices = sorted(solution.multipliers.items(), key=lambda row: -row[1])
    shown = [f"{rounded(price)} ({name})" for name, price in prices if price > 1e-3]
    more = f" and {len(shown) - _MAX_LISTED} more" if len(shown) > _MAX_LISTED else ""
    return (
        "largest multipliers: " + ", ".join(shown[:_MAX_LISTED]) + more
        if shown
        else "no constraint has a multiplier above zero"
    )
