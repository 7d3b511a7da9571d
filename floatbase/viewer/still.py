"""A picture as an image, drawn without a browser: for notebooks that are read where nothing runs.

It looks like the page's, more plainly: one light, no gloss, no shadows, lines always behind. Drawing takes about a tenth of a
second.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from floatbase._arrays import Array
from floatbase.viewer.colours import RGB
from floatbase.viewer.lowering import Shape
from floatbase.viewer.shapes import Item
from floatbase.viewer.text import LETTER, font

FINE = 2  # pixels drawn for each of the image, across and down
NEAR = 0.05  # m from the camera: what is nearer is not drawn
_AMBIENT, _LIGHT = 0.5, 0.55
_SUN = np.array([0.25, 0.35, 0.9]) / np.linalg.norm([0.25, 0.35, 0.9])
_AT_ONCE = 1 << 21  # samples, so that large triangles take no more memory than small ones

Image_ = npt.NDArray[np.float32]


class Camera(NamedTuple):
    """eye, target: (3,), m, world. angle: vertical field of view, degrees. size: width and height of the image, pixels."""

    eye: Array
    target: Array
    angle: float
    size: tuple[int, int]

    def project(self, points: Array) -> Array:
        """Pixels from the left and from the top, and the distance along the view, m; shape (n, 3) from (n, 3) m, world."""
        ahead = (self.target - self.eye) / np.linalg.norm(self.target - self.eye)
        right = np.cross(ahead, [0.0, 0.0, 1.0])
        right = right / np.linalg.norm(right) if np.linalg.norm(right) > 1e-9 else np.array([0.0, -1.0, 0.0])
        seen = (points - self.eye) @ np.stack([right, np.cross(ahead, right), ahead], axis=1)
        scale = self.pixels_at_one_metre / np.maximum(seen[:, 2:], NEAR)
        seen[:, :2] = seen[:, :2] * scale + 0.5 * np.array(self.size)
        return np.asarray(seen)

    @property
    def pixels_at_one_metre(self) -> float:
        return 0.5 * self.size[1] / float(np.tan(np.radians(self.angle) / 2))


class Caption(NamedTuple):
    """title: a line at the top. legend: (colour as "#rrggbb", meaning) of each line. text: RGB of both."""

    title: str
    legend: Sequence[tuple[str, str]]
    text: RGB


class _Mesh(NamedTuple):
    """vertices, normals: (n, 3). faces: (m, 3). colours: (n, 3) from 0 to 1, without light."""

    vertices: Array
    normals: Array
    faces: npt.NDArray[np.int64]
    colours: Array


class _Samples(NamedTuple):
    """What triangles cover. at: number of a pixel, row by row. depth: m. colour: (n, 3)."""

    at: npt.NDArray[np.int64]
    depth: Image_
    colour: Image_


def png(
    items: Sequence[Item], camera: Camera, paper: tuple[RGB, RGB], caption: Caption, colours: int = 255
) -> bytes:
    """The image of items as a PNG file.

    items: of a picture. camera: from where; its size is that of the image. paper: RGB of the background at top and bottom.
    caption: the words. colours: how many the image may have: fewer make a smaller file.
    """
    fine = camera._replace(size=(FINE * camera.size[0], FINE * camera.size[1]))
    canvas = _paper(fine.size, paper)
    kinds = [item.shape.lowered["object"]["type"] for item in items]
    _draw_lines([item for item, kind in zip(items, kinds, strict=True) if kind == "LineSegments"], fine, canvas)
    _draw_meshes([item for item, kind in zip(items, kinds, strict=True) if kind == "Mesh"], fine, canvas)
    image = Image.fromarray(np.clip(255.0 * canvas + 0.5, 0, 255).astype(np.uint8))
    _draw_labels([item for item, kind in zip(items, kinds, strict=True) if kind == "Sprite"], fine, image)
    _draw_caption(caption, image)
    file = io.BytesIO()
    image.reduce(FINE).quantize(colours, dither=Image.Dither.NONE).save(file, "png", optimize=True)
    return file.getvalue()


def _paper(size: tuple[int, int], paper: tuple[RGB, RGB]) -> Image_:
    down = np.linspace(0.0, 1.0, size[1], dtype=np.float32)[:, None, None]
    top, bottom = (np.array(colour, dtype=np.float32) for colour in paper)
    return np.ascontiguousarray(np.broadcast_to(top + down * (bottom - top), (size[1], size[0], 3)))


def _draw_lines(items: Sequence[Item], camera: Camera, canvas: Image_) -> None:
    image = Image.fromarray((255.0 * canvas).astype(np.uint8))
    draw = ImageDraw.Draw(image)
    for item in items:
        points = _array(item.shape.lowered["geometries"][0]["data"]["attributes"]["position"]).astype(np.float64)
        seen = camera.project(points @ item.matrix[:3, :3].T + item.matrix[:3, 3]).reshape(-1, 6)
        wide, high = camera.size
        is_near = (np.abs(seen[:, [0, 3]]) < 4 * wide).all(axis=1) & (np.abs(seen[:, [1, 4]]) < 4 * high).all(axis=1)
        for x0, y0, _, x1, y1, _ in seen[is_near & (seen[:, [2, 5]] > NEAR).all(axis=1)].tolist():
            draw.line((x0, y0, x1, y1), fill=_hexadecimal(item.shape.lowered["materials"][0]["color"]), width=FINE)
    canvas[:] = np.asarray(image, dtype=np.float32) / 255.0


def _draw_meshes(items: Sequence[Item], camera: Camera, canvas: Image_) -> None:
    """Opaque meshes first, then translucent ones from far to near, then what is drawn over whatever is in front of it."""
    pixels, depth = canvas.reshape(-1, 3), np.full(canvas.shape[0] * canvas.shape[1], np.inf, dtype=np.float32)
    opaque = [item for item in items if _opacity(item) >= 1.0 and not _is_on_top(item)]
    for item in opaque:
        for samples in _samples(item, camera):
            _cover(samples, pixels, depth)
    others = [item for item in items if _opacity(item) < 1.0 and not _is_on_top(item)]
    for item in sorted(others, key=lambda item: -float(np.linalg.norm(item.matrix[:3, 3] - camera.eye))):
        found = list(_samples(item, camera))
        samples = _Samples(*(np.concatenate(part) for part in zip(*found, strict=True))) if found else None
        if samples is not None:
            before = samples.depth < depth[samples.at]
            _tint(_Samples(*(part[before] for part in samples)), _opacity(item), _hides_back(item), pixels)
    for item in (item for item in items if _is_on_top(item)):
        over = np.full_like(depth, np.inf)
        for samples in _samples(item, camera):
            _cover(samples, pixels, over)


def _cover(samples: _Samples, pixels: Image_, depth: Image_) -> None:
    """Draw the nearest of the samples where it is nearer than what is there."""
    np.minimum.at(depth, samples.at, samples.depth)
    seen = samples.depth == depth[samples.at]
    pixels[samples.at[seen]] = samples.colour[seen]


def _tint(samples: _Samples, opacity: float, only_nearest: bool, pixels: Image_) -> None:
    """Lay translucent samples over what is there; those of one pixel count as layers of their mean colour."""
    where, which, layers = np.unique(samples.at, return_inverse=True, return_counts=True)
    rest = (1.0 - opacity) ** (np.ones_like(layers) if only_nearest else layers)
    mean = np.stack([np.bincount(which, samples.colour[:, i], len(where)) for i in range(3)], axis=1) / layers[:, None]
    pixels[where] = rest[:, None] * pixels[where] + (1.0 - rest[:, None]) * mean


def _samples(item: Item, camera: Camera) -> Iterator[_Samples]:
    """What the triangles of a mesh cover, with its colours as the light makes them."""
    mesh, pose = _mesh(item.shape), item.matrix
    points = mesh.vertices @ pose[:3, :3].T + pose[:3, 3]
    colours = mesh.colours if item.colour is None else np.broadcast_to(item.colour[:3], mesh.colours.shape)
    if item.shape.lowered["materials"][0]["type"] == "MeshPhongMaterial":
        normals = mesh.normals @ np.linalg.pinv(pose[:3, :3])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        towards = np.sign(np.sum(normals * (camera.eye - points), axis=1))  # both sides of a surface are lit
        light = _AMBIENT + _LIGHT * np.maximum(towards * (normals @ _SUN), 0.0)
        colours = np.minimum(colours * light[:, None], 1.0)
    corners = camera.project(points)[mesh.faces].astype(np.float32)
    corners_colours = colours[mesh.faces].astype(np.float32)
    low, high = corners[:, :, :2].min(axis=1), corners[:, :, :2].max(axis=1)
    seen = (high > 0).all(axis=1) & (low < camera.size).all(axis=1) & (corners[:, :, 2] > NEAR).all(axis=1)
    wide = np.ceil(np.minimum(high, camera.size) - np.maximum(low, 0.0)).max(axis=1) + 1.0
    side = 2
    while side < 2 * max(camera.size):
        rows = np.flatnonzero(seen & (wide <= side) & ((wide > side // 2) | (side == 2)))
        step = max(_AT_ONCE // side**2, 1)
        for part in (rows[i : i + step] for i in range(0, len(rows), step)):
            yield _filled(corners[part], corners_colours[part], side, camera.size)
        side *= 2


def _filled(corners: Image_, colours: Image_, side: int, size: tuple[int, int]) -> _Samples:
    """The pixels in triangles none of which is wider or higher than `side`. corners, colours: (n, 3, 3)."""
    start = np.floor(np.maximum(corners[:, :, :2].min(axis=1), 0.0)).astype(np.int64)
    across = np.arange(side)
    x, y = (start[:, 0, None, None] + across[None, None, :]), (start[:, 1, None, None] + across[None, :, None])
    (ax, ay), (bx, by), (cx, cy) = (corners[:, i, :2].T[:, :, None, None] for i in range(3))
    px, py = x + np.float32(0.5), y + np.float32(0.5)
    area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    with np.errstate(divide="ignore", invalid="ignore"):
        v = ((px - ax) * (cy - ay) - (cx - ax) * (py - ay)) / area
        w = ((bx - ax) * (py - ay) - (px - ax) * (by - ay)) / area
    inside = (v >= 0) & (w >= 0) & (v + w <= 1) & (x < size[0]) & (y < size[1])
    which, row, column = np.nonzero(inside)
    weights = np.stack([1.0 - v[inside] - w[inside], v[inside], w[inside]], axis=1)
    at = (start[which, 1] + row) * size[0] + start[which, 0] + column
    depth = 1.0 / np.einsum("ni,ni->n", weights, 1.0 / corners[which, :, 2])
    return _Samples(at, depth.astype(np.float32), np.einsum("ni,nij->nj", weights, colours[which]).astype(np.float32))


def _draw_labels(items: Sequence[Item], camera: Camera, image: Image.Image) -> None:
    for item in items:
        ((x, y, far),) = camera.project(item.matrix[None, :3, 3])
        size = camera.pixels_at_one_metre / far * np.diag(np.reshape(item.shape.lowered["object"]["matrix"], (4, 4)))[:2]
        if far <= NEAR or not (size >= 1.0).all() or (size > camera.size).any():
            continue
        about = item.shape.lowered["images"][0]["url"]
        data = np.frombuffer(about["data"].data, np.uint8).reshape(about["height"], about["width"], 2)[::-1]
        made = Image.fromarray(np.ascontiguousarray(data), "LA").resize((round(size[0]), round(size[1])))
        image.paste(made.convert("RGB"), (round(x - size[0] / 2), round(y - size[1] / 2)), made.getchannel("A"))


def _draw_caption(caption: Caption, image: Image.Image) -> None:
    draw, ink = ImageDraw.Draw(image), tuple(round(255 * part) for part in caption.text)
    for i, line in enumerate(caption.title.splitlines()):
        draw.text((12 * FINE, 8 * FINE + 1.3 * i * LETTER), line, font=font(), fill=ink)
    for i, (colour, meaning) in enumerate(reversed(caption.legend)):
        y = image.size[1] - 12 * FINE - round(1.4 * i * LETTER)
        draw.rectangle((12 * FINE, y - LETTER // 1.4, 12 * FINE + LETTER // 1.4, y), fill=colour)
        draw.text((12 * FINE + 1.1 * LETTER, y), meaning, font=font(), fill=ink, anchor="ls")


@lru_cache(maxsize=256)
def _mesh(shape: Shape) -> _Mesh:
    """The triangles of a shape, as `lowering.mesh` packed them."""
    data, material = shape.lowered["geometries"][0]["data"], shape.lowered["materials"][0]
    vertices = _array(data["attributes"]["position"]) * shape.lowered["object"]["matrix"][0]
    faces = _array(data["index"]).reshape(-1, 3).astype(np.int64)
    colours = np.broadcast_to(np.array(_parts(material["color"])) / 255.0, vertices.shape)
    if material["vertexColors"]:
        colours = colours * _array(data["attributes"]["color"]) / 255.0
    if material.get("flatShading"):
        vertices, colours, faces = vertices[faces].reshape(-1, 3), colours[faces].reshape(-1, 3), np.arange(faces.size)
        faces = faces.reshape(-1, 3)
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    normals = np.tile(np.cross(b - a, c - a), (3, 1))
    at = faces.T.ravel()
    summed = np.stack([np.bincount(at, normals[:, i], len(vertices)) for i in range(3)], axis=1)
    return _Mesh(vertices, summed, faces, colours)


_TYPES = {"Uint8Array": "u1", "Int16Array": "<i2", "Uint16Array": "<u2", "Uint32Array": "<u4", "Float32Array": "<f4"}


def _array(packed: dict[str, Any]) -> Any:
    return np.frombuffer(packed["array"].data, _TYPES[packed["type"]]).reshape(-1, packed["itemSize"])


def _parts(code: int) -> tuple[int, int, int]:
    return code >> 16, code >> 8 & 255, code & 255


def _hexadecimal(code: int) -> str:
    return f"#{code:06x}"


def _opacity(item: Item) -> float:
    return float(item.shape.lowered["materials"][0]["opacity"] if item.colour is None else item.colour[3])


def _is_on_top(item: Item) -> bool:
    return not item.shape.lowered["materials"][0]["depthTest"]


def _hides_back(item: Item) -> bool:
    return bool(item.shape.lowered["materials"][0]["depthWrite"])
