"""Shared geometry: rotations about z, the minimum-jerk profile, convex polygons in the plane."""

from __future__ import annotations

from math import cos, sin

import numpy as np

from floatbase._validation import Array


def rotation_z(angle: float) -> Array:
    """The rotation by `angle`, rad, about the z axis, shape (3, 3)."""
    c, s = cos(angle), sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def minimum_jerk(s: float) -> tuple[float, float, float]:
    """10 s³ - 15 s⁴ + 6 s⁵ and its first two derivatives: from 0 to 1, at rest at both ends.

    s: a fraction of the time, clipped to [0, 1].
    """
    s = min(max(s, 0.0), 1.0)
    w = s * (1.0 - s)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s * s), 30.0 * w * w, 60.0 * w * (1.0 - 2.0 * s)


def convex_hull(points: Array) -> Array:
    """Corners of the convex hull of points (n, 2), n ≥ 1: shape (k, 2), counter-clockwise.

    Points on one line give the two ends of the segment, equal points give one.
    """
    from scipy.spatial import ConvexHull, QhullError  # slow to load

    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except QhullError:  # fewer than three points, or points on one line
        ends = points[np.lexsort(points.T[::-1])][[0, -1]]
        return np.asarray(ends if np.any(ends[0] != ends[1]) else ends[:1])


def distance_to_polygon(points: Array, polygon: Array) -> Array:
    """Distance of points from the border of a convex polygon: positive inside, negative outside.

    points: (2,) or (n, 2).
    polygon: corners, (k, 2), counter-clockwise; a segment or a point has no inside.

    Returns shape () or (n,), in the unit of the points.
    """
    edges = np.roll(polygon, -1, axis=0) - polygon
    from_corners = points[..., None, :] - polygon
    lengths = np.linalg.norm(edges, axis=1)
    lengths = np.where(lengths > 0.0, lengths, 1.0)
    heights = (
        edges[:, 0] * from_corners[..., 1] - edges[:, 1] * from_corners[..., 0]
    ) / lengths  # of the points above the edges' lines
    nearest = heights.min(axis=-1)
    fractions = np.clip(np.sum(from_corners * edges, axis=-1) / lengths**2, 0.0, 1.0)
    to_edges = np.linalg.norm(from_corners - fractions[..., None] * edges, axis=-1).min(axis=-1)
    inside = (nearest >= 0.0) & (len(polygon) > 2)
    return np.asarray(np.where(inside, nearest, -to_edges))
