"""Triangle meshes of simple shapes.

A mesh consists of vertices, shape (n, 3), and faces, shape (m, 3), which are indices of the
vertices.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt

Vertices = npt.NDArray[np.float32]
Faces = npt.NDArray[np.uint32]
Mesh = tuple[Vertices, Faces]


def merged(meshes: Sequence[tuple[npt.ArrayLike, npt.ArrayLike]]) -> Mesh:
    """Merge several meshes into one."""
    starts = np.cumsum([0] + [len(np.asarray(vertices)) for vertices, _ in meshes])
    faces = [np.asarray(part) + start for (_, part), start in zip(meshes, starts, strict=False)]
    vertices = [np.asarray(part) for part, _ in meshes]
    return np.vstack(vertices).astype(np.float32), np.vstack(faces).astype(np.uint32)


def vertex_colours(vertices: npt.ArrayLike, colour: npt.ArrayLike) -> npt.NDArray[np.uint8]:
    """Return the same colour for all vertices, given as RGB from 0 to 1."""
    code = np.round(255 * np.asarray(colour)).astype(np.uint8)
    return np.tile(code, (len(np.asarray(vertices)), 1))


def surface_of_revolution(profile: Sequence[tuple[float, float]], sides: int = 24) -> Mesh:
    """Make a surface of revolution around the z axis."""
    angles = 2.0 * np.pi * np.arange(sides) / sides
    circle = np.stack([np.cos(angles), np.sin(angles), np.zeros(sides)], axis=1)
    bands = []
    for (r0, z0), (r1, z1) in pairwise(profile):
        low, high = circle * [r0, r0, 0] + [0, 0, z0], circle * [r1, r1, 0] + [0, 0, z1]
        bands.append((np.vstack([low, high]), _band(sides, r0 > 0, r1 > 0)))
    return merged(bands)


def _band(sides: int, low: bool, high: bool) -> npt.NDArray[np.int64]:
    """Return the faces between two circles."""
    i = np.arange(sides)
    j = (i + 1) % sides
    up = np.stack([i, j, j + sides], axis=1) if low else np.zeros((0, 3), int)
    down = np.stack([i, j + sides, i + sides], axis=1) if high else np.zeros((0, 3), int)
    return np.vstack([up, down])


def sphere(radius: float, sides: int = 20) -> Mesh:
    """Make a sphere around the origin."""
    heights = np.linspace(-np.pi / 2, np.pi / 2, sides // 2 + 1)
    angles = 2.0 * np.pi * np.arange(sides) / sides
    circle = np.stack([np.cos(angles), np.sin(angles), np.zeros(sides)], axis=1)
    rings = [radius * (np.cos(h) * circle + [0.0, 0.0, np.sin(h)]) for h in heights]
    bands = [_band(sides, k > 0, k < len(rings) - 2) + k * sides for k in range(len(rings) - 1)]
    return np.vstack(rings).astype(np.float32), np.vstack(bands).astype(np.uint32)


def cylinder(start: npt.ArrayLike, end: npt.ArrayLike, radius: float, sides: int = 14) -> Mesh:
    """Make a closed cylinder."""
    a, b = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    length = float(np.linalg.norm(b - a))
    profile = [(0, 0), (radius, 0), (radius, length), (0, length)]
    vertices, faces = surface_of_revolution(profile, sides)
    return (vertices @ rotation_with_z_axis((b - a) / length).T + a).astype(np.float32), faces


def rotation_with_z_axis(direction: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Return a rotation whose z axis is a given direction."""
    x, y, z = np.asarray(direction, dtype=float)
    # Duff et al., Building an orthonormal basis, revisited (2017)
    sign = 1.0 if z >= 0 else -1.0
    a = -1.0 / (sign + z)
    b = x * y * a
    return np.array(
        [[1.0 + sign * x * x * a, b, x], [sign * b, sign + y * y * a, y], [-sign * x, -y, z]]
    )


def convex_polygon(corners: npt.ArrayLike) -> Mesh:
    """Make a flat convex polygon."""
    points = np.asarray(corners, dtype=np.float32)
    i = np.arange(1, len(points) - 1)
    return points, np.stack([np.zeros_like(i), i, i + 1], axis=1).astype(np.uint32)


def pyramid(rays: npt.ArrayLike) -> Mesh:
    """Make the sides of a pyramid with its tip at the origin; each side has its own vertices."""
    ends = np.asarray(rays, dtype=np.float32)
    pairs = zip(ends, np.roll(ends, -1, axis=0), strict=True)
    return merged([convex_polygon([np.zeros(3), a, b]) for a, b in pairs])


def torus_arc(radius: float, tube: float, start: float, end: float, sides: int = 40) -> Mesh:
    """Make a part of a torus around the z axis."""
    around = np.linspace(start, end, sides + 1)
    across = 2.0 * np.pi * np.arange(10) / 10
    reach = radius + tube * np.cos(across)
    rings = [
        np.stack([reach * np.cos(a), reach * np.sin(a), tube * np.sin(across)], axis=1)
        for a in around
    ]
    bands = [_band(10, True, True)[:, ::-1] + k * 10 for k in range(sides)]
    return np.vstack(rings).astype(np.float32), np.vstack(bands).astype(np.uint32)


def round_1_2_5(value: float) -> float:
    """Round to 1, 2 or 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(min((1.0, 2.0, 5.0, 10.0), key=lambda m: abs(np.log(m * power / value))) * power)
