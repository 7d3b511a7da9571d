"""The ground in the picture: level, a given slope, or the slope on which the contacts stand."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from floatbase._arrays import Array
from floatbase.friction import tangents
from floatbase.viewer.colours import RGB
from floatbase.viewer.shapes import Item, ground, placed

STEEPEST = 0.2  # least vertical part of a normal of the ground: contacts with less stand on walls
STEP = 0.01  # m; the height of the ground is rounded to this, so that it does not tremble with the feet


class Plane(NamedTuple):
    """The points p with normal · p = offset. normal: (3,), unit, world, upwards. offset: m."""

    normal: tuple[float, float, float]
    offset: float = 0.0

    def height(self, point: Array) -> float:
        """z of the plane, m, below or above a point, shape (3,), m."""
        x, y, z = self.normal
        return (self.offset - x * float(point[0]) - y * float(point[1])) / z

    def lines(self, colour: RGB) -> Item:
        """The lines of the plane's grid."""
        return _lines(self, colour)


LEVEL = Plane((0.0, 0.0, 1.0))


def plane_under(normals: Array, positions: Array) -> Plane:
    """The slope on which contact points stand. normals: (n, 3), unit, world. positions: (n, 3), m, world.

    It is level, through the origin, when there are no points, when their normals differ, when they do not lie in one plane,
    and when they stand on a wall.
    """
    if not len(normals) or np.ptp(normals, axis=0).max() > 1e-6 or normals[0, 2] < STEEPEST:
        return LEVEL
    heights = positions @ normals[0]
    if normals[0, 2] > 1.0 - 1e-9 or np.ptp(heights) > STEP:
        return LEVEL
    x, y, z = (float(c) for c in normals[0])
    return Plane((x, y, z), STEP * float(np.round(np.mean(heights) / STEP)))


@lru_cache(maxsize=64)
def _lines(plane: Plane, colour: RGB) -> Item:
    t1, t2 = tangents(plane.normal)
    normal = np.array(plane.normal)
    return Item(ground(colour).shape, placed(plane.offset * normal, np.stack([t1, t2, normal], axis=1)))
