"""Plots of a rollout: centre of mass, forces, friction, torques."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from floatbase._validation import Array, as_instance, as_strings, numeric_copy, short_repr
from floatbase.errors import InputError, unknown_name
from floatbase.viewer.export.recording import as_rollout
from floatbase.viewer.scene.colours import (
    ALARM,
    CALM,
    COM,
    GREYS,
    LIMIT,
    MEASURED,
    PLANNED,
    PUSH,
    RGB,
    WARNING,
    X_AXIS,
    Y_AXIS,
    Z_AXIS,
)

if TYPE_CHECKING:
    from floatbase.simulation import Rollout

Runs: TypeAlias = "Rollout | Mapping[str, Rollout]"
Kind: TypeAlias = Literal["measured", "planned"]

# fraction of the weight: the direction of a smaller force says nothing about friction
_MIN_LOAD = 0.01
_COLOURS: tuple[RGB, ...] = (MEASURED, WARNING, CALM, COM, PUSH, PLANNED)
_STYLES = ("-", "--", ":", "-.")  # of the first run, the second, …


def plot_run(rollout: Runs, select: Sequence[str] = ()) -> Figure:
    """Plot a rollout: centre of mass, normal forces, used friction, and torques.

    Parameters
    ----------
    rollout : Rollout, or mapping of str to Rollout
        Record to plot, or records to compare, by their names in the legends. Planned forces are
        drawn for a single record only.
    select : sequence of str, optional
        What to show: the plots "com", "forces", "friction" and "torques", contacts, and joints. An
        asterisk stands for any characters, as in ``["torques", "FL_*"]``. If no plot is named, the
        plots of the named contacts and joints are shown. By default, everything is shown.

    Returns
    -------
    Figure
        Figure with up to four plots.

    Raises
    ------
    UnknownNameError
        If a name is not that of a plot, a contact or a joint.

    Examples
    --------
    >>> from floatbase.viewer.plots import plot_run
    >>> figure = plot_run({"stiff": stiff, "soft": soft}, select=["com", "*_calf_joint"])
    """
    runs = _as_runs(rollout)
    feet, joints = _selected(runs, select)
    shown = set(select) & set(_PLOTS)
    if feet and not shown & {"forces", "friction"}:
        shown |= {"forces", "friction"}
    if joints:
        shown.add("torques")
    plots = [plot for name, plot in _PLOTS.items() if name in shown or not shown]
    size = (9, 1 + 2.5 * len(plots))
    figure, grid = plt.subplots(len(plots), figsize=size, sharex=True, squeeze=False)
    figure.set_layout_engine("constrained")
    axes = grid[:, 0]
    for plot, axis in zip(plots, axes, strict=True):
        plot(runs, axis, *([] if plot is plot_com else [select]))
        axis.label_outer()
    axes[0].set_title(
        ", ".join(f"{name or run.robot.name}: {run.outcome}" for name, run in runs.items())
    )
    return figure


def plot_com(rollout: Runs, axis: Axes | None = None) -> Axes:
    """Plot the displacement of the centre of mass since the start in x, y and z [mm].

    Parameters
    ----------
    rollout : Rollout, or mapping of str to Rollout
        As for `plot_run`.
    axis : Axes, optional
        Axes to plot on. By default, a new figure.

    Returns
    -------
    Axes
        The axes.
    """
    runs, axis = _as_runs(rollout), _axes_or_new(axis)
    for i, (run, style) in enumerate(_styled(runs)):
        moved = 1000.0 * (run.com - run.com[:1])
        for column, name, colour in zip(moved.T, "xyz", (X_AXIS, Y_AXIS, Z_AXIS), strict=True):
            axis.plot(run.time, column, style, color=colour, label="" if i else name)
    return _finished(axis, runs, "displacement of the CoM [mm]")


def plot_forces(rollout: Runs, axis: Axes | None = None, select: Sequence[str] = ()) -> Axes:
    """Plot the measured normal force at each contact [N]; for a flat foot, the sum of its corners.

    A wider line behind it shows the planned force.

    Parameters
    ----------
    rollout, select
        As for `plot_run`.
    axis : Axes, optional
        Axes to plot on. By default, a new figure.

    Returns
    -------
    Axes
        The axes.
    """
    runs = _as_runs(rollout)
    feet, axis = _selected(runs, select)[0] or _feet(runs), _axes_or_new(axis)
    _plot_feet(axis, runs, feet, _normal_force)
    return _finished(axis, runs, "normal forces [N]")


def plot_friction(rollout: Runs, axis: Axes | None = None, select: Sequence[str] = ()) -> Axes:
    """Plot the used fraction of friction at each contact; for a flat foot, its worst corner.

    The fraction is ‖f_tangent‖ / (μ f_normal). Above 1, a force is outside its cone. The curve of a
    contact has gaps where it carries little load; see `friction_used`. A wider line shows the
    fraction of the planned forces.

    Parameters
    ----------
    rollout, select
        As for `plot_run`.
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
    runs = _as_runs(rollout)
    feet, axis = _selected(runs, select)[0] or _feet(runs), _axes_or_new(axis)
    _plot_feet(axis, runs, feet, _friction_of_foot)
    axis.axhline(1.0, color=ALARM, linestyle="--", linewidth=1.0, label="cone")
    return _finished(axis, runs, "friction / (μ · normal force)")


def plot_torques(rollout: Runs, axis: Axes | None = None, select: Sequence[str] = ()) -> Axes:
    """Plot each joint torque divided by its limit, for all joints with a limit.

    The joints that come nearest to their limits have a colour and a name; all others are grey.

    Parameters
    ----------
    rollout, select
        As for `plot_run`.
    axis : Axes, optional
        Axes to plot on. By default, a new figure.

    Returns
    -------
    Axes
        The axes.
    """
    runs = _as_runs(rollout)
    chosen, axis = _selected(runs, select)[1] or _joints(runs), _axes_or_new(axis)
    shares = {name: _torque_shares(run, chosen) for name, run in runs.items()}
    peaks = {
        joint: max(
            np.abs(found[joint]).max(initial=0.0) for found in shares.values() if joint in found
        )
        for joint in dict.fromkeys(joint for found in shares.values() for joint in found)
    }
    ranked = sorted(peaks, key=peaks.__getitem__, reverse=True)
    others = ranked[len(_COLOURS) :]
    colours = dict(zip((joint for joint in peaks if joint not in others), _COLOURS, strict=False))
    for joint in peaks:
        look: dict[str, Any] = {"color": LIMIT, "linewidth": 0.6, "alpha": 0.5}
        if joint in colours:
            look = {"color": colours[joint], "linewidth": 1.2, "zorder": 3, "label": joint}
        for (run, style), found in zip(_styled(runs), shares.values(), strict=True):
            if joint in found:
                axis.plot(run.time, found[joint], style, **look)
                look.pop("label", None)
    if others:
        label = f"{len(others)} others, up to {100 * peaks[others[0]]:.0f} %"
        axis.plot([], [], color=LIMIT, linewidth=0.6, label=label)
    for limit in (-1.0, 1.0):
        label = "limit" if limit > 0 else ""
        axis.axhline(limit, color=LIMIT, linestyle="--", linewidth=1.0, label=label)
    return _finished(axis, runs, "torque / limit")


_PLOTS = {
    "com": plot_com,
    "forces": plot_forces,
    "friction": plot_friction,
    "torques": plot_torques,
}


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
    columns = rollout.contacts.point_force_indices
    f = np.reshape(found[:, columns], (len(rollout), columns.size // 3, 3))
    normals, mus = rollout.contacts.normals, rollout.contacts.mus
    push = np.einsum("nij,ij->ni", f, normals)
    slide = np.linalg.norm(f - push[:, :, None] * normals, axis=2)
    carried = push > _MIN_LOAD * rollout.robot.weight
    share = np.full_like(push, np.nan)
    np.divide(slide, mus * push, out=share, where=carried)
    return np.asarray(share.T)


def _axes_or_new(axis: Axes | None) -> Axes:
    """Return the given axes, or those of a new figure."""
    if axis is None:
        return plt.subplots(figsize=(8, 3), layout="constrained")[1]
    return as_instance("axis", axis, Axes, "plt.gca()")


def _as_runs(rollout: Runs) -> dict[str, Rollout]:
    """Return records by name; a single one has the name ""."""
    runs = dict(rollout) if isinstance(rollout, Mapping) else {"": rollout}
    if not runs or len(runs) > len(_STYLES):
        raise InputError(
            f"There are {len(runs)} records to plot, but there must be 1 to {len(_STYLES)}."
        )
    return {
        as_strings("names of records", [name])[0]: as_rollout(run) for name, run in runs.items()
    }


def _styled(runs: Mapping[str, Rollout]) -> list[tuple[Rollout, str]]:
    """Return each record with the style of its lines."""
    return list(zip(runs.values(), _STYLES, strict=False))


def _feet(runs: Mapping[str, Rollout]) -> list[str]:
    """Return the names of all contacts whose forces act at points."""
    contacts = (contact for run in runs.values() for contact in run.contacts.friction_contacts)
    return list(dict.fromkeys(contact.name for contact in contacts))


def _joints(runs: Mapping[str, Rollout]) -> list[str]:
    """Return the names of all joints."""
    return list(dict.fromkeys(name for run in runs.values() for name in run.robot.joint_names))


def _selected(runs: Mapping[str, Rollout], select: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the contacts and joints that are selected, after checking the selection."""
    found: tuple[list[str], list[str]] = ([], [])
    known = _feet(runs), _joints(runs)
    for pattern in as_strings("select", select):
        matches = [[name for name in names if fnmatchcase(name, pattern)] for names in known]
        if pattern not in _PLOTS and not any(matches):
            raise unknown_name("plot, contact or joint", pattern, [*_PLOTS, *known[0], *known[1]])
        for chosen, names in zip(found, matches, strict=True):
            chosen += [name for name in names if name not in chosen]
    return found


def _plot_feet(
    axis: Axes,
    runs: Mapping[str, Rollout],
    feet: Sequence[str],
    curve: Callable[[Rollout, str, Kind], Array],
) -> None:
    """Plot a curve of each contact, over a wider line for the planned one of a single record."""
    for i, foot in enumerate(feet):
        colour, label = _COLOURS[i % len(_COLOURS)], foot
        for run, style in _styled(runs):
            if foot not in run.contacts.names:
                continue
            if len(runs) == 1:
                planned = curve(run, foot, "planned")
                axis.plot(run.time, planned, color=colour, linewidth=4.0, alpha=0.3)
            measured = curve(run, foot, "measured")
            axis.plot(run.time, measured, style, color=colour, linewidth=1.2, label=label)
            label = ""
    if len(runs) == 1 and feet:
        axis.plot([], [], color=LIMIT, linewidth=4.0, alpha=0.5, label="planned")


def _normal_force(run: Rollout, foot: str, kind: Kind) -> Array:
    """Return the normal component of the force at a contact, shape (n,) [N]."""
    return np.asarray(run.force(foot, kind) @ run.contacts.friction_contact(foot).normal)


def _friction_of_foot(run: Rollout, foot: str, kind: Kind) -> Array:
    """Return the largest used fraction of friction among the points of a contact, shape (n,)."""
    points = run.contacts.only(foot).point_names
    rows = [run.contacts.point_names.index(point) for point in points]
    used = friction_used(run, run.measured if kind == "measured" else run.planned)
    return np.asarray(np.fmax.reduce(used[rows]))


def _torque_shares(run: Rollout, joints: Sequence[str]) -> dict[str, Array]:
    """Return torque / limit of those joints of a record that have a limit."""
    limits = run.robot.torque_limits
    return {
        name: run.tau[:, i] / limits[i]
        for i, name in enumerate(run.robot.joint_names)
        if name in joints and np.isfinite(limits[i])
    }


def _finished(axis: Axes, runs: Mapping[str, Rollout], label: str) -> Axes:
    """Add labels, a legend, and a band for each push."""
    pushes = {(p.start, p.start + p.duration) for run in runs.values() for p in run.pushes}
    for i, (start, end) in enumerate(sorted(pushes)):
        axis.axvspan(start, end, color=PUSH, alpha=0.12, label="" if i else "push")
    for (_, style), name in zip(_styled(runs), runs, strict=True):
        if name:
            axis.plot([], [], style, color=GREYS[0], label=name)
    axis.set(xlabel="time [s]", ylabel=label)
    axis.grid(alpha=0.25)
    axis.legend(fontsize="small", loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return axis
