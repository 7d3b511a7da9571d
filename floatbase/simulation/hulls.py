"""Convex hulls of a robot's links, made from the URDF's collision shapes.

After a fall, the robot lies on them.
"""

from __future__ import annotations

from collections import defaultdict
from functools import lru_cache
from pathlib import Path

import numpy as np

from floatbase._validation import Array, read_only
from floatbase.robots import Robot
from floatbase.robots._shapes import link_shapes, placed_points, sphere_directions

_MIN_THICKNESS = 1e-3  # m: MuJoCo builds no hull from flatter sets of points
_BLOCK_SIZE = 1024  # points at a time: as many as one core's cache holds


@lru_cache(maxsize=16)
def link_hulls(robot: Robot, folders: tuple[Path, ...]) -> tuple[tuple[int, Array], ...]:
    """Return the joints that move links, each with the points that span its links' hull.

    All links that one joint moves share one hull, because a plane touches a body exactly where it
    touches the body's hull. A robot with a fixed base has no hulls.
    """
    if not robot.is_floating:
        return ()
    clouds = defaultdict[int, list[Array]](list)
    for shape in link_shapes(robot.model, robot.urdf, folders)[0]:
        clouds[int(shape.parentJoint)].append(placed_points(shape))
    return tuple(
        (joint, read_only(_extreme_points(points)))
        for joint, points in zip(clouds, map(np.vstack, clouds.values()), strict=True)
        if _thickness(points) > _MIN_THICKNESS
    )


def _thickness(points: Array) -> float:
    """Return the least extent of points along their principal axes; 0 for fewer than four."""
    if len(points) < 4:
        return 0.0
    centred = points - points.mean(axis=0)
    axes = np.linalg.eigh(centred.T @ centred)[1]
    return float(np.ptp(centred @ axes, axis=0).min())


def _extreme_points(points: Array) -> Array:
    """Return the points that are farthest in some direction, shape (m, 3): enough for a hull."""
    directions = sphere_directions()
    best, support = np.zeros(len(directions), dtype=int), np.full(len(directions), -np.inf)
    for first in range(0, len(points), _BLOCK_SIZE):
        supports = directions @ points[first : first + _BLOCK_SIZE].T
        indices = supports.argmax(axis=1)
        farther = (candidate := supports[np.arange(len(directions)), indices]) > support
        best[farther], support[farther] = first + indices[farther], candidate[farther]
    extreme: Array = points[np.unique(best)]
    return extreme
