"""Shapes of a robot's links in the URDF, with meshes in metres and stand-ins for missing meshes."""

from __future__ import annotations

import copy
import os
import warnings
import xml.etree.ElementTree as ElementTree
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from floatbase._validation import Array
from floatbase.errors import RobotWarning
from floatbase.robots.inertia import text_of

_PRISM_SIDES = 24  # sides of the prism that approximates a cylinder to 1 % of its radius
_N_DIRECTIONS = 1000  # points on a sphere: a ball of 10 cm flattens by 0.2 mm


def link_shapes(
    model: pin.Model,
    urdf: str,
    folders: Sequence[Path],
    kind: pin.GeometryType = pin.COLLISION,
    links: Collection[str] | None = None,
) -> tuple[list[Any], set[str]]:
    """Return shapes as Pinocchio's geometry objects, and the links whose meshes are missing.

    A link without collision shapes has its visual shapes instead. A link with a missing mesh is
    represented by its shapes of the other kind, or else by a box with the link's inertia.
    """
    root = ElementTree.fromstring(urdf)
    loader = coal.CachedMeshLoader(coal.BV_OBB)  # Python cannot read the vertices of other trees
    tags = ("collision", "visual") if kind == pin.COLLISION else ("visual", "collision")
    incomplete = set()
    for link in root.findall("link"):
        shapes, others = (link.findall(tag) for tag in tags)
        for shape in (*shapes, *others):
            link.remove(shape)
        if links is not None and link.get("name") not in links:
            continue
        if not shapes and kind == pin.COLLISION:
            shapes, others = others, []
        loaded = [shape for shape in shapes if _load_mesh(shape, folders, loader)]
        if len(loaded) < len(shapes):
            incomplete.add(link.get("name", ""))
            stand_ins = [shape for shape in others if _load_mesh(shape, folders, loader)]
            loaded = stand_ins or loaded or _inertia_box(link)
        for shape in loaded:
            shape.tag = tags[0]
            link.append(shape)
    text = ElementTree.tostring(root, encoding="unicode")
    found = pin.buildGeomFromUrdfString(model, text, kind, mesh_loader=loader)
    return list(found.geometryObjects), incomplete


def missing_meshes(urdf: str, folders: Sequence[Path]) -> list[str]:
    """Return the names of the mesh files that do not exist."""
    names = {mesh.get("filename", "") for mesh in ElementTree.fromstring(urdf).iter("mesh")}
    return sorted(name for name in names if _find_mesh(name, folders) is None)


def placed_points(shape: Any, joint: pin.SE3 | None = None) -> Array:
    """Return points whose hull is a shape, shape (n, 3) [m]; none if its kind is unknown.

    They are in the frame of the shape's joint, or in the one in which the joint has a placement.
    """
    place = shape.placement if joint is None else joint * shape.placement
    points: Array = _points(shape.geometry) @ place.rotation.T + place.translation
    return points


def _points(shape: Any) -> Array:
    """Return points whose hull is a shape, shape (n, 3), in its frame [m]; none if unknown."""
    match shape:
        case coal.Box():
            half_sides: Array = np.array(shape.halfSide).ravel()
            return half_sides * (2.0 * np.indices((2, 2, 2)).reshape(3, 8).T - 1.0)
        case coal.Sphere():
            return float(shape.radius) * sphere_directions()
        case coal.Cylinder() | coal.Capsule():
            ends = np.array([[0.0, 0.0, -shape.halfLength], [0.0, 0.0, shape.halfLength]])
            angles = np.arange(_PRISM_SIDES) * 2.0 * np.pi / _PRISM_SIDES
            circle = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(_PRISM_SIDES)])
            profile = circle if isinstance(shape, coal.Cylinder) else sphere_directions()
            return np.vstack([end + shape.radius * profile for end in ends])
        case coal.BVHModelBase():
            return np.array(shape.vertices())
    return np.zeros((0, 3))


def sphere_directions() -> Array:
    """Return unit vectors, shape (n, 3), along a golden spiral on a sphere, then the six axes."""
    i = np.arange(_N_DIRECTIONS)
    z, angle = 1.0 - (2.0 * i + 1.0) / _N_DIRECTIONS, i * np.pi * (3.0 - np.sqrt(5.0))
    radius = np.sqrt(1.0 - z**2)
    spiral = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])
    return np.vstack([spiral, np.eye(3), -np.eye(3)])


def _load_mesh(shape: ElementTree.Element, folders: Sequence[Path], loader: Any) -> bool:
    """Return whether a shape needs no mesh, or its mesh can be read; complete its path and scale.

    The warning about a file that cannot be read is shown once, whatever the mesh is needed for.
    """
    mesh = shape.find("geometry/mesh")
    if mesh is None:
        return True
    path = _find_mesh(mesh.get("filename", ""), folders)
    if path is None:
        return False
    try:
        scale = _unit(path) * np.array(mesh.get("scale", "1 1 1").split(), dtype=np.float64)
        loader.load(str(path), scale)
    except (RuntimeError, ValueError) as error:
        warnings.warn(
            f"The mesh file {path} cannot be read: {_reason(error)}. Its link is represented by "
            f"other shapes or a box. Replace the file.",
            RobotWarning,
            stacklevel=1,
        )
        return False
    mesh.set("filename", str(path))
    mesh.set("scale", text_of(scale))
    return True


def _reason(error: Exception) -> str:
    """Return the line of coal's error message that says why a file cannot be read."""
    _, _, text = str(error).partition("message: ")
    lines = [line for line in text.splitlines() if line and not line.startswith("Hint")]
    return (lines or str(error).splitlines() or ["unknown reason"])[-1].rstrip(".")


def _unit(path: Path) -> float:
    """Return the unit of length of a Collada file [m]; 1 for other files, which have none."""
    if path.suffix.lower() == ".dae":
        try:
            for _, element in ElementTree.iterparse(path, ("start",)):
                if element.tag.endswith("}unit"):
                    return float(element.get("meter", 1.0))
                if element.tag.endswith("}library_geometries"):
                    break  # the unit would precede it
        except (ElementTree.ParseError, ValueError):
            pass  # the loader reports a file that it cannot read either
    return 1.0


def _find_mesh(name: str, folders: Sequence[Path]) -> Path | None:
    """Return the path of a mesh file, looked up in folders and in all folders above them.

    The name of the package may be missing from the path, as in a copy of a ROS package.
    """
    scheme, _, location = name.replace("\\", "/").rpartition("://")
    if not location:
        return None
    locations = [location]
    if scheme in ("package", "model"):
        locations.append(location.partition("/")[2])
    ros = [
        Path(folder)
        for variable in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH")
        for folder in os.environ.get(variable, "").split(os.pathsep)
        if folder
    ]
    starts = [folder.absolute() for folder in (*folders, *ros)] or [Path("/")]
    places = (
        above / place
        for start in starts
        for place in locations
        if place
        for above in (start, start / "share", *start.parents)
    )
    return next((path for path in places if path.is_file()), None)


def _inertia_box(link: ElementTree.Element) -> list[ElementTree.Element]:
    """Return a box with the mass and the moments of inertia of a link; none if it has no mass."""
    mass, inertia = link.find("inertial/mass"), link.find("inertial/inertia")
    if mass is None or inertia is None or float(mass.get("value", 0.0)) <= 0.0:
        return []
    moments = np.array([float(inertia.get(name, 0.0)) for name in ("ixx", "iyy", "izz")])
    squares = 6.0 * (moments.sum() - 2.0 * moments) / float(mass.get("value", 0.0))
    shape = ElementTree.Element("collision")
    shape.extend(copy.copy(origin) for origin in link.findall("inertial/origin"))
    size = text_of(np.sqrt(np.maximum(squares, 0.0)))
    ElementTree.SubElement(ElementTree.SubElement(shape, "geometry"), "box", size=size)
    return [shape]
