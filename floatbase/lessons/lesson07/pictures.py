"""Lesson 07: a QP in the plane, and multipliers."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from floatbase.lessons.qp_plots import plot_optimum
from floatbase.lessons.rounding import rounded
from floatbase.qp import QP, Solution
from floatbase.viewer.scene.colours import GREYS

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
