"""Force arrows, friction cones, contact patches, the centre of mass, the ground, labels.

Each function returns items. An item is a shape of unit size, and a matrix that scales and places
it. So a force that changes costs one matrix, and the matrix tells how long an arrow is and how wide
a cone opens.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array, as_array, as_positive, read_only
from floatbase.errors import InputError
from floatbase.friction import FrictionPolyhedron, tangents
from floatbase.viewer.scene import geometry, threejs, unit_shapes
from floatbase.viewer.scene.colours import (
    COM,
    CONE,
    CONE_ALPHA,
    PATCH,
    RGB,
    RGBA,
    with_alpha,
)
from floatbase.viewer.scene.threejs import Shape

# width of an arrow's shaft over its length, where the length is `ARROW_LENGTH`
ARROW_SLENDERNESS = 0.085
ARROW_LENGTH = 0.2  # m


class Item(NamedTuple):
    """One object in a picture.

    shape: what it looks like. matrix: (4, 4), its pose and scale in the world. colour: RGBA if it
        may change, else None.
    """

    shape: Shape
    matrix: Array
    colour: RGBA | None = None


_IDENTITY = read_only(np.eye(3))

# path -> item. No path may lie below another one, because a matrix moves everything below its path.
Picture = dict[str, Item]


def with_normal_paths(picture: Mapping[str, Item]) -> Picture:
    """The picture with every path in one spelling: parts with a slash between them, as "com/ball"
    is for "/com//ball".

    Raises `InputError` for a path without a name, because its matrix would move the whole picture.
    """
    return {_normal_path(path): item for path, item in picture.items()}


@lru_cache(maxsize=4096)  # a picture has some fifty paths, the same ones every time
def _normal_path(path: str) -> str:
    normal = "/".join(part for part in path.split("/") if part) if isinstance(path, str) else ""
    if not normal:
        raise InputError(
            f"the path {path!r} in a picture has no name; give it one, as prefixed('a name', "
            f"items) does."
        )
    return normal


def prefixed(path: str, items: Mapping[str, Item]) -> Picture:
    """The same items, each path prefixed by `path`."""
    return {path + name: item for name, item in items.items()}


def path_part(name: str) -> str:
    """The name as one part of a path: without slashes."""
    return name.replace("/", "_")


def transform(
    position: npt.ArrayLike, rotation: npt.ArrayLike | None = None, scale: npt.ArrayLike = 1.0
) -> Array:
    """The matrix, (4, 4), that scales a shape, then turns it, then places it.

    position: (3,), m, world. rotation: (3, 3); None for the identity. scale: one number, or (3,)
        along the shape's own axes.
    Raises `InputError` for a position of another shape, and for numbers that are not finite.
    """
    matrix = np.zeros((4, 4))
    matrix[:3, :3] = (_IDENTITY if rotation is None else np.asarray(rotation)) * np.asarray(scale)
    matrix[3, 3] = 1.0
    try:
        matrix[:3, 3] = position
    except (TypeError, ValueError):
        as_array("position in the picture", position, (3,), "m")
        raise
    if not math.isfinite(matrix.sum()):
        as_array("position in the picture", position, (3,), "m")
        raise InputError(
            f"axes or size of a shape at {position!r} are not finite numbers: "
            f"{matrix[:3, :3].tolist()}."
        )
    return matrix


def vector_and_length(what: str, vector: npt.ArrayLike) -> tuple[Array, float]:
    """The vector, shape (3,), m, and its length. what: its name, for the error.

    Raises `InputError` for a vector without length: it has no direction.
    """
    array = np.asarray(vector, dtype=np.float64)
    length = math.sqrt(array @ array) if array.shape == (3,) else 0.0
    if not 1e-12 < length < math.inf:
        as_array(f"the vector of {what}", vector, (3,), "m")
        raise InputError(f"{what} of no length points nowhere: leave it out of the picture.")
    return array, length


def arrow(
    start: npt.ArrayLike, vector: npt.ArrayLike, colour: RGB, size: float = 1.0, halo: bool = False
) -> Item:
    """An arrow.

    start: (3,), m, world.
    vector: (3,), m, world, from its start to its tip.
    colour: RGB.
    size: size of the robot, m. The width of the shaft grows with the square roots of `size` and of
        the arrow's length.
    halo: whether it is wider and translucent, so that it is seen around another arrow at the same
        place.
    """
    vector, length = vector_and_length("an arrow", vector)
    width = arrow_width(length, size) * (1.8 if halo else 1.0)
    rotation = geometry.rotation_with_z_axis(vector / length)
    return Item(
        unit_shapes.arrow(colour, 0.6 if halo else 1.0),
        transform(start, rotation, (width / 2, width / 2, length)),
    )


def arrow_width(length: float, size: float) -> float:
    """Width of an arrow's shaft, m. length: of the arrow, m. size: of the robot, m."""
    return min(ARROW_SLENDERNESS * math.sqrt(length * ARROW_LENGTH * size), 0.35 * length)


def friction_cone(
    position: npt.ArrayLike, normal: npt.ArrayLike, mu: float, height: float, status: str
) -> Item:
    """(28) The cone ‖f_tangent‖ ≤ μ f_normal.

    position: (3,), m, world, its tip.
    normal: (3,), unit, world, out of the ground.
    mu: friction coefficient μ.
    height: m: the largest normal force that it shows, times the picture's scale.
    status: "idle" (no force), "inside", "active" or "outside", which gives the colour.
    """
    as_positive("mu of a friction cone", mu)
    as_positive("height of a friction cone", height, "m")
    matrix = transform(position, _contact_axes(normal), (mu * height, mu * height, height))
    return Item(unit_shapes.cone(), matrix, cone_colour(status))


def cone_colour(status: str) -> RGBA:
    """The colour of a friction cone with a status, as `friction_cone` has it."""
    return with_alpha(CONE[status], CONE_ALPHA[status])


def friction_polyhedron(
    position: npt.ArrayLike,
    polyhedron: FrictionPolyhedron,
    height: float,
    status: str,
    active: npt.ArrayLike = (),
) -> Picture:
    """The friction polyhedron that approximates a cone.

    position: (3,), m, world, its tip.
    polyhedron: the polyhedron.
    height, status: as for `friction_cone`.
    active: numbers of the facets that have the colour of a reached limit.
    """
    as_positive("height of a friction polyhedron", height, "m")
    matrix = transform(position, _contact_axes(polyhedron.normal), height)
    key = (
        float(polyhedron.mu),
        int(polyhedron.facets),
        bool(polyhedron.inner_approximation),
        float(polyhedron.facet_rotation),
    )
    picture = {"/sides": Item(unit_shapes.polyhedron(*key), matrix, cone_colour(status))}
    for facet in np.atleast_1d(np.asarray(active, dtype=int)):
        picture[f"/facet {facet}"] = Item(unit_shapes.facet(*key, int(facet)), matrix)
    return picture


def cone_rim(
    position: npt.ArrayLike, polyhedron: FrictionPolyhedron, height: float, is_round: bool = False
) -> Item:
    """A dark rim around the mouth of a cone, so that a force outside it is told by more than a hue.

    position, polyhedron, height: as for `friction_polyhedron`.
    is_round: whether it is the rim of the round cone with the polyhedron's normal and friction.
    """
    frame = _contact_axes(polyhedron.normal)
    if is_round:
        return Item(
            unit_shapes.round_rim(),
            transform(position, frame, (polyhedron.mu * height, polyhedron.mu * height, height)),
        )
    key = (
        float(polyhedron.mu),
        int(polyhedron.facets),
        bool(polyhedron.inner_approximation),
        float(polyhedron.facet_rotation),
    )
    return Item(unit_shapes.polygonal_rim(*key), transform(position, frame, height))


def contact_patch(position: npt.ArrayLike, normal: npt.ArrayLike, radius: float) -> Item:
    """A disc at a contact. position: (3,), m, world. normal: (3,), unit, world. radius: m."""
    as_positive("radius of a contact patch", radius, "m")
    return Item(
        unit_shapes.disc(PATCH),
        transform(position, _contact_axes(normal), (radius, radius, 0.12 * radius)),
    )


def centre_of_mass(position: npt.ArrayLike, ground: float, size: float) -> Picture:
    """A ball at the centre of mass, its projection on the ground, and the line between.

    position: (3,), m, world. ground: height of the ground below it, m. size: of the robot, m.
    """
    x, y, z = np.asarray(position, dtype=np.float64)
    radius = 0.04 * size
    foot = np.array([x, y, ground])
    return {
        "/ball": Item(unit_shapes.sphere(COM, True), transform([x, y, z], scale=radius)),
        "/line": Item(
            unit_shapes.cylinder(COM),
            transform(foot, scale=(0.1 * radius, 0.1 * radius, max(z - ground, 1e-4))),
        ),
        "/projection": Item(
            unit_shapes.disc(COM),
            transform(foot, scale=(0.8 * radius, 0.8 * radius, 0.12 * radius)),
        ),
    }


def label(
    position: npt.ArrayLike,
    text: str,
    height: float,
    colour: RGB = (0.13, 0.13, 0.13),
    plate: bool = True,
) -> Item:
    """Text that always faces the reader.

    position: (3,), m, world, its centre.
    text: the text; braces make a subscript: "f{c}".
    height: height of its letters, m.
    colour: RGB of the text.
    plate: whether a plate lies behind it.
    """
    return Item(
        unit_shapes.label(
            text, as_positive("height of a label's letters", height, "m"), plate, colour
        ),
        transform(position),
    )


def scale_bar(
    position: npt.ArrayLike, force: float, length: float, size: float, colour: RGB
) -> Picture:
    """A bar along x which shows how long a force is drawn.

    position: (3,), m, world, where it starts.
    force: the force on its label, N.
    length: how long this force is drawn, m.
    size: of the robot, m.
    colour: RGB.
    """
    start = np.asarray(position, dtype=np.float64)
    along = geometry.rotation_with_z_axis([1.0, 0.0, 0.0])
    thick = 0.012 * size
    text_at = start + np.array(
        [length / 2, 0.17 * size, 0.03 * size]
    )  # beside it: from its end the bar is short
    picture = {
        "/bar": Item(
            unit_shapes.cylinder(colour), transform(start, along, (thick / 2, thick / 2, length))
        )
    }
    for end, x in (("/start", 0.0), ("/end", length)):
        where = start + np.array([x, 0.0, 0.0])
        picture[end] = Item(
            unit_shapes.cylinder(colour),
            transform(where, along, (2.2 * thick, 2.2 * thick, thick / 2)),
        )
    words = unit_shapes.label(
        f"{force:g} N", 0.055 * size, True, colour, False
    )  # behind the robot where the bar is
    return picture | {"/label": Item(words, transform(text_at))}


def rod(
    start: npt.ArrayLike, rotation: npt.ArrayLike, length: float, radius: float, colour: RGB
) -> Item:
    """A rod.

    start: (3,), m, world.
    rotation: (3, 3); the rod lies along its z axis.
    length, radius: m.
    colour: RGB.
    """
    as_positive("length of a rod", length, "m")
    return Item(unit_shapes.cylinder(colour), transform(start, rotation, (radius, radius, length)))


def flat_polygon(corners: npt.ArrayLike, colour: RGB, opacity: float) -> Shape:
    """A flat convex polygon, seen from both sides. corners: (n, 3), m. colour: RGB. opacity: from 0
    to 1.
    """
    points = as_array("corners of a polygon", corners, (None, 3), "m")
    if len(points) < 3:
        raise InputError(f"a polygon needs three corners or more, not {len(points)}.")
    return unit_shapes.polygon(tuple(tuple(corner) for corner in points.tolist()), colour, opacity)


def invisible_point(position: npt.ArrayLike) -> Item:
    """A place without anything to see, for the camera to follow. position: (3,), m, world."""
    return Item(unit_shapes.invisible_point(), transform(position))


def ground_grid(colour: RGB, step: float = 0.25, half: float = 5.0) -> Item:
    """A square grid of lines on the plane z = 0. colour: RGB. step: m between lines. half: half its
    side, m.
    """
    return Item(_grid(colour, step, half), np.eye(4))


def grid_lines(step: float = 0.25, half: float = 5.0) -> Array:
    """Line segments of `ground_grid`, two ends each, shape (2 n, 3), m. step, half: as there."""
    at = np.arange(-half, half + step / 2, step)
    # each line in pieces of one step: software renderers lose lines that begin far behind the
    # camera
    start, line = (grid.ravel() for grid in np.meshgrid(at[:-1], at))
    along_x = np.stack([start, line, start + step, line], axis=1).reshape(-1, 2)
    points = np.vstack([along_x, along_x[:, ::-1]])
    return np.hstack([points, np.zeros((len(points), 1))])


def _contact_axes(normal: npt.ArrayLike) -> Array:
    """Axes of a contact, (3, 3): the two tangents that the friction rows use, and the normal."""
    x, y, z = np.asarray(normal, dtype=np.float64).tolist()
    return _contact_axes_of(x, y, z)


@lru_cache(maxsize=256)
def _contact_axes_of(x: float, y: float, z: float) -> Array:
    """`_contact_axes` of a normal. There are few normals, so each is computed once."""
    t1, t2 = tangents([x, y, z])
    return read_only(np.stack([t1, t2, np.cross(t1, t2)], axis=1))


@lru_cache(maxsize=8)
def _grid(colour: RGB, step: float, half: float) -> Shape:
    return threejs.lines(grid_lines(step, half), colour)
