"""Lesson 09: soles with corner forces and resultants, limits of a sole, and walks from above."""

from __future__ import annotations

from collections.abc import Iterable

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

import floatbase as fb
from floatbase._validation import Array
from floatbase.behaviours import StepPlan
from floatbase.friction import WrenchSet, centre_of_pressure, contact_wrench
from floatbase.lessons import svg
from floatbase.lessons.lesson09.helpers import centre_of_pressure_path, corner_forces
from floatbase.simulation import Rollout
from floatbase.viewer import Picture, View, Viewer, prefixed, shapes
from floatbase.viewer.scene.colours import GREYS, PLANNED, hex_code

SOLES_VIEW = View(30.0, 30.0, 1.0, around=((0.0, 0.03, 0.06), 0.27))  # both feet of Talos
ONE_SOLE_VIEW = View(30.0, 30.0, 1.0, around=((0.0, 0.1, 0.07), 0.2))
_FRAME_RATE = 30.0  # 1/s: pictures of a movie
_MAX_DISTANCE = 1.0  # m from a sole: planned forces beyond this are not drawn
MIN_FORCE = 1.0  # N: smaller forces are not drawn
_HIDDEN_PARTS = ("robot", "com", "scale")  # parts of the picture other than the feet
# m: position of the force scale in the world frame, and size of two feet
_BESIDE, _SIZE = (-0.1, 0.21, 0.002), 0.3
DRAWING_SIZE = WIDE, HIGH = 300, 250  # pixels of a drawing
_COLUMNS = 261  # of a slice: one for each mm
_LIMIT_TOLERANCE = 1e-6  # fraction of the normal force: a wrench this close to a limit is allowed
_ZERO_TOLERANCE = 1e-9  # rounding of a constraint of length one


def show_soles(view: Viewer, state: fb.State, contacts: fb.Contacts, forces: npt.ArrayLike) -> str:
    """Draw planned forces at the corners of soles, and the centres of pressure from above."""
    view.draw(_feet_only(view, view.painter.picture(state, contacts, planned=forces)))
    return soles_picture(state, contacts, forces)


def _feet_only(view: Viewer, picture: Picture, side: str = "") -> Picture:
    """Remove everything above the feet of Talos from a picture, and add a scale of forces."""
    feet = tuple(f"robot/leg_{name}_6" for name in ("left", "right") if side in ("", name))
    kept = {
        path: item
        for path, item in picture.items()
        if path.startswith(feet) or path.split("/")[0] not in _HIDDEN_PARTS
    }
    bar = shapes.scale_bar(_BESIDE, 100.0, 100.0 * view.scale, _SIZE, view.painter.text_colour)
    return kept | prefixed("scale", bar)


def soles_picture(state: fb.State, contacts: fb.Contacts, forces: npt.ArrayLike) -> str:
    """Draw soles from above with their centres of pressure."""
    flat, drawn = np.asarray(forces, dtype=np.float64), ""
    first = 0
    for contact in contacts:
        own = flat[first : first + contact.k]
        first += contact.k
        one = contacts.only(contact.name)
        corners = _to_pixels(one.positions(state))
        drawn += _polygon(corners)
        for corner, normal in zip(corners, own[2::3], strict=True):
            radius = 0.8 * np.sqrt(max(float(normal), 0.0))
            drawn += svg.circle(corner, radius, fill=hex_code(PLANNED))
        if own[2::3].sum() > MIN_FORCE:
            drawn += _cross(_to_pixels(centre_of_pressure(state, one, own)[None])[0], 5)
    drawn += _cross(_to_pixels(centre_of_pressure(state, contacts, flat)[None])[0], 9)
    com = _to_pixels(state.com[None])[0]
    drawn += svg.circle(com, 9, fill="none", stroke=hex_code(GREYS[1]), stroke_width=3)
    words = ("small crosses: centre of pressure of each sole", "large cross: of both; ring: x_c")
    return svg.captioned(drawn, DRAWING_SIZE, 20, "from above; forwards is up", *words)


def show_sole(
    view: Viewer, state: fb.State, sole: fb.Contacts, limits: WrenchSet, wrench: npt.ArrayLike
) -> str:
    """Draw a sole with the corner forces of a wrench and their sum at the centre of pressure."""
    w = np.asarray(wrench, dtype=np.float64)
    forces = corner_forces(state, sole, w)
    picture = view.painter.picture(state, sole, planned=forces, com=False)
    if forces[2::3].sum() > MIN_FORCE:
        at = centre_of_pressure(state, sole, forces)
        total = view.scale * forces.reshape(-1, 3).sum(axis=0)
        picture["planned/sum"] = shapes.arrow(at, total, PLANNED, _SIZE, halo=True)
    view.draw(_feet_only(view, picture, "left"))
    missed = np.abs(contact_wrench(state, sole, forces, limits.reference_point) - w)
    possible = bool(np.max(limits.face_matrix @ w) <= _LIMIT_TOLERANCE * w[2])
    if possible:
        return _slice(limits, w, "corner forces exist", "")
    summary = f"impossible with corner forces: {_violated_limits(limits, w)}"
    off = f"{missed[:3].max():.0f} N, {missed[3:].max():.0f} N·m"
    return _slice(limits, w, summary, f"closest forces: off by {off}")


def play_resultants(view: Viewer, record: Rollout, speed: float, title: str) -> Viewer:
    """Play a record with the planned force of each sole at its planned centre of pressure."""
    period = record.time[1] - record.time[0]
    rows = range(0, len(record), max(1, round(speed / (_FRAME_RATE * period))))
    pictures = []
    for i in rows:
        state = record.state(i)
        picture = view.painter.picture(state)
        for contact, wrench in zip(record.contacts, record.planned[i].reshape(-1, 6), strict=True):
            f, tau = wrench[:3], wrench[3:]
            if f[2] <= MIN_FORCE:
                continue
            ahead = np.array([-tau[1], tau[0], 0.0]) / f[2]
            if np.linalg.norm(ahead) < _MAX_DISTANCE:
                at = state.point(contact.name) + ahead
                picture[f"planned/{contact.name}"] = shapes.arrow(
                    at, view.scale * f, PLANNED, view.painter.size, halo=True
                )
        pictures.append(picture)
    view.play_pictures(record.time[list(rows)].tolist(), pictures, speed=speed, title=title)
    return view


def _violated_limits(limits: WrenchSet, wrench: Array) -> str:
    """Return the kinds of limits that a wrench violates."""
    broken = limits.face_matrix[limits.face_matrix @ wrench > _LIMIT_TOLERANCE * wrench[2]]
    return ", ".join(dict.fromkeys(limit_kinds(broken)))


def limit_kinds(rows: npt.ArrayLike) -> list[str]:
    """Return the motion that each constraint on the wrench of a level sole prevents."""
    R = np.asarray(rows)
    R = R / np.abs(R).max(axis=1, keepdims=True)
    moment = np.abs(R[:, 3:5]).max(axis=1) > _ZERO_TOLERANCE
    twist = np.abs(R[:, 5]) > _ZERO_TOLERANCE
    return [
        "twisting" if t else "tipping" if m else "sliding"
        for m, t in zip(moment, twist, strict=True)
    ]


def _slice(limits: WrenchSet, wrench: Array, *lines: str) -> str:
    """Draw the centres of pressure along x and the twists that this force allows, as SVG."""
    half, most = 150.0, 60.0  # mm, N·m: the ends of the axes
    sx, sy = WIDE / (2 * half), HIGH / (2 * most)
    x = np.linspace(-half, half, _COLUMNS)
    many = np.tile(wrench, (len(x), 1))
    many[:, 4], many[:, 5] = -1e-3 * x * wrench[2], 0.0
    # each constraint is by_twist · twist ≤ room
    room, by_twist = -many @ limits.face_matrix.T, limits.face_matrix[:, 5]
    up = by_twist > _ZERO_TOLERANCE
    down = by_twist < -_ZERO_TOLERANCE
    free = np.abs(by_twist) <= _ZERO_TOLERANCE
    highest = (room[:, up] / by_twist[up]).min(axis=1)
    lowest = (room[:, down] / by_twist[down]).max(axis=1)
    there = (highest >= lowest) & np.all(room[:, free] >= -_ZERO_TOLERANCE * wrench[2], axis=1)
    across = np.concatenate([x[there], x[there][::-1]])
    twist = np.concatenate([highest[there], lowest[there][::-1]])
    corners = np.column_stack([WIDE / 2 + sx * across, HIGH / 2 - sy * twist])
    cross = f"M0 {HIGH / 2}H{WIDE}M{WIDE / 2} 0V{HIGH}"
    drawn = svg.element("path", d=cross, stroke=hex_code(GREYS[2]), stroke_width=1)
    drawn += _polygon(corners, 0.35) if len(corners) else ""
    at = -1e3 * wrench[4] / wrench[2], wrench[5]
    at_pixel = WIDE / 2 + sx * at[0], HIGH / 2 - sy * at[1]
    drawn += svg.circle(at_pixel, 6, fill="currentColor")
    axes = (
        f"across: centre of pressure, ±{half:.0f} mm",
        f"up: twist, ±{most:.0f} N·m; filled: allowed",
    )
    return svg.captioned(drawn, DRAWING_SIZE, 20, *axes, *lines)


def plot_walk(record: Rollout, steps: Iterable[StepPlan]) -> Axes:
    """Plot a walk from above: centre of mass, centre of pressure and the soles on the ground."""
    figure, axis = plt.subplots(figsize=(8.5, 3.0), layout="constrained")
    for step in steps:
        state = record.state(min(int(np.searchsorted(record.time, step.time)), len(record) - 1))
        for name in step.stance:
            corners = record.contacts.only(name).positions(state)[:, :2]
            label = "_" if axis.patches else "soles"
            sole = Polygon(corners, color=hex_code(GREYS[2]), alpha=0.3, linewidth=0, label=label)
            axis.add_patch(sole)
    x, y = centre_of_pressure_path(record).T
    axis.plot(x, y, color=hex_code(GREYS[1]), linewidth=1.5, label="centre of pressure")
    com = record.com
    axis.plot(com[:, 0], com[:, 1], "--", color=hex_code(GREYS[0]), linewidth=2.5, label="x_c")
    axis.set(xlabel="forwards [m]", ylabel="to the left [m]", aspect="equal")
    axis.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize="small")
    plt.close(figure)
    return axis


def _to_pixels(places: Array) -> Array:
    return svg.from_above(places, (WIDE / 2, HIGH / 2), WIDE / 0.44)


def _cross(at: Array, half: float) -> str:
    x, y = at
    path = (
        f"M{x - half:.1f} {y - half:.1f}l{2 * half} {2 * half}m{-2 * half} 0l{2 * half} {-2 * half}"
    )
    return svg.element("path", d=path, stroke="currentColor", stroke_width="2.5")


def _polygon(corners: Array, opacity: float = 0.12) -> str:
    grey, opaque = hex_code(GREYS[1]), {"fill_opacity": f"{opacity}"}
    return svg.polygon(corners, fill=grey, stroke=grey, stroke_width=2, **opaque)
