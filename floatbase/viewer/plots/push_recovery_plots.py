"""Push-recovery maps and maximum horizontal forces, as polar plots and in pictures."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.projections.polar import PolarAxes

from floatbase._validation import Array, as_instance, as_positive
from floatbase.errors import InputError
from floatbase.friction import WrenchSet
from floatbase.viewer.scene import geometry, threejs
from floatbase.viewer.scene.colours import CALM, COM, LEGEND, LIMIT, MEASURED, RGB, WARNING
from floatbase.viewer.scene.shapes import Item, Picture, label, transform

if TYPE_CHECKING:
    from floatbase.simulation import PushRecovery

_FILL = 0.15  # opacity of the area inside the measured curve
_HEIGHT_ABOVE_GROUND = 0.004  # m above the ground: no flicker with its lines, no visible gap
_RING_SIDES = 72  # number of sides of a ring

# kind as in `LEGEND`, values (n,) in N, colour, style of its line
_Curve: TypeAlias = tuple[str, Array, RGB, str]


def plot(
    result: PushRecovery,
    axis: Axes | None = None,
    theory: bool = True,
    previous: PushRecovery | None = None,
) -> Axes:
    """Plot a push-recovery map: the largest push survived in each direction.

    The map is seen from above: x points up and y to the left.

    Parameters
    ----------
    result : PushRecovery
        Map to plot, as from `fb.push_recovery`.
    axis : Axes, optional
        Polar axes to plot on. By default, a new figure.
    theory : bool, optional
        Whether to plot the capture-point bound and the static bound as well.
    previous : PushRecovery, optional
        Map of another controller for comparison, in the same directions; it is plotted in grey.

    Returns
    -------
    Axes
        The axes.

    Raises
    ------
    InputError
        If the axes are not polar, or if the two maps have different directions.
    """
    title = f"{result.state.robot.name}: pushes of {result.duration:g} s at {result.frame} [N]"
    return _plot(result.directions, _curves(result, theory, previous), title, axis)


def picture(
    result: PushRecovery,
    scale: float | None = None,
    theory: bool = True,
    previous: PushRecovery | None = None,
) -> Picture:
    """Draw a push-recovery map on level ground around the robot, with rings for its scale.

    scale: length of a drawn push [m/N]; by default, the widest curve is 1.5 times as wide as the
    stance. Other arguments are as for `plot`.
    """
    curves, feet = _curves(result, theory, previous), result.contacts.positions(result.state)
    middle = result.state.frame_pose(result.frame).translation
    return _picture(result.directions, curves, middle, feet, scale)


def plot_horizontal_force_limits(
    wrenches: WrenchSet, axis: Axes | None = None, n: int = 72
) -> Axes:
    """Plot the maximum horizontal force of a stance in each direction.

    The forces are those at full weight without moment. The plot is seen from above.

    Parameters
    ----------
    wrenches : WrenchSet
        Wrenches of the stance, as from `floatbase.friction.wrench_set`.
    axis : Axes, optional
        Polar axes to plot on. By default, a new figure.
    n : int, optional
        Number of directions.

    Returns
    -------
    Axes
        The axes.

    Raises
    ------
    InputError
        If the axes are not polar, or if a force is unbounded.
    InfeasibleError
        If the stance cannot carry the weight.
    """
    title = "maximum horizontal force at full weight without moment [N]"
    return _plot(*_horizontal_force_curve(wrenches, n), title, axis)


def _plot(directions: Array, curves: list[_Curve], title: str, axis: Axes | None) -> Axes:
    """Plot curves over directions [rad] on polar axes."""
    if axis is None:
        axis = plt.subplots(figsize=(6, 6.6), subplot_kw={"projection": "polar"})[1]
    if not isinstance(axis, PolarAxes):
        raise InputError(
            'axis must be polar axes, as from plt.subplots(subplot_kw={"projection": "polar"}).'
        )
    axis.set_theta_zero_location("N")
    for kind, values, colour, style in curves:
        angles, forces, label = _closed(directions), _closed(values), _legend_text(kind)
        axis.plot(angles, forces, style, color=colour, linewidth=2, markersize=4, label=label)
    _, first, colour, _ = curves[0]
    axis.fill(directions, first, color=colour, alpha=_FILL)
    axis.set_rlim(0.0, 1.1 * max(values.max() for _, values, _, _ in curves))
    axis.set_rlabel_position(34.0)  # between the ticks, and between 8 or 16 directions
    axis.tick_params(axis="y", labelsize="small", labelcolor=LIMIT)
    axis.set_xticks(np.pi / 4 * np.arange(8), ["x", "45°", "y", "135°", "-x", "225°", "-y", "315°"])
    axis.grid(alpha=0.35)
    axis.set_title(title, pad=14)
    axis.legend(loc="upper center", bbox_to_anchor=(0.5, -0.08), fontsize="small", ncols=3)
    return axis


def _picture(
    directions: Array, curves: list[_Curve], middle: Array, feet: Array, scale: float | None
) -> Picture:
    """Draw curves over directions [rad] around a point, shape (3,), on the ground below it."""
    centre = np.array([*middle[:2], feet[:, 2].mean() + _HEIGHT_ABOVE_GROUND])
    span = float(np.linalg.norm((feet - centre)[:, :2], axis=1).max())
    largest = max(float(values.max()) for _, values, _, _ in curves)
    scale = 1.5 * span / largest if scale is None else as_positive("scale", scale, "m/N")
    items: Picture = {}
    for height, (kind, values, colour, _) in enumerate(reversed(curves)):
        tips = scale * values[:, None] * _unit_vectors(directions)
        above = centre + [0.0, 0.0, height * _HEIGHT_ABOVE_GROUND / 2]
        items[f"{kind}/line"] = _loop(above, tips, 0.015 * span, colour)
    # a fan from the middle, as the area is not convex; kind, tips and colour are those of the first
    # curve
    fan = geometry.convex_polygon(np.vstack([np.zeros(3), tips, tips[:1]]))
    inside = threejs.mesh(*fan, colour, opacity=_FILL, lit=False)
    items[f"{kind}/inside"] = Item(inside, transform(centre))
    circle = _unit_vectors(2.0 * np.pi * np.arange(_RING_SIDES) / _RING_SIDES)
    step = geometry.round_1_2_5(largest / 3)
    for force in step * np.arange(1, int(largest / step) + 1):
        ring = _loop(centre, scale * force * circle, 0.006 * span, LIMIT)
        items[f"{kind}/ring {force:g} N"] = ring
        at = centre + scale * force * _unit_vectors(-np.pi / 8)
        items[f"{kind}/label {force:g} N"] = label(at, f"{force:g} N", 0.09 * span)
    return items


def _curves(result: PushRecovery, theory: bool, previous: PushRecovery | None) -> list[_Curve]:
    """Return the curves of a map, the measured one first."""
    curves = [("push_recovery", result.pushes, MEASURED, "o-")]
    if previous is not None:
        if not np.array_equal(previous.directions, result.directions):
            raise InputError(
                f"result has {len(result.directions)} directions and previous has "
                f"{len(previous.directions)}. Both must have the same directions."
            )
        curves.append(("previous", previous.pushes, LIMIT, "o-"))
    if theory:
        curves += [
            ("capture_point_bound", result.capture_point_bound, CALM, "--"),
            ("static_bound", result.static_bound, WARNING, ":"),
        ]
    return curves


def _horizontal_force_curve(wrenches: WrenchSet, n: int) -> tuple[Array, list[_Curve]]:
    """Return the directions [rad] and the curve of the maximum horizontal force."""
    angles, forces = as_instance("wrenches", wrenches, WrenchSet).max_horizontal_forces(n)
    if not np.isfinite(forces).all():
        raise InputError(
            "The horizontal force of this stance is unbounded in some direction. Pass "
            "max_normal_force to wrench_set."
        )
    return angles, [("horizontal_force", forces, COM, "-")]


def _unit_vectors(angles: Array | float) -> Array:
    """Return horizontal unit vectors, shape (…, 3), at angles from the x axis [rad]."""
    return np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=-1)


def _legend_text(kind: str) -> str:
    """Return the legend entry of a kind of curve."""
    return next(text for key, _, text in LEGEND if key == kind)


def _closed(values: Array) -> Array:
    """Return values with the first one repeated at the end."""
    return np.append(values, values[0])


def _loop(centre: Array, corners: Array, radius: float, colour: RGB) -> Item:
    """Draw a closed line around `centre`, shape (3,), in the world frame [m]."""
    ends = np.roll(corners, -1, axis=0)
    rods = [
        geometry.cylinder(a, b, radius, 8)
        for a, b in zip(corners, ends, strict=True)
        if not np.array_equal(a, b)
    ]
    vertices, faces = geometry.sphere(radius, 8)
    joints = [(vertices + corner, faces) for corner in corners]
    return Item(threejs.mesh(*geometry.merged(rods + joints), colour, lit=False), transform(centre))
