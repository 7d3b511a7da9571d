"""Meshes, lines and labels as plain data for three.js.

Equal shapes are the same object, so a picture that shows a shape again sends nothing.
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
    """A three.js object as plain data.

    The object in the data is named "shape", by which animations find its material.

    Parameters
    ----------
    data : dict
        The object in the JSON format of three.js.
    name : str
        Name or text of the shape.
    """

    data: dict[str, Any]
    name: str = ""

    @cached_property
    def packed(self) -> bytes:
        """Object in MessagePack for `protocol.set_object`, packed once for all pictures."""
        return umsgpack.packb(self.data)


def _array(kind: str, values: npt.ArrayLike, size: int, normalized: bool = False) -> dict[str, Any]:
    """Return an attribute of a geometry."""
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
    """Return an object with its geometry and material."""
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
    """Convert a colour to the number 0xrrggbb.

    Parameters
    ----------
    colour : tuple of float
        RGB, from 0 to 1.

    Returns
    -------
    int
        The number.
    """
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
    """Make a mesh of triangles.

    Parameters
    ----------
    vertices : array_like, shape (n, 3)
        Vertices [m]. Vertices are sent as 16-bit integers, in units of 1/32767 of the largest
        coordinate.
    faces : array_like, shape (m, 3)
        Indices of the vertices.
    colour : tuple of float, optional
        RGB of the whole mesh.
    colours : array_like, shape (n, 3), optional
        RGB of each vertex, 0 to 255. By default, the mesh has one colour.
    opacity : float, optional
        Opacity [-]: 0 is invisible, 1 is opaque.
    flat : bool, optional
        Whether each triangle has one shade, so that edges look sharp.
    lit : bool, optional
        Whether the mesh is shaded by light.
    on_top : bool, optional
        Whether the mesh is drawn on top of objects in front of it.
    hide_back : bool, optional
        Whether a translucent mesh hides its own far side.
    name : str, optional
        Name of the shape.

    Returns
    -------
    Shape
        The mesh.
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
    """Make m line segments, one pixel wide.

    Parameters
    ----------
    points : array_like, shape (2 m, 3)
        Start and end of each segment [m].
    colour : tuple of float
        RGB.
    opacity : float, optional
        Opacity, from 0 to 1 [-].

    Returns
    -------
    Shape
        The lines.
    """
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
    """Make text that always faces the viewer.

    Parameters
    ----------
    text : str
        The text. Braces make a subscript: "f{c}".
    height : float
        Height of the letters [m].
    plate : bool, optional
        Whether a plate lies behind the text.
    colour : tuple of float, optional
        RGB of the text.
    on_top : bool, optional
        Whether the text is drawn on top of objects in front of it.

    Returns
    -------
    Shape
        The text.
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
    # 1025: two bytes per pixel, grey and alpha; 1006: smooth scaling
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
