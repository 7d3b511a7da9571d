"""Meshes, lines and labels as plain data for three.js.

Equal shapes are the same object, so a picture that shows a shape again sends nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import msgpack
import numpy as np
import numpy.typing as npt

from floatbase._validation import cached_property
from floatbase.viewer.scene.colours import RGB
from floatbase.viewer.scene.label_image import FONT_SIZE, text_image

# arrays of JavaScript: their codes in MessagePack, and their types in NumPy
_EXT_CODES = {
    "Uint8Array": 0x12, "Int16Array": 0x13, "Uint16Array": 0x14, "Uint32Array": 0x16,
    "Float32Array": 0x17,
}  # fmt: skip
TYPES = {
    "Uint8Array": "u1", "Int16Array": "<i2", "Uint16Array": "<u2", "Uint32Array": "<u4",
    "Float32Array": "<f4",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Shape:
    """A three.js object as plain data."""

    data: dict[str, Any]
    name: str = ""

    @cached_property
    def packed(self) -> bytes:
        """Object in MessagePack for `protocol.set_object`, packed once for all pictures."""
        return msgpack.packb(self.data)


def packed_array(kind: str, values: npt.ArrayLike) -> msgpack.ExtType:
    """Return numbers as an array of JavaScript."""
    raw = np.ascontiguousarray(values, dtype=TYPES[kind]).tobytes()
    return msgpack.ExtType(_EXT_CODES[kind], raw)


def _array(kind: str, values: npt.ArrayLike, size: int, normalized: bool = False) -> dict[str, Any]:
    """Return an attribute of a geometry."""
    array = packed_array(kind, values)
    return {"itemSize": size, "type": kind, "array": array, "normalized": normalized}


def _object(
    kind: str, geometry: dict[str, Any] | None, material: dict[str, Any], scale: float = 1.0
) -> dict[str, Any]:
    """Return an object with its geometry and material."""
    object_data: dict[str, Any] = {"uuid": "object", "type": kind, "name": "shape"}
    object_data["material"] = "material"
    object_data["matrix"] = [float(x) for x in np.diag([scale, scale, scale, 1.0]).ravel()]
    data: dict[str, Any] = {"metadata": {"version": 4.5, "type": "Object"}}
    if geometry is not None:
        object_data["geometry"] = "geometry"
        data["geometries"] = [{"uuid": "geometry", "type": "BufferGeometry", "data": geometry}]
    return {**data, "materials": [{"uuid": "material", **material}], "object": object_data}


def colour_number(colour: RGB) -> int:
    """Convert a colour to the number 0xrrggbb."""
    red, green, blue = (round(255 * part) for part in colour)
    return (red << 16) + (green << 8) + blue


def mesh(
    vertices: npt.ArrayLike,
    faces: npt.ArrayLike,
    colour: RGB = (1.0, 1.0, 1.0),
    *,
    colours: npt.ArrayLike | None = None,
    opacity: float = 1.0,
    flat: bool = False,
    lit: bool = True,
    on_top: bool = False,
    hide_back: bool = False,
    name: str = "",
) -> Shape:
    """Make a mesh of triangles."""
    points = np.asarray(vertices, dtype=np.float64)
    step = max(float(np.abs(points).max(initial=0.0)), 1e-9) / 32767
    attributes = {"position": _array("Int16Array", np.round(points / step), 3)}
    if colours is not None:
        attributes["color"] = _array("Uint8Array", colours, 3, normalized=True)
    index = _array("Uint16Array" if len(points) < 65536 else "Uint32Array", faces, 1)
    material = {
        "type": "MeshPhongMaterial" if lit else "MeshBasicMaterial",
        "color": colour_number(colour),
        "vertexColors": colours is not None,
        "side": 2,
        "transparent": opacity < 1.0 or on_top,  # three.js draws translucent objects last
        "opacity": opacity,
        "depthWrite": opacity == 1.0 or hide_back,
        "depthTest": not on_top,
    }
    if lit:
        material |= {"shininess": 25, "specular": 0x1C1C1C, "flatShading": flat}
    data = _object("Mesh", {"attributes": attributes, "index": index}, material, step)
    if on_top:
        data["object"]["renderOrder"] = 5
    return Shape(data, name)


def lines(points: npt.ArrayLike, colour: RGB, opacity: float = 1.0) -> Shape:
    """Make m line segments, one pixel wide."""
    attributes = {"position": _array("Float32Array", points, 3)}
    material = {
        "type": "LineBasicMaterial",
        "color": colour_number(colour),
        "transparent": opacity < 1.0,
        "opacity": opacity,
    }
    return Shape(_object("LineSegments", {"attributes": attributes}, material))


def label(
    text: str,
    height: float,
    plate: bool = True,
    colour: RGB = (0.13, 0.13, 0.13),
    on_top: bool = True,
) -> Shape:
    """Make text that always faces the viewer."""
    image_data = text_image(text, plate, colour)
    tall, wide = image_data.shape[:2]
    pixels = packed_array("Uint8Array", image_data[::-1])
    image = {"type": "Uint8Array", "width": wide, "height": tall, "data": pixels}
    material = {
        "type": "SpriteMaterial", "map": "texture", "transparent": True,
        "depthTest": not on_top, "depthWrite": False,
    }  # fmt: skip
    data = _object("Sprite", None, material)
    data["images"] = [{"uuid": "image", "url": image}]
    # 1025: two bytes per pixel, grey and alpha; 1006: smooth scaling
    texture = {
        "uuid": "texture", "image": "image", "format": 1025, "minFilter": 1006,
        "magFilter": 1006, "generateMipmaps": False,
    }  # fmt: skip
    data["textures"] = [texture]
    size = height / FONT_SIZE
    data["object"]["matrix"] = np.diag([wide * size, tall * size, 1.0, 1.0]).ravel().tolist()
    data["object"]["renderOrder"] = 10
    return Shape(data, text)
