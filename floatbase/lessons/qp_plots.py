"""Quadratic programs in the plane, drawn: level curves, rows, and what they leave."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from floatbase._validation import Array, as_array, as_instance, as_strings
from floatbase.errors import InputError, unknown_name
from floatbase.qp import QP
from floatbase.viewer.scene.colours import GREYS

Box = tuple[float, float, float, float]
_LEVELS = 12  # curves of equal objective
_TOLERANCE = 1e-9  # a point of a row's line counts as allowed by that row: rounding
_NAME_OFFSET = np.array(
    [24.0, 13.0]
)  # points from a row's line to the middle of its name, which is wider than high
_RESOLUTION = 90  # points of each curve, or along each side of what it is drawn through


def plot(
    qp: QP,
    box: Box = (-3.0, 3.0, -2.0, 3.0),
    working_set: Sequence[str] = (),
    point: npt.ArrayLike | None = None,
    axis: Axes | None = None,
) -> Axes:
    """App. C: a QP of two variables in the plane: its level curves, its rows with names, and in
    grey what they leave.

    qp: of two variables, without equalities.
    box: what is seen, from and to along the first variable and the second.
    working_set: names of the rows that are held with equality, drawn thick.
    point: (2,), a dot, or None.
    axis: to plot on; None for a new figure.

    Raises `InputError` for another number of variables or with equalities, `UnknownNameError` for a
    row that does not exist.
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


def feasible_polygon(qp: QP, box: Box) -> Array:
    """Corners of what the rows of a QP in the plane leave of a box, in order, shape (k, 2); (0, 2)
    where they leave nothing.

    qp, box, errors: as for `plot`.
    """
    if as_instance("qp", qp, QP).n != 2 or len(qp.A):
        raise InputError(
            f"{qp!r} does not lie in the plane: 2 variables and no equalities can be drawn."
        )
    x0, x1, y0, y1 = as_array("box", box, (4,))
    if not (x0 < x1 and y0 < y1):
        raise InputError(
            f"box is {tuple(box)}; it must be from and to along each variable, in ascending order."
        )
    corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    for normal, bound in zip(qp.G, qp.h, strict=True):
        corners = _clipped(corners, normal, bound)
    return corners


def _clipped(corners: Array, normal: Array, bound: float) -> Array:
    """What normal · x ≤ bound leaves of a convex polygon."""
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
    """Curves of equal objective, at objectives that grow like squares: at equal distances where the
    problem is a bowl.
    """
    try:
        root = np.linalg.inv(
            np.linalg.cholesky(qp.H)
        ).T  # a circle of radius r becomes the ellipse r²/2 above the least
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
    """The line where a row holds with equality; its name stands on the forbidden side, beside the
    border of what is allowed.
    """
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
            bbox={"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none",
                  "alpha": 0.8},
        )  # fmt: skip
