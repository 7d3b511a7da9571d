"""Lesson 10: a pendulum that takes a step, and the loads of a pronk."""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from floatbase.simulation import Rollout
from floatbase.viewer.scene.colours import GREYS, hex_code

_STYLES = ("-", "--", ":", "-.")


def plot_step(paths: Mapping[str, npt.ArrayLike], reach: float) -> Figure:
    """Plot pendulums that take a step of 0.3 m after 1 s.

    Parameters
    ----------
    paths : mapping of str to array_like, shape (n, 3)
        Time [s], centre of mass [m] and zero-moment point [m], by the label of the pendulum.
    reach : float
        Half of the length of the foot [m].

    Returns
    -------
    Figure
        The figure.
    """
    figure, ax = plt.subplots(figsize=(6.5, 3.2), layout="constrained")
    for foot, times in ((0.0, (0.0, 1.0)), (0.3, (1.0, 2.0))):
        ax.fill_between(times, foot - reach, foot + reach, color=hex_code(GREYS[2]), alpha=0.4)
    for (label, path), style in zip(paths.items(), _STYLES, strict=False):
        t, c, p = np.asarray(path, dtype=np.float64).T
        ax.plot(t, c, style, color=hex_code(GREYS[0]), linewidth=2, label=f"c, {label}")
        ax.plot(t, p, style, color=hex_code(GREYS[1]), linewidth=1, label=f"p, {label}")
    ax.set(xlabel="time [s]", ylabel="forwards [m]", ylim=(-0.2, 0.45))
    ax.legend(loc="upper left", fontsize="small")
    plt.close(figure)
    return figure


def plot_loads(record: Rollout, begin: float, end: float) -> Figure:
    """Plot the sum of the vertical forces of the ground, planned and measured.

    Parameters
    ----------
    record : Rollout
        The record.
    begin, end : float
        Part of the record [s].

    Returns
    -------
    Figure
        The figure.
    """
    rows = (record.time >= begin) & (record.time < end)
    figure, ax = plt.subplots(figsize=(6.5, 3.2), layout="constrained")
    for forces, grey, width, label in (
        (record.measured, GREYS[1], 1.0, "measured"),
        (record.planned, GREYS[0], 2.0, "planned"),
    ):
        load = np.nan_to_num(forces[rows, 2::3]).sum(axis=1) / record.robot.weight
        ax.plot(record.time[rows], load, color=hex_code(grey), linewidth=width, label=label)
    ax.axhline(1.0, color=hex_code(GREYS[2]), linestyle="--", linewidth=1)
    ax.set(xlabel="time [s]", ylabel="vertical force / weight", ylim=(0, 4))
    ax.grid(alpha=0.3)
    ax.legend()
    plt.close(figure)
    return figure
