"""Lesson 10: a pendulum that takes a step, the loads of a pronk, and push-recovery maps."""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes

from floatbase.lessons.push_recovery import measured_push_recovery
from floatbase.simulation import Rollout
from floatbase.viewer.scene.colours import COM, GREYS, LIMIT, MEASURED, hex_code

_STYLES = ("-", "--", ":", "-.")
_MAPS = {
    "07": "07: QP, standing",
    "08": "08: Stand, steps when pushed",
    "10 walking": "Walk, trot on the spot",
    "10": "MPC, trot on the spot",
}


def plot_step(paths: Mapping[str, npt.ArrayLike], reach: float) -> Figure:
    """Plot pendulums that take a step of 0.3 m after 1 s."""
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
    """Plot the sum of the vertical forces of the ground, planned and measured."""
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


def plot_push_recovery_maps() -> Figure:
    """Plot the push-recovery maps of lessons 07, 08 and 10 together, seen from above."""
    figure, ax = plt.subplots(
        figsize=(6, 6), layout="constrained", subplot_kw={"projection": "polar"}
    )
    assert isinstance(ax, PolarAxes)
    ax.set_theta_zero_location("N")
    colours = (LIMIT, LIMIT, COM, MEASURED)
    for (lesson, label), colour, style in zip(
        _MAPS.items(), colours, (":", "-", "--", "-"), strict=True
    ):
        recovery = measured_push_recovery(lesson)
        angles = np.append(recovery.directions, recovery.directions[0])
        pushes = np.append(recovery.pushes, recovery.pushes[0])
        ax.plot(angles, pushes, style, color=hex_code(colour), linewidth=2, label=label)
    ax.set_xticks(np.pi / 4 * np.arange(8), ["x", "45°", "y", "135°", "-x", "225°", "-y", "315°"])
    ax.set_rlim(0.0, 600.0)
    ax.set_rlabel_position(22.5)
    ax.grid(alpha=0.35)
    ax.set_title("go2: largest push of 0.1 s that is survived [N]", pad=14)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.06), fontsize="small", ncols=2)
    plt.close(figure)
    return figure
