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
_MAX_CONTROL_VALUE = 1e18  # of a slider: MessagePack's integers end at 1.8e19
_FLOAT32 = np.dtype(
    [("code", "u1"), ("value", ">f4")]
)  # MessagePack: the byte 0xca, then a big-endian float


def encode(command: Mapping[str, Any]) -> Update:
    """Encode a command.

    Parameters
    ----------
    command : dict
        Command as plain data.

    Returns
    -------
    Update
        Key and bytes of the command.

    Raises
    ------
    ViewerError
        If the type of the command is unknown.
    """
    kind = command.get("type")
    if kind not in TYPES:
        raise ViewerError(f"Unknown viewer command {kind!r}. Known commands: {', '.join(TYPES)}.")
    path = normal_path(command.get("path", ""))
    return (path, kind, str(command.get("property", command.get("name", "")))), umsgpack.packb(
        dict(command)
    )


def set_transform(path: str, matrix: Array) -> Update:
    """Place an object by a homogeneous transform.

    Most commands are of this type, so they are packed by hand.

    Parameters
    ----------
    path : str
        Path of the object.
    matrix : ndarray, shape (4, 4)
        Transform relative to its parent.

    Returns
    -------
    Update
        The command.
    """
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
    """Set a property of an object.

    Parameters
    ----------
    path : str
        Path of the object.
    name : str
        Name of the property, such as `visible`, `scale` or `color`.
    value
        New value.

    Returns
    -------
    Update
        The command.
    """
    return encode({"type": "set_property", "path": path, "property": name, "value": value})


def set_object(path: str, packed: bytes) -> Update:
    """Put an object at a path.

    Parameters
    ----------
    path : str
        Path of the object.
    packed : bytes
        Object for three.js in MessagePack; see `threejs.Shape`.

    Returns
    -------
    Update
        The command.
    """
    path = normal_path(path)
    return (path, "set_object", ""), b"\x83\xa4type\xaaset_object\xa4path" + _text(
        path
    ) + b"\xa6object" + packed


def _text(text: str) -> bytes:
    """Encode text of at most 64 KB in MessagePack."""
    data = text.encode()
    return b"\xda" + struct.pack(">H", len(data)) + data


def delete(path: str) -> Update:
    """Remove a path and everything below it.

    Parameters
    ----------
    path : str
        Path to remove.

    Returns
    -------
    Update
        The command.
    """
    return encode({"type": "delete", "path": path})


def set_camera(position: npt.ArrayLike, target: npt.ArrayLike, angle: float) -> Update:
    """Point the camera at a target.

    It is a custom command, because meshcat's camera node cannot move the point around which the
    mouse rotates the view.

    Parameters
    ----------
    position : array_like, shape (3,)
        Position of the camera in the world frame [m].
    target : array_like, shape (3,)
        Point to look at, in the world frame [m].
    angle : float
        Vertical field of view [degrees].

    Returns
    -------
    Update
        The command.
    """
    eye, at = (_to_threejs(point) for point in (position, target))
    return encode({"type": "set_camera", "position": eye, "target": at, "fov": angle})


def set_follow(node: str, start: npt.ArrayLike, begin: npt.ArrayLike, smooth: bool) -> Update:
    """Let the camera follow an object at a constant height above the ground.

    Parameters
    ----------
    node : str
        Path of the object; "" for none.
    start : array_like, shape (3,)
        Position of the object when the camera was set, in the world frame [m].
    begin : array_like, shape (3,)
        Displacement of that position from the standing position [m]. The scale bar is displaced by
        it, too.
    smooth : bool
        Whether the camera lags a little, so that it does not shake with the object.

    Returns
    -------
    Update
        The command.
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


def set_ground(
    planes: Iterable[tuple[npt.ArrayLike, float]], boxes: Iterable[Sequence[float]] = ()
) -> Update:
    """Define the ground above which a following camera keeps its height.

    Parameters
    ----------
    planes : iterable of tuple
        Unit normal, shape (3,), in the world frame, pointing upwards, and offset [m] of each plane.
    boxes : iterable of sequence, optional
        x0, x1, y0, y1 and top of each box, in the world frame [m].

    Returns
    -------
    Update
        The command.
    """
    in_threejs = [{"normal": _to_threejs(normal), "offset": offset} for normal, offset in planes]
    bounds = [[float(bound) for bound in box] for box in boxes]
    return encode({"type": "set_ground", "path": "", "planes": in_threejs, "boxes": bounds})


def set_views(views: Mapping[str, tuple[npt.ArrayLike, npt.ArrayLike, float]]) -> Update:
    """Define the views that the page offers.

    Parameters
    ----------
    views : dict
        Name -> position, target and angle, as for `set_camera`.

    Returns
    -------
    Update
        The command.
    """
    named = {
        name: {"position": _to_threejs(eye), "target": _to_threejs(at), "fov": fov}
        for name, (eye, at, fov) in views.items()
    }
    return encode({"type": "set_views", "path": "", "views": named})


def page_command(kind: str, **values: Any) -> Update:
    """Make a command that concerns the page and no object, such as set_title or set_legend.

    Parameters
    ----------
    kind : str
        Type of the command.
    **values
        Contents of the command.

    Returns
    -------
    Update
        The command.
    """
    return encode({"type": kind, "path": "", **values})


def no_animation() -> Update:
    """End an animation: all objects return to where they were before it.

    Returns
    -------
    Update
        The command.
    """
    return encode(
        {"type": "set_animation", "path": "", "animations": [], "options": {"play": False}}
    )


def end_animation() -> list[Update]:
    """End the animation before the next picture is drawn.

    A busy page may receive this command, the next picture and the next animation in one frame. The
    command therefore occurs twice. One has the key of the animation, which the next animation
    overwrites. The other has its own key, so that the old animation ends before the picture is
    drawn and cannot undo it.

    Returns
    -------
    list of Update
        The commands.
    """
    key, command = no_animation()
    return [(key, command), ((key[0], key[1], "end"), command)]


def set_control(name: str, **kind: Any) -> Update:
    """Add a control to the page's panel.

    The control is a slider if it has value, min, max and step; a menu if it has choices and the
    index of the chosen one; a check box if its value is a bool; otherwise a button. See panel.js.

    Parameters
    ----------
    name : str
        Name of the control.
    **kind
        Properties of the control.

    Returns
    -------
    Update
        The command.
    """
    return encode({"type": "set_control", "name": name, **kind})


def checked_control_value(command: dict[str, Any], value: Any) -> Any:
    """Check the value that a page reports for a control, and limit it to the control's range.

    Parameters
    ----------
    command : dict
        Command of the control, decoded.
    value
        Reported value.

    Returns
    -------
    float, int, bool or None
        The value; None for a button.

    Raises
    ------
    ViewerError
        If such a control cannot have this value. The viewer's own page never sends one.
    """
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
    return (
        value
        if is_switch
        else min(max(value, command.get("min", value)), command.get("max", value))
    )


def _to_threejs(point: npt.ArrayLike) -> list[float]:
    """Convert a point from z up to the coordinates of three.js, y up."""
    x, y, z = (float(c) for c in np.asarray(point))
    return [x, z, -y]


@lru_cache(maxsize=4096)  # a picture has some fifty paths, which stay the same
def normal_path(path: str) -> str:
    """Return the path with one leading slash and no empty parts.

    Parameters
    ----------
    path : str
        Path of an object.

    Returns
    -------
    str
        The normalized path.
    """
    return "/" + "/".join(part for part in path.split("/") if part)


def frame(commands: Iterable[bytes]) -> bytes:
    """Pack several commands into one message, which the page draws at once.

    Parameters
    ----------
    commands : iterable of bytes
        Encoded commands.

    Returns
    -------
    bytes
        Each command after its length (4 bytes, little-endian).
    """
    return b"".join(
        part for command in commands for part in (struct.pack("<I", len(command)), command)
    )


def unframe(data: bytes) -> list[bytes]:
    """Unpack the commands of a message, the inverse of `frame`.

    Parameters
    ----------
    data : bytes
        Message.

    Returns
    -------
    list of bytes
        Encoded commands.
    """
    commands, at = [], 0
    while at < len(data):
        (length,) = struct.unpack_from("<I", data, at)
        commands.append(data[at + 4 : at + 4 + length])
        at += 4 + length
    return commands
