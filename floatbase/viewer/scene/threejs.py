"""Meshes, lines and labels as plain data that three.js reads.

Equal shapes are the same object, so that a picture that shows a shape again sends nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import umsgpack

from floatbase._validation import cached_property
from floatbase.viewer.scene.colours import RGB
from floatbase.viewer.scene.label_image import FONT_SIZE, text_image

_EXT = {
    "Uint8Array": 0x12,
    "Int16Array": 0x13,
    "Uint16Array": 0x14,
    "Uint32Array": 0x16,
    "Float32Array": 0x17,
}
_TYPES = {
    "Uint8Array": "u1",
    "Int16Array": "<i2",
    "Uint16Array": "<u2",
    "Uint32Array": "<u4",
    "Float32Array": "<f4",
}


@dataclass(frozen=True, eq=False)
class Shape:
    """A three.js object as plain data. The object is named "shape", so that animations find its
    material.
    """

    data: dict[str, Any]
    name: str = ""

    @cached_property
    def packed(self) -> bytes:
        """The object in MessagePack, for `protocol.set_object`, packed once for all pictures."""
        return umsgpack.packb(self.data)


def _array(kind: str, values: npt.ArrayLike, size: int, normalized: bool = False) -> dict[str, Any]:
    raw = np.ascontiguousarray(values, dtype=_TYPES[kind]).tobytes()
    return {
        "itemSize": size,
        "type": kind,
        "array": umsgpack.Ext(_EXT[kind], raw),
        "normalized": normalized,
    }


def _object(
    kind: str, geometry: dict[str, Any] | None, material: dict[str, Any], scale: float = 1.0
) -> dict[str, Any]:
    object_data: dict[str, Any] = {
        "uuid": "object",
        "type": kind,
        "name": "shape",
        "material": "material",
    }
    object_data["matrix"] = [float(x) for x in np.diag([scale, scale, scale, 1.0]).ravel()]
    data: dict[str, Any] = {"metadata": {"version": 4.5, "type": "Object"}}
    if geometry is not None:
        object_data["geometry"] = "geometry"
        data["geometries"] = [{"uuid": "geometry", "type": "BufferGeometry", "data": geometry}]
    return {**data, "materials": [{"uuid": "material", **material}], "object": object_data}


def colour_number(colour: RGB) -> int:
    """A colour as the number 0xrrggbb."""
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
    """Triangles.

    vertices: (n, 3), m. They are sent as 16-bit numbers, as multiples of 1/32767 of the largest.
    faces: (m, 3), indices of the vertices.
    colour: RGB of the whole mesh.
    colours: (n, 3), 0-255, RGB of each vertex; None for one colour.
    opacity: 0 is invisible, 1 hides what is behind.
    flat: whether each triangle has one shade, so that edges look sharp.
    lit: whether the mesh is shaded by light.
    on_top: whether it is drawn over whatever is in front of it.
    hide_back: whether a translucent mesh hides its own far side.
    name: of the shape.
    """
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
    """m line segments, one pixel wide. points: (2 m, 3), start and end of each, m."""
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
    """Text that always faces the reader.

    text: the text; braces make a subscript: "f{c}".
    height: height of its letters, m.
    plate: whether a plate lies behind it.
    colour: RGB of the text.
    on_top: whether it is drawn over whatever is in front of it.
    """
    image_data = text_image(text, plate, colour)
    tall, wide = image_data.shape[:2]
    image = {
        "type": "Uint8Array",
        "width": wide,
        "height": tall,
        "data": umsgpack.Ext(0x12, image_data[::-1].tobytes()),
    }
    material = {
        "type": "SpriteMaterial",
        "map": "texture",
        "transparent": True,
        "depthTest": not on_top,
        "depthWrite": False,
    }
    data = _object("Sprite", None, material)
    data["images"] = [{"uuid": "image", "url": image}]
    # 1025: two bytes a pixel, grey and alpha; 1006: smooth when scaled
    texture = {
        "uuid": "texture",
        "image": "image",
        "format": 1025,
        "minFilter": 1006,
        "magFilter": 1006,
    }
    data["textures"] = [texture | {"generateMipmaps": False}]
    size = height / FONT_SIZE
    data["object"]["matrix"] = [
        float(x) for x in np.diag([wide * size, tall * size, 1.0, 1.0]).ravel()
    ]
    data["object"]["renderOrder"] = 10
    return Shape(data, text)
