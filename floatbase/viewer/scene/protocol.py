"""Commands for the page, encoded as bytes.

The commands are those of meshcat and some custom ones. Each command has a key: path, type,
property. Of two commands with the same key only the later one counts, so a scene is a dict from key
to the newest command. The dict does not grow when something is drawn again.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import msgpack
import numpy as np
import numpy.typing as npt

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

ROOT = "/meshcat/"  # path of all that a picture shows
ANIMATION: Key = ("/", "set_animation", "")
_MAX_CONTROL_VALUE = 1e18  # of a slider: MessagePack's integers end at 1.8e19
# MessagePack: the byte 0xca, then a big-endian float
_FLOAT32 = np.dtype([("code", "u1"), ("value", ">f4")])


def encode(command: Mapping[str, Any]) -> Update:
    """Encode a command."""
    kind = command.get("type")
    if kind not in TYPES:
        raise ViewerError(f"Unknown viewer command {kind!r}. Known commands: {', '.join(TYPES)}.")
    path = normal_path(command.get("path", ""))
    key = (path, kind, str(command.get("property", command.get("name", ""))))
    return key, msgpack.packb(dict(command))


def set_transform(path: str, matrix: Array) -> Update:
    """Place an object by a homogeneous transform."""
    key, head = _transform_head(path)
    numbers = np.empty(16, _FLOAT32)
    numbers["code"] = 0xCA
    numbers["value"] = matrix.T.ravel()
    return key, head + numbers.tobytes()


@lru_cache(maxsize=4096)  # a picture has some fifty paths, which stay the same
def _transform_head(path: str) -> tuple[Key, bytes]:
    """Return the key of the transforms at a path, and the first part of their bytes."""
    path = normal_path(path)
    head = b"\x83\xa4type\xadset_transform\xa4path" + _text(path) + b"\xa6matrix\xdc\x00\x10"
    return (path, "set_transform", ""), head


def set_property(path: str, name: str, value: Any) -> Update:
    """Set a property of an object."""
    return encode({"type": "set_property", "path": path, "property": name, "value": value})


def set_object(path: str, packed: bytes) -> Update:
    """Put an object at a path."""
    path = normal_path(path)
    head = b"\x83\xa4type\xaaset_object\xa4path" + _text(path)
    return (path, "set_object", ""), head + b"\xa6object" + packed


def _text(text: str) -> bytes:
    """Encode text of at most 64 KB in MessagePack."""
    data = text.encode()
    return b"\xda" + struct.pack(">H", len(data)) + data


def delete(path: str) -> Update:
    """Remove a path and everything below it."""
    return encode({"type": "delete", "path": path})


def set_camera(position: npt.ArrayLike, target: npt.ArrayLike, angle: float) -> Update:
    """Point the camera at a target."""
    eye, at = (_to_threejs(point) for point in (position, target))
    return encode({"type": "set_camera", "position": eye, "target": at, "fov": angle})


def set_follow(node: str, start: npt.ArrayLike, begin: npt.ArrayLike, smooth: bool) -> Update:
    """Let the camera follow an object at a constant height above the ground."""
    at, moved = _to_threejs(start), _to_threejs(begin)
    values = {"node": node, "from": at, "begin": moved, "smooth": smooth}
    return page_command("set_follow", **values)


def set_ground(
    planes: Iterable[tuple[npt.ArrayLike, float]], boxes: Iterable[Sequence[float]] = ()
) -> Update:
    """Define the ground above which a following camera keeps its height."""
    in_threejs = [{"normal": _to_threejs(normal), "offset": offset} for normal, offset in planes]
    bounds = [[float(bound) for bound in box] for box in boxes]
    return page_command("set_ground", planes=in_threejs, boxes=bounds)


def set_views(views: Mapping[str, tuple[npt.ArrayLike, npt.ArrayLike, float]]) -> Update:
    """Define the views that the page offers."""
    named = {
        name: {"position": _to_threejs(eye), "target": _to_threejs(at), "fov": fov}
        for name, (eye, at, fov) in views.items()
    }
    return page_command("set_views", views=named)


def page_command(kind: str, **values: Any) -> Update:
    """Make a command that concerns the page and no object, such as set_title or set_legend."""
    return encode({"type": kind, "path": "", **values})


def no_animation() -> Update:
    """End an animation: all objects return to where they were before it."""
    return page_command("set_animation", animations=[], options={"play": False})


def end_animation() -> list[Update]:
    """End the animation before the next picture is drawn."""
    key, command = no_animation()
    return [(key, command), ((key[0], key[1], "end"), command)]


def set_control(name: str, **kind: Any) -> Update:
    """Add a control to the page's panel."""
    return encode({"type": "set_control", "name": name, **kind})


def checked_control_value(command: dict[str, Any], value: Any) -> Any:
    """Check the value that a page reports for a control, and limit it to the control's range."""
    if "value" not in command:
        return None
    is_switch = isinstance(command["value"], bool)
    if (
        isinstance(value, bool) != is_switch
        or not isinstance(value, int | float)
        or not abs(value) < _MAX_CONTROL_VALUE
    ):
        raise ViewerError(f"The control {command['name']!r} cannot have the value {value!r}.")
    if "choices" in command:
        return min(max(round(value), 0), len(command["choices"]) - 1)
    if is_switch:
        return value
    return min(max(value, command.get("min", value)), command.get("max", value))


def _to_threejs(point: npt.ArrayLike) -> list[float]:
    """Convert a point from z up to the coordinates of three.js, y up."""
    x, y, z = (float(c) for c in np.asarray(point))
    return [x, z, -y]


@lru_cache(maxsize=4096)  # a picture has some fifty paths, which stay the same
def normal_path(path: str) -> str:
    """Return the path with one leading slash and no empty parts."""
    return "/" + "/".join(part for part in path.split("/") if part)


def frame(commands: Iterable[bytes]) -> bytes:
    """Pack several commands into one message, which the page draws at once."""
    return b"".join(
        part for command in commands for part in (struct.pack("<I", len(command)), command)
    )


def unframe(data: bytes) -> list[bytes]:
    """Unpack the commands of a message, the inverse of `frame`."""
    commands, at = [], 0
    while at < len(data):
        (length,) = struct.unpack_from("<I", data, at)
        commands.append(data[at + 4 : at + 4 + length])
        at += 4 + length
    return commands
