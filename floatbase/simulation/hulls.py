"""Convex hulls of a robot's links, made from the URDF's collision shapes.

After a fall, the robot lies on them.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from functools import lru_cache
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from floatbase._validation import Array, read_only
from floatbase.robots import Robot

_MIN_THICKNESS = 1e-3  # m: MuJoCo builds no hull from flatter sets of points
_PRISM_SIDES = 24  # sides of the prism that approximates a cylinder to 1 % of its radius
_BLOCK_SIZE = 1024  # points at a time: as many as one core's cache holds
# directions in each of which a hull keeps its farthest point: a ball of 10 cm flattens by 0.2 mm
_N_DIRECTIONS = 1000


@lru_cache(maxsize=16)
def link_hulls(robot: Robot) -> tuple[tuple[int, Array], ...]:
    """Return the joints that move links, each with the points that span its links' hull.

    All links that one joint moves share one hull, because a plane touches a body exactly where it
    touches the body's hull. A robot with a fixed base has no hulls.
    """
    if not robot.is_floating:
        return ()
    clouds = dict[int, list[Array]]()
    for item in _collision_objects(robot):
        points = (
            _shape_points(item.geometry) @ item.placement.rotation.T + item.placement.translation
        )
        clouds.setdefault(int(item.parentJoint), []).append(points)
    hulls = {joint: np.vstack(cloud) for joint, cloud in clouds.items()}
    return tuple(
        (joint, read_only(_extreme_points(points)))
        for joint, points in hulls.items()
        if _thickness(points) > _MIN_THICKNESS
    )


def _collision_objects(robot: Robot) -> list[Any]:
    """Return the links' collision shapes, or visual shapes where a link has no collision shape.

    Meshes are left out if the file of any of them is missing.
    """
    root = ElementTree.fromstring(robot.urdf)
    for link in root.findall("link"):
        if link.find("collision") is None:
            for visual in link.findall("visual"):
                visual.tag = "collision"
    try:
        return _read_geometry(robot, root)
    except ValueError:
        for link in root.findall("link"):
            for shape in link.findall("collision"):
                if shape.find("geometry/mesh") is not None:
                    link.remove(shape)
        return _read_geometry(robot, root)


def _read_geometry(robot: Robot, root: ElementTree.Element) -> list[Any]:
    """Return the collision shapes of a URDF; a missing mesh file raises `ValueError`."""
    urdf = ElementTree.tostring(root, encoding="unicode")
    # legs share files; Python cannot read the vertices of other kinds of trees
    loader = coal.CachedMeshLoader(coal.BV_OBB)
    folders = [str(folder) for folder in robot.package_dirs]
    return list(
        pin.buildGeomFromUrdfString(
            robot.model, urdf, pin.COLLISION, package_dirs=folders, mesh_loader=loader
        ).geometryObjects
    )


def _shape_points(shape: Any) -> Array:
    """Return points whose hull is a shape, shape (n, 3), in its frame [m]; none if unknown."""
    match shape:
        case coal.Box():
            half_sides: Array = np.array(shape.halfSide).ravel()
            return half_sides * (2.0 * np.indices((2, 2, 2)).reshape(3, 8).T - 1.0)
        case coal.Sphere():
            return float(shape.radius) * _sphere_directions()
        case coal.Cylinder() | coal.Capsule():
            ends = np.array([[0.0, 0.0, -shape.halfLength], [0.0, 0.0, shape.halfLength]])
            angles = np.arange(_PRISM_SIDES) * 2.0 * np.pi / _PRISM_SIDES
            circle = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(_PRISM_SIDES)])
            profile = circle if isinstance(shape, coal.Cylinder) else _sphere_directions()
            return np.vstack([end + shape.radius * profile for end in ends])
        case coal.BVHModelBase():
            return np.array(shape.vertices())
    return np.zeros((0, 3))


def _thickness(points: Array) -> float:
    """Return the least extent of points along their principal axes; 0 for fewer than four."""
    if len(points) < 4:
        return 0.0
    centred = points - points.mean(axis=0)
    axes = np.linalg.eigh(centred.T @ centred)[1]
    return float(np.ptp(centred @ axes, axis=0).min())


def _extreme_points(points: Array) -> Array:
    """Return the points that are farthest in some direction, shape (m, 3): enough for a hull."""
    directions = _sphere_directions()
    best, support = np.zeros(len(directions), dtype=int), np.full(len(directions), -np.inf)
    for first in range(0, len(points), _BLOCK_SIZE):
        supports = directions @ points[first : first + _BLOCK_SIZE].T
        indices = supports.argmax(axis=1)
        farther = (candidate := supports[np.arange(len(directions)), indices]) > support
        best[farther], support[farther] = first + indices[farther], candidate[farther]
    extreme: Array = points[np.unique(best)]
    return extreme


def _sphere_directions() -> Array:
    """Return unit vectors, shape (n, 3), along a golden spiral on a sphere, then the six axes."""
    i = np.arange(_N_DIRECTIONS)
    z, angle = 1.0 - (2.0 * i + 1.0) / _N_DIRECTIONS, i * np.pi * (3.0 - np.sqrt(5.0))
    radius = np.sqrt(1.0 - z**2)
    return np.vstack(
        [
            np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z]),
            np.eye(3),
            -np.eye(3),
        ]
    )
