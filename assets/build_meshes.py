"""Build the light meshes of the robots in the catalogue: `python assets/build_meshes.py [robot …]`.

Needs the packages trimesh, pycollada and fast-simplification. Reading the result needs only numpy.

It loads the visuals of a robot's URDF material by material, welds them, decimates them to a number
of faces for the whole robot, splits them at creases so that edges look sharp, and merges them into
one mesh with coloured vertices for each joint. The file `assets/meshes/<robot>.npz` contains, for
part i: `joints[i]`, its joint's name; rows `vertex_start[i]:vertex_start[i + 1]` of `vertices`
(int16, times `steps[i]` metres, in the joint's frame) and of `colours` (index of `palette`, 0-255);
rows `face_start[i]:face_start[i + 1]` of `faces` (indices of the part's own vertices). `appearance`
and `moving` say which robots look like that: those for whose URDF `appearance_digest(urdf, moving)`
is the same.
"""

from __future__ import annotations

import sys
from pathlib import Path

import fast_simplification
import numpy as np
import trimesh

from floatbase.robots import Robot, catalogue, load
from floatbase.viewer.scene.meshes import appearance_digest
from floatbase.viewer.scene.visuals import VisualMesh, urdf_visuals

OUT = Path(__file__).parent / "meshes"
FACES = 36_000  # of a robot; fewer if the file would be larger than SIZE
SIZE = 380_000  # bytes
CREASE = np.radians(35.0)  # angle between two faces above which their edge is sharp
# colours of robots whose files in example-robot-data have none: word in the file's name -> colour
SOLO = {"": (0.24, 0.25, 0.27), "foot": (0.08, 0.08, 0.08), "lower_leg": (0.87, 0.87, 0.85)}
PAINT = {"solo12": SOLO, "solo8": SOLO}

Light = tuple[np.ndarray, trimesh.Trimesh]  # colour and mesh


def paint(robot: str, piece: VisualMesh) -> np.ndarray:
    """The piece's colour: of PAINT if the robot is there, else its own."""
    words = [word for word in PAINT.get(robot, {}) if word in piece.source]
    return np.array(PAINT[robot][max(words, key=len)]) if words else piece.colour


def budget(pieces: list[VisualMesh], total: float) -> list[int]:
    """How many faces each piece may have: in proportion to its size, `total` together."""
    have = np.array([len(piece.mesh.faces) for piece in pieces])
    size = np.array([np.sqrt(piece.mesh.area) for piece in pieces])
    low, high = 0.0, 1e6
    for _ in range(60):
        share = (low + high) / 2
        low, high = (
            (low, share) if np.minimum(have, 24 + share * size).sum() > total else (share, high)
        )
    return [int(n) for n in np.minimum(have, 24 + low * size)]


def lighten(mesh: trimesh.Trimesh, faces: int) -> trimesh.Trimesh:
    """Weld a mesh, decimate it to a number of faces, drop degenerate faces, and split vertices at
    creases.
    """
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    if faces < len(mesh.faces):
        points, triangles = fast_simplification.simplify(
            mesh.vertices.astype(np.float32), mesh.faces.astype(np.int32), target_count=faces, agg=7
        )
        mesh = trimesh.Trimesh(
            np.clip(points, *mesh.bounds), triangles
        )  # back into the original's box
    mesh.update_faces(mesh.nondegenerate_faces())
    return trimesh.graph.smooth_shade(mesh, angle=CREASE) if len(mesh.faces) else mesh


def merge(pieces: list[Light], palette: list[bytes]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, m, faces and palette indices of the pieces of one joint. Adds new colours to the
    palette.
    """
    vertices, faces, colours, start = [], [], [], 0
    for colour, mesh in pieces:
        code = np.clip(np.round(255 * colour), 0, 255).astype(np.uint8).tobytes()
        if code not in palette:
            palette.append(code)
        vertices.append(mesh.vertices)
        faces.append(mesh.faces + start)
        colours.append(np.full(len(mesh.vertices), palette.index(code), np.uint8))
        start += len(mesh.vertices)
    return np.vstack(vertices), np.vstack(faces), np.concatenate(colours)


def build(name: str) -> None:
    """Write the light meshes of one robot."""
    robot, total = load(name), float(FACES)
    pieces = urdf_visuals(robot)
    path = write(robot, pieces, total)
    while path.stat().st_size > SIZE:
        total *= 0.85
        path = write(robot, pieces, total)


def write(robot: Robot, pieces: list[VisualMesh], total: float) -> Path:
    """Write the light meshes with `total` faces, print their numbers, and return the file."""
    light: dict[int, list[Light]] = {}
    for piece, faces in zip(pieces, budget(pieces, total), strict=True):
        light.setdefault(piece.joint, []).append(
            (paint(robot.name, piece), lighten(piece.mesh.copy(), faces))
        )
    palette: list[bytes] = []
    parts = [merge(light[joint], palette) for joint in sorted(light)]
    steps = [np.abs(vertices).max() / 32767 for vertices, *_ in parts]
    OUT.mkdir(exist_ok=True)
    path = OUT / f"{robot.name}.npz"
    np.savez_compressed(
        path,
        appearance=np.array(appearance_digest(robot.urdf, robot.joint_names)),
        moving=np.array(robot.joint_names),
        joints=np.array([robot.model.names[joint] for joint in sorted(light)]),
        steps=np.array(steps),
        palette=np.frombuffer(b"".join(palette), np.uint8).reshape(-1, 3),
        vertex_start=np.cumsum([0] + [len(v) for v, *_ in parts]),
        face_start=np.cumsum([0] + [len(f) for _, f, _ in parts]),
        vertices=np.vstack(
            [np.round(v / s) for (v, *_), s in zip(parts, steps, strict=True)]
        ).astype(np.int16),
        faces=np.vstack([f for _, f, _ in parts]).astype(np.uint16),
        colours=np.concatenate([c for *_, c in parts]),
    )
    before, after = sum(len(p.mesh.faces) for p in pieces), sum(len(f) for _, f, _ in parts)
    vertices = sum(len(v) for v, *_ in parts)
    print(
        f"{robot.name}: {before} -> {after} faces, {vertices} vertices, {len(parts)} parts, "
        f"{len(palette)} colours, "
        f"{path.stat().st_size / 1000:.0f} KB"
    )
    return path


if __name__ == "__main__":
    for robot_name in sys.argv[1:] or catalogue():
        build(robot_name)
