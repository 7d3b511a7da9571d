"""Lesson 05, Steering the centre of mass: forces with the wrench that they make, and what a preference costs."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import floatbase as fb
from floatbase._arrays import Array, flat_forces
from floatbase.lessons.rounding import about
from floatbase.objectives import com_wrench
from floatbase.simulation import Rollout
from floatbase.viewer import GREYS, Viewer, hexadecimal, plots, shapes


def show_forces(
    view: Viewer, state: fb.State, contacts: fb.Contacts, forces: npt.ArrayLike, wish: npt.ArrayLike | None = None
) -> str:
    """Draw forces at the feet and their wrench (f_c, τ_c), without the part that carries the weight; returns it as HTML.

    forces: shape (k,), N, world. wish: shape (3,), N, world, the force that was wished for beside the weight: a grey arrow.
    """
    forces = flat_forces(forces, contacts.k)
    wrench = com_wrench(state, contacts)(forces) - [0, 0, state.robot.weight, 0, 0, 0]
    shown = np.where(np.abs(wrench) > 1e-6, wrench, 0.0)
    grey = {}
    if wish is not None and np.linalg.norm(wish) > 1e-6:
        above = state.com + [0.0, 0.0, 0.15 * view.painter.size]
        grey["wish"] = shapes.arrow(above, view.scale * np.asarray(wish, dtype=float), GREYS[1], view.painter.size)
    view.show(state, contacts=contacts, planned=forces, wrench=shown, extra=grey)
    f_c, tau_c = np.split(np.round(shown, 4), [3])
    return f"beside the weight: f<sub>c</sub> = <b>{about(f_c, 'N')}</b>, τ<sub>c</sub> = <b>{about(tau_c, 'N·m')}</b>"


def price_of_preference(weights: npt.ArrayLike, forces: npt.ArrayLike, lean: npt.ArrayLike, mu: float, wish: float) -> Figure:
    """What is left of a wish, and how far the worst force leans, over the weight of a preference.

    weights: shape (n,). forces: shape (n,), N, f_c along the wish. lean: shape (n,), the largest lean of any foot.
    mu: drawn beside the lean. wish: N, drawn beside the force.
    """
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.2), layout="constrained", sharex=True)
    dark, light = hexadecimal(GREYS[0]), hexadecimal(GREYS[1])
    for ax, values, limit, name, label in (
        (left, forces, wish, "wished for", "force at the centre of mass [N]"),
        (right, lean, mu, "μ", "largest lean of a foot"),
    ):
        ax.semilogx(np.asarray(weights), np.asarray(values), color=dark, linewidth=2)
        ax.axhline(limit, color=light, linestyle="--", linewidth=1.5, label=name)
        ax.set(xlabel="weight of the preference", ylabel=label, ylim=(0, None))
        ax.grid(alpha=0.3)
        ax.legend(loc="lower left")
    plt.close(figure)
    return figure


def two_norms() -> Figure:
    """‖x‖ and ½‖x‖² of one number: only the second is quadratic."""
    x = np.linspace(-2, 2, 81)
    figure, ax = plt.subplots(figsize=(4.6, 2.6), layout="constrained")
    for y, colour, style, name in ((np.abs(x), GREYS[1], "--", "½‖x‖"), (x**2, GREYS[0], "-", "½‖x‖²")):
        ax.plot(x, 0.5 * y, style, color=hexadecimal(colour), label=name, linewidth=2)
    ax.set(xlabel="friction at a foot [N]", ylabel="cost")
    ax.grid(alpha=0.3)
    ax.legend()
    plt.close(figure)
    return figure


def planned_pull(record: Rollout, until: float) -> Axes:
    """Normal forces that were planned and measured up to a time in s, N, with a line at zero."""
    axis = plots.plot_forces(record)
    axis.axhline(0.0, color=hexadecimal(GREYS[0]), linewidth=1.0)
    normal = normal_forces(record)[record.time <= until]
    axis.set(xlim=(0.0, until), ylim=(min(-40.0, 1.2 * _robust_least(normal)), 100.0))
    return axis


def normal_forces(record: Rollout) -> Array:
    """Planned normal force at each point, shape (rows, n), N."""
    planned = record.planned.reshape(len(record), -1, 3)
    return np.asarray(np.einsum("tij,ij->ti", planned, record.contacts.normals))


def _robust_least(values: Sequence[float] | Array) -> float:
    """The least value, or -60 where it is lower: a plan that has lost the robot asks for thousands."""
    return float(max(np.min(values), -60.0))
