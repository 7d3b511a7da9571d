"""Force arrows, friction cones, contact patches, the centre of mass, the ground, labels.

Each function returns items. An item is a shape of unit size and a matrix that scales and places it.
A changed force therefore costs one matrix, and the matrix gives the length of an arrow and the
opening of a cone.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array, as_array, as_instance, as_positive, as_string, read_only
from floatbase.errors import InputError
from floatbase.friction import FrictionPolyhedron, tangents
from floatbase.viewer.scene import geometry, threejs, unit_shapes
from floatbase.viewer.scene.colours import COM, CONE, CONE_ALPHA, PATCH, RGB, RGBA, with_alpha
from floatbase.viewer.scene.threejs import Shape

# width of an arrow's shaft divided by its length, for an arrow of length `ARROW_LENGTH`
ARROW_SLENDERNESS = 0.085
ARROW_LENGTH = 0.2  # m


class Item(NamedTuple):
    """One object in a picture.

    Parameters
    ----------
    shape : Shape
        Shape of the object.
    matrix : ndarray, shape (4, 4)
        Pose and scale in the world frame.
    colour : tuple of float or None
        RGBA if the colour may change, else None.
    """

    shape: Shape
    matrix: Array
    colour: RGBA | None = None


_IDENTITY = read_only(np.eye(3))

# names that every JavaScript object has: the page would take its own function for an object of the
# picture, so a link with such a name would not be drawn
_JAVASCRIPT_NAMES = (
    "__defineGetter__", "__defineSetter__", "__lookupGetter__", "__lookupSetter__", "__proto__",
    "constructor", "hasOwnProperty", "isPrototypeOf", "propertyIsEnumerable", "toLocaleString",
    "toString", "valueOf",
)  # fmt: skip

# path -> item. No path may lie below another one, because a matrix moves everything below its path.
Picture = dict[str, Item]


def with_normal_paths(picture: Picture) -> Picture:
    """Return the picture with normalized paths: "com/ball" instead of "/com//ball".

    A path without a name is an `InputError`, because its matrix would move the whole picture.
    """
    normal = {}
    for path, item in as_instance("picture", picture, dict).items():
        normal[_normal_path(path)] = as_instance("an item of the picture", item, Item)
    return normal


@lru_cache(maxsize=4096)  # a picture has some fifty paths, which stay the same
def _normal_path(path: str) -> str:
    """Return a path without empty parts and names of JavaScript; raise `InputError` if empty."""
    parts = path.split("/") if isinstance(path, str) else []
    normal = "/".join(f"{part}'" if part in _JAVASCRIPT_NAMES else part for part in parts if part)
    if not normal:
        raise InputError(
            f"The path {path!r} in a picture has no name. Add one, as in prefixed('name', items)."
        )
    return normal


def prefixed(path: str, items: Picture) -> Picture:
    """Put items, path -> item, below a path."""
    as_string("path", path)
    return {path + name: item for name, item in as_instance("items", items, dict).items()}


def path_part(name: str) -> str:
    """Return a name as one part of a path, with underscores instead of slashes."""
    return name.replace("/", "_")


def transform(
    position: npt.ArrayLike, rotation: npt.ArrayLike | None = None, scale: npt.ArrayLike = 1.0
) -> Array:
    """Return the matrix, (4, 4), that scales a shape, then rotates it, then places it [m].

    The scale is along the shape's own axes.
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
            f"The rotation or scale of a shape at {position!r} is not finite: "
            f"{matrix[:3, :3].tolist()}."
        )
    return matrix


def vector_and_length(what: str, vector: npt.ArrayLike) -> tuple[Array, float]:
    """Return a vector, shape (3,) [m], and its length; raise `InputError` if it is zero."""
    array = np.asarray(vector, dtype=np.float64)
    length = math.sqrt(array @ array) if array.shape == (3,) else 0.0
    if not 1e-12 < length < math.inf:
        as_array(f"the vector of {what}", vector, (3,), "m")
        raise InputError(
            f"The vector of {what} is zero, so it has no direction. Leave it out of the picture."
        )
    return array, length


def arrow(
    start: npt.ArrayLike, vector: npt.ArrayLike, colour: RGB, size: float = 1.0, halo: bool = False
) -> Item:
    """Draw an arrow along a vector from its tail, `start`, both in the world frame [m].

    The width of the shaft grows with the square roots of `size`, the size of the robot [m], and of
    the arrow's length. With a halo, the arrow is wider and translucent, so that it is visible
    around another arrow at the same place.
    """
    vector, length = vector_and_length("an arrow", vector)
    width = arrow_width(length, size) * (1.8 if halo else 1.0)
    rotation = geometry.rotation_with_z_axis(vector / length)
    return Item(
        unit_shapes.arrow(colour, 0.6 if halo else 1.0),
        transform(start, rotation, (width / 2, width / 2, length)),
    )


def arrow_width(length: float, size: float) -> float:
    """Return the width of an arrow's shaft [m] from its length and the size of the robot [m]."""
    return min(ARROW_SLENDERNESS * math.sqrt(length * ARROW_LENGTH * size), 0.35 * length)


def friction_cone(
    position: npt.ArrayLike, normal: npt.ArrayLike, mu: float, height: float, status: str
) -> Item:
    """Draw the friction cone ‖f_tangent‖ ≤ μ f_normal.

    Parameters
    ----------
    position : array_like, shape (3,)
        Tip in the world frame [m].
    normal : array_like, shape (3,)
        Unit normal in the world frame, pointing out of the ground.
    mu : float
        Friction coefficient μ, dimensionless.
    height : float
        Height, which is the largest normal force shown times the picture's scale [m].
    status : {"idle", "inside", "active", "outside"}
        Status of the force, which gives the colour; "idle" means no force.

    Returns
    -------
    Item
        The cone.

    Notes
    -----
    [FBR]_, eq. (28).
    """
    as_positive("mu of a friction cone", mu)
    as_positive("height of a friction cone", height, "m")
    matrix = transform(position, _contact_axes(normal), (mu * height, mu * height, height))
    return Item(unit_shapes.cone(), matrix, cone_colour(status))


def cone_colour(status: str) -> RGBA:
    """Return the RGBA of a friction cone for the status of its force, as in `friction_cone`."""
    return with_alpha(CONE[status], CONE_ALPHA[status])


def friction_polyhedron(
    position: npt.ArrayLike,
    polyhedron: FrictionPolyhedron,
    height: float,
    status: str,
    active: npt.ArrayLike = (),
) -> Picture:
    """Draw the friction polyhedron that approximates a cone; see `friction_cone`.

    active: indices of the facets that have the colour of an active constraint.
    """
    as_positive("height of a friction polyhedron", height, "m")
    matrix = transform(position, _contact_axes(polyhedron.normal), height)
    key = _facets_key(polyhedron)
    picture = {"/sides": Item(unit_shapes.polyhedron(*key), matrix, cone_colour(status))}
    for facet in np.atleast_1d(np.asarray(active, dtype=int)):
        picture[f"/facet {facet}"] = Item(unit_shapes.facet(*key, int(facet)), matrix)
    return picture


def cone_rim(
    position: npt.ArrayLike, polyhedron: FrictionPolyhedron, height: float, is_round: bool = False
) -> Item:
    """Draw a dark rim around the mouth of a cone whose tip is at a position; see `friction_cone`.

    The rim marks a force outside the cone, so that readers need not rely on colour alone. A round
    rim is that of the cone with the polyhedron's normal and friction.
    """
    frame = _contact_axes(polyhedron.normal)
    if is_round:
        radius = polyhedron.mu * height
        return Item(unit_shapes.round_rim(), transform(position, frame, (radius, radius, height)))
    rim = unit_shapes.polygonal_rim(*_facets_key(polyhedron))
    return Item(rim, transform(position, frame, height))


def contact_patch(position: npt.ArrayLike, normal: npt.ArrayLike, radius: float) -> Item:
    """Draw a disc at a contact point with a unit normal, both in the world frame [m]."""
    as_positive("radius of a contact patch", radius, "m")
    scale = (radius, radius, 0.12 * radius)
    return Item(unit_shapes.disc(PATCH), transform(position, _contact_axes(normal), scale))


def centre_of_mass(position: npt.ArrayLike, ground: float, size: float) -> Picture:
    """Draw a ball at the centre of mass, its projection on the ground, and a line between them.

    ground: height of the ground below it [m]. size: size of the robot [m].
    """
    x, y, z = np.asarray(position, dtype=np.float64)
    radius = 0.04 * size
    foot = np.array([x, y, ground])
    line = transform(foot, scale=(0.1 * radius, 0.1 * radius, max(z - ground, 1e-4)))
    projection = transform(foot, scale=(0.8 * radius, 0.8 * radius, 0.12 * radius))
    return {
        "/ball": Item(unit_shapes.sphere(COM, True), transform([x, y, z], scale=radius)),
        "/line": Item(unit_shapes.cylinder(COM), line),
        "/projection": Item(unit_shapes.disc(COM), projection),
    }


def label(
    position: npt.ArrayLike,
    text: str,
    height: float,
    colour: RGB = (0.13, 0.13, 0.13),
    plate: bool = True,
) -> Item:
    """Draw text, with letters of this height [m], that always faces the viewer.

    Braces make a subscript: "f{c}". A plate lies behind the text by default.
    """
    as_positive("height of a label's letters", height, "m")
    return Item(unit_shapes.label(text, height, plate, colour), transform(position))


def scale_bar(
    position: npt.ArrayLike, force: float, length: float, size: float, colour: RGB
) -> Picture:
    """Draw a bar along x that shows the drawn length [m] of a force [N], which its label names."""
    start = np.asarray(position, dtype=np.float64)
    along = geometry.rotation_with_z_axis([1.0, 0.0, 0.0])
    thick = 0.012 * size
    rod = unit_shapes.cylinder(colour)
    picture = {"/bar": Item(rod, transform(start, along, (thick / 2, thick / 2, length)))}
    for end, x in (("/start", 0.0), ("/end", length)):
        where = start + np.array([x, 0.0, 0.0])
        picture[end] = Item(rod, transform(where, along, (2.2 * thick, 2.2 * thick, thick / 2)))
    # beside the bar, which looks short from its end; the robot can hide both
    text_at = start + np.array([length / 2, 0.17 * size, 0.03 * size])
    words = unit_shapes.label(f"{force:g} N", 0.055 * size, True, colour, False)
    return picture | {"/label": Item(words, transform(text_at))}


def rod(
    start: npt.ArrayLike, rotation: npt.ArrayLike, length: float, radius: float, colour: RGB
) -> Item:
    """Draw a rod from its end `start` [m] along the z axis of a rotation."""
    as_positive("length of a rod", length, "m")
    return Item(unit_shapes.cylinder(colour), transform(start, rotation, (radius, radius, length)))


def flat_polygon(corners: npt.ArrayLike, colour: RGB, opacity: float) -> Shape:
    """Make a flat convex polygon of at least three corners [m], visible from both sides."""
    points = as_array("corners of a polygon", corners, (None, 3), "m")
    if len(points) < 3:
        raise InputError(f"A polygon needs at least three corners, not {len(points)}.")
    return unit_shapes.polygon(tuple(tuple(corner) for corner in points.tolist()), colour, opacity)


def invisible_point(position: npt.ArrayLike) -> Item:
    """Make an invisible object at a position [m] for the camera to follow."""
    return Item(unit_shapes.invisible_point(), transform(position))


def ground_grid(colour: RGB, step: float = 0.25, half: float = 5.0) -> Item:
    """Draw a square grid on the plane z = 0, with lines at a distance `step` [m]."""
    return Item(_grid(colour, step, half), np.eye(4))


def grid_lines(step: float = 0.25, half: float = 5.0) -> Array:
    """Return start and end of each line segment of `ground_grid`, shape (2 n, 3) [m]."""
    at = np.arange(-half, half + step / 2, step)
    # each line in pieces of one step: software renderers drop lines that begin far behind the
    # camera
    start, line = (grid.ravel() for grid in np.meshgrid(at[:-1], at))
    along_x = np.stack([start, line, start + step, line], axis=1).reshape(-1, 2)
    points = np.vstack([along_x, along_x[:, ::-1]])
    return np.hstack([points, np.zeros((len(points), 1))])


def _facets_key(polyhedron: FrictionPolyhedron) -> tuple[float, int, bool, float]:
    """Return what determines the shape of a polyhedron, as plain values."""
    return (
        float(polyhedron.mu), int(polyhedron.facets),
        bool(polyhedron.inner_approximation), float(polyhedron.facet_rotation),
    )  # fmt: skip


def _contact_axes(normal: npt.ArrayLike) -> Array:
    """Return the two tangents used by the friction constraints, and the normal, shape (3, 3)."""
    x, y, z = np.asarray(normal, dtype=np.float64).tolist()
    return _contact_axes_of(x, y, z)


@lru_cache(maxsize=256)
def _contact_axes_of(x: float, y: float, z: float) -> Array:
    """Return `_contact_axes` of a normal; each is computed once, since there are few normals."""
    t1, t2 = tangents([x, y, z])
    return read_only(np.stack([t1, t2, np.cross(t1, t2)], axis=1))


@lru_cache(maxsize=8)
def _grid(colour: RGB, step: float, half: float) -> Shape:
    """Return the lines of a grid; each grid is made once."""
    return threejs.lines(grid_lines(step, half), colour)
