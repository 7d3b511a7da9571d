"""Images of pictures, drawn without a browser, for notebooks that are read without a kernel.

An image resembles the page, but is simpler: it has one light, no gloss and no shadows, and lines
always lie behind meshes. Drawing takes some tenths of a second.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from floatbase._validation import Array
from floatbase.viewer.export.rasteriser import NEAR_PLANE, Camera, Pixels, draw_meshes, unpacked
from floatbase.viewer.scene.colours import BACKGROUNDS, RGB, hex_code
from floatbase.viewer.scene.ground import LEVEL, DrawnGround, Plane, Planes, Terrain, displacement
from floatbase.viewer.scene.label_image import FONT_SIZE, font
from floatbase.viewer.scene.protocol import ROOT
from floatbase.viewer.scene.shapes import Item, Picture
from floatbase.viewer.scene.store import Scene

SUPERSAMPLING = 2  # pixels drawn per pixel of the image, in each direction
_ASPECT = 1.7  # width / height
_SCALE = 0.8  # size of the image / size of the picture in the page
_COLOURS = 256
_MAX_TEXT = 110  # characters, as in ipywidgets


def render_png(picture: Picture, scene: Scene, height: int) -> bytes:
    """Draw a picture as a PNG file, with its scene's camera, background, title and legend."""
    size = SUPERSAMPLING * round(_ASPECT * _SCALE * height), SUPERSAMPLING * round(_SCALE * height)
    background = BACKGROUNDS[_setting(scene, "set_theme", {"name": "light"})["name"]]
    canvas, camera = _background(size, background), _camera(picture, scene, size)
    kinds: dict[str, list[Item]] = {"LineSegments": [], "Mesh": [], "Sprite": []}
    for item in picture.values():
        kinds[item.shape.data["object"]["type"]].append(item)
    _draw_lines(kinds["LineSegments"], camera, canvas)
    draw_meshes(kinds["Mesh"], camera, canvas)
    image = Image.fromarray(np.clip(255.0 * canvas + 0.5, 0, 255).astype(np.uint8))
    _draw_labels(kinds["Sprite"], camera, image)
    _draw_caption(scene, background[3], image)
    return _png_bytes(image.reduce(SUPERSAMPLING))


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


def panel_bundle(panel: Any, *pictures: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return what a notebook stores of a panel with live pictures, with any ipywidgets."""
    data = {
        "text/plain": repr(panel)[:_MAX_TEXT],
        "application/vnd.jupyter.widget-view+json": {
            "version_major": 2,
            "version_minor": 0,
            "model_id": panel.model_id,
        },
    }
    # Colab needs to know where it finds the code of the pictures
    live = [picture for picture in pictures if hasattr(picture, "thumbnail")]
    metadata = live[0]._repr_mimebundle_()[1] if live else {}
    return with_thumbnail((data, metadata), *pictures)


def with_thumbnail(
    bundle: tuple[dict[str, Any], dict[str, Any]], *pictures: Any
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Add an image to a stored widget, for readers that cannot show widgets."""
    data, metadata = bundle
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


def _camera(picture: Picture, scene: Scene, size: tuple[int, int]) -> Camera:
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
    return Camera(eye + gone, target + gone, set_to["fov"], size)


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


def _background(size: tuple[int, int], background: tuple[RGB, ...]) -> Pixels:
    """Return an image of the background, a vertical gradient."""
    down = np.linspace(0.0, 1.0, size[1], dtype=np.float32)[:, None, None]
    top, bottom = (np.array(colour, dtype=np.float32) for colour in background[:2])
    return np.ascontiguousarray(np.broadcast_to(top + down * (bottom - top), (size[1], size[0], 3)))


def _draw_lines(items: Sequence[Item], camera: Camera, canvas: Pixels) -> None:
    """Draw line segments."""
    image = Image.fromarray((255.0 * canvas).astype(np.uint8))
    draw = ImageDraw.Draw(image)
    for item in items:
        points = unpacked(
            item.shape.data["geometries"][0]["data"]["attributes"]["position"]
        ).astype(np.float64)
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


def _draw_labels(items: Sequence[Item], camera: Camera, image: Image.Image) -> None:
    """Draw labels."""
    for item in items:
        ((x, y, far),) = camera.project(item.matrix[None, :3, 3])
        size = (
            camera.pixels_at_one_metre
            / far
            * np.diag(np.reshape(item.shape.data["object"]["matrix"], (4, 4)))[:2]
        )
        if far <= NEAR_PLANE or not (size >= 1.0).all() or (size > camera.size).any():
            continue
        texture = item.shape.data["images"][0]["url"]
        data = np.frombuffer(texture["data"].data, np.uint8).reshape(
            texture["height"], texture["width"], 2
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
    """Draw the title and the legend."""
    draw, ink, margin = ImageDraw.Draw(image), hex_code(text), 12 * SUPERSAMPLING
    for i, line in enumerate(_setting(scene, "set_title", {"text": ""})["text"].splitlines()):
        y = 8 * SUPERSAMPLING + 1.3 * i * FONT_SIZE
        draw.text((margin, y), line, font=font(), fill=ink)
    side = FONT_SIZE / 1.4  # of a square
    legend = _setting(scene, "set_legend", {"items": []})["items"]
    for i, (colour, meaning, _) in enumerate(reversed(legend)):
        y = image.height - margin - round(1.4 * i * FONT_SIZE)
        draw.rectangle((margin, y - side, margin + side, y), fill=colour)
        draw.text((margin + 1.1 * FONT_SIZE, y), meaning, font=font(), fill=ink, anchor="ls")


def _hex_code(code: int) -> str:
    """Return a colour as CSS writes it."""
    return f"#{code:06x}"
