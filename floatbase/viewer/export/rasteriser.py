"""A rasterizer for meshes: triangles with a depth buffer in numpy, for images without a browser."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array
from floatbase.viewer.scene.shapes import Item
from floatbase.viewer.scene.threejs import Shape

NEAR_PLANE = 0.05  # m from the camera: anything nearer is not drawn
_AMBIENT, _DIFFUSE = 0.62, 0.42
_LIGHT_DIRECTION = np.array([0.25, 0.35, 0.9]) / np.linalg.norm([0.25, 0.35, 0.9])
_MAX_SAMPLES = 1 << 20  # samples at once, so that memory does not grow with the number of triangles
_MAX_BOX = 32  # pixels: a box around a longer triangle has many pixels outside the triangle
_BOX_STEP = 8  # pixels: boxes whose sides differ by less are made equal and filled together
Pixels = npt.NDArray[np.float32]


class Camera(NamedTuple):
    """A perspective camera."""

    eye: Array
    target: Array
    angle: float
    size: tuple[int, int]

    def project(self, points: Array) -> Array:
        """Project points to the image."""
        forward = (self.target - self.eye) / np.linalg.norm(self.target - self.eye)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        right = (
            right / np.linalg.norm(right)
            if np.linalg.norm(right) > 1e-9
            else np.array([0.0, -1.0, 0.0])
        )
        seen = (points - self.eye) @ np.stack([right, np.cross(forward, right), forward], axis=1)
        scale = self.pixels_at_one_metre / np.maximum(seen[:, 2:], NEAR_PLANE)
        seen[:, :2] = seen[:, :2] * scale + 0.5 * np.array(self.size)
        return np.asarray(seen)

    @property
    def pixels_at_one_metre(self) -> float:
        """Size in the image of a length of 1 m at a distance of 1 m [pixels]."""
        return 0.5 * self.size[1] / float(np.tan(np.radians(self.angle) / 2))


class _Mesh(NamedTuple):
    """A mesh."""

    vertices: Array
    normals: Array
    faces: npt.NDArray[np.int64]
    colours: Array


class _Samples(NamedTuple):
    """Pixels covered by triangles."""

    at: npt.NDArray[np.int64]
    depth: Pixels
    colour: Pixels


def draw_meshes(items: Sequence[Item], camera: Camera, canvas: Pixels) -> None:
    """Draw opaque meshes, then translucent ones from far to near, then items always on top."""
    pixels = canvas.reshape(-1, 3)
    depth = np.full(canvas.shape[0] * canvas.shape[1], 0.0, dtype=np.float32)
    opaque = [item for item in items if _opacity(item) >= 1.0 and not _is_on_top(item)]
    for item in opaque:
        for samples in _samples(item, camera):
            _draw_nearest(samples, pixels, depth)
    others = [item for item in items if _opacity(item) < 1.0 and not _is_on_top(item)]
    for item in sorted(
        others, key=lambda item: -float(np.linalg.norm(item.matrix[:3, 3] - camera.eye))
    ):
        for samples in _concatenated(_samples(item, camera)):
            _blend(samples, depth, item, pixels)
    for item in (item for item in items if _is_on_top(item)):
        over = np.zeros_like(depth)
        for samples in _samples(item, camera):
            _draw_nearest(samples, pixels, over)


def _draw_nearest(samples: _Samples, pixels: Pixels, depth: Pixels) -> None:
    """Draw the nearest samples where they are nearer than what is already drawn."""
    np.minimum.at(depth, samples.at, samples.depth)
    seen = samples.depth == depth[samples.at]
    pixels[samples.at[seen]] = samples.colour[seen]


def _concatenated(parts: Iterable[_Samples]) -> list[_Samples]:
    """Return the parts as one, or an empty list if there are none."""
    all_of = list(parts)
    at, depth, colour = ([part[i] for part in all_of] for i in range(3))
    return (
        [_Samples(np.concatenate(at), np.concatenate(depth), np.concatenate(colour))]
        if all_of
        else []
    )


def _blend(samples: _Samples, depth: Pixels, item: Item, pixels: Pixels) -> None:
    """Blend a translucent mesh; samples of one pixel count as layers of their mean colour."""
    seen = samples.depth < depth[samples.at]
    where, which, layers = np.unique(samples.at[seen], return_inverse=True, return_counts=True)
    sums = [np.bincount(which, samples.colour[seen, i], len(where)) for i in range(3)]
    rest = (1.0 - _opacity(item)) ** (np.ones_like(layers) if _hides_back(item) else layers)[
        :, None
    ]
    pixels[where] = rest * pixels[where] + (1.0 - rest) * np.stack(sums, axis=1) / layers[:, None]


def _samples(item: Item, camera: Camera) -> Iterator[_Samples]:
    """Yield the pixels that the triangles of a mesh cover, with lit colours."""
    mesh, pose = _mesh(item.shape), item.matrix
    points = mesh.vertices @ pose[:3, :3].T + pose[:3, 3]
    colours = (
        mesh.colours
        if item.colour is None
        else np.broadcast_to(item.colour[:3], mesh.colours.shape)
    )
    if item.shape.data["materials"][0]["type"] == "MeshPhongMaterial":
        normals = mesh.normals @ np.linalg.pinv(pose[:3, :3])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        # both sides of a surface are lit
        towards = np.sign(np.sum(normals * (camera.eye - points), axis=1))
        light = _AMBIENT + _DIFFUSE * np.maximum(towards * (normals @ _LIGHT_DIRECTION), 0.0)
        colours = np.minimum(colours * light[:, None], 1.0)
    seen = camera.project(points)
    forward = (seen[:, 2] > NEAR_PLANE)[mesh.faces].all(axis=1)
    # unlike the distance, linear over a triangle in the image
    seen[:, 2] = -1.0 / np.maximum(seen[:, 2], NEAR_PLANE)
    corners = np.concatenate([seen, colours], axis=1)[mesh.faces[forward]].astype(np.float32)
    corners, low, sides = _split(corners, camera.size)
    kinds = sides @ (_MAX_BOX + 1, 1)  # one number for both sides
    for kind in np.unique(kinds).tolist():
        rows, (wide, tall) = np.flatnonzero(kinds == kind), divmod(kind, _MAX_BOX + 1)
        step = max(_MAX_SAMPLES // (wide * tall), 1)
        for part in (rows[i : i + step] for i in range(0, len(rows), step)):
            yield _rasterised(corners[part], low[part], (wide, tall), camera.size)


def _split(
    corners: Pixels, size: tuple[int, int]
) -> tuple[Pixels, npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return the triangles in the image, long ones split, and the start and sides of boxes."""
    while True:
        a, b, c = (corners[:, i, :2] for i in range(3))
        low = np.floor(np.maximum(np.minimum(np.minimum(a, b), c), 0.0)).astype(np.int64)
        high = np.ceil(np.minimum(np.maximum(np.maximum(a, b), c), size)).astype(np.int64)
        inside = (high > low).all(axis=1)
        corners, low, sides = corners[inside], low[inside], (high - low)[inside]
        is_long = sides.max(axis=1) > _MAX_BOX
        if not is_long.any():
            return corners, low, -(sides // -_BOX_STEP) * _BOX_STEP
        edges = np.linalg.norm(
            corners[is_long, :, :2] - np.roll(corners[is_long, :, :2], -1, axis=1), axis=2
        )
        turn = (edges.argmax(axis=1)[:, None] + np.arange(3)) % 3  # the longest edge first
        a, b, c = np.swapaxes(np.take_along_axis(corners[is_long], turn[:, :, None], axis=1), 0, 1)
        middle = 0.5 * (a + b)
        halves = [np.stack(half, axis=1) for half in ((a, middle, c), (middle, b, c))]
        corners = np.concatenate([corners[~is_long], *halves])


def _rasterised(
    corners: Pixels, start: npt.NDArray[np.int64], sides: tuple[int, int], size: tuple[int, int]
) -> _Samples:
    """Return the pixels in triangles."""
    (ax, ay), (bx, by), (cx, cy) = (corners[:, i, :2].T for i in range(3))
    area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    area = np.where(area == 0.0, np.float32(np.nan), area)  # edge-on: it covers no pixel
    px, py = (start + 0.5).astype(np.float32).T
    across, down = (np.arange(side, dtype=np.float32) for side in sides)
    v = _linear_function(
        (px - ax) * (cy - ay) - (cx - ax) * (py - ay), cy - ay, ax - cx, area, across, down
    )
    w = _linear_function(
        (bx - ax) * (py - ay) - (px - ax) * (by - ay), ay - by, bx - ax, area, across, down
    )
    found = np.flatnonzero((v >= 0.0) & (w >= 0.0) & (v + w <= 1.0))
    which, rest = np.divmod(found, sides[0] * sides[1])
    row, column = np.divmod(rest, sides[0])
    v, w = v.ravel()[found], w.ravel()[found]
    x, y = start[which, 0] + column, start[which, 1] + row
    inside = (x < size[0]) & (y < size[1])
    which, v, w = which[inside], v[inside, None], w[inside, None]
    mixed = (
        (1.0 - v - w) * corners[which, 0, 2:]
        + v * corners[which, 1, 2:]
        + w * corners[which, 2, 2:]
    )
    return _Samples(y[inside] * size[0] + x[inside], mixed[:, 0], mixed[:, 1:])


def _linear_function(
    at_start: Pixels, along_x: Pixels, along_y: Pixels, area: Pixels, across: Pixels, down: Pixels
) -> Pixels:
    """Evaluate a linear function on boxes of pixels, shape (n, tall, wide)."""
    first, x, y = (part[:, None] / area[:, None] for part in (at_start, along_x, along_y))
    return (first + y * down)[:, :, None] + (x * across)[:, None, :]


@lru_cache(maxsize=256)
def _mesh(shape: Shape) -> _Mesh:
    """Return the triangles of a shape, as `threejs.mesh` packed them."""
    data, material = shape.data["geometries"][0]["data"], shape.data["materials"][0]
    vertices: Array = unpacked(data["attributes"]["position"]) * shape.data["object"]["matrix"][0]
    faces = unpacked(data["index"]).reshape(-1, 3).astype(np.int64)
    colours = np.broadcast_to(np.array(_rgb(material["color"])) / 255.0, vertices.shape)
    if material["vertexColors"]:
        colours = colours * unpacked(data["attributes"]["color"]) / 255.0
    if material.get("flatShading"):
        vertices, colours = vertices[faces].reshape(-1, 3), colours[faces].reshape(-1, 3)
        faces = np.arange(faces.size, dtype=np.int64).reshape(-1, 3)
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    normals: Array = np.tile(np.cross(b - a, c - a), (3, 1))
    at = faces.T.ravel()
    summed = np.stack([np.bincount(at, normals[:, i], len(vertices)) for i in range(3)], axis=1)
    return _Mesh(vertices, np.asarray(summed, dtype=np.float64), faces, colours)


_TYPES = {
    "Uint8Array": "u1",
    "Int16Array": "<i2",
    "Uint16Array": "<u2",
    "Uint32Array": "<u4",
    "Float32Array": "<f4",
}


def unpacked(packed: dict[str, Any]) -> Any:
    """Unpack the numbers of an attribute that `threejs` packed."""
    return np.frombuffer(packed["array"].data, _TYPES[packed["type"]]).reshape(
        -1, packed["itemSize"]
    )


def _opacity(item: Item) -> float:
    """Return the opacity of an item, from 0 to 1."""
    return float(
        item.shape.data["materials"][0]["opacity"] if item.colour is None else item.colour[3]
    )


def _is_on_top(item: Item) -> bool:
    """Return whether an item is drawn over whatever is in front of it."""
    return not item.shape.data["materials"][0]["depthTest"]


def _hides_back(item: Item) -> bool:
    """Return whether the front of a translucent item hides its back."""
    return bool(item.shape.data["materials"][0]["depthWrite"])


def _rgb(code: int) -> tuple[int, int, int]:
    """Return the components of a colour code, from 0 to 255."""
    return code >> 16, code >> 8 & 255, code & 255
