"""Objects as three.js reads them: meshes, lines and labels, lowered to plain data.

A `Shape` is a value: what is equal is the same object, so a picture that shows it again sends nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import umsgpack

from floatbase.viewer.colours import RGB
from floatbase.viewer.text import LETTER, text_picture

_EXT = {"Uint8Array": 0x12, "Int16Array": 0x13, "Uint16Array": 0x14, "Uint32Array": 0x16, "Float32Array": 0x17}
_TYPES = {"Uint8Array": "u1", "Int16Array": "<i2", "Uint16Array": "<u2", "Uint32Array": "<u4", "Float32Array": "<f4"}


@dataclass(frozen=True, eq=False)
class Shape:
    """A lowered three.js object, ready for `set_object`; its object is called "shape", so animations find its material."""

    lowered: dict[str, Any]
    name: str = ""

    @cached_property
    def packed(self) -> bytes:
        """The object as it goes over the wire, packed once for all that show it."""
        return umsgpack.packb(self.lowered)


def _array(kind: str, values: npt.ArrayLike, size: int, normalized: bool = False) -> dict[str, Any]:
    data = np.ascontiguousarray(values, dtype=_TYPES[kind]).tobytes()
    return {"itemSize": size, "type": kind, "array": umsgpack.Ext(_EXT[kind], data), "normalized": normalized}


def _object(kind: str, geometry: dict[str, Any] | None, material: dict[str, Any], scale: float = 1.0) -> dict[str, Any]:
    drawn: dict[str, Any] = {"uuid": "object", "type": kind, "name": "shape", "material": "material"}
    drawn["matrix"] = [float(x) for x in np.diag([scale, scale, scale, 1.0]).ravel()]
    lowered: dict[str, Any] = {"metadata": {"version": 4.5, "type": "Object"}}
    if geometry is not None:
        drawn["geometry"] = "geometry"
        lowered["geometries"] = [{"uuid": "geometry", "type": "BufferGeometry", "data": geometry}]
    return {**lowered, "materials": [{"uuid": "material", **material}], "object": drawn}


def code(colour: RGB) -> int:
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
    through: bool = False,
    veil: bool = False,
    name: str = "",
) -> Shape:
    """Triangles of one colour, or with `colours`, shape (n, 3), 0-255, for each vertex.

    Vertices travel as 16-bit numbers, 1/32767 of the largest: half the bytes, and finer than the eye. flat: each triangle
    is shaded for itself.
    lit: shaded at all. through: seen through what is in front of it. veil: translucent, but hides its own far side.
    """
    points = np.asarray(vertices, dtype=np.float64)
    step = max(float(np.abs(points).max(initial=0.0)), 1e-9) / 32767
    attributes = {"position": _array("Int16Array", np.round(points / step), 3)}
    if colours is not None:
        attributes["color"] = _array("Uint8Array", colours, 3, normalized=True)
    index = _array("Uint16Array" if len(points) < 65536 else "Uint32Array", faces, 1)
    material = {
        "type": "MeshPhongMaterial" if lit else "MeshBasicMaterial",
        "color": code(colour),
        "vertexColors": colours is not None,
        "side": 2,
        "transparent": opacity < 1.0 or through,  # so that no veil comes over what is seen through all
        "opacity": opacity,
        "depthWrite": opacity == 1.0 or veil,
        "depthTest": not through,
    }
    if lit:
        material |= {"shininess": 25, "specular": 0x1C1C1C, "flatShading": flat}
    lowered = _object("Mesh", {"attributes": attributes, "index": index}, material, step)
    if through:
        lowered["object"]["renderOrder"] = 5
    return Shape(lowered, name)


def lines(points: npt.ArrayLike, colour: RGB, opacity: float = 1.0) -> Shape:
    """Line segments between each two of the points, shape (2 m, 3), one pixel wide."""
    attributes = {"position": _array("Float32Array", points, 3)}
    material = {
        "type": "LineBasicMaterial",
        "color": code(colour),
        "transparent": opacity < 1.0,
        "opacity": opacity,
    }
    return Shape(_object("LineSegments", {"attributes": attributes}, material))


def label(text: str, height: float, plate: bool = True, colour: RGB = (0.13, 0.13, 0.13)) -> Shape:
    """Text that faces the reader, its letters `height` m high: a picture on a sprite. Braces lower a part: "f{c}"."""
    picture = text_picture(text, plate, colour)
    tall, wide = picture.shape[:2]
    image = {"type": "Uint8Array", "width": wide, "height": tall, "data": umsgpack.Ext(0x12, picture[::-1].tobytes())}
    material = {"type": "SpriteMaterial", "map": "texture", "transparent": True, "depthTest": False, "depthWrite": False}
    lowered = _object("Sprite", None, material)
    lowered["images"] = [{"uuid": "image", "url": image}]
    # 1025: two bytes a pixel, grey and alpha; 1006: smooth when scaled
    texture = {"uuid": "texture", "image": "image", "format": 1025, "minFilter": 1006, "magFilter": 1006}
    lowered["textures"] = [texture | {"generateMipmaps": False}]
    size = height / LETTER
    lowered["object"]["matrix"] = [float(x) for x in np.diag([wide * size, tall * size, 1.0, 1.0]).ravel()]
    lowered["object"]["renderOrder"] = 10
    return Shape(lowered, text)
