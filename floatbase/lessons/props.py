"""Objects beside the robot: a wheel, a turntable, a hydraulic cylinder, a wall and bolts."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from floatbase._geometry import rotation_z
from floatbase._validation import as_array, as_positive, unit_vector
from floatbase.errors import InputError
from floatbase.viewer import Item, Picture, shapes
from floatbase.viewer.scene import geometry, threejs
from floatbase.viewer.scene.colours import MEASURED, PLANNED, RGB, WARNING
from floatbase.viewer.scene.shapes import transform, vector_and_length
from floatbase.viewer.scene.threejs import Shape

STEEL: RGB = (0.55, 0.58, 0.62)
RUBBER: RGB = (0.16, 0.17, 0.18)
WALL: RGB = (0.78, 0.76, 0.72)


def rod_between(start: npt.ArrayLike, end: npt.ArrayLike, radius: float, colour: RGB) -> Item:
    """Draw a rod between two points in the world frame [m]."""
    begin = np.asarray(start, dtype=np.float64)
    way = np.asarray(end, dtype=np.float64) - begin
    length = float(np.linalg.norm(way))
    return shapes.rod(begin, geometry.rotation_with_z_axis(way / length), length, radius, colour)


def wheel(
    centre: npt.ArrayLike,
    axis: npt.ArrayLike,
    radius: float,
    angle: float,
    width: float | None = None,
) -> Item:
    """Draw a wheel with spokes, one of which is marked and points upwards at the angle 0 [rad].

    The width [m] is 0.35 of the radius by default.
    """
    axle = unit_vector("axis of the wheel", axis)
    as_positive("radius of the wheel", radius, "m")
    up = np.array([0.0, 0.0, 1.0]) if abs(axle[2]) < 0.99 else np.array([1.0, 0.0, 0.0])
    x = up - axle * (axle @ up)
    x /= np.linalg.norm(x)
    rest = np.stack([x, np.cross(axle, x), axle], axis=1)
    thick = 0.35 * radius if width is None else width
    return Item(_unit_wheel(), transform(centre, rest @ rotation_z(angle), (radius, radius, thick)))


def turntable(centre: npt.ArrayLike, radius: float, angle: float) -> Item:
    """Draw a round level table on a foot, with painted lines, one of which is marked.

    Parameters
    ----------
    centre : array_like, shape (3,)
        Centre of the table's top in the world frame [m].
    radius : float
        Radius [m].
    angle : float
        Angle of rotation about the vertical, by the right-hand rule [rad]. At 0 the marked line
        points along x.

    Returns
    -------
    Item
        Item for `extra` of `Viewer.show`.
    """
    as_positive("radius of the turntable", radius, "m")
    return Item(_unit_table(), transform(centre, rotation_z(angle), radius))


def hydraulic_cylinder(
    base: npt.ArrayLike,
    end: npt.ArrayLike,
    stroke: tuple[float, float],
    pressures: tuple[float, float] = (0.5, 0.5),
) -> Picture:
    """Draw a double-acting hydraulic cylinder: barrel, rod, piston and two chambers.

    stroke: smallest and largest distance between the ends [m]. pressures: of the chamber at the
    base and of the chamber around the rod, from 0 (pale) to 1 (full colour).
    """
    if not 0.0 < stroke[0] < stroke[1]:
        raise InputError(
            f"stroke of the cylinder is {stroke}; it must be the smallest and the largest length "
            f"[m], both above zero and in ascending order."
        )
    start = as_array("base of the cylinder", base, (3,), "m")
    way, length = vector_and_length(
        "a cylinder", as_array("end of the cylinder", end, (3,), "m") - start
    )
    turned = geometry.rotation_with_z_axis(way / length)
    barrel = 0.92 * stroke[0]
    piston = min(max(length - 0.95 * stroke[0], 0.06 * barrel), 0.94 * barrel)
    radius = 0.10 * stroke[0]

    def between(low: float, high: float, width: float) -> np.ndarray:
        return transform(start + turned[:, 2] * low, turned, (width, width, max(high - low, 1e-4)))

    return {
        "/barrel": Item(_tube(), between(0.0, barrel, radius)),
        "/rod": Item(_rod(STEEL), between(piston, length, 0.38 * radius)),
        "/piston": Item(
            _rod(RUBBER), between(piston - 0.03 * barrel, piston + 0.03 * barrel, 0.93 * radius)
        ),
        "/base chamber": Item(
            _fluid(), between(0.0, piston, 0.9 * radius), (*MEASURED, 0.15 + 0.7 * pressures[0])
        ),
        "/rod chamber": Item(
            _fluid(), between(piston, barrel, 0.9 * radius), (*PLANNED, 0.15 + 0.7 * pressures[1])
        ),
    }


def wall(position: npt.ArrayLike, normal: npt.ArrayLike, width: float, height: float) -> Item:
    """Draw a vertical wall.

    Parameters
    ----------
    position : array_like, shape (3,)
        Centre of the front in the world frame [m].
    normal : array_like, shape (3,)
        Normal of the front in the world frame, pointing out of the wall.
    width, height : float
        Width and height [m].

    Returns
    -------
    Item
        Item for `extra` of `Viewer.show`.

    Raises
    ------
    InputError
        If `normal` is vertical.
    """
    n = unit_vector("normal of the wall", normal)
    side = np.cross([0.0, 0.0, 1.0], n)
    if np.linalg.norm(side) < 1e-6:
        raise InputError(
            "normal of the wall is vertical. A wall is upright, so its normal must have a "
            "horizontal component."
        )
    side /= np.linalg.norm(side)
    as_positive("width of the wall", width, "m")
    as_positive("height of the wall", height, "m")
    turned = np.stack([n, side, np.cross(n, side)], axis=1)
    thick = 0.05 * height
    return Item(
        _unit_box(WALL),
        transform(np.asarray(position) - n * thick / 2, turned, (thick, width, height)),
    )


def bolts(position: npt.ArrayLike, radius: float, count: int = 4) -> Picture:
    """Draw bolts on a horizontal circle.

    Parameters
    ----------
    position : array_like, shape (3,)
        Centre of the circle in the world frame [m].
    radius : float
        Radius of the circle [m].
    count : int, optional
        Number of bolts.

    Returns
    -------
    Picture
        Items for `extra` of `Viewer.show`.
    """
    as_positive("radius of the bolts' circle", radius, "m")
    picture: Picture = {}
    for i in range(count):
        angle = 2.0 * np.pi * (i + 0.5) / count
        at = np.asarray(position) + radius * np.array([np.cos(angle), np.sin(angle), 0.0])
        picture[f"/bolt {i}"] = Item(_bolt(), transform(at, scale=0.14 * radius))
    return picture


@lru_cache(maxsize=1)
def _unit_wheel() -> Shape:
    """Return a wheel around z, of radius 1 and width 1, with one marked spoke."""
    tyre = geometry.surface_of_revolution(
        [(0.8, -0.5), (1.0, -0.5), (1.0, 0.5), (0.8, 0.5), (0.8, -0.5)], 48
    )
    hub = geometry.surface_of_revolution([(0.0, -0.5), (0.16, -0.5), (0.16, 0.5), (0.0, 0.5)])
    angles = 2.0 * np.pi * np.arange(6) / 6
    spokes = [
        geometry.cylinder(np.zeros(3), [0.85 * np.cos(a), 0.85 * np.sin(a), 0.0], 0.06)
        for a in angles
    ]
    parts = [
        (tyre, RUBBER),
        (hub, STEEL),
        (spokes[0], WARNING),
        *((spoke, STEEL) for spoke in spokes[1:]),
    ]
    colours = [
        np.tile(np.round(255 * np.array(colour)), (len(mesh[0]), 1)) for mesh, colour in parts
    ]
    return threejs.mesh(*geometry.merged([mesh for mesh, _ in parts]), colours=np.vstack(colours))


@lru_cache(maxsize=1)
def _unit_table() -> Shape:
    """Return a disc of radius 1 with its top at z = 0, a rim and twelve painted lines."""
    top = geometry.surface_of_revolution([(0.97, 0.0), (0.0, 0.0)], 72)
    rim = geometry.surface_of_revolution(
        [(0.97, -0.05), (1.0, -0.05), (1.0, 0.012), (0.97, 0.012), (0.97, -0.05)], 72
    )
    foot = geometry.surface_of_revolution(
        [(0.0, -0.25), (0.3, -0.25), (0.06, -0.2), (0.06, -0.05), (0.0, -0.05)], 36
    )
    angles = 2.0 * np.pi * np.arange(12) / 12
    lines = [
        geometry.cylinder(np.zeros(3), [0.97 * np.cos(a), 0.97 * np.sin(a), 0.0], 0.005)
        for a in angles
    ]
    mark = geometry.cylinder([0.0, 0.0, 0.0], [0.97, 0.0, 0.0], 0.016)
    parts = [
        (top, WALL),
        (rim, STEEL),
        (foot, STEEL),
        (mark, RUBBER),
        *((line, STEEL) for line in lines[1:]),
    ]
    colours = [
        np.tile(np.round(255 * np.array(colour)), (len(mesh[0]), 1)) for mesh, colour in parts
    ]
    return threejs.mesh(*geometry.merged([mesh for mesh, _ in parts]), colours=np.vstack(colours))


@lru_cache(maxsize=1)
def _tube() -> Shape:
    """Return a translucent tube along z, of length 1 and radius 1."""
    return threejs.mesh(
        *geometry.surface_of_revolution([(1.0, 0.0), (1.0, 1.0)], 32), STEEL, opacity=0.35
    )


@lru_cache(maxsize=1)
def _fluid() -> Shape:
    profile = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    return threejs.mesh(*geometry.surface_of_revolution(profile, 24), (1.0, 1.0, 1.0), opacity=0.5)


@lru_cache(maxsize=8)
def _rod(colour: RGB) -> Shape:
    return threejs.mesh(
        *geometry.surface_of_revolution([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)], 24),
        colour,
    )


@lru_cache(maxsize=8)
def _unit_box(colour: RGB) -> Shape:
    """Return a cube of side 1 around the origin."""
    corners = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return threejs.mesh(
        *geometry.merged([geometry.convex_polygon(corners[list(side)]) for side in sides]),
        colour,
        flat=True,
    )


@lru_cache(maxsize=1)
def _bolt() -> Shape:
    head = geometry.surface_of_revolution([(0.0, 0.0), (1.0, 0.0), (1.0, 0.9), (0.0, 0.9)], 6)
    return threejs.mesh(*head, (0.25, 0.26, 0.28), flat=True)
