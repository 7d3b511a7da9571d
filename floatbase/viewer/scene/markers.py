"""Marks in the picture: wrenches, pushes, support regions, prices of friction, frames."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull, QhullError

from floatbase._validation import as_array, as_positive
from floatbase.dynamics import Contacts
from floatbase.errors import InputError
from floatbase.qp import ConstraintLabel, Solution
from floatbase.viewer.scene import geometry, threejs
from floatbase.viewer.scene.colours import CALM, COM, PUSH, RGB, X_AXIS, Y_AXIS, Z_AXIS
from floatbase.viewer.scene.ground import LEVEL, Plane, Planes
from floatbase.viewer.scene.shapes import (
    Item,
    Picture,
    arrow,
    arrow_width,
    flat_polygon,
    label,
    transform,
    vector_and_length,
)
from floatbase.viewer.scene.threejs import Shape
from floatbase.viewer.scene.unit_shapes import ARROW

_CONE_CONSTRAINTS = (
    "friction",
    "normal force",
    "largest normal force",
)  # kinds of the rows whose prices are shown
_LEAST_SHOWN = 1e-3  # part of the dearest row's price below which a label would only hide others
OUTLINE = 0.6  # width of the outline of a push, over the radius of its shaft


def wrench(
    position: npt.ArrayLike,
    force: npt.ArrayLike,
    moment: npt.ArrayLike,
    size: float,
    colour: RGB = COM,
) -> Picture:
    """A force as a straight arrow, and a moment as a curled arrow around its axis, drawn over the
    robot, in which it would hide. Either may be zero, and is left out.

    position: (3,), m, world, where both begin.
    force: (3,), m, world: the force times the picture's scale (m/N).
    moment: (3,), m, world: the moment times the scale, over `size`. So the radius of the curled
        arrow is the length of a force that has this moment at a lever of `size` m.
    size: size of the robot, m.
    colour: RGB of both.
    """
    picture: Picture = {}
    if np.linalg.norm(force) > 1e-6:
        picture["/force"] = arrow(position, force, colour, size)
    if np.linalg.norm(moment) > 1e-6:
        picture["/moment"] = curled_arrow(position, moment, colour, on_top=True)
    return picture


def curled_arrow(
    position: npt.ArrayLike, moment: npt.ArrayLike, colour: RGB = COM, on_top: bool = False
) -> Item:
    """An arrow that turns around an axis by the right-hand rule.

    position: (3,), m, world, its centre.
    moment: (3,), m, world: along the axis, as long as the radius.
    colour: RGB.
    on_top: whether it is drawn over what is in front of it.
    """
    moment, radius = vector_and_length("a curled arrow", moment)
    return Item(
        _unit_curled_arrow(colour, on_top),
        transform(position, geometry.rotation_with_z_axis(moment / radius), radius),
    )


def push(
    position: npt.ArrayLike,
    vector: npt.ArrayLike,
    size: float,
    colour: RGB = PUSH,
    outline: RGB = (1.0, 1.0, 1.0),
) -> Item:
    """A push: an arrow that ends where the push acts. It is drawn over the robot, with an outline
    that sets it off.

    position: (3,), m, world, where the push acts.
    vector: (3,), m, world, from the arrow's start to its end.
    size: size of the robot, m, from which the arrow has its width.
    colour, outline: RGB of the arrow and of its outline.
    """
    vector, length = vector_and_length("an arrow", vector)
    width = arrow_width(length, size)
    rotation = geometry.rotation_with_z_axis(vector / length)
    shape = _outlined_arrow(colour, outline, max(round(2.0 * length / width), 1))
    return Item(
        shape, transform(np.asarray(position) - vector, rotation, (width / 2, width / 2, length))
    )


def support_region(
    positions: npt.ArrayLike, height_above_ground: float, ground: Plane | Planes = LEVEL
) -> Picture:
    """The convex hull of contact points, seen from above; nothing for fewer than three points, or
    for points on a line.

    positions: (n, 3), m, world. height_above_ground: m, how far above the ground it is drawn.
        ground: where its corners lie.
    """
    points = np.asarray(positions, dtype=np.float64)[:, :2]
    try:
        corners = points[ConvexHull(points).vertices] if len(points) >= 3 else points[:0]
    except QhullError:
        corners = points[:0]
    if not len(corners):
        return {}
    flat = np.round([[*corner, ground.height(corner)] for corner in corners], 3)
    return {"": Item(flat_polygon(flat, CALM, 0.22), transform([0.0, 0.0, height_above_ground]))}


def multiplier_labels(
    positions: npt.ArrayLike, contacts: Contacts, solution: Solution, height: float, size: float
) -> Picture:
    """The multiplier of each active friction and normal-force row, two significant digits, at the
    middle of its facet.

    A normal-force row has no facet: its label stands on the cone's axis, at the top. Prices below a
    thousandth of the dearest one shown get no label.
    positions: (n, 3), m, world, of the n contact points.
    contacts: the contacts that the problem was made for.
    solution: of a `QP` with a block of forces; its rows say where their facets are.
    height: of the drawn cones, m. size: size of the robot, m, from which letters have their height.
    Raises `InputError` where the problem has no forces at these contacts.
    """
    qp, found = solution.qp, solution.multipliers
    forces = qp.blocks.get("forces", slice(0, 0))
    rows = [
        row for row in zip(qp.inequality_names, qp.G[:, forces], strict=True) if row[0] in found
    ]
    labels = [
        (name, row)
        for name, row in rows
        if isinstance(name, ConstraintLabel) and name.kind in _CONE_CONSTRAINTS
    ]
    if forces.stop - forces.start != contacts.k or not {name.owner for name, _ in labels} <= set(
        contacts.point_names
    ):
        raise InputError(
            "the solution is not one of these contacts: give contacts and solution of the same "
            "command."
        )
    picture: Picture = {}
    least = _LEAST_SHOWN * max((found[name] for name, _ in labels), default=0.0)
    for name, row in labels:
        if found[name] < least:
            continue
        i = contacts.point_names.index(name.owner)
        normal, own = contacts.normals[i], row[3 * i : 3 * i + 3]
        across = own - normal * (
            normal @ own
        )  # the tangent that the facet faces, times the row's length
        to_facet = (
            normal - across * (normal @ own) / (across @ across)
            if name.kind == "friction"
            else 1.5 * normal
        )
        at = (
            np.asarray(positions)[i] + height / 1.5 * to_facet
        )  # the centroid of a triangle with its tip in the point
        picture[f"/{name.replace('/', '_')}"] = label(
            at, f"{float(f'{found[name]:.2g}'):g}", 0.05 * size
        )
    return picture


def frame_axes(pose: npt.ArrayLike, length: float, name: str = "") -> Picture:
    """The axes of a frame as three rods, x vermilion, y green, z blue, drawn over the robot.

    pose: (4, 4), homogeneous, world. length: of the rods, m. name: a label; without one there is
        none.
    """
    matrix = np.array(as_array("pose of a frame", pose, (4, 4)))
    matrix[:3, :3] *= as_positive("length of a frame's axes", length, "m")
    picture = {"/axes": Item(_axes(), matrix)}
    if name:
        picture["/name"] = label(matrix[:3, 3] + [0.0, 0.0, 0.35 * length], name, 0.3 * length)
    return picture


@lru_cache(maxsize=64)
def _unit_curled_arrow(colour: RGB, on_top: bool) -> Shape:
    """Three quarters of a ring of radius 1 around z, with a head at its end and two before: one is
    seen from anywhere.
    """
    end = 1.5 * np.pi - 0.3
    ring = geometry.torus_arc(1.0, 0.055, 0.0, end)
    heads = [_arrow_head(angle) for angle in (end / 3.0, 2.0 * end / 3.0, end)]
    return threejs.mesh(*geometry.merged([ring, *heads]), colour, on_top=on_top)


def _arrow_head(angle: float) -> geometry.Mesh:
    """A head of an arrow on the ring of radius 1 around z, along it."""
    head, faces = geometry.surface_of_revolution([(0.0, 0.0), (0.17, 0.0), (0.0, 0.42)])
    at = np.array([np.cos(angle), np.sin(angle), 0.0])
    return head @ geometry.rotation_with_z_axis([-at[1], at[0], 0.0]).T + at, faces


@lru_cache(maxsize=64)
def _outlined_arrow(colour: RGB, outline: RGB, slenderness: int) -> Shape:
    """The unit arrow, drawn over a wider one. slenderness: its length over the radius of its shaft.

    A mesh on top is painted in the order of its faces, so the outline comes first.
    """
    (_, _), (shaft, _), (_, neck), (head, _), (_, tip) = ARROW
    opening = head / (slenderness * (tip - neck))  # of the head, as it is drawn
    back = OUTLINE / slenderness
    top = tip + OUTLINE * math.hypot(1.0, 1.0 / opening) / slenderness
    wide, low = shaft + OUTLINE, neck - back
    around = geometry.surface_of_revolution(
        [
            (0.0, -back),
            (wide, -back),
            (wide, low),
            (opening * slenderness * (top - low), low),
            (0.0, top),
        ]
    )
    parts = [around, geometry.surface_of_revolution(ARROW)]
    colours = [
        np.tile(np.round(255 * np.array(c)), (len(p), 1))
        for c, (p, _) in zip((outline, colour), parts, strict=True)
    ]
    return threejs.mesh(*geometry.merged(parts), colours=np.vstack(colours), lit=False, on_top=True)


@lru_cache(maxsize=1)
def _axes() -> Shape:
    """Three rods of length 1."""
    rods = [geometry.cylinder(np.zeros(3), axis, 0.035) for axis in np.eye(3)]
    colours = [
        np.tile(np.round(255 * np.array(colour)), (len(vertices), 1))
        for colour, (vertices, _) in zip((X_AXIS, Y_AXIS, Z_AXIS), rods, strict=True)
    ]
    return threejs.mesh(*geometry.merged(rods), colours=np.vstack(colours), on_top=True)
