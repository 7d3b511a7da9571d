"""Plots of quadratic programs with two variables: level curves, constraints and feasible set."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from floatbase._validation import Array, as_array, as_instance, as_strings
from floatbase.errors import InputError, unknown_name
from floatbase.qp import QP, solve
from floatbase.viewer.scene.colours import GREYS

Box = tuple[float, float, float, float]
_LEVELS = 12  # curves of equal objective
_TOLERANCE = 1e-9  # rounding: a point on the line of a constraint satisfies the constraint
# typographic points from the line of a constraint to the middle of its name, which is wider than
# high
_NAME_OFFSET = np.array([24.0, 13.0])
_RESOLUTION = 90  # points of each curve, or of a grid along each of its sides


def plot(
    qp: QP,
    box: Box = (-3.0, 3.0, -2.0, 3.0),
    working_set: Sequence[str] = (),
    point: npt.ArrayLike | None = None,
    axis: Axes | None = None,
) -> Axes:
    """Plot a QP of two variables: level curves, named constraints, and the feasible set in grey.

    Parameters
    ----------
    qp : QP
        QP of two variables without equality constraints.
    box : tuple of float, optional
        Visible range: minimum and maximum of the first variable, then of the second.
    working_set : sequence of str, optional
        Names of the inequality constraints that hold with equality; they are drawn thick.
    point : array_like, shape (2,), optional
        Point that is marked with a dot.
    axis : Axes, optional
        Axes to plot on; by default a new figure.

    Returns
    -------
    Axes
        The axes.

    Raises
    ------
    InputError
        If the QP does not have two variables, or has equality constraints.
    UnknownNameError
        If a name in `working_set` is unknown.

    Notes
    -----
    [FBR]_, App. C.
    """
    corners = feasible_polygon(qp, box)
    for name in as_strings("working_set", working_set):
        if name not in qp.inequality_names:
            raise unknown_name("inequality constraint", name, qp.inequality_names)
    axis = plt.figure().gca() if axis is None else as_instance("axis", axis, Axes)
    axis.fill(*corners.T, color=GREYS[2], alpha=0.35, linewidth=0.0)
    _plot_levels(qp, box, axis)
    for i, name in enumerate(qp.inequality_names):
        _plot_constraint(qp, i, name in working_set, box, axis)
    if point is not None:
        axis.plot(
            *as_array("point", point, (2,)),
            "o",
            color=GREYS[0],
            markeredgecolor="white",
            markersize=10,
            zorder=5,
        )
    axis.set(xlim=box[:2], ylim=box[2:], aspect="equal")
    return axis


def plot_optimum(qp: QP, box: Box = (-3.0, 3.0, -2.0, 3.0), axis: Axes | None = None) -> Axes:
    """Plot a QP of two variables, its optimum, and how the active constraints balance the gradient.

    The dark arrow at the optimum is the negative gradient of the objective. The light arrows,
    drawn head to tail, are the normals of the active constraints times their multipliers. Their
    sum is the dark arrow. All arrows have the same scale.

    Parameters
    ----------
    qp : QP
        QP of two variables without equality constraints.
    box : tuple of float, optional
        Visible range: minimum and maximum of the first variable, then of the second.
    axis : Axes, optional
        Axes to plot on; by default a new figure.

    Returns
    -------
    Axes
        The axes.

    Raises
    ------
    InfeasibleError
        If no point satisfies all constraints.
    InputError
        If the QP does not have two variables, or has equality constraints.

    Notes
    -----
    [FBR]_, App. C.
    """
    feasible_polygon(qp, box)  # checks the QP
    solution = solve(qp)
    prices = {str(name): price for name, price in solution.multipliers.items()}
    axis = plot(qp, box, list(prices), solution.x, axis)
    slope = -(qp.H @ solution.x + qp.g)
    scale = 0.3 * min(box[1] - box[0], box[3] - box[2]) / (float(np.linalg.norm(slope)) or 1.0)
    start = solution.x
    for i, name in enumerate(map(str, qp.inequality_names)):
        if name in prices:
            tip = start + scale * prices[name] * qp.G[i]
            _plot_arrow(axis, start, tip, GREYS[1], width=5.0)
            start = tip
    _plot_arrow(axis, solution.x, solution.x + scale * slope, GREYS[0], width=2.0)
    return axis


def _plot_arrow(
    axis: Axes, start: Array, tip: Array, colour: tuple[float, float, float], width: float
) -> None:
    (x, y), (x0, y0) = tip.tolist(), start.tolist()
    axis.annotate(
        "", (x, y), xytext=(x0, y0), zorder=6,
        arrowprops={
            "arrowstyle": "-|>", "color": colour, "linewidth": width, "shrinkA": 0, "shrinkB": 0,
        },
    )  # fmt: skip


def feasible_polygon(qp: QP, box: Box) -> Array:
    """Return the corners of the feasible set of a QP with two variables, within a box.

    The corners, shape (k, 2), are in order; there are none if the feasible set does not meet the
    box.
    """
    if as_instance("qp", qp, QP).n != 2 or len(qp.A):
        raise InputError(
            f"{qp!r} cannot be plotted. It must have 2 variables and no equality constraints."
        )
    x0, x1, y0, y1 = as_array("box", box, (4,))
    if not (x0 < x1 and y0 < y1):
        raise InputError(
            f"box is {tuple(box)}; it must contain the minimum and maximum of each variable, in "
            f"ascending order."
        )
    corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    for normal, bound in zip(qp.G, qp.h, strict=True):
        corners = _clipped(corners, normal, bound)
    return corners


def _clipped(corners: Array, normal: Array, bound: float) -> Array:
    """Return the part of a convex polygon with normal · x ≤ bound."""
    kept: list[Array] = []
    over = corners @ normal - bound
    for i, (here, now) in enumerate(zip(corners, over, strict=True)):
        before, then = corners[i - 1], over[i - 1]
        if (now <= 0.0) != (then <= 0.0):
            kept.append(before + (here - before) * then / (then - now))
        if now <= 0.0:
            kept.append(here)
    return np.array(kept).reshape(-1, 2)


def _plot_levels(qp: QP, box: Box, axis: Axes) -> None:
    """Plot curves of equal objective."""
    try:
        # this maps a circle of radius r to the ellipse on which the objective is r²/2 above its
        # minimum
        root = np.linalg.inv(np.linalg.cholesky(qp.H)).T
    except np.linalg.LinAlgError:  # a valley or a plane
        _plot_contours(qp, box, axis)
        return
    centre = np.linalg.solve(qp.H, -qp.g)
    corners = np.array([[x, y] for x in box[:2] for y in box[2:]])
    most = float(np.max(np.linalg.norm((corners - centre) @ np.linalg.inv(root).T, axis=1)))
    angles = np.linspace(0.0, 2.0 * np.pi, _RESOLUTION)
    circle = np.column_stack([np.cos(angles), np.sin(angles)]) @ root.T
    radii = most * np.arange(1, _LEVELS + 1) / _LEVELS
    axis.add_collection(
        LineCollection([centre + r * circle for r in radii], colors=[GREYS[2]], linewidths=0.8)
    )


def _plot_contours(qp: QP, box: Box, axis: Axes) -> None:
    x, y = np.meshgrid(
        np.linspace(box[0], box[1], _RESOLUTION), np.linspace(box[2], box[3], _RESOLUTION)
    )
    points = np.stack([x.ravel(), y.ravel()])
    height = (0.5 * np.sum(points * (qp.H @ points), axis=0) + qp.g @ points).reshape(x.shape)
    low, high = height.min(), height.max()
    if high > low:
        levels = low + (high - low) * (np.arange(1, _LEVELS + 1) / _LEVELS) ** 2
        axis.contour(x, y, height, levels=levels, colors=[GREYS[2]], linewidths=0.8)


def _plot_constraint(qp: QP, i: int, thick: bool, box: Box, axis: Axes) -> None:
    """Plot the line on which a constraint holds with equality."""
    G, h = qp.G[i], qp.h[i]
    length = np.linalg.norm(G)
    if not length:
        return
    along, foot = np.array([-G[1], G[0]]) / length, G * h / length**2
    reach = np.linalg.norm(foot) + float(np.hypot(*np.abs(np.reshape(box, (2, 2))).max(axis=1)))
    axis.plot(
        *np.transpose([foot - reach * along, foot + reach * along]),
        color=GREYS[0 if thick else 1],
        linewidth=4.0 if thick else 1.2,
    )
    line = foot + np.linspace(-reach, reach, 800)[:, None] * along
    seen = line[
        (line[:, 0] > box[0])
        & (line[:, 0] < box[1])
        & (line[:, 1] > box[2])
        & (line[:, 1] < box[3])
    ]
    bounds = seen[np.all(seen @ qp.G.T <= qp.h + _TOLERANCE * (1.0 + abs(h)), axis=1)]
    if len(seen):
        at = bounds[len(bounds) // 2] if len(bounds) else seen[len(seen) // 8]
        axis.annotate(
            str(qp.inequality_names[i]), at, xytext=G / length * _NAME_OFFSET,
            textcoords="offset points", ha="center",
            va="center",
            color=GREYS[0], weight="bold" if thick else "normal", annotation_clip=True,
            bbox={
                "boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none",
                "alpha": 0.8,
            },
        )  # fmt: skip
