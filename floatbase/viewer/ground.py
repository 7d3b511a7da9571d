"""The ground in the picture: level, a slope that was given, or the slope that the contacts stand on."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from floatbase._arrays import Array
from floatbase.friction import tangents
from floatbase.viewer.colours import RGB
from floatbase.viewer.shapes import Item, ground, placed

STEEPEST = 0.2  # vertical part of a normal below which contacts stand on walls, not on the ground
STEP = 0.01  # m: a plane as near to the origin goes through it, so that it does not tremble with the feet


class Plane(NamedTuple):
    """All points with normal · p = offset. normal: unit, world, upwards. offset: m."""

    normal: tuple[float, float, float]
    offset: float = 0.0

    def height(self, point: Array) -> float:
        """z of the plane below or above a point, shape (3,), m."""
        x, y, z = self.normal
        return (self.offset - x * float(point[0]) - y * float(point[1])) / z

    def lines(self, colour: RGB) -> Item:
        """Its grid."""
        return _lines(self, colour)


LEVEL = Plane((0.0, 0.0, 1.0))


def plane_under(normals: Array, positions: Array) -> Plane:
    """The slope that contact points, shape (n, 3), m, with these normals, shape (n, 3), stand on.

    Level through the origin where they have several normals or none, or do not lie in one plane, and on walls.
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
