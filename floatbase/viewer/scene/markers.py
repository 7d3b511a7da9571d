"""Markers: wrenches, pushes, support polygons, constraint multipliers and frames."""

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
from floatbase.viewer.scene.ground import LEVEL, DrawnGround
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

# kinds of the constraints whose multipliers are shown
_CONE_CONSTRAINTS = ("friction", "normal force", "largest normal force")
_LEAST_SHOWN = 0.01  # fraction of the largest multiplier; labels of smaller ones would cover others
OUTLINE = 0.6  # width of the outline of a push, as a fraction of the radius of its shaft


def wrench(
    position: npt.ArrayLike,
    force: npt.ArrayLike,
    moment: npt.ArrayLike,
    size: float,
    colour: RGB = COM,
) -> Picture:
    """Draw a force as a straight arrow and a moment as a curled arrow around its axis.

    The moment is drawn on top of the robot, which would otherwise hide it. A zero force or moment
    is left out. The force is times the picture's scale [m], and the moment is also divided by
    `size`, the size of the robot [m]: the radius of the curled arrow is the length of a force that
    has this moment at a lever arm of `size`.
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
    """Draw an arrow that turns around an axis by the right-hand rule.

    The length of the moment is the radius [m]. With `on_top`, nothing in front hides the arrow.
    """
    moment, radius = vector_and_length("a curled arrow", moment)
    rotation = geometry.rotation_with_z_axis(moment / radius)
    return Item(_unit_curled_arrow(colour, on_top), transform(position, rotation, radius))


def push(
    position: npt.ArrayLike,
    vector: npt.ArrayLike,
    size: float,
    colour: RGB = PUSH,
    outline: RGB = (1.0, 1.0, 1.0),
) -> Item:
    """Draw a push as an outlined arrow on top of the robot.

    The arrow ends at `position`, where the push acts, and `vector` points from its tail to its tip,
    both in the world frame [m]. `size`, the size of the robot [m], determines the width.
    """
    vector, length = vector_and_length("an arrow", vector)
    width = arrow_width(length, size)
    rotation = geometry.rotation_with_z_axis(vector / length)
    shape = _outlined_arrow(colour, outline, max(round(2.0 * length / width), 1))
    start = np.asarray(position) - vector
    return Item(shape, transform(start, rotation, (width / 2, width / 2, length)))


def support_region(
    positions: npt.ArrayLike, height_above_ground: float, ground: DrawnGround = LEVEL
) -> Picture:
    """Draw the support polygon: the convex hull of the contact points, seen from above.

    Nothing is drawn for fewer than three points, or for points on a line. The corners lie at a
    distance `height_above_ground` [m] from the ground.
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
    """Label the facets of active friction constraints with their multipliers.

    Multipliers have two significant digits. The label of a normal-force limit, which has no facet,
    is on the cone's axis at the top. Multipliers below a hundredth of the largest one have no
    label. height: that of the drawn cones [m]. size: size of the robot [m].
    """
    qp, found = solution.qp, solution.multipliers
    forces = qp.blocks.get("forces", slice(0, 0))
    labels = [
        (name, row)
        for name, row in zip(qp.inequality_names, qp.G[:, forces], strict=True)
        if name in found and isinstance(name, ConstraintLabel) and name.kind in _CONE_CONSTRAINTS
    ]
    owners = {name.owner for name, _ in labels}
    if forces.stop - forces.start != contacts.k or not owners <= set(contacts.point_names):
        raise InputError(
            "The solution is not for these contacts. Pass contacts and solution of the same "
            "command."
        )
    picture: Picture = {}
    least = _LEAST_SHOWN * max((found[name] for name, _ in labels), default=0.0)
    for name, row in labels:
        if found[name] < least:
            continue
        i = contacts.point_names.index(name.owner)
        normal, own = contacts.normals[i], row[3 * i : 3 * i + 3]
        to_facet = 1.5 * normal
        if name.kind == "friction":
            # the tangent that the facet faces, times the row's length
            across = own - normal * (normal @ own)
            to_facet = normal - across * (normal @ own) / (across @ across)
        # the centroid of a triangle with its tip at the point
        at = np.asarray(positions)[i] + height / 1.5 * to_facet
        text = f"{float(f'{found[name]:.2g}'):g}"
        picture[f"/{name.replace('/', '_')}"] = label(at, text, 0.042 * size)
    return picture


def frame_axes(pose: npt.ArrayLike, length: float, name: str = "") -> Picture:
    """Draw the axes of a frame on top of the robot: x vermilion, y green, z blue.

    pose: homogeneous transform of the frame in the world, shape (4, 4).
    """
    matrix = np.array(as_array("pose of a frame", pose, (4, 4)))
    matrix[:3, :3] *= as_positive("length of a frame's axes", length, "m")
    picture = {"/axes": Item(_axes(), matrix)}
    if name:
        picture["/name"] = label(matrix[:3, 3] + [0.0, 0.0, 0.35 * length], name, 0.3 * length)
    return picture


@lru_cache(maxsize=64)
def _unit_curled_arrow(colour: RGB, on_top: bool) -> Shape:
    """Return three quarters of a ring of radius 1 around z with three heads."""
    end = 1.5 * np.pi - 0.3
    ring = geometry.torus_arc(1.0, 0.055, 0.0, end)
    heads = [_arrow_head(angle) for angle in (end / 3.0, 2.0 * end / 3.0, end)]
    return threejs.mesh(*geometry.merged([ring, *heads]), colour, on_top=on_top)


def _arrow_head(angle: float) -> geometry.Mesh:
    """Return the head of an arrow along the ring of radius 1 around z."""
    head, faces = geometry.surface_of_revolution([(0.0, 0.0), (0.17, 0.0), (0.0, 0.42)])
    at = np.array([np.cos(angle), np.sin(angle), 0.0])
    return head @ geometry.rotation_with_z_axis([-at[1], at[0], 0.0]).T + at, faces


@lru_cache(maxsize=64)
def _outlined_arrow(colour: RGB, outline: RGB, slenderness: int) -> Shape:
    """Return the unit arrow, drawn over a wider one."""
    (_, _), (shaft, _), (_, neck), (head, _), (_, tip) = ARROW
    opening = head / (slenderness * (tip - neck))  # of the head, as it is drawn
    back = OUTLINE / slenderness
    top = tip + OUTLINE * math.hypot(1.0, 1.0 / opening) / slenderness
    wide, low = shaft + OUTLINE, neck - back
    rim = opening * slenderness * (top - low)
    around = geometry.surface_of_revolution(
        [(0.0, -back), (wide, -back), (wide, low), (rim, low), (0.0, top)]
    )
    parts = [around, geometry.surface_of_revolution(ARROW)]
    colours = [
        geometry.vertex_colours(vertices, c)
        for c, (vertices, _) in zip((outline, colour), parts, strict=True)
    ]
    return threejs.mesh(*geometry.merged(parts), colours=np.vstack(colours), lit=False, on_top=True)


@lru_cache(maxsize=1)
def _axes() -> Shape:
    """Return three rods of length 1."""
    rods = [geometry.cylinder(np.zeros(3), axis, 0.035) for axis in np.eye(3)]
    colours = [
        geometry.vertex_colours(vertices, colour)
        for colour, (vertices, _) in zip((X_AXIS, Y_AXIS, Z_AXIS), rods, strict=True)
    ]
    return threejs.mesh(*geometry.merged(rods), colours=np.vstack(colours), on_top=True)
