"""Lesson 04: costs as level curves, and torques as arrows."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

import floatbase as fb
from floatbase._validation import Array
from floatbase.dynamics import EquationsOfMotion
from floatbase.lessons import svg
from floatbase.viewer import Viewer, shapes
from floatbase.viewer.scene.colours import COM, GREYS, hex_code

ARROW_SCALE = 0.5  # m drawn for 1 m/s²
LEVELS = (0.02, 0.125, 0.4, 1.0, 2.0)  # of a cost above its minimum
# ratio of curvatures below which the flatter direction counts as the floor of a valley
VALLEY_RATIO = 0.02


def show_torques(
    view: Viewer, eom: EquationsOfMotion, tau: npt.ArrayLike, length: float = ARROW_SCALE
) -> Array:
    """Draw the contact forces and the acceleration of the centre of mass that torques cause."""
    state = eom.state
    a = state.com_jacobian @ fb.accelerations_from_torques(eom)(tau) + state.com_drift
    arrow = {}
    view.add_legend_entry("acceleration", COM, "its acceleration")
    if np.linalg.norm(a) > 1e-6:
        arrow["acceleration"] = shapes.arrow(state.com, length * a, COM, view.painter.size)
    view.show(state, contacts=eom.contacts, planned=fb.forces_from_torques(eom)(tau), extra=arrow)
    return a


def cost_slices(**costs: tuple[fb.Quadratic, str, str, float]) -> Figure:
    """Plot level curves of costs on two variables."""
    figure, axes = plt.subplots(
        1, len(costs), figsize=(3.6 * len(costs), 3.5), layout="constrained", squeeze=False
    )
    for ax, (title, (cost, x_name, y_name, half)) in zip(axes[0], costs.items(), strict=True):
        x, y = np.meshgrid(np.linspace(-half, half, 80), np.linspace(-half, half, 80))
        points = np.stack([x.ravel(), y.ravel()])
        height = 0.5 * np.sum(points * (cost.H @ points), axis=0) + cost.g @ points + cost.c
        height = (height - height.min()).reshape(x.shape)
        ax.contourf(x, y, np.sqrt(height), levels=14, cmap="viridis_r")
        ax.contour(x, y, height, levels=LEVELS, colors="white", linewidths=0.8)
        flat, curved = np.linalg.eigvalsh(cost.H)
        if flat > VALLEY_RATIO * curved:
            style = {"color": hex_code(GREYS[0]), "markeredgecolor": "white"}
            ax.plot(*cost.minimizer(), "o", markersize=8, **style)
        ax.set(xlabel=x_name, ylabel=y_name, title=title.replace("_", " "), aspect="equal")
    plt.close(figure)
    return figure


def level_curves(
    cost: fb.Quadratic, point: npt.ArrayLike, half: float, x_name: str, y_name: str
) -> str:
    """Draw level curves of a cost on two variables, fast enough for a slider."""
    values, vectors = np.linalg.eigh(cost.H)
    values = np.maximum(values, 1e-9 * values[-1])
    centre = -vectors @ ((vectors.T @ cost.g) / values)
    turn = -np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1]))
    s = 130.0 / half  # pixels for 1
    x, y = (np.array([1, -1]) * s * np.asarray(point)) + 130
    place = f"translate({130 + s * centre[0]:.1f} {130 - s * centre[1]:.1f}) rotate({turn:.2f})"
    grey = hex_code(GREYS[1])
    drawn = svg.element("rect", width=260, height=260, fill_opacity="0.05")
    for level in LEVELS:
        rx, ry = (float(s * (2 * level / value) ** 0.5) for value in values[::-1])
        style = {"fill": grey, "fill_opacity": "0.15", "stroke": grey, "stroke_width": "1.5"}
        drawn += svg.element("ellipse", rx=rx, ry=ry, transform=place, **style)
    style = {"stroke": "currentColor", "stroke_opacity": "0.4", "stroke_dasharray": "3 3"}
    drawn += svg.element("path", d="M0 130H260M130 0V260", **style)
    drawn += svg.circle((x, y), 6)
    drawn = svg.element("svg", drawn, x=0, y=0, width=260, height=260)
    drawn += svg.text((130, 278), f"{x_name}, ± {half:g}")
    drawn += svg.upright_text((-10, 130), f"{y_name}, ± {half:g}")
    return svg.drawing(drawn, 310, "-40 0 310 290")
