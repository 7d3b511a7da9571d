"""Rotations about z, the minimum-jerk profile, and convex polygons in the plane."""

from __future__ import annotations

from math import cos, sin

import numpy as np

from floatbase._validation import Array

MIN_EDGE = 1e-6  # m: rounding decides the direction of shorter edges
_ON_EDGE = 1e-9  # m: rounding decides on which side of an edge such a point is


def rotation_z(angle: float) -> Array:
    """Return the rotation matrix about the z axis by an angle [rad]."""
    c, s = cos(angle), sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def minimum_jerk(s: float) -> tuple[float, float, float]:
    """Return 10 s³ - 15 s⁴ + 6 s⁵ and its first two derivatives: from 0 to 1, at rest at both ends.

    The fraction s of the time is clipped to [0, 1].
    """
    s = min(max(s, 0.0), 1.0)
    w = s * (1.0 - s)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s * s), 30.0 * w * w, 60.0 * w * (1.0 - 2.0 * s)


def bump(s: float) -> tuple[float, float, float]:
    """Return a smooth rise from 0 to 1 and back for s from 0 to 1, with two derivatives.

    The first two derivatives are zero at both ends.
    """
    w = s * (1.0 - s)
    return 64.0 * w**3, 192.0 * w * w * (1.0 - 2.0 * s), 384.0 * w * (1.0 - 5.0 * w)


def convex_hull(points: Array) -> Array:
    """Return the corners of the convex hull of n ≥ 1 points, shape (k, 2), counter-clockwise.

    Points on one line give the two ends of the segment, and equal points give a single point.
    """
    # Andrew, Another efficient algorithm, 1979. scipy's takes 0.1 ms more, and `Stand` calls this
    # in each control step.
    ordered = sorted(set(map(tuple, points.tolist())))
    corners: list[tuple[float, ...]] = []
    for line in (ordered, ordered[::-1]):
        half: list[tuple[float, ...]] = []
        for x, y in line:
            while len(half) > 1 and (half[-1][0] - half[-2][0]) * (y - half[-2][1]) <= (
                half[-1][1] - half[-2][1]
            ) * (x - half[-2][0]):
                half.pop()
            half.append((x, y))
        corners += half[:-1]
    return np.array(corners or ordered)


def first_corner(points: Array) -> int:
    """Return the index of a corner of the convex hull of points (n, 2 or more).

    Like `next_corner`, this function is also compiled, as a part of the controller.
    """
    first, largest = 0, 0.0  # the point that is farthest from point 0
    for i in range(len(points)):
        distance = ((points[i, 0] - points[0, 0]) ** 2 + (points[i, 1] - points[0, 1]) ** 2) ** 0.5
        if distance > largest + MIN_EDGE:
            first, largest = i, distance
    return first


def next_corner(points: Array, i: int) -> int:
    """Return the index of the corner after corner i, counter-clockwise; i if there is no other.

    Points on an edge are not corners. Points nearer to each other than `MIN_EDGE` are one corner.
    """
    found, x, y, length = i, 0.0, 0.0, 0.0  # direction and distance of the point found
    for k in range(len(points)):
        dx, dy = points[k, 0] - points[i, 0], points[k, 1] - points[i, 1]
        distance, side = (dx * dx + dy * dy) ** 0.5, x * dy - y * dx
        is_next = side < -_ON_EDGE or (side <= _ON_EDGE and distance > length + MIN_EDGE)
        if distance > MIN_EDGE and (found == i or is_next):
            found, x, y, length = k, dx / distance, dy / distance, distance
    return found


def distance_to_polygon(points: Array, polygon: Array) -> Array:
    """Return the distance of points from the border of a convex polygon, negative outside.

    The points have shape (2,) or (n, 2), and the result has shape () or (n,). The corners of the
    polygon, shape (k, 2), are counter-clockwise. A segment or a point has no inside.
    """
    edges = np.roll(polygon, -1, axis=0) - polygon
    from_corners = points[..., None, :] - polygon
    lengths = np.linalg.norm(edges, axis=1)
    lengths = np.where(lengths > 0.0, lengths, 1.0)
    # of the points above the lines through the edges
    heights = (edges[:, 0] * from_corners[..., 1] - edges[:, 1] * from_corners[..., 0]) / lengths
    nearest = heights.min(axis=-1)
    inside = (nearest >= 0.0) & (len(polygon) > 2)
    if np.all(inside):
        return np.asarray(nearest)
    fractions = np.clip(np.sum(from_corners * edges, axis=-1) / lengths**2, 0.0, 1.0)
    to_edges = np.linalg.norm(from_corners - fractions[..., None] * edges, axis=-1).min(axis=-1)
    return np.asarray(np.where(inside, nearest, -to_edges))
