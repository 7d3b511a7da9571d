"""The ground in the picture: level, given planes, or the slope on which the contacts stand."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from floatbase._validation import Array
from floatbase.friction import tangents
from floatbase.viewer.scene import threejs
from floatbase.viewer.scene.colours import RGB
from floatbase.viewer.scene.shapes import Item, grid_lines, ground_grid, transform

# least vertical part of a normal of the ground: contacts with less stand on walls
MIN_VERTICAL = 0.2
# m that the grid jumps at once to stay below a robot: a whole number of its squares, so that nobody
# sees it
GRID_JUMP = 2.5
# m; the height of the ground is rounded to this, so that it does not tremble with the feet
HEIGHT_STEP = 0.01


class Plane(NamedTuple):
    """The points p with normal · p = offset. normal: (3,), unit, world, upwards. offset: m."""

    normal: tuple[float, float, float]
    offset: float = 0.0

    @property
    def planes(self) -> tuple[Plane, ...]:
        """This plane alone, as `Planes` has several."""
        return (self,)

    def height(self, point: Array) -> float:
        """z of the plane, m, below or above a point, shape (3,), m."""
        x, y, z = self.normal
        return (self.offset - x * float(point[0]) - y * float(point[1])) / z

    def lines(self, colour: RGB, around: Array | None = None) -> Item:
        """The lines of the plane's grid, which reach at least 3 m around a point, shape (3,), m;
        None for the origin.
        """
        i, j = (
            (0, 0)
            if around is None
            else np.round(_tangents(self) @ around / GRID_JUMP).astype(int).tolist()
        )
        return _lines(self, colour, i, j)


class Planes(NamedTuple):
    """Several planes that all are solid below, as the two sides of a valley: what is seen of each
    lies above the others.
    """

    planes: tuple[Plane, ...]

    def height(self, point: Array) -> float:
        """z of the ground, m, below or above a point, shape (3,), m."""
        return max(plane.height(point) for plane in self.planes)

    def lines(self, colour: RGB, around: Array | None = None) -> Item:
        """The lines of all planes' grids around the origin, each as far as it is seen. around: does
        not count.
        """
        return _visible_lines(self, colour)


LEVEL = Plane((0.0, 0.0, 1.0))


def displacement(ground: Plane | Planes, start: Array, end: Array) -> Array:
    """From one place to another, shapes (3,), m, and as much up or down as the ground between them."""
    x, y = (end - start)[:2]
    return np.array([x, y, ground.height(end) - ground.height(start)])


def plane_under(normals: Array, positions: Array) -> Plane:
    """The slope on which contact points stand. normals: (n, 3), unit, world. positions: (n, 3), m,
    world.

    It is level, through the origin, when there are no points, when their normals differ, when they
    do not lie in one plane, and when they stand on a wall.
    """
    if not len(normals) or np.ptp(normals, axis=0).max() > 1e-6 or normals[0, 2] < MIN_VERTICAL:
        return LEVEL
    heights = positions @ normals[0]
    if normals[0, 2] > 1.0 - 1e-9 or np.ptp(heights) > HEIGHT_STEP:
        return LEVEL
    x, y, z = (float(c) for c in normals[0])
    return Plane((x, y, z), HEIGHT_STEP * float(np.round(np.mean(heights) / HEIGHT_STEP)))


@lru_cache(maxsize=64)
def _tangents(plane: Plane) -> Array:
    """The two directions of the plane's grid, shape (2, 3)."""
    return tangents(plane.normal)


@lru_cache(maxsize=64)
def _lines(plane: Plane, colour: RGB, i: int, j: int) -> Item:
    """i, j: how many jumps along its two tangents the grid has made."""
    pose = _pose(plane)
    pose[:3, 3] += GRID_JUMP * (i * pose[:3, 0] + j * pose[:3, 1])
    return Item(ground_grid(colour).shape, pose)


@lru_cache(maxsize=16)
def _visible_lines(ground: Planes, colour: RGB) -> Item:
    seen: list[Array] = []
    for plane in ground.planes:
        pose = _pose(plane)
        ends: Array = (grid_lines() @ pose[:3, :3].T + pose[:3, 3]).reshape(-1, 2, 3)
        for other in ground.planes:
            if other != plane:
                ends = _parts_above(other, ends)
        seen.append(ends.reshape(-1, 3))
    return Item(threejs.lines(np.vstack(seen), colour), np.eye(4))


def _parts_above(plane: Plane, ends: Array) -> Array:
    """The parts of lines above a plane. ends: shape (n, 2, 3), m, world; so is the answer, with
    fewer lines or as many.
    """
    clear = ends @ np.array(plane.normal) - plane.offset
    seen = clear.max(axis=1) > 0.0
    low, lines = np.maximum(-clear[seen], 0.0), ends[seen]
    fraction = low / np.where(
        low > 0.0, np.ptp(clear[seen], axis=1, keepdims=True), 1.0
    )  # part of the line, at each end
    return np.asarray(lines + fraction[:, :, None] * (lines[:, ::-1] - lines))


def _pose(plane: Plane) -> Array:
    """Where the plane's grid stands, (4, 4)."""
    t1, t2 = _tangents(plane)
    normal = np.array(plane.normal)
    return transform(plane.offset * normal, np.stack([t1, t2, normal], axis=1))
