"""Plots of a rollout: centre of mass, forces, gait, friction, torques."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from floatbase._validation import Array, as_instance, numeric_copy, short_repr
from floatbase.dynamics import FrictionContact
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
MIN_LOAD = 0.01
_INSIDE: dict[str, Any] = {"loc": "upper right"}  # position of the legend
_ABOVE: dict[str, Any] = {
    "loc": "lower right",
    "bbox_to_anchor": (1.0, 1.0),
    "ncols": 3,
    "frameon": False,
}


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
    """Plot the displacement of the centre of mass since the start in x, y and z [mm].

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
    moved = 1000.0 * (rollout.com - rollout.com[0])
    for column, name, colour in zip(moved.T, "xyz", (X_AXIS, Y_AXIS, Z_AXIS), strict=True):
        axis.plot(rollout.time, column, color=colour, label=name)
    return _finished(axis, rollout, "displacement of the CoM [mm]")


def plot_forces(rollout: Rollout, axis: Axes | None = None) -> Axes:
    """Plot the measured normal force at each contact point [N].

    A wider line behind it shows the planned force.

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
    planned, measured = _normal(rollout, rollout.planned), _normal(rollout, rollout.measured)
    for i in range(len(planned)):
        _plot_both(axis, rollout.time, planned[i], measured[i], 1.2, has_labels=i == 0)
    return _finished(axis, rollout, "normal forces [N]")


def plot_gait(rollout: Rollout, axis: Axes | None = None) -> Axes:
    """Plot the gait diagram.

    Each foot has a bar while it is in the controller's stance, and a line while the ground carries
    it.

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

    Raises
    ------
    InputError
        If the record has no contacts.
    """
    names = _contact_names(rollout)
    axis = _axes_or_new(axis)
    stances, forces = _stance_rows(rollout), _normal_of_contacts(rollout, rollout.measured)
    for i, (stands, measured) in enumerate(zip(stances, forces, strict=True)):
        times, place = _intervals(rollout.time, stands), (i - 0.36, 0.72)
        bars = axis.broken_barh(times, place, color=GREYS[2], alpha=0.6, linewidth=0.0)
        bars.set_label("" if i else "in the controller's stance")
        carried = np.where(measured > MIN_LOAD * rollout.robot.weight, float(i), np.nan)
        label = "" if i else "measured contact"
        axis.plot(rollout.time, carried, color=MEASURED, linewidth=2.5, label=label)
    axis.set_yticks(range(len(names)), names)
    axis.set_ylim(len(names) - 0.5, -0.5)
    return _finished(axis, rollout, "", _ABOVE)


def plot_normal_forces(rollout: Rollout, axes: Sequence[Axes] | None = None) -> list[Axes]:
    """Plot the normal force of each contact over time in its own axes [N].

    The measured force is drawn over a wider line for the planned one.

    Parameters
    ----------
    rollout : Rollout
        Record to plot.
    axes : sequence of Axes, optional
        One for each contact of the record. By default, a new figure.

    Returns
    -------
    list of Axes
        The axes.

    Raises
    ------
    InputError
        If the record has no contacts, or if the number of axes differs from that of contacts.
    """
    names = _contact_names(rollout)
    if axes is None:
        figure = plt.figure(figsize=(8, 1.0 + 1.1 * len(names)), layout="constrained")
        grid = figure.subplots(len(names), sharex=True, sharey=True, squeeze=False)
        axes = list(grid.flat)
    if isinstance(axes, np.ndarray):  # as of plt.subplots
        axes = list(axes.flat)
    made = [
        as_instance("one of axes", axis, Axes, "plt.gca()")
        for axis in (axes if isinstance(axes, list | tuple) else [axes])
    ]
    if len(made) != len(names):
        raise InputError(
            f"axes has {len(made)} entries; it must have one for each of the {len(names)} "
            f"contacts: {', '.join(names)}."
        )
    planned, measured = (
        _normal_of_contacts(rollout, forces) for forces in (rollout.planned, rollout.measured)
    )
    for i, (axis, name) in enumerate(zip(made, names, strict=True)):
        _plot_both(axis, rollout.time, planned[i], measured[i], 1.0)
        axis.axhline(0.0, color=LIMIT, linewidth=0.6)
        _finished(axis, rollout, "", {} if i else _ABOVE)
        axis.set_ylabel(f"{name}\n[N]", rotation=0, ha="right", va="center")
        axis.set_xlabel("time [s]" if i + 1 == len(made) else "")
    return made


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
    """Compute the used fraction of friction, ‖f_tangent‖ / (μ f_normal).

    Parameters
    ----------
    rollout : Rollout
        Record with n times and k / 3 contact points.
    forces : ndarray, shape (n, k)
        Contact forces in the world frame [N], such as `rollout.measured`.

    Returns
    -------
    ndarray, shape (k / 3, n)
        Fraction at each contact point and time, dimensionless; NaN where the point carries little
        load.

    Raises
    ------
    InputError
        If the forces do not have the shape of `rollout.measured`.
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
    carried = push > MIN_LOAD * rollout.robot.weight
    share = np.full_like(push, np.nan)
    np.divide(slide, mus * push, out=share, where=carried)
    return np.asarray(share.T)


def _normal(rollout: Rollout, forces: Array) -> Array:
    """Return the normal force at each contact point and time, shape (k / 3, n) [N]."""
    f = np.reshape(forces, (len(rollout.time), -1, 3))
    return np.asarray(np.einsum("nij,ij->in", f, rollout.contacts.normals))


def _contact_names(rollout: Rollout) -> tuple[str, ...]:
    """Return the names of the record's contacts; raise `InputError` if there are none."""
    names = as_rollout(rollout).contacts.names
    if not names:
        raise InputError("The record has no contacts, so there is nothing to plot.")
    return names


def _normal_of_contacts(rollout: Rollout, forces: Array) -> Array:
    """Return the normal force of each contact and time, shape (contacts, n) [N]."""
    counts = [len(c.point_names) if isinstance(c, FrictionContact) else 0 for c in rollout.contacts]
    points, starts = _normal(rollout, forces), np.cumsum([0, *counts])
    return np.array([points[a:b].sum(axis=0) for a, b in pairwise(starts)])


def _stance_rows(rollout: Rollout) -> npt.NDArray[np.bool_]:
    """Return whether the controller's stance had each contact at each time, shape (contacts, n)."""
    if not rollout.stances:
        return np.ones((len(rollout.contacts), len(rollout)), dtype=bool)
    has = {
        stance: [name in stance.names for name in rollout.contacts.names]
        for stance in dict.fromkeys(rollout.stances)
    }
    return np.array([has[stance] for stance in rollout.stances], dtype=bool).T


def _intervals(times: Array, there: npt.NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Return the start and length [s] of each interval in which a condition holds."""
    changes = np.flatnonzero(np.diff(np.concatenate([[False], there, [False]]).astype(int)))
    ends = np.append(times, times[-1:])
    return [(float(times[a]), float(ends[b] - times[a])) for a, b in changes.reshape(-1, 2)]


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


def _finished(
    axis: Axes, rollout: Rollout, label: str, legend: Mapping[str, Any] = _INSIDE
) -> Axes:
    """Add labels, a band for each push, and a legend unless `legend` is empty."""
    for i, push in enumerate(rollout.pushes):
        end, label_of_push = push.start + push.duration, "" if i else "push"
        axis.axvspan(push.start, end, color=PUSH, alpha=0.12, label=label_of_push)
    axis.set(xlabel="time [s]", ylabel=label)
    axis.grid(alpha=0.25)
    if legend and axis.get_legend_handles_labels()[0]:
        axis.legend(fontsize="small", **legend)
    return axis
