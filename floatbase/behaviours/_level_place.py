"""Level places on a known terrain, where a foot does not touch an edge."""

from __future__ import annotations

from functools import lru_cache
from math import cos, sin

import numpy as np

from floatbase._validation import Array, read_only
from floatbase.behaviours.terrain import Plane, Terrain
from floatbase.robots import Foot

_LARGEST_EDGE = 0.01  # m: a foot may stand on lower edges
_SEARCH_STEP = 0.02  # m between the places that are tried
_EDGE_MARGIN = 0.02  # m between a ball of a foot and an edge of a known ground
_SOLE_MARGIN = 1.1  # size of a sole for which a known ground must be flat, relative to its own
_CIRCLE = np.array([[np.cos(a), np.sin(a)] for a in np.arange(8) * np.pi / 4])


def level_place(terrain: Terrain, point: Array, around: Array, reach: float) -> Array:
    """Return the place nearest to a point where a foot does not touch an edge of the terrain."""
    for displacement in _search_grid(reach):
        if _is_flat(terrain, point + displacement, around):
            return np.asarray(point + displacement)
    return point


def _is_flat(terrain: Terrain, place: Array, around: Array) -> bool:
    """Return whether a terrain is in its tangent plane at points around a place, (n, 2) [m]."""
    plane = Plane.tangent(terrain, place)
    return all(
        abs(terrain.height(point) - plane.height(point)) < _LARGEST_EDGE for point in place + around
    )


@lru_cache(maxsize=16)
def _search_grid(reach: float) -> Array:
    """Return displacements of at most a distance, shape (n, 2), the shortest ones first [m]."""
    n = int(reach / _SEARCH_STEP)
    steps = _SEARCH_STEP * np.arange(-n, n + 1)
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    lengths = np.linalg.norm(grid, axis=1)
    order = np.argsort(lengths, kind="stable")
    return read_only(grid[order[lengths[order] <= reach]])


def foot_outline(foot: Foot, yaw: float) -> Array:
    """Return points around the middle of a foot that must not be beyond an edge, (n, 2) [m]."""
    if not foot.is_flat:
        return (2.0 * foot.radius + _EDGE_MARGIN) * _CIRCLE
    c, s = cos(yaw), sin(yaw)
    return np.asarray(_SOLE_MARGIN * foot.points[:, :2] @ np.array([[c, s], [-s, c]]))
