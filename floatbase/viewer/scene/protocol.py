"""Meshcat's commands as bytes, as they are sent to the page.

Every command has a key: path, type, property. Of two commands with the same key only the later one
matters, so a scene is a dict from key to the newest command. Drawing something again does not make
it grow.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
import umsgpack

from floatbase._validation import Array
from floatbase.errors import ViewerError

Key = tuple[str, str, str]
Update = tuple[Key, bytes]

# meshcat's own commands, then those of web/src/scene.js
TYPES = (
    "set_object", "set_transform", "set_property", "delete", "set_animation", "delete_control",
    "set_control", "set_control_value", "set_camera", "set_follow", "set_title", "set_legend",
    "set_theme",
    "set_text", "add_plot_point", "set_views", "set_disconnect_message", "set_ground",
)  # fmt: skip

ANIMATION: Key = ("/", "set_animation", "")
_MAX_CONTROL_VALUE = 1e18  # of what a slider may report: MessagePack's whole numbers end at 1.8e19
_FLOAT32 = np.dtype(
    [("code", "u1"), ("value", ">f4")]
)  # MessagePack: the byte 0xca, then a big-endian float


def encode(command: Mapping[str, Any]) -> Update:
    """Key and bytes of a meshcat command that is given as plain data. Raises `ViewerError` for an
    unknown type of command.
    """
    kind = command.get("type")
    if kind not in TYPES:
        raise ViewerError(f"unknown viewer command {kind!r}; known: {', '.join(TYPES)}.")
    path = normal_path(command.get("path", ""))
    return (path, kind, str(command.get("property", command.get("name", "")))), umsgpack.packb(
        dict(command)
    )


def set_transform(path: str, matrix: Array) -> Update:
    """Place the object at `path` by a homogeneous matrix, shape (4, 4), relative to its parent.

    Most commands are of this type, so it is packed by hand.
    """
    key, head = _transform_head(path)
    numbers = np.empty(16, _FLOAT32)
    numbers["code"] = 0xCA
    numbers["value"] = matrix.T.ravel()
    return key, head + numbers.tobytes()


@lru_cache(maxsize=4096)  # a picture has some fifty paths, the same ones every time
def _transform_head(path: str) -> tuple[Key, bytes]:
    """Key of the transforms at a path, and how their bytes begin."""
    path = normal_path(path)
    head = b"\x83\xa4type\xadset_transform\xa4path" + _text(path) + b"\xa6matrix\xdc\x00\x10"
    return (path, "set_transform", ""), head


def set_property(path: str, name: str, value: Any) -> Update:
    """Set a property of the object at `path`, for example `visible`, `scale` or `color`."""
    return encode({"type": "set_property", "path": path, "property": name, "value": value})


def set_object(path: str, packed: bytes) -> Update:
    """Put an object at `path`. packed: the object as three.js reads it, in MessagePack (see
    `threejs.Shape`).
    """
    path = normal_path(path)
    return (path, "set_object", ""), b"\x83\xa4type\xaaset_object\xa4path" + _text(
        path
    ) + b"\xa6object" + packed


def _text(text: str) -> bytes:
    """A text of at most 64 KB in MessagePack."""
    data = text.encode()
    return b"\xda" + struct.pack(">H", len(data)) + data


def delete(path: str) -> Update:
    """Remove `path` and everything below it."""
    return encode({"type": "delete", "path": path})


def set_camera(position: npt.ArrayLike, target: npt.ArrayLike, angle: float) -> Update:
    """Look from `position` at `target`, both shape (3,), m, world. angle: vertical field of view,
    degrees.

    The command is ours, because meshcat's camera node cannot move the point that the mouse turns
    around.
    """
    eye, at = (_to_threejs(point) for point in (position, target))
    return encode({"type": "set_camera", "position": eye, "target": at, "fov": angle})


def set_follow(node: str, start: npt.ArrayLike, begin: npt.ArrayLike, smooth: bool) -> Update:
    """Let the camera go with the object at the path `node`, at the same height over the ground; ""
    for none.

    start: (3,), m, world, where the object was when the camera was set.
    begin: (3,), m, how far that is from where it is at home; the scale goes there, too.
    smooth: whether the camera is a little behind, so that it does not shake with the object.
    """
    at, moved = _to_threejs(start), _to_threejs(begin)
    return encode(
        {
            "type": "set_follow",
            "path": "",
            "node": node,
            "from": at,
            "begin": moved,
            "smooth": smooth,
        }
    )


def set_ground(planes: Iterable[tuple[npt.ArrayLike, float]]) -> Update:
    """The ground, for the height of a camera that follows. planes: normals, (3,), unit, world,
    upwards; and offsets, m.
    """
    in_threejs = [{"normal": _to_threejs(normal), "offset": offset} for normal, offset in planes]
    return encode({"type": "set_ground", "path": "", "planes": in_threejs})


def set_views(views: Mapping[str, tuple[npt.ArrayLike, npt.ArrayLike, float]]) -> Update:
    """The views that the page offers, each as position, target and angle of `set_camera`."""
    named = {
        name: {"position": _to_threejs(eye), "target": _to_threejs(at), "fov": fov}
        for name, (eye, at, fov) in views.items()
    }
    return encode({"type": "set_views", "path": "", "views": named})


def page_command(kind: str, **values: Any) -> Update:
    """A command of the page's that belongs to no object, as set_title, set_legend and set_theme."""
    return encode({"type": kind, "path": "", **values})


def no_animation() -> Update:
    """The command that ends an animation: everything returns to where it was before."""
    return encode(
        {"type": "set_animation", "path": "", "animations": [], "options": {"play": False}}
    )


def end_animation() -> list[Update]:
    """End the animation before the next picture is drawn.

    A busy page may receive this, the next picture and the next animation in one frame. So
    `no_animation` stands twice: under the animation's key, which the next animation takes over, and
    under a key of its own, so that the old animation ends before the picture is drawn. Ended later,
    it would undo the picture.
    """
    key, command = no_animation()
    return [(key, command), ((key[0], key[1], "end"), command)]


def set_control(name: str, **kind: Any) -> Update:
    """A control in the page's panel that reports to the window, see panel.js: a slider with value,
    min, max and step, a choice of texts with the number of the chosen one, a check box with a truth
    value, else a button.
    """
    return encode({"type": "set_control", "name": name, **kind})


def checked_control_value(command: dict[str, Any], value: Any) -> Any:
    """The value that a page reports for a control, within the control's range: a number, a truth
    value, or None of a button.

    command: of the control, decoded. Raises `ViewerError` for a value that no such control has: a
        page of ours sends none.
    """
    if "value" not in command:
        return None
    is_switch = isinstance(command["value"], bool)
    if (
        isinstance(value, bool) != is_switch
        or not isinstance(value, int | float)
        or not abs(value) < _MAX_CONTROL_VALUE
    ):
        raise ViewerError(f"the control {command['name']!r} cannot be {value!r}.")
    if "choices" in command:
        return min(max(round(value), 0), len(command["choices"]) - 1)
    return (
        value
        if is_switch
        else min(max(value, command.get("min", value)), command.get("max", value))
    )


def _to_threejs(point: npt.ArrayLike) -> list[float]:
    """A point of ours, z up, in the coordinates of three.js, y up."""
    x, y, z = (float(c) for c in np.asarray(point))
    return [x, z, -y]


@lru_cache(maxsize=4096)  # a picture has some fifty paths, the same ones every time
def normal_path(path: str) -> str:
    """The path with one leading slash and no empty parts."""
    return "/" + "/".join(part for part in path.split("/") if part)


def frame(commands: Iterable[bytes]) -> bytes:
    """Several commands as one message, each after its length (4 bytes, little-endian). The page
    draws them together.
    """
    return b"".join(
        part for command in commands for part in (struct.pack("<I", len(command)), command)
    )


def unframe(data: bytes) -> list[bytes]:
    """The commands in a frame: the inverse of `frame`."""
    commands, at = [], 0
    while at < len(data):
        (length,) = struct.unpack_from("<I", data, at)
        commands.append(data[at + 4 : at + 4 + length])
        at += 4 + length
    return commands
