"""Visuals in a robot's URDF, from which light meshes are made; other robots show them directly.

meshcat drops parts of files with several materials, and Pinocchio's loader reads some of them with
wrong triangles. Therefore trimesh reads the files here, material by material. The module needs
trimesh, and pycollada for .dae files.
"""

from __future__ import annotations

import io
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase.robots import Robot
from floatbase.robots._shapes import link_shapes

if TYPE_CHECKING:
    import trimesh

GREY = (0.62, 0.64, 0.67)
SHARP = 0.5  # rad: edges with a larger angle between their faces are drawn as edges
DARK = (0.2, 0.2, 0.2)  # colour of a material whose texture is missing


@dataclass(frozen=True, eq=False)
class VisualMesh:
    """One piece of a robot."""

    joint: int
    colour: npt.NDArray[np.float64]
    mesh: trimesh.Trimesh
    source: str


def urdf_visuals(robot: Robot) -> list[VisualMesh]:
    """Read all visuals of a robot's URDF."""
    import trimesh  # noqa: F401  raises at once if it is missing

    items, _ = link_shapes(robot.model, robot.urdf, robot.package_dirs, pin.VISUAL)
    return [piece for item in items for piece in _pieces(item)]


def _pieces(item: pin.GeometryObject) -> list[VisualMesh]:
    """Return the pieces of one visual, one for each of its materials."""
    import trimesh

    scale = np.asarray(item.meshScale).ravel()
    if not Path(item.meshPath).is_file():
        meshes = [_primitive(item.geometry)]
    else:
        try:
            dump = _scene(Path(item.meshPath)).dump()
        except Exception:  # trimesh raises errors of many libraries; Pinocchio has read the file
            dump, scale = [_as_mesh(item.geometry)], np.ones(3)
        meshes = [mesh for mesh in dump if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces)]
    pieces = []
    for mesh in meshes:
        plain = trimesh.Trimesh(mesh.vertices, mesh.faces)
        plain.apply_scale(scale)
        plain.apply_transform(item.placement.homogeneous)
        if not Path(item.meshPath).is_file():
            plain = trimesh.graph.smooth_shade(plain, angle=SHARP)  # separate vertices at edges
        pieces.append(
            VisualMesh(int(item.parentJoint), _colour(item, mesh), plain, Path(item.meshPath).stem)
        )
    return pieces


def _scene(path: Path) -> trimesh.Scene:
    """Read the meshes in a file."""
    import trimesh

    scene = trimesh.load_scene(path)
    if scene.geometry or path.suffix.lower() != ".dae":
        return scene
    return trimesh.load_scene(io.BytesIO(_without_textures(path)), file_type="dae")


def _without_textures(path: Path) -> bytes:
    """Return a .dae file with a dark colour in place of each texture."""
    root = ElementTree.parse(path).getroot()
    space = root.tag.rpartition("}")[0] + "}"
    for parent in list(root.iter()):
        for child in list(parent):
            if child.tag == f"{space}newparam":
                parent.remove(child)
            elif child.tag == f"{space}texture":
                parent.remove(child)
                ElementTree.SubElement(parent, f"{space}color").text = " ".join(
                    map(str, (*DARK, 1.0))
                )
    return ElementTree.tostring(root)


def _as_mesh(shape: Any) -> trimesh.Trimesh:
    """Return a mesh as Pinocchio has read it."""
    import trimesh

    faces = [list(shape.tri_indices(i)) for i in range(shape.num_tris)]
    return trimesh.Trimesh(np.array(shape.vertices()), faces)


def _primitive(shape: Any) -> trimesh.Trimesh:
    """Return a box, cylinder or sphere of the URDF as a mesh."""
    import trimesh

    if hasattr(shape, "halfSide"):
        return trimesh.creation.box(2.0 * np.asarray(shape.halfSide).ravel())
    if hasattr(shape, "halfLength"):
        return trimesh.creation.cylinder(shape.radius, 2.0 * shape.halfLength, sections=24)
    return trimesh.creation.icosphere(2, shape.radius)


def _colour(item: pin.GeometryObject, mesh: trimesh.Trimesh) -> npt.NDArray[np.float64]:
    """Return the colour of the file's material, else that of the URDF, else grey."""
    material = getattr(mesh.visual, "material", None)
    if Path(item.meshPath).suffix.lower() in (".dae", ".obj") and material is not None:
        return np.asarray(material.main_color[:3]) / 255.0
    return np.asarray(item.meshColor).ravel()[:3] if item.overrideMaterial else np.array(GREY)
