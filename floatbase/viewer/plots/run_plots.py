"""Plots of a rollout: centre of mass, forces, friction, torques."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from floatbase._validation import Array, as_instance, numeric_copy, short_repr
from floatbase.errors import InputError
from floatbase.viewer.export.recording import as_rollout
from floatbase.viewer.scene.colours import (
    ALARM,
    GREYS,
    LIMIT,
    MEASURED,
    PLANNED,
    PUSH,
    X_AXIS,
    Y_AXIS,
    Z_AXIS,
)

if TYPE_CHECKING:
    from floatbase.simulation import Rollout

# fraction of the weight: the direction of a smaller force says nothing about friction
_MIN_LOAD = 0.01


def plot_run(rollout: Rollout) -> Figure:
    """Plot a rollout: centre of mass, normal forces, used friction, and torques.

    Parameters
    ----------
    rollout : Rollout
        Record to plot.

    Returns
    -------
    Figure
        Figure with four plots.
    """
    as_rollout(rollout)
    figure, axes = plt.subplots(4, 1, figsize=(8, 11), sharex=True, layout="constrained")
    plots = (plot_com, plot_forces, plot_friction, plot_torques)
    for plot, axis in zip(plots, axes, strict=True):
        plot(rollout, axis)
    axes[0].set_title(f"{rollout.robot.name}: {rollout.outcome}")
    for axis in axes[:-1]:
        axis.set_xlabel("")
    return figure


def plot_com(rollout: Rollout, axis: Axes | None = None) -> Axes:
    """Plot the displacement of the centre of mass since the start in x, y and z [mm]."""
    as_rollout(rollout)
    axis = _axes_or_new(axis)
    moved = 1000.0 * (rollout.com - rollout.com[0])
    for column, name, colour in zip(moved.T, "xyz", (X_AXIS, Y_AXIS, Z_AXIS), strict=True):
        axis.plot(rollout.time, column, color=colour, label=name)
    return _finished(axis, rollout, "displacement of the CoM [mm]")


def plot_forces(rollout: Rollout, axis: Axes | None = None) -> Axes:
    """Plot the measured normal force at each contact point [N].

    A wider line behind it shows the planned force.
    """
    as_rollout(rollout)
    axis = _axes_or_new(axis)
    planned, measured = _normal(rollout, rollout.planned), _normal(rollout, rollout.measured)
    for i in range(len(planned)):
        _plot_both(axis, rollout.time, planned[i], measured[i], 1.2, has_labels=i == 0)
    return _finished(axis, rollout, "normal forces [N]")


def plot_friction(rollout: Rollout, axis: Axes | None = None) -> Axes:
    """Plot the used fraction of friction at each contact point, planned and measured.

    The fraction is ‖f_tangent‖ / (μ f_normal). Above 1, a force is outside its cone. The curve of a
    point has gaps where the point carries little load; see `friction_used`.

    Parameters
    ----------
    rollout : Rollout
        Record to plot.
    axis : Axes, optional
        Axes to plot on. By default, a new figure.

    Returns
    -------
    Axes
        The axes.

    Notes
    -----
    [FBR]_, eq. (28).
    """
    as_rollout(rollout)
    axis = _axes_or_new(axis)
    for forces, colour, name, width in (
        (rollout.planned, PLANNED, "planned", 3.5),
        (rollout.measured, MEASURED, "measured", 1.2),
    ):
        for i, share in enumerate(friction_used(rollout, forces)):
            label = "" if i else name
            axis.plot(rollout.time, share, color=colour, linewidth=width, alpha=0.7, label=label)
    axis.axhline(1.0, color=ALARM, linestyle="--", linewidth=1.0, label="cone")
    return _finished(axis, rollout, "friction / (μ · normal force)")


def plot_torques(rollout: Rollout, axis: Axes | None = None) -> Axes:
    """Plot each joint torque divided by its limit, for all joints with a limit.

    Parameters
    ----------
    rollout : Rollout
        Record to plot.
    axis : Axes, optional
        Axes to plot on. By default, a new figure.

    Returns
    -------
    Axes
        The axes.
    """
    as_rollout(rollout)
    axis = _axes_or_new(axis)
    limited = np.isfinite(rollout.robot.torque_limits)
    share = rollout.tau[:, limited] / rollout.robot.torque_limits[limited]
    axis.plot(rollout.time, share, color=GREYS[0], linewidth=0.8, alpha=0.7)
    for limit in (-1.0, 1.0):
        label = "limit" if limit > 0 else ""
        axis.axhline(limit, color=LIMIT, linestyle="--", linewidth=1.0, label=label)
    return _finished(axis, rollout, "torque / limit")


def friction_used(rollout: Rollout, forces: Array) -> Array:
    """Compute the used fraction of friction, ‖f_tangent‖ / (μ f_normal), shape (k / 3, n).

    forces: contact forces in the world frame, shape (n, k) [N], such as `rollout.measured`. The
    result is NaN where a point carries little load.
    """
    as_rollout(rollout)
    found = numeric_copy(forces)  # NaN where no forces were planned
    if found is None or found.shape != rollout.measured.shape:
        raise InputError(
            f"forces must have shape {rollout.measured.shape} [N], the shape of "
            f"rollout.measured, not {short_repr(forces)}."
        )
    f = np.reshape(found, (len(rollout.time), -1, 3))
    normals, mus = rollout.contacts.normals, rollout.contacts.mus
    push = np.einsum("nij,ij->ni", f, normals)
    slide = np.linalg.norm(f - push[:, :, None] * normals, axis=2)
    carried = push > _MIN_LOAD * rollout.robot.weight
    share = np.full_like(push, np.nan)
    np.divide(slide, mus * push, out=share, where=carried)
    return np.asarray(share.T)


def _normal(rollout: Rollout, forces: Array) -> Array:
    """Return the normal force at each contact point and time, shape (k / 3, n) [N]."""
    f = np.reshape(forces, (len(rollout.time), -1, 3))
    return np.asarray(np.einsum("nij,ij->in", f, rollout.contacts.normals))


def _axes_or_new(axis: Axes | None) -> Axes:
    """Return the given axes, or those of a new figure."""
    if axis is None:
        return plt.subplots(figsize=(8, 3), layout="constrained")[1]
    return as_instance("axis", axis, Axes, "plt.gca()")


def _plot_both(
    axis: Axes, time: Array, planned: Array, measured: Array, width: float, has_labels: bool = True
) -> None:
    """Plot measured values over a wider line for the planned ones."""
    labels = ("planned", "measured") if has_labels else ("", "")
    axis.plot(time, planned, color=PLANNED, linewidth=3.5, alpha=0.6, label=labels[0])
    axis.plot(time, measured, color=MEASURED, linewidth=width, label=labels[1])


def _finished(axis: Axes, rollout: Rollout, label: str) -> Axes:
    """Add labels, a legend if a curve has a label, and a band for each push."""
    for i, push in enumerate(rollout.pushes):
        end, label_of_push = push.start + push.duration, "" if i else "push"
        axis.axvspan(push.start, end, color=PUSH, alpha=0.12, label=label_of_push)
    axis.set(xlabel="time [s]", ylabel=label)
    axis.grid(alpha=0.25)
    if axis.get_legend_handles_labels()[0]:
        axis.legend(fontsize="small", loc="upper right")
    return axis
