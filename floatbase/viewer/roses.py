"""A push rose as a polar plot, and drawn on the ground below the robot."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.projections.polar import PolarAxes

from floatbase._arrays import Array, positive
from floatbase.errors import InputError
from floatbase.viewer import geometry, lowering
from floatbase.viewer.colours import CALM, LEGEND, LIMIT, MEASURED, RGB, WARNING
from floatbase.viewer.painter import nice
from floatbase.viewer.shapes import Item, Picture, label, placed

if TYPE_CHECKING:
    from floatbase.simulation import PushRose

_FILL = 0.15  # opacity of what lies inside the measured curve
_LIFT = 0.004  # m above the ground: no flicker with its lines, no gap to be seen
_SIDES = 72  # of a ring


def plot(rose: PushRose, axis: Axes | None = None, theory: bool = True) -> Axes:
    """The largest pushes that were survived, N, over their directions, seen from above: x points up, y to the left.

    rose: the record, as from `fb.push_rose`.
    axis: polar axes to plot on; None for a new figure.
    theory: whether to draw the curves of the capture point and of a steady push too.
    Raises `InputError` for axes that are not polar.
    """
    if axis is None:
        axis = plt.subplots(figsize=(6, 6.6), subplot_kw={"projection": "polar"})[1]
    if not isinstance(axis, PolarAxes):
        raise InputError('a rose needs polar axes: plt.subplots(subplot_kw={"projection": "polar"}).')
    axis.set_theta_zero_location("N")
    for kind, values, colour, style in _curves(rose, theory):
        axis.plot(_closed(rose.directions), _closed(values), style, color=colour, linewidth=2, markersize=4, label=_name(kind))
    axis.fill(rose.directions, rose.pushes, color=MEASURED, alpha=_FILL)
    axis.set_rlim(0.0, 1.1 * max(values.max() for _, values, _, _ in _curves(rose, theory)))
    axis.set_rlabel_position(34.0)  # beside the ticks, and beside the directions of 8 and 16
    axis.tick_params(axis="y", labelsize="small", labelcolor=LIMIT)
    axis.set_xticks(np.pi / 4 * np.arange(8), ["x", "45°", "y", "135°", "-x", "225°", "-y", "315°"])
    axis.grid(alpha=0.35)
    axis.set_title(f"{rose.state.robot.name}: pushes of {rose.duration:g} s at {rose.frame} [N]", pad=14)
    axis.legend(loc="upper center", bbox_to_anchor=(0.5, -0.08), fontsize="small", ncols=3)
    return axis


def picture(rose: PushRose, scale: float | None = None, theory: bool = True) -> Picture:
    """The rose on level ground around the robot, with rings for its scale: items for `extra` of `Viewer.show`.

        view.show(rose.state, rose.contacts, cones=False, extra=roses.picture(rose))

    rose: the record, as from `fb.push_rose`.
    scale: length of a drawn push, m/N; None makes its widest curve half as wide again as the stance.
    theory: as for `plot`.
    """
    positions = rose.contacts.positions(rose.state)
    centre = np.array([*rose.state.frame_pose(rose.frame).translation[:2], positions[:, 2].mean() + _LIFT])
    span = float(np.linalg.norm((positions - centre)[:, :2], axis=1).max())
    largest = max(float(values.max()) for _, values, _, _ in _curves(rose, theory))
    scale = 1.5 * span / largest if scale is None else positive("scale", scale, "m/N")
    items: Picture = {}
    for height, (kind, values, colour, _) in enumerate(reversed(_curves(rose, theory))):
        tips = scale * values[:, None] * rose.unit_vectors
        items[f"{kind}/line"] = _loop(centre + [0.0, 0.0, height * _LIFT / 2], tips, 0.015 * span, colour)
    tips = scale * rose.pushes[:, None] * rose.unit_vectors
    # a fan from the middle, for the rose is not convex
    inside = lowering.mesh(*geometry.fan(np.vstack([np.zeros(3), tips, tips[:1]])), MEASURED, opacity=_FILL, lit=False)
    items["rose/inside"] = Item(inside, placed(centre))
    angles = 2.0 * np.pi * np.arange(_SIDES) / _SIDES
    circle = np.stack([np.cos(angles), np.sin(angles), np.zeros(_SIDES)], axis=1)
    step = nice(largest / 3)
    for force in step * np.arange(1, int(largest / step) + 1):
        items[f"rose/ring {force:g} N"] = _loop(centre, scale * force * circle, 0.006 * span, LIMIT)
        at = centre + scale * force * np.array([np.cos(-np.pi / 8), np.sin(-np.pi / 8), 0.0])
        items[f"rose/label {force:g} N"] = label(at, f"{force:g} N", 0.09 * span)
    return items


def _curves(rose: PushRose, theory: bool) -> list[tuple[str, Array, RGB, str]]:
    """Kind as in `LEGEND`, values (n,) in N, colour and style of each curve, the measured one first."""
    curves = [("rose", rose.pushes, MEASURED, "o-")]
    if theory:
        curves += [("capture", rose.capture, CALM, "--"), ("steady", rose.steady, WARNING, ":")]
    return curves


def _name(kind: str) -> str:
    return next(text for key, _, text in LEGEND if key == kind)


def _closed(values: Array) -> Array:
    return np.append(values, values[0])


def _loop(centre: Array, corners: Array, radius: float, colour: RGB) -> Item:
    """A closed line. centre: (3,), m, world. corners: (n, 3), m, from there. radius: half its width, m."""
    ends = np.roll(corners, -1, axis=0)
    rods = [geometry.rod(a, b, radius, 8) for a, b in zip(corners, ends, strict=True) if not np.array_equal(a, b)]
    joints = [(vertices + corner, faces) for corner in corners for vertices, faces in [geometry.ball(radius, 8)]]
    return Item(lowering.mesh(*geometry.merged(rods + joints), colour, lit=False), placed(centre))
