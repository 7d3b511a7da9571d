"""Lesson 07: a QP in the plane, and multipliers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import floatbase as fb
from floatbase.control import LinearInequality
from floatbase.lessons.qp_plots import plot_optimum
from floatbase.lessons.rounding import rounded
from floatbase.qp import QP, Solution
from floatbase.viewer.scene.colours import GREYS, hex_code

_MAX_LISTED = 4  # constraints that a note lists


def plot_one_foot() -> Axes:
    """Plot a QP for the force of one foot whose optimum lies in the corner of two constraints."""
    goal = np.array([70.0, 85.0])  # N
    G, h = np.array([[1.0, -0.5], [-1.0, -0.5], [0.0, 1.0]]), np.array([0.0, 0.0, 60.0])
    names = ("facet, forwards", "facet, backwards", "largest normal force")
    qp = QP(np.eye(2), -goal, np.zeros((0, 2)), np.zeros(0), G, h, inequality_names=names)
    ax = plot_optimum(qp, (-45.0, 90.0, -10.0, 95.0))
    ax.plot(*goal, "+", color=GREYS[0], markersize=12, markeredgewidth=2)
    ax.set(xlabel="horizontal force [N]", ylabel="normal force [N]")
    return ax


def plot_ways_out(
    controller: fb.WholeBodyController, tasks: Sequence[Any], state: fb.State
) -> Figure:
    """Plot what a soft constraint reaches, and what weights miss, over their weights."""
    J, q, v = state.com_jacobian, state.q, state.v
    demand = (-J[:1], [-2.0])  # at least 2 m/s² forwards
    figure, (soft, ranked) = plt.subplots(1, 2, figsize=(9, 3.2), layout="constrained")
    slack = np.arange(1.0, 41.0, 3.0)
    rows = [LinearInequality("forwards", "qdd", demand, weight=w) for w in slack]
    kept = [*tasks, fb.CoMTask(state.com)]
    got = [(J @ controller.replace(tasks=kept, inequalities=[r])(q, v).qdd)[0] for r in rows]
    dark, light = hex_code(GREYS[0]), hex_code(GREYS[1])
    soft.plot(slack, got, "o-", color=dark)
    soft.axhline(2.0, color=light, linestyle="--")
    soft.set(xlabel="weight of the slack, w", ylabel="reached [m/s²]")
    goals = {
        w: fb.CoMTask(state.com, acceleration=[0, 2, 0], weight=w) for w in 10.0 ** np.arange(5)
    }
    lists: dict[float, Any] = {w: [goal, *tasks] for w, goal in goals.items()}
    lists[0.0] = [[goals[10.0]], list(tasks)]  # the hierarchy
    missed = {w: abs((J @ controller.replace(tasks=t)(q, v).qdd)[1] - 2) for w, t in lists.items()}
    none = max(missed.pop(0.0), 1e-7)
    ranked.axhline(none, color=light, linestyle="--", label="hierarchy, at most")
    ranked.loglog(list(missed), list(missed.values()), "o-", color=dark, label="one list of tasks")
    ranked.set(xlabel="weight of the first task", ylabel="missed [m/s²]")
    ranked.legend()
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
