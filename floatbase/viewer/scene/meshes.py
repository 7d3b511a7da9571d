"""Meshes of robots.

The meshes are the light ones in `assets/` if there are any, otherwise those of the URDF, otherwise
balls and rods along the kinematic tree.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Collection
from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from floatbase._assets import assets_root
from floatbase.robots import Robot
from floatbase.viewer.scene import geometry
from floatbase.viewer.scene.colours import ROBOT


@dataclass(frozen=True, eq=False)
class JointMesh:
    """Mesh that moves with one joint."""

    joint: int
    vertices: npt.NDArray[np.float32]
    faces: npt.NDArray[np.uint32]
    colours: npt.NDArray[np.uint8]


def robot_meshes(robot: Robot) -> list[JointMesh]:
    """Find the meshes of a robot."""
    asset = _mesh_file(robot.urdf, robot.joint_names)
    if asset is not None:
        return _merged_by_joint(
            [mesh for part in _mesh_parts(asset) for mesh in _joint_meshes(robot, *part)]
        )
    try:
        meshes = _from_urdf(robot)
    except (ImportError, ValueError, OSError):
        meshes = []  # no trimesh, or files that trimesh or Pinocchio cannot read
    return meshes or _from_tree(robot)


def appearance_digest(urdf: str, moving: Collection[str]) -> str:
    """Compute a digest of everything in a URDF that light meshes are made from."""
    root, visuals = ElementTree.fromstring(urdf), ElementTree.Element("looks")
    visuals.extend(root.findall("material"))
    for link in root.findall("link"):
        copy = ElementTree.SubElement(visuals, "link", name=link.get("name", ""))
        copy.extend(link.findall("visual"))
    for joint in root.findall("joint"):
        places = [] if joint.get("name") in moving else joint.findall("origin")
        ends = [*joint.findall("parent"), *joint.findall("child")]
        copy = ElementTree.SubElement(visuals, "joint", name=joint.get("name", ""))
        copy.extend([*ends, *places])
    for bolt in ("link[@name='world']", "joint/parent[@link='world']/.."):
        for element in visuals.findall(bolt):
            visuals.remove(element)
    text = ElementTree.canonicalize(ElementTree.tostring(visuals), strip_text=True)
    return sha256(text.encode()).hexdigest()


@lru_cache(maxsize=32)
def _mesh_file(urdf: str, joints: tuple[str, ...]) -> Path | None:
    """Find the light meshes made from such a URDF with at least these moving joints, or None."""
    for asset in sorted((assets_root() / "meshes").glob("*.npz")):
        with np.load(asset) as file:
            moving = set(file["moving"].tolist())
            if moving.issuperset(joints) and appearance_digest(urdf, moving) == file["appearance"]:
                return asset
    return None


Part = tuple[str, npt.NDArray[np.float32], npt.NDArray[np.uint32], npt.NDArray[np.uint8]]


@lru_cache(maxsize=8)
def _mesh_parts(asset: Path) -> list[Part]:
    """Return joint name, vertices, faces and colours of each part in a file."""
    parts = []
    with np.load(asset) as file:
        data = {name: file[name] for name in file.files}
    vertex, face = data["vertex_start"], data["face_start"]
    for i, joint in enumerate(data["joints"]):
        rows = slice(vertex[i], vertex[i + 1])
        vertices = (data["vertices"][rows] * data["steps"][i]).astype(np.float32)
        faces = data["faces"][face[i] : face[i + 1]].astype(np.uint32)
        parts.append((str(joint), vertices, faces, data["palette"][data["colours"][rows]]))
    return parts


def _joint_meshes(
    robot: Robot,
    joint: str,
    vertices: npt.NDArray[np.float32],
    faces: npt.NDArray[np.uint32],
    colours: npt.NDArray[np.uint8],
) -> list[JointMesh]:
    """Return one part as the mesh of its joint, or of the parent joint if the joint is locked."""
    model = robot.model
    if joint in ("universe", "root_joint"):
        return [JointMesh(1 if robot.is_floating else 0, vertices, faces, colours)]
    if model.existJointName(joint):
        return [JointMesh(int(model.getJointId(joint)), vertices, faces, colours)]
    if model.existFrame(joint):
        frame = model.frames[model.getFrameId(joint)]
        moved = vertices @ frame.placement.rotation.T + frame.placement.translation
        return [JointMesh(int(frame.parentJoint), moved.astype(np.float32), faces, colours)]
    return []


def _merged_by_joint(meshes: list[JointMesh]) -> list[JointMesh]:
    """Merge the meshes of each joint into one."""
    together = []
    for joint in dict.fromkeys(mesh.joint for mesh in meshes):
        own = [mesh for mesh in meshes if mesh.joint == joint]
        if len(own) > 1:
            vertices, faces = geometry.merged([(mesh.vertices, mesh.faces) for mesh in own])
            own = [JointMesh(joint, vertices, faces, np.vstack([mesh.colours for mesh in own]))]
        together += own
    return together


def _from_urdf(robot: Robot) -> list[JointMesh]:
    """Return the URDF's visuals, merged for each joint; raise `ImportError` without trimesh."""
    from floatbase.viewer.scene.visuals import urdf_visuals

    pieces = urdf_visuals(robot)
    meshes = []
    for joint in sorted({piece.joint for piece in pieces}):
        own = [piece for piece in pieces if piece.joint == joint]
        colours = [geometry.vertex_colours(piece.mesh.vertices, piece.colour) for piece in own]
        vertices, faces = geometry.merged(
            [(piece.mesh.vertices, piece.mesh.faces) for piece in own]
        )
        meshes.append(JointMesh(joint, vertices, faces, np.vstack(colours)))
    return meshes


def _from_tree(robot: Robot) -> list[JointMesh]:
    """Return a ball at each joint and a rod to each of its children."""
    model = robot.model
    places = list(model.jointPlacements)[1:]
    lengths = [float(np.linalg.norm(place.translation)) for place in places]
    radius = 0.12 * float(np.median([length for length in lengths if length > 1e-3] or [0.2]))
    meshes = []
    for joint in range(model.njoints):
        ends = [model.jointPlacements[child].translation for child in model.children[joint]]
        ends += [foot_frame.placement.translation for foot_frame in _feet(robot, joint)]
        if joint == 0 and robot.is_floating:
            continue
        ends = [end for end in ends if np.linalg.norm(end) > 1e-6]
        rods = [geometry.cylinder(np.zeros(3), end, radius) for end in ends]
        shapes = [geometry.sphere(1.6 * radius), *rods]
        vertices, faces = geometry.merged(shapes)
        colours = geometry.vertex_colours(vertices, ROBOT)
        meshes.append(JointMesh(joint, vertices, faces, colours))
    return meshes


def _feet(robot: Robot, joint: int) -> list[Any]:
    """Return the frames of the feet that a joint carries."""
    frames = [robot.model.frames[robot.frame_id(foot.frame)] for foot in robot.feet]
    return [frame for frame in frames if frame.parentJoint == joint]
