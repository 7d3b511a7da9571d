"""Lesson 05: forces with their net wrench, a moved centre of mass, and a plan that pulls."""

from __future__ import annotations

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

import floatbase as fb
from floatbase._validation import as_forces
from floatbase.lessons.rounding import rounded
from floatbase.objectives import com_wrench_map
from floatbase.simulation import Rollout
from floatbase.viewer import View, Viewer, markers, plots, prefixed, shapes
from floatbase.viewer.scene.colours import GREYS, hex_code

LEAST_FORCE, LEAST_MOMENT = 5e-3, 5e-4  # N, N·m: smaller values are shown as zero
PLOT_RANGE = (-40.0, 100.0)  # N: after a fall, the planned forces are thousands of newtons


def show_forces(
    view: Viewer,
    state: fb.State,
    contacts: fb.Contacts,
    forces: npt.ArrayLike,
    wish: npt.ArrayLike | None = None,
) -> str:
    """Draw contact forces, and their wrench (f_c, τ_c) above the robot, where it is visible."""
    forces = as_forces(forces, contacts.k)
    wrench = com_wrench_map(state, contacts)(forces) - [0, 0, state.robot.weight, 0, 0, 0]
    wrench = np.where(np.abs(wrench) > np.repeat([LEAST_FORCE, LEAST_MOMENT], 3), wrench, 0.0)
    size, scale = view.painter.size, view.scale
    above = np.array([state.com[0], state.com[1], view.painter.box[1][2] + 0.12 * size])
    drawn = prefixed(
        "wrench", markers.wrench(above, scale * wrench[:3], scale / size * wrench[3:], size)
    )
    if wish is not None and np.linalg.norm(wish) > LEAST_FORCE:
        view.add_legend_entry("wish", GREYS[1], "desired force")
        higher = above + [0.0, 0.0, 0.1 * size]
        drawn["wish"] = shapes.arrow(higher, scale * np.asarray(wish, dtype=float), GREYS[1], size)
    view.show(state, contacts=contacts, planned=forces, extra=drawn)
    f_c, tau_c = np.split(wrench, [3])
    return (
        f"without the weight: f<sub>c</sub> = <b>{rounded(f_c, 'N')}</b>, τ<sub>c</sub> = "
        f"<b>{rounded(tau_c, 'N·m')}</b>"
    )


def show_moved_com(view: Viewer, now: fb.State, before: fb.State, name: str) -> Viewer:
    """Draw a state, and another one as a ghost with a dark spot below its centre of mass."""
    x, y, _ = before.com
    spot = shapes.contact_patch([x, y, 0.0], [0.0, 0.0, 1.0], 0.035 * view.painter.size)
    stem = shapes.rod([x, y, 0.0], np.eye(3), before.com[2], 0.005 * view.painter.size, GREYS[0])
    view.show(
        now, ghost=before, ghost_name=name, extra={"earlier/spot": spot, "earlier/stem": stem}
    )
    return view.camera(View(20.0, 24.0, 0.75))


def plot_planned_pull(record: Rollout, until: float) -> Figure:
    """Plot planned and measured normal forces with a line at zero."""
    figure, axis = plt.subplots(figsize=(8, 3.2), layout="constrained")
    plots.plot_forces(record, axis)
    axis.axhline(0.0, color=hex_code(GREYS[0]), linewidth=1.0)
    axis.set(xlim=(0.0, until), ylim=PLOT_RANGE)
    axis.legend(loc="lower left", fontsize="small")
    plt.close(figure)
    return figure


def plot_constrained_minimum() -> Figure:
    """Plot a cost of two variables, a linear constraint, and the slope at two of its points."""
    cost = fb.Quadratic.from_residual([[1.0, 0.3], [0.0, 1.4]], [1.6, 2.4])
    normal, along = np.array([1.0, 1.0]) / np.sqrt(2), np.array([1.0, -1.0]) / np.sqrt(2)
    line = fb.Affine(along[:, None], 0.4 * normal)  # distance along the constraint -> point
    best = line(cost.pullback(line).minimizer())
    figure, axis = plt.subplots(figsize=(6.0, 4.4), layout="constrained")
    x, y = np.meshgrid(np.linspace(-2.2, 3.0, 80), np.linspace(-1.4, 2.4, 80))
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    height = np.array([cost(point) for point in points]).reshape(x.shape)
    axis.contour(x, y, height, levels=14, colors=[hex_code(GREYS[2])], linewidths=0.8)
    axis.plot(*cost.minimizer(), "x", color=hex_code(GREYS[1]), label="minimum of the cost")
    ends = np.array([line([-3.5]), line([3.5])])
    axis.plot(*ends.T, color=hex_code(GREYS[1]), linewidth=3.0, label="constraint")
    axis.plot(*best, "o", color=hex_code(GREYS[0]), markersize=9, label="constrained minimum")
    arrow: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1.0}
    arrow |= {"width": 0.011, "zorder": 4}
    dark = hex_code(GREYS[0])
    others = np.array([best, best + 1.2 * along])
    downhill = -0.45 * (others @ cost.H + cost.g)
    part = along * (along @ downhill[1])
    axis.quiver(*others.T, *downhill.T, color=dark, label="downhill (minus the slope)", **arrow)
    axis.quiver(
        *others[1], *part, facecolor="white", edgecolor=dark, linewidth=1.2,
        label="its part along the constraint", **arrow,
    )  # fmt: skip
    axis.set(xlim=(-2.2, 3.0), ylim=(-1.4, 2.4), aspect="equal", xlabel="β₁", ylabel="β₂")
    axis.legend(loc="lower left", fontsize="small")
    plt.close(figure)
    return figure
