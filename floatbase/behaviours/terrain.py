"""Terrain for planning: a ground that is known, or a plane through the feet."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol, runtime_checkable

import numpy as np

from floatbase._validation import Array

_RANK_TOLERANCE = 1e-3  # fraction of the feet's extent: no slope is fitted along a smaller extent

_LARGEST_EDGE = 0.01  # m: a foot may stand on lower edges
_SEARCH_STEP = 0.02  # m between the places that are tried


@runtime_checkable
class Terrain(Protocol):
    """A ground whose shape is known, such as `fb.Ground`."""

    def height(self, xy: Array) -> float:
        """Return the height at a horizontal position, shape (2,), in the world frame [m]."""

    def normal(self, xy: Array) -> Array:
        """Return the upward unit normal at a horizontal position, shape (3,), world frame."""


def level_place(terrain: Terrain, point: Array, around: Array, reach: float) -> Array:
    """Return the place nearest to a point where a foot does not touch an edge of the terrain.

    Parameters
    ----------
    terrain : Terrain
        The terrain.
    point : ndarray, shape (2,)
        Desired place in the world frame [m].
    around : ndarray, shape (n, 2)
        Points relative to the place, such as the corners of a sole, at which the terrain must be in
        the tangent plane of the place [m].
    reach : float
        Largest distance of the place from the point [m].

    Returns
    -------
    ndarray, shape (2,)
        The nearest such place on a grid, or the point if there is none [m].
    """
    places = point + np.concatenate([[np.zeros(2)], _search_grid(reach)])
    for first, last in ((0, 1), (1, len(places))):  # the point itself is good enough, in general
        heights = _heights(terrain, places[first:last, None] + around)
        middles = _heights(terrain, places[first:last])
        normals = np.array([terrain.normal(place) for place in places[first:last]])
        slopes = -normals[:, :2] / normals[:, 2:]
        steps = np.abs(heights - middles[:, None] - slopes @ around.T).max(axis=1)
        good = np.flatnonzero(steps < _LARGEST_EDGE)
        if len(good):
            return np.asarray(places[first + good[0]])
    return point


@lru_cache(maxsize=16)
def _search_grid(reach: float) -> Array:
    """Return displacements of at most a distance, shape (n, 2), the shortest ones first [m]."""
    n = int(reach / _SEARCH_STEP)
    steps = _SEARCH_STEP * np.arange(-n, n + 1)
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    lengths = np.linalg.norm(grid, axis=1)
    order = np.argsort(lengths, kind="stable")
    return grid[order[(lengths[order] > 0.0) & (lengths[order] <= reach)]]


def _heights(terrain: Terrain, points: Array) -> Array:
    """Return the heights at points, shape (..., 2); the terrain may accept one at a time only."""
    heights = np.asarray(terrain.height(points))
    if heights.shape != points.shape[:-1]:
        flat = [terrain.height(point) for point in points.reshape(-1, 2)]
        heights = np.reshape(flat, points.shape[:-1])
    return heights


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane z = slope · (x, y) + level.

    Parameters
    ----------
    slope : ndarray, shape (2,)
        Slope along x and y [-].
    level : float
        Height at the origin [m].
    """

    slope: Array
    level: float

    @staticmethod
    def through(points: Array) -> Plane:
        """Fit a plane to points, shape (n, 3), in the world frame [m].

        If the points show no slope in some direction, for example because they are on a line, the
        plane is level in that direction.
        """
        middle = points.mean(axis=0)
        differences = points - middle
        slope = np.linalg.lstsq(differences[:, :2], differences[:, 2], rcond=_RANK_TOLERANCE)[0]
        return Plane(slope, float(middle[2] - slope @ middle[:2]))

    @staticmethod
    def tangent(terrain: Terrain, xy: Array) -> Plane:
        """Return the tangent plane of a terrain at a horizontal position, shape (2,) [m]."""
        return Plane.of_normal(terrain.normal(xy), np.array([*xy, terrain.height(xy)]))

    @staticmethod
    def of_normal(normal: Array, point: Array) -> Plane:
        """Return the plane with an upward normal, shape (3,), through a point, shape (3,) [m]."""
        slope = -np.asarray(normal)[:2] / normal[2]
        return Plane(slope, float(point[2] - slope @ point[:2]))

    def height(self, xy: Array) -> float:
        """Return the height at a horizontal position, shape (2,) [m]."""
        return float(self.slope @ xy + self.level)

    @property
    def tilt(self) -> Array:
        """Rotation from level ground to the plane as a rotation vector, its x and y, (2,) [rad]."""
        steepness = float(np.hypot(*self.slope))
        scale = np.arctan(steepness) / steepness if steepness > 0.0 else 1.0
        return scale * np.array([self.slope[1], -self.slope[0]])
