"""A picture as an image, drawn without a browser: for notebooks that are read where nothing runs.

It looks like the page's, more plainly: one light, no gloss, no shadows, lines always behind.
Drawing takes some tenths of a second.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from floatbase._validation import Array
from floatbase.viewer.scene.colours import BACKGROUNDS, RGB, hex_code
from floatbase.viewer.scene.diff import ROOT
from floatbase.viewer.scene.ground import LEVEL, Plane, Planes, displacement
from floatbase.viewer.scene.label_image import FONT_SIZE, font
from floatbase.viewer.scene.shapes import Item, Picture
from floatbase.viewer.scene.store import Scene
from floatbase.viewer.scene.threejs import Shape

SUPERSAMPLING = 2  # pixels drawn for each of the image, across and down
NEAR_PLANE = 0.05  # m from the camera: what is nearer is not drawn
_ASPECT, _SCALE = (
    1.7,
    0.8,
)  # width over height, and the size of the image over that of the picture in the page
_COLOURS = 256
_AMBIENT, _DIFFUSE = 0.62, 0.42
_LIGHT_DIRECTION = np.array([0.25, 0.35, 0.9]) / np.linalg.norm([0.25, 0.35, 0.9])
_MAX_SAMPLES = 1 << 20  # samples, so that many triangles take no more memory than few
_MAX_BOX = 32  # pixels: a box around a longer triangle has much that is not in the triangle
_BOX_STEP = 8  # pixels: boxes whose sides differ by less are made equal, to be filled together

Pixels = npt.NDArray[np.float32]


class Camera(NamedTuple):
    """eye, target: (3,), m, world. angle: vertical field of view, degrees. size: width and height
    of the image, pixels.
    """

    eye: Array
    target: Array
    angle: float
    size: tuple[int, int]

    def project(self, points: Array) -> Array:
        """Pixels from the left and from the top, and the distance along the view, m; shape (n, 3)
        from (n, 3) m, world.
        """
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
        return 0.5 * self.size[1] / float(np.tan(np.radians(self.angle) / 2))


class _Mesh(NamedTuple):
    """vertices, normals: (n, 3). faces: (m, 3). colours: (n, 3) from 0 to 1, without light."""

    vertices: Array
    normals: Array
    faces: npt.NDArray[np.int64]
    colours: Array


class _Samples(NamedTuple):
    """What triangles cover. at: number of a pixel, row by row. depth: -1/m, less is nearer. colour:
    (n, 3).
    """

    at: npt.NDArray[np.int64]
    depth: Pixels
    colour: Pixels


def render_png(picture: Picture, scene: Scene, height: int) -> bytes:
    """A picture as a PNG file, with the settings of its scene: camera, background, title and
    legend. height: in the page.
    """
    size = SUPERSAMPLING * round(_ASPECT * _SCALE * height), SUPERSAMPLING * round(_SCALE * height)
    background = BACKGROUNDS[_setting(scene, "set_theme", {"name": "light"})["name"]]
    canvas, camera = _background(size, background), _camera(picture, scene, size)
    kinds: dict[str, list[Item]] = {"LineSegments": [], "Mesh": [], "Sprite": []}
    for item in picture.values():
        kinds[item.shape.data["object"]["type"]].append(item)
    _draw_lines(kinds["LineSegments"], camera, canvas)
    _draw_meshes(kinds["Mesh"], camera, canvas)
    image = Image.fromarray(np.clip(255.0 * canvas + 0.5, 0, 255).astype(np.uint8))
    _draw_labels(kinds["Sprite"], camera, image)
    _draw_caption(scene, background[3], image)
    return _png_bytes(image.reduce(SUPERSAMPLING))


def side_by_side(files: Sequence[bytes]) -> bytes:
    """Several PNG files of pictures as one, from left to right."""
    images = [Image.open(io.BytesIO(file)).convert("RGB") for file in files]
    whole = Image.new(
        "RGB",
        (sum(image.width for image in images), max(image.height for image in images)),
        "white",
    )
    for i, image in enumerate(images):
        whole.paste(image, (sum(before.width for before in images[:i]), 0))
    return _png_bytes(whole)


def with_thumbnail(bundle: Any, *pictures: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """What a notebook stores of a widget, and beside it an image of the pictures in it, for
    wherever no widget can be.

    bundle: of the widget, as `_repr_mimebundle_` returns it.
    pictures: widgets of viewers. Those that hold a copy of a scene as HTML, as `Viewer.widget`
        says, are stored as that copy.
    """
    data, metadata = bundle if isinstance(bundle, tuple) else (bundle, {})
    scenes = [picture.value for picture in pictures if not hasattr(picture, "thumbnail")]
    if scenes:
        data = {**data, "text/html": "".join(scenes)}
    files = [picture.thumbnail for picture in pictures if getattr(picture, "thumbnail", b"")]
    if files:
        data = {
            **data,
            "image/png": base64.b64encode(
                side_by_side(files) if len(files) > 1 else files[0]
            ).decode(),
        }
    return data, metadata


def _png_bytes(image: Image.Image) -> bytes:
    file = io.BytesIO()
    image.quantize(_COLOURS, Image.Quantize.FASTOCTREE).save(file, "png")
    return file.getvalue()


def _setting(scene: Scene, kind: str, default: dict[str, Any]) -> dict[str, Any]:
    return scene.command(("/", kind, "")) or default


def _camera(picture: Picture, scene: Scene, size: tuple[int, int]) -> Camera:
    """The camera, moved with what it follows, at the same height over the ground."""
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
    return Camera(eye + gone, target + gone, set_to["fov"], size)


def _ground(scene: Scene) -> Plane | Planes:
    planes = _setting(scene, "set_ground", {"planes": []})["planes"]
    return (
        Planes(
            tuple(Plane(tuple(_from_threejs(plane["normal"])), plane["offset"]) for plane in planes)
        )
        if planes
        else LEVEL
    )


def _from_threejs(point: Sequence[float]) -> Array:
    """A point of three.js, y up, in our coordinates, z up: the inverse of `protocol`'s."""
    x, y, z = point
    return np.array([x, -z, y])


def _background(size: tuple[int, int], background: tuple[RGB, ...]) -> Pixels:
    down = np.linspace(0.0, 1.0, size[1], dtype=np.float32)[:, None, None]
    top, bottom = (np.array(colour, dtype=np.float32) for colour in background[:2])
    return np.ascontiguousarray(np.broadcast_to(top + down * (bottom - top), (size[1], size[0], 3)))


def _draw_lines(items: Sequence[Item], camera: Camera, canvas: Pixels) -> None:
    image = Image.fromarray((255.0 * canvas).astype(np.uint8))
    draw = ImageDraw.Draw(image)
    for item in items:
        points = _array(item.shape.data["geometries"][0]["data"]["attributes"]["position"]).astype(
            np.float64
        )
        seen = camera.project(points @ item.matrix[:3, :3].T + item.matrix[:3, 3]).reshape(-1, 6)
        wide, high = camera.size
        is_near = (np.abs(seen[:, [0, 3]]) < 4 * wide).all(axis=1) & (
            np.abs(seen[:, [1, 4]]) < 4 * high
        ).all(axis=1)
        for x0, y0, _, x1, y1, _ in seen[
            is_near & (seen[:, [2, 5]] > NEAR_PLANE).all(axis=1)
        ].tolist():
            draw.line(
                (x0, y0, x1, y1),
                fill=_hex_code(item.shape.data["materials"][0]["color"]),
                width=SUPERSAMPLING,
            )
    canvas[:] = np.asarray(image, dtype=np.float32) / 255.0


def _draw_meshes(items: Sequence[Item], camera: Camera, canvas: Pixels) -> None:
    """Opaque meshes first, then translucent ones from far to near, then what is drawn over whatever
    is in front of it.
    """
    pixels, depth = (
        canvas.reshape(-1, 3),
        np.full(canvas.shape[0] * canvas.shape[1], 0.0, dtype=np.float32),
    )
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
    """Draw the nearest of the samples where it is nearer than what is there."""
    np.minimum.at(depth, samples.at, samples.depth)
    seen = samples.depth == depth[samples.at]
    pixels[samples.at[seen]] = samples.colour[seen]


def _concatenated(parts: Iterable[_Samples]) -> list[_Samples]:
    """The parts as one, or none."""
    all_of = list(parts)
    at, depth, colour = ([part[i] for part in all_of] for i in range(3))
    return (
        [_Samples(np.concatenate(at), np.concatenate(depth), np.concatenate(colour))]
        if all_of
        else []
    )


def _blend(samples: _Samples, depth: Pixels, item: Item, pixels: Pixels) -> None:
    """Lay what a translucent mesh covers over what is there; samples of one pixel count as layers
    of their mean colour.
    """
    seen = samples.depth < depth[samples.at]
    where, which, layers = np.unique(samples.at[seen], return_inverse=True, return_counts=True)
    sums = [np.bincount(which, samples.colour[seen, i], len(where)) for i in range(3)]
    rest = (1.0 - _opacity(item)) ** (np.ones_like(layers) if _hides_back(item) else layers)[
        :, None
    ]
    pixels[where] = rest * pixels[where] + (1.0 - rest) * np.stack(sums, axis=1) / layers[:, None]


def _samples(item: Item, camera: Camera) -> Iterator[_Samples]:
    """What the triangles of a mesh cover, with its colours as the light makes them."""
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
        towards = np.sign(
            np.sum(normals * (camera.eye - points), axis=1)
        )  # both sides of a surface are lit
        light = _AMBIENT + _DIFFUSE * np.maximum(towards * (normals @ _LIGHT_DIRECTION), 0.0)
        colours = np.minimum(colours * light[:, None], 1.0)
    seen = camera.project(points)
    forward = (seen[:, 2] > NEAR_PLANE)[mesh.faces].all(axis=1)
    seen[:, 2] = -1.0 / np.maximum(
        seen[:, 2], NEAR_PLANE
    )  # linear over a triangle in the image, as the distance is not
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
    """The triangles in the image, long ones in pieces, and of a box around each its first pixel and
    its sides.
    """
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
    """The pixels in triangles. corners: (n, 3, 6), place, depth and colour. start, sides: of a box
    around each, pixels.
    """
    (ax, ay), (bx, by), (cx, cy) = (corners[:, i, :2].T for i in range(3))
    area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    area = np.where(area == 0.0, np.float32(np.nan), area)  # seen from the side: it covers nothing
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
    """A linear function on boxes of pixels, (n, tall, wide), from its value at their first pixels
    and its slopes.
    """
    first, x, y = (part[:, None] / area[:, None] for part in (at_start, along_x, along_y))
    return (first + y * down)[:, :, None] + (x * across)[:, None, :]


def _draw_labels(items: Sequence[Item], camera: Camera, image: Image.Image) -> None:
    for item in items:
        ((x, y, far),) = camera.project(item.matrix[None, :3, 3])
        size = (
            camera.pixels_at_one_metre
            / far
            * np.diag(np.reshape(item.shape.data["object"]["matrix"], (4, 4)))[:2]
        )
        if far <= NEAR_PLANE or not (size >= 1.0).all() or (size > camera.size).any():
            continue
        about = item.shape.data["images"][0]["url"]
        data = np.frombuffer(about["data"].data, np.uint8).reshape(
            about["height"], about["width"], 2
        )[::-1]
        made = Image.fromarray(np.ascontiguousarray(data), "LA").resize(
            (round(size[0]), round(size[1]))
        )
        image.paste(
            made.convert("RGB"),
            (round(x - size[0] / 2), round(y - size[1] / 2)),
            made.getchannel("A"),
        )


def _draw_caption(scene: Scene, text: RGB, image: Image.Image) -> None:
    draw, ink = ImageDraw.Draw(image), hex_code(text)
    for i, line in enumerate(_setting(scene, "set_title", {"text": ""})["text"].splitlines()):
        draw.text(
            (12 * SUPERSAMPLING, 8 * SUPERSAMPLING + 1.3 * i * FONT_SIZE),
            line,
            font=font(),
            fill=ink,
        )
    for i, (colour, meaning, _) in enumerate(
        reversed(_setting(scene, "set_legend", {"items": []})["items"])
    ):
        y = image.height - 12 * SUPERSAMPLING - round(1.4 * i * FONT_SIZE)
        draw.rectangle(
            (12 * SUPERSAMPLING, y - FONT_SIZE / 1.4, 12 * SUPERSAMPLING + FONT_SIZE / 1.4, y),
            fill=colour,
        )
        draw.text(
            (12 * SUPERSAMPLING + 1.1 * FONT_SIZE, y), meaning, font=font(), fill=ink, anchor="ls"
        )


@lru_cache(maxsize=256)
def _mesh(shape: Shape) -> _Mesh:
    """The triangles of a shape, as `threejs.mesh` packed them."""
    data, material = shape.data["geometries"][0]["data"], shape.data["materials"][0]
    vertices: Array = _array(data["attributes"]["position"]) * shape.data["object"]["matrix"][0]
    faces = _array(data["index"]).reshape(-1, 3).astype(np.int64)
    colours = np.broadcast_to(np.array(_rgb(material["color"])) / 255.0, vertices.shape)
    if material["vertexColors"]:
        colours = colours * _array(data["attributes"]["color"]) / 255.0
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


def _array(packed: dict[str, Any]) -> Any:
    return np.frombuffer(packed["array"].data, _TYPES[packed["type"]]).reshape(
        -1, packed["itemSize"]
    )


def _rgb(code: int) -> tuple[int, int, int]:
    return code >> 16, code >> 8 & 255, code & 255


def _hex_code(code: int) -> str:
    return f"#{code:06x}"


def _opacity(item: Item) -> float:
    return float(
        item.shape.data["materials"][0]["opacity"] if item.colour is None else item.colour[3]
    )


def _is_on_top(item: Item) -> bool:
    return not item.shape.data["materials"][0]["depthTest"]


def _hides_back(item: Item) -> bool:
    return bool(item.shape.data["materials"][0]["depthWrite"])
