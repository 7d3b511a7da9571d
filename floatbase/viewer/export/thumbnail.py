"""Images of pictures, drawn without a browser, for notebooks that are read without a kernel.

An image resembles the page, but is simpler: it has one light, no gloss and no shadows, and lines
always lie behind meshes. Triangles are drawn from far to near, which takes some tenths of a second.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from PIL import Image, ImageDraw

from floatbase._validation import Array
from floatbase.viewer.scene.colours import BACKGROUNDS, RGB, hex_code
from floatbase.viewer.scene.diff import ROOT
from floatbase.viewer.scene.ground import LEVEL, DrawnGround, Plane, Planes, Terrain, displacement
from floatbase.viewer.scene.label_image import FONT_SIZE, font
from floatbase.viewer.scene.shapes import Item, Picture
from floatbase.viewer.scene.store import Scene
from floatbase.viewer.scene.threejs import TYPES

_SUPERSAMPLING = 2  # pixels drawn per pixel of the image, in each direction
_ASPECT = 1.7  # width / height
_SCALE = 0.8  # size of the image / size of the picture in the page
_COLOURS = 256
_NEAR_PLANE = 0.05  # m from the camera: anything nearer is not drawn
_CORNERS, _DISTANCE, _COLOUR = slice(6), 6, slice(7, 10)  # columns of triangles in the image
_AMBIENT, _DIFFUSE = 0.62, 0.42
_LIGHT_DIRECTION = np.array([0.25, 0.35, 0.9]) / np.linalg.norm([0.25, 0.35, 0.9])


class _Camera(NamedTuple):
    """A perspective camera."""

    eye: Array
    target: Array
    angle: float
    size: tuple[int, int]

    def project(self, points: Array) -> Array:
        """Return the places of points in the image [pixels], and their distances [m]."""
        forward = (self.target - self.eye) / np.linalg.norm(self.target - self.eye)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        if np.linalg.norm(right) < 1e-9:
            right = np.array([0.0, -1.0, 0.0])
        right = right / np.linalg.norm(right)
        seen = (points - self.eye) @ np.stack([right, np.cross(forward, right), forward], axis=1)
        scale = self.pixels_at_one_metre / np.maximum(seen[..., 2:], _NEAR_PLANE)
        return np.concatenate(
            [seen[..., :2] * scale + 0.5 * np.array(self.size), seen[..., 2:]], -1
        )

    @property
    def pixels_at_one_metre(self) -> float:
        """Size in the image of a length of 1 m at a distance of 1 m [pixels]."""
        return 0.5 * self.size[1] / float(np.tan(np.radians(self.angle) / 2))


def render_png(picture: Picture, scene: Scene, height: int) -> bytes:
    """Draw a picture as a PNG file, with its scene's camera, background, title and legend."""
    size = (
        _SUPERSAMPLING * round(_ASPECT * _SCALE * height),
        _SUPERSAMPLING * round(_SCALE * height),
    )
    top, bottom, *_, text = BACKGROUNDS[_setting(scene, "set_theme", {"name": "light"})["name"]]
    image, camera = _gradient(size, top, bottom), _camera(picture, scene, size)
    kinds: dict[str, list[Item]] = {"LineSegments": [], "Mesh": [], "Sprite": []}
    for item in picture.values():
        kinds[item.shape.data["object"]["type"]].append(item)
    _draw_lines(kinds["LineSegments"], camera, image)
    for on_top in (False, True):
        meshes = [item for item in kinds["Mesh"] if _material(item)["depthTest"] != on_top]
        image = _with_meshes(meshes, camera, image)
    _draw_labels(kinds["Sprite"], camera, image)
    _draw_caption(scene, text, image)
    return _png_bytes(image.reduce(_SUPERSAMPLING))


def side_by_side(files: Sequence[bytes]) -> bytes:
    """Join PNG files of pictures from left to right."""
    if len(files) == 1:
        return files[0]
    images = [Image.open(io.BytesIO(file)).convert("RGB") for file in files]
    width, height = sum(image.width for image in images), max(image.height for image in images)
    whole, left = Image.new("RGB", (width, height), "white"), 0
    for image in images:
        whole.paste(image, (left, 0))
        left += image.width
    return _png_bytes(whole)


def with_thumbnail(bundle: Any, *pictures: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """Add an image to a stored widget, for readers that cannot show widgets."""
    data, metadata = bundle if isinstance(bundle, tuple) else (bundle, {})
    scenes = [picture.value for picture in pictures if not hasattr(picture, "thumbnail")]
    if scenes:
        data = {**data, "text/html": "".join(scenes)}
    files = [picture.thumbnail for picture in pictures if getattr(picture, "thumbnail", b"")]
    if files:
        data = {**data, "image/png": base64.b64encode(side_by_side(files)).decode()}
    return data, metadata


def _png_bytes(image: Image.Image) -> bytes:
    """Return an image as a PNG file."""
    file = io.BytesIO()
    image.quantize(_COLOURS, Image.Quantize.FASTOCTREE).save(file, "png")
    return file.getvalue()


def _setting(scene: Scene, kind: str, default: dict[str, Any]) -> dict[str, Any]:
    """Return the command of one kind in the scene, or `default` if there is none."""
    return scene.command(("/", kind, "")) or default


def _camera(picture: Picture, scene: Scene, size: tuple[int, int]) -> _Camera:
    """Return the camera, moved with what it follows, at a constant height above the ground."""
    set_to = _setting(
        scene, "set_camera", {"position": [2.0, 1.0, 0.0], "target": [0.0, 0.0, 0.0], "fov": 32.0}
    )
    eye, target = (_from_threejs(set_to[name]) for name in ("position", "target"))
    follow = _setting(scene, "set_follow", {"node": ""})
    item = picture.get(follow["node"].removeprefix(ROOT))
    gone = (
        np.zeros(3)
        if item is None
        else displacement(_ground(scene), _from_threejs(follow["from"]), item.matrix[:3, 3])
    )
    return _Camera(eye + gone, target + gone, set_to["fov"], size)


def _ground(scene: Scene) -> DrawnGround:
    """Return the scene's ground."""
    command = _setting(scene, "set_ground", {"planes": [], "boxes": []})
    planes = tuple(
        Plane(tuple(_from_threejs(plane["normal"])), plane["offset"]) for plane in command["planes"]
    )
    base = Planes(planes) if planes else LEVEL
    return Terrain(base, tuple(map(tuple, command["boxes"]))) if command["boxes"] else base


def _from_threejs(point: Sequence[float]) -> Array:
    """Convert a point of three.js (y up) to our coordinates (z up), inverting `protocol`."""
    x, y, z = point
    return np.array([x, -z, y])


def _gradient(size: tuple[int, int], top: RGB, bottom: RGB) -> Image.Image:
    """Return an image of the background, a vertical gradient."""
    down = np.linspace(0.0, 1.0, size[1])[:, None, None]
    column = np.array(top) + down * (np.array(bottom) - np.array(top))
    return Image.fromarray((255.0 * column).round().astype(np.uint8)).resize(size)


def _draw_lines(items: Sequence[Item], camera: _Camera, image: Image.Image) -> None:
    """Draw line segments."""
    draw = ImageDraw.Draw(image)
    for item in items:
        segments = camera.project(_vertices(item)).reshape(-1, 2, 3)
        is_near = (np.abs(segments[:, :, :2]) < 4 * np.array(camera.size)).all(axis=(1, 2))
        is_seen = is_near & (segments[:, :, 2] > _NEAR_PLANE).all(axis=1)
        for ends in segments[is_seen, :, :2].reshape(-1, 4).tolist():
            draw.line(ends, fill=f"#{_material(item)['color']:06x}", width=_SUPERSAMPLING)


def _with_meshes(items: Sequence[Item], camera: _Camera, image: Image.Image) -> Image.Image:
    """Return the image with meshes, drawn from far to near."""
    opaque: list[Array] = [np.empty((0, 10))]
    layers: list[tuple[float, Array, float]] = []
    for item in items:
        triangles, material = _triangles(item, camera), _material(item)
        opacity = material["opacity"] if item.colour is None else item.colour[3]
        if opacity >= 1.0:
            opaque.append(triangles)
        else:
            # the far and the near half are one layer each, unless the front hides the back
            parts = np.array_split(triangles, 1 if material["depthWrite"] else 2)
            layers += [(part[:, _DISTANCE].mean(), part, opacity) for part in parts if len(part)]
    rest = _from_far_to_near(np.concatenate(opaque))
    for distance, layer, opacity in sorted(layers, key=lambda layer: -layer[0]):
        is_behind = rest[:, _DISTANCE] > distance
        _draw_triangles(rest[is_behind], image)
        rest = rest[~is_behind]
        covered = image.copy()
        _draw_triangles(layer, covered)
        image = Image.blend(image, covered, opacity)
    _draw_triangles(rest, image)
    return image


def _draw_triangles(triangles: Array, image: Image.Image) -> None:
    """Draw each triangle over what is already there."""
    draw = ImageDraw.Draw(image)
    colours = (255.0 * triangles[:, _COLOUR]).round().astype(int).tolist()
    for corners, colour in zip(triangles[:, _CORNERS].tolist(), colours, strict=True):
        draw.polygon(corners, fill=tuple(colour))


def _from_far_to_near(triangles: Array) -> Array:
    """Return triangles sorted by their distance."""
    return triangles[np.argsort(-triangles[:, _DISTANCE], kind="stable")]


def _triangles(item: Item, camera: _Camera) -> Array:
    """Return the triangles of a mesh that are in the image, with lit colours, from far to near."""
    data, material = item.shape.data["geometries"][0]["data"], _material(item)
    faces = _unpacked(data["index"]).reshape(-1, 3).astype(np.int64)
    points = _vertices(item)[faces]
    colour = np.array([material["color"] >> shift & 255 for shift in (16, 8, 0)]) / 255.0
    if item.colour is not None:
        colour = np.array(item.colour[:3])
    colours = np.broadcast_to(colour, (len(faces), 3))
    if material["vertexColors"] and item.colour is None:
        colours = colours * _unpacked(data["attributes"]["color"])[faces].mean(axis=1) / 255.0
    if material["type"] == "MeshPhongMaterial":
        normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        # both sides of a surface are lit
        towards = np.sign(np.sum(normals * (camera.eye - points[:, 0]), axis=1))
        light = _AMBIENT + _DIFFUSE * np.maximum(towards * (normals @ _LIGHT_DIRECTION), 0.0)
        colours = np.minimum(colours * light[:, None], 1.0)
    seen = camera.project(points)
    corners, distances = seen[:, :, :2], seen[:, :, 2]
    is_inside = (corners.max(axis=1) > 0.0) & (corners.min(axis=1) < camera.size)
    is_seen = is_inside.all(axis=1) & (distances > _NEAR_PLANE).all(axis=1)
    columns = [corners.reshape(-1, 6), distances.mean(axis=1)[:, None], colours]
    return _from_far_to_near(np.concatenate(columns, axis=1)[is_seen])


def _material(item: Item) -> dict[str, Any]:
    """Return the material of an item."""
    return item.shape.data["materials"][0]


def _vertices(item: Item) -> Array:
    """Return the places of an item's vertices."""
    data = item.shape.data
    vertices = _unpacked(data["geometries"][0]["data"]["attributes"]["position"])
    scale = data["object"]["matrix"][0]
    return scale * vertices @ item.matrix[:3, :3].T + item.matrix[:3, 3]


def _unpacked(packed: dict[str, Any]) -> Array:
    """Return the numbers of an attribute that `threejs` packed."""
    return np.frombuffer(packed["array"].data, TYPES[packed["type"]]).reshape(
        -1, packed["itemSize"]
    )


def _draw_labels(items: Sequence[Item], camera: _Camera, image: Image.Image) -> None:
    """Draw labels."""
    for item in items:
        ((x, y, far),) = camera.project(item.matrix[None, :3, 3])
        shape = item.shape.data["object"]["matrix"]
        size = np.array([shape[0], shape[5]]) * camera.pixels_at_one_metre / far
        if far <= _NEAR_PLANE or not (size >= 1.0).all() or (size > camera.size).any():
            continue
        texture = item.shape.data["images"][0]["url"]
        pixels = np.frombuffer(texture["data"].data, np.uint8)
        pixels = pixels.reshape(texture["height"], texture["width"], 2)[::-1]  # grey and alpha
        made = Image.fromarray(np.ascontiguousarray(pixels), "LA").resize(
            (round(size[0]), round(size[1]))
        )
        corner = (round(x - size[0] / 2), round(y - size[1] / 2))
        image.paste(made.convert("RGB"), corner, made.getchannel("A"))


def _draw_caption(scene: Scene, text: RGB, image: Image.Image) -> None:
    """Draw the title and the legend."""
    draw, ink, margin = ImageDraw.Draw(image), hex_code(text), 12 * _SUPERSAMPLING
    for i, line in enumerate(_setting(scene, "set_title", {"text": ""})["text"].splitlines()):
        y = 8 * _SUPERSAMPLING + 1.3 * i * FONT_SIZE
        draw.text((margin, y), line, font=font(), fill=ink)
    side = FONT_SIZE / 1.4  # of a square
    legend = _setting(scene, "set_legend", {"items": []})["items"]
    for i, (colour, meaning, _) in enumerate(reversed(legend)):
        y = image.height - margin - round(1.4 * i * FONT_SIZE)
        draw.rectangle((margin, y - side, margin + side, y), fill=colour)
        draw.text((margin + 1.1 * FONT_SIZE, y), meaning, font=font(), fill=ink, anchor="ls")
