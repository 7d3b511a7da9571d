"""Hulls of a robot's links, with which it lies on the ground after a fall, from the URDF's
collision shapes.
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

_MIN_THICKNESS = 1e-3  # m: flatter points have no hull for MuJoCo
_PRISM_SIDES = 24  # of the prism that stands for a cylinder: it is within 1 % of the radius
_BLOCK_SIZE = 1024  # points at a time: what one core's cache holds
# a hull keeps the farthest point in each: a ball of 10 cm becomes flatter by 0.2 mm
_N_DIRECTIONS = 1000


@lru_cache(maxsize=16)
def link_hulls(robot: Robot) -> tuple[tuple[int, Array], ...]:
    """Pinocchio's number of the joint that moves a link, and points whose hull it fills, shape (n,
    3), m, in the joint's frame.

    All that one joint moves has one hull: a plane touches a body where it touches its hull. A robot
    that is bolted to the ground has none.
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
    """The links' collision shapes, or what is seen of links without; no meshes where one of their
    files is missing.
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
    """The collision shapes of a URDF. Raises `ValueError` where a file of a mesh is missing."""
    urdf = ElementTree.tostring(root, encoding="unicode")
    loader = coal.CachedMeshLoader(
        coal.BV_OBB
    )  # legs share files; of other kinds of trees Python cannot see the vertices
    folders = [str(folder) for folder in robot.package_dirs]
    return list(
        pin.buildGeomFromUrdfString(
            robot.model, urdf, pin.COLLISION, package_dirs=folders, mesh_loader=loader
        ).geometryObjects
    )


def _shape_points(shape: Any) -> Array:
    """Points whose hull is a shape, in its own frame, shape (n, 3), m; none for a kind that is not
    known.
    """
    match shape:
        case coal.Box():
            return np.array(shape.halfSide).ravel() * (
                2.0 * np.indices((2, 2, 2)).reshape(3, 8).T - 1.0
            )
        case coal.Sphere():
            return shape.radius * _sphere_directions()
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
    """The least extension along the principal axes of points, shape (n, 3); 0 for fewer than four
    points.
    """
    if len(points) < 4:
        return 0.0
    centred = points - points.mean(axis=0)
    axes = np.linalg.eigh(centred.T @ centred)[1]
    return float(np.ptp(centred @ axes, axis=0).min())


def _extreme_points(points: Array) -> Array:
    """Those points, shape (m, 3), that are the farthest in some direction: enough for a hull."""
    directions = _sphere_directions()
    best, support = np.zeros(len(directions), dtype=int), np.full(len(directions), -np.inf)
    for first in range(0, len(points), _BLOCK_SIZE):
        supports = directions @ points[first : first + _BLOCK_SIZE].T
        indices = supports.argmax(axis=1)
        farther = (candidate := supports[np.arange(len(directions)), indices]) > support
        best[farther], support[farther] = first + indices[farther], candidate[farther]
    return points[np.unique(best)]


def _sphere_directions() -> Array:
    """Unit vectors that cover a sphere evenly along a golden spiral, shape (n, 3), the six axes
    among them.
    """
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
