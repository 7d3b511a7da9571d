"""Ground in pictures: level ground, given planes and boxes, or the slope below the contacts."""

from __future__ import annotations

from functools import lru_cache
from itertools import product
from typing import NamedTuple, TypeAlias

import numpy as np

from floatbase._validation import Array
from floatbase.friction import tangents
from floatbase.viewer.scene import geometry, threejs
from floatbase.viewer.scene.colours import GREYS, RGB
from floatbase.viewer.scene.shapes import Item, Picture, grid_lines, ground_grid, transform

# smallest vertical component of a normal of the ground: with less, a contact is on a wall
MIN_VERTICAL = 0.2
# m by which the grid jumps to stay below a robot: a whole number of its squares, so that jumps are
# invisible
GRID_JUMP = 2.5
# m; the height of the ground is rounded to this, so that it does not shake with the feet
HEIGHT_STEP = 0.01
# m: faces of boxes are drawn in pieces of this size, because an image without a browser drops a
# triangle with a corner behind the camera
FACE_SIZE = 0.5
EDGE_WIDTH = 8e-3  # m, width of the drawn edges of boxes
EDGE_LIFT = 2e-3  # m by which edges of boxes are drawn above their faces, which would hide them
# m between the points where the camera takes the height of the ground; in between the height is
# interpolated, so that the camera does not jump at a step
CAMERA_GRID = 0.5


class Plane(NamedTuple):
    """The points p with normal · p = offset."""

    normal: tuple[float, float, float]
    offset: float = 0.0

    @property
    def planes(self) -> tuple[Plane, ...]:
        """Tuple that contains this plane alone; `Planes.planes` contains several."""
        return (self,)

    def height(self, point: Array) -> float:
        """Return the height of the plane below or above a point."""
        x, y, z = self.normal
        return (self.offset - x * float(point[0]) - y * float(point[1])) / z

    def lines(self, colour: RGB, around: Array | None = None) -> Item:
        """Draw the grid of the plane."""
        i, j = (
            (0, 0)
            if around is None
            else np.round(_tangents(self) @ around / GRID_JUMP).astype(int).tolist()
        )
        return _lines(self, colour, i, j)


class Planes(NamedTuple):
    """Several planes that are solid below, such as the two sides of a valley, or a wall."""

    planes: tuple[Plane, ...]

    def height(self, point: Array) -> float:
        """Return the height of the ground below or above a point."""
        return max(plane.height(point) for plane in self.planes if plane.normal[2] >= MIN_VERTICAL)

    def lines(self, colour: RGB, around: Array | None = None) -> Item:
        """Draw the visible parts of all grids, around the origin."""
        return _visible_lines(self, colour)


class Terrain(NamedTuple):
    """Planes with boxes on them, such as steps."""

    base: Plane | Planes
    boxes: tuple[tuple[float, float, float, float, float], ...]

    @property
    def planes(self) -> tuple[Plane, ...]:
        """Planes below the boxes."""
        return self.base.planes

    def height(self, point: Array) -> float:
        """Return the height of the ground below or above a point."""
        x, y = float(point[0]), float(point[1])
        tops = (top for x0, x1, y0, y1, top in self.boxes if x0 <= x <= x1 and y0 <= y <= y1)
        return max([self.base.height(point), *tops])

    def lines(self, colour: RGB, around: Array | None = None) -> Item:
        """Draw the grid of the planes."""
        return self.base.lines(colour, around)


DrawnGround: TypeAlias = Plane | Planes | Terrain
LEVEL = Plane((0.0, 0.0, 1.0))


def displacement(ground: DrawnGround, start: Array, end: Array) -> Array:
    """Return the displacement between two positions that follows the ground up or down."""
    x, y = (end - start)[:2]
    return np.array([x, y, _smooth_height(ground, end) - _smooth_height(ground, start)])


def _smooth_height(ground: DrawnGround, point: Array) -> float:
    """Return the height of the ground below a point, with steps made into ramps [m]."""
    if not isinstance(ground, Terrain):
        return ground.height(point)
    x, y = np.asarray(point)[:2] / CAMERA_GRID
    i, j = np.floor([x, y])
    height = 0.0
    for a, b in product((0, 1), (0, 1)):  # the corners of the grid's square around the point
        weight = (1.0 - abs(x - i - a)) * (1.0 - abs(y - j - b))
        height += weight * ground.height(CAMERA_GRID * np.array([i + a, j + b]))
    return float(height)


def blocks(ground: DrawnGround, colour: RGB) -> Picture:
    """Draw the boxes of the ground, with their edges."""
    return _blocks(ground, colour) if isinstance(ground, Terrain) else {}


def plane_under(normals: Array, positions: Array) -> Plane:
    """Return the slope on which contact points stand."""
    if not len(normals) or np.ptp(normals, axis=0).max() > 1e-6 or normals[0, 2] < MIN_VERTICAL:
        return LEVEL
    heights = positions @ normals[0]
    if normals[0, 2] > 1.0 - 1e-9 or np.ptp(heights) > HEIGHT_STEP:
        return LEVEL
    x, y, z = (float(c) for c in normals[0])
    return Plane((x, y, z), HEIGHT_STEP * float(np.round(np.mean(heights) / HEIGHT_STEP)))


@lru_cache(maxsize=64)
def _tangents(plane: Plane) -> Array:
    """Return the two directions of the plane's grid, shape (2, 3)."""
    return tangents(plane.normal)


@lru_cache(maxsize=64)
def _lines(plane: Plane, colour: RGB, i: int, j: int) -> Item:
    """Return the grid after `i` and `j` jumps along its two tangents."""
    pose = _pose(plane)
    pose[:3, 3] += GRID_JUMP * (i * pose[:3, 0] + j * pose[:3, 1])
    return Item(ground_grid(colour).shape, pose)


@lru_cache(maxsize=16)
def _visible_lines(ground: Planes, colour: RGB) -> Item:
    """Return the parts of all grids that lie above the other planes."""
    seen: list[Array] = []
    for plane in ground.planes:
        pose = _pose(plane)
        ends: Array = (grid_lines() @ pose[:3, :3].T + pose[:3, 3]).reshape(-1, 2, 3)
        for other in ground.planes:
            if other != plane:
                ends = _parts_above(other, ends)
        seen.append(ends.reshape(-1, 3))
    return Item(threejs.lines(np.vstack(seen), colour), np.eye(4))


@lru_cache(maxsize=16)
def _blocks(ground: Terrain, colour: RGB) -> Picture:
    """Return the faces of all boxes as one mesh, and dark edges of their tops as another."""
    faces: list[geometry.Mesh] = []
    edges: list[geometry.Mesh] = []
    for x0, x1, y0, y1, top in ground.boxes:
        corners = np.array([[x0, y0, top], [x1, y0, top], [x1, y1, top], [x0, y1, top]])
        low = min([top, *(ground.base.height(corner) for corner in corners)])
        down = np.array([0.0, 0.0, low - top])
        faces.append(_face(corners[0], corners[1] - corners[0], corners[3] - corners[0]))
        for i, corner in enumerate(corners):
            along, back = corners[(i + 1) % 4] - corner, corner - corners[i - 1]
            inwards = -EDGE_WIDTH * back / np.linalg.norm(back)
            edges.append(_face(corner + [0.0, 0.0, EDGE_LIFT], along, inwards))
            if low < top:
                faces.append(_face(corner, along, down))
    return {
        "terrain/faces": Item(threejs.mesh(*geometry.merged(faces), colour, flat=True), np.eye(4)),
        "terrain/edges": Item(
            threejs.mesh(*geometry.merged(edges), GREYS[1], lit=False), np.eye(4)
        ),
    }


def _face(corner: Array, side: Array, other_side: Array) -> geometry.Mesh:
    """Return a rectangle in pieces, given a corner and the two sides that begin there [m]."""
    pieces = [
        max(1, int(np.ceil(np.linalg.norm(along) / FACE_SIZE))) for along in (side, other_side)
    ]
    u, v = (np.linspace(0.0, 1.0, n + 1) for n in pieces)
    vertices = corner + np.add.outer(u, 0 * v)[..., None] * side + v[:, None] * other_side
    first = np.arange(vertices[..., 0].size).reshape(vertices.shape[:2])
    a, b, c, d = first[:-1, :-1], first[1:, :-1], first[1:, 1:], first[:-1, 1:]
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    return vertices.reshape(-1, 3).astype(np.float32), faces.astype(np.uint32)


def _parts_above(plane: Plane, ends: Array) -> Array:
    """Return the parts of lines that lie above a plane."""
    clear = ends @ np.array(plane.normal) - plane.offset
    seen = clear.max(axis=1) > 0.0
    low, lines = np.maximum(-clear[seen], 0.0), ends[seen]
    # fraction of the line, at each end
    fraction = low / np.where(low > 0.0, np.ptp(clear[seen], axis=1, keepdims=True), 1.0)
    return np.asarray(lines + fraction[:, :, None] * (lines[:, ::-1] - lines))


def _pose(plane: Plane) -> Array:
    """Return the pose of the plane's grid, shape (4, 4)."""
    t1, t2 = _tangents(plane)
    normal = np.array(plane.normal)
    return transform(plane.offset * normal, np.stack([t1, t2, normal], axis=1))
