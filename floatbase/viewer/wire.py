"""What goes over the wire: meshcat's commands as bytes, and the scene they add up to.

Every command has a key (path, type, property). Of two commands with the same key only the later one matters, so a scene
is a dict from key to the newest command, and never grows by being drawn again.
"""

from __future__ import annotations

import json
import struct
import threading
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import umsgpack

from floatbase._arrays import Array
from floatbase.errors import ViewerError

Key = tuple[str, str, str]
Update = tuple[Key, bytes]

# meshcat's commands, and those that our page adds
STORED = (
    "set_object", "set_transform", "set_property", "delete", "set_animation", "set_control", "delete_control",
    "set_camera", "set_follow", "set_title", "set_legend", "set_theme", "set_kept",
)  # fmt: skip

_ANIMATION: Key = ("/", "set_animation", "")
_FLOAT32 = np.dtype([("code", "u1"), ("value", ">f4")])  # MessagePack: the byte 0xca, then a big-endian float


def encode(command: Mapping[str, Any]) -> Update:
    """Key and bytes of a lowered meshcat command. Raises `ViewerError` for a type that makes no scene."""
    kind = command.get("type")
    if kind not in STORED:
        raise ViewerError(f"unknown viewer command {kind!r}; known: {', '.join(STORED)}.")
    path = normal_path(command.get("path", ""))
    return (path, kind, str(command.get("property", command.get("name", "")))), umsgpack.packb(dict(command))


def set_transform(path: str, matrix: Array) -> Update:
    """Place `path` by a homogeneous matrix, shape (4, 4), relative to its parent; the hot path, 3 µs."""
    numbers = np.empty(16, _FLOAT32)
    numbers["code"] = 0xCA
    numbers["value"] = matrix.T.ravel()
    head = b"\x83\xa4type\xadset_transform\xa4path" + _text(path)
    return (path, "set_transform", ""), head + b"\xa6matrix\xdc\x00\x10" + numbers.tobytes()


def set_property(path: str, name: str, value: Any) -> Update:
    """Set a property of the object at `path`, as `visible`, `scale` or `color`."""
    return encode({"type": "set_property", "path": path, "property": name, "value": value})


def set_object(path: str, packed: bytes) -> Update:
    """Put a lowered three.js object, packed already, at `path`."""
    return (path, "set_object", ""), b"\x83\xa4type\xaaset_object\xa4path" + _text(path) + b"\xa6object" + packed


def _text(text: str) -> bytes:
    """MessagePack of a text below 64 KB."""
    data = text.encode()
    return b"\xda" + struct.pack(">H", len(data)) + data


def delete(path: str) -> Update:
    """Remove `path` and everything below it."""
    return encode({"type": "delete", "path": path})


def set_camera(position: npt.ArrayLike, target: npt.ArrayLike, angle: float) -> Update:
    """Look from `position` at `target`, both shape (3,), m, world, with a vertical field of view of `angle` degrees.

    Our own command: meshcat's camera node cannot move the point that the mouse turns around.
    """
    eye, at = (_upright(point) for point in (position, target))
    return encode({"type": "set_camera", "position": eye, "target": at, "fov": angle})


def page_command(kind: str, **values: Any) -> Update:
    """One of our page's own commands that belong to no object: set_title, set_legend, set_follow, set_theme, set_kept."""
    return encode({"type": kind, "path": "", **values})


def no_animation() -> Update:
    """The command that ends an animation and puts everything back where it was before."""
    return encode({"type": "set_animation", "path": "", "animations": [], "options": {"play": False}})


def end_animation() -> list[Update]:
    """`no_animation` twice: in the animation's place, and in a place of its own, before what is drawn next. A page that was
    busy may get that and another animation in one frame; ended only then, the old one would undo what is drawn."""
    key, command = no_animation()
    return [(key, command), ((key[0], key[1], "end"), command)]


def set_control(name: str, **range_of_values: float) -> Update:
    """A slider with value, min, max and step, or a button without them, in the page's panel; it reports to the window."""
    told = json.dumps(name)
    report = f"(value) => viewer.connection.send(JSON.stringify({{type: 'control', name: {told}, value: value ?? null}}))"
    return encode({"type": "set_control", "name": name, "callback": report, **range_of_values})


def _upright(point: npt.ArrayLike) -> list[float]:
    """A point in three.js coordinates, where y is up."""
    x, y, z = (float(c) for c in np.asarray(point))
    return [x, z, -y]


def normal_path(path: str) -> str:
    """`path` with one leading slash and no empty parts."""
    return "/" + "/".join(part for part in path.split("/") if part)


def frame(commands: Iterable[bytes]) -> bytes:
    """Commands in one piece, each after its length (4 bytes, little-endian): drawn together, so no picture is half done."""
    return b"".join(part for command in commands for part in (struct.pack("<I", len(command)), command))


def unframe(data: bytes) -> list[bytes]:
    """The commands of a frame, one by one."""
    commands, at = [], 0
    while at < len(data):
        (length,) = struct.unpack_from("<I", data, at)
        commands.append(data[at + 4 : at + 4 + length])
        at += 4 + length
    return commands


class Scene:
    """The newest command of every key, each with the number of the change that brought it.

    Any thread may write. A change is one assignment under a lock, and readers sort by number, so an interrupt in the middle
    of a write loses at most that write. A viewer that has seen change n is brought up to date by `since(n)`, however many
    changes it slept through.
    """

    def __init__(self) -> None:
        self.newest = 0
        self.seen_by_all = 0
        self._lock = threading.Lock()
        self._entries: dict[Key, tuple[int, bytes]] = {}

    def put(self, updates: Iterable[Update]) -> int:
        """Take updates, all at once for readers, and return the number of the last one."""
        with self._lock:
            for key, command in updates:
                self.newest += 1
                self._entries[key] = (self.newest, command)
                if key[1] == "delete":
                    self._forget_below(key[0], self.newest)
            return self.newest

    def since(self, number: int) -> tuple[int, list[bytes]]:
        """The number of the newest change, and the commands that came after change `number`, in order."""
        with self._lock:
            newest = self.newest
            entries = [entry for entry in self._entries.values() if entry[0] > number]
        return newest, [command for _, command in sorted(entries)]

    def copy(self) -> Scene:
        """The scene as it is now, which later changes leave alone; the commands themselves are shared."""
        other = Scene()
        with self._lock:
            other.newest, other._entries = self.newest, dict(self._entries)
        return other

    def instead_of(self, shown: Scene) -> list[bytes]:
        """The commands that lead a page from another scene to this one: settings only where they differ, so that the
        reader's own view stays, and everything that is drawn."""
        with shown._lock:
            old = dict(shown._entries)
        with self._lock:
            entries = sorted((number, key, command) for key, (number, command) in self._entries.items())
        commands = [delete("/meshcat")[1]]
        if _ANIMATION in old and _ANIMATION not in self._entries:
            commands.append(no_animation()[1])
        for _, key, command in entries:
            setting = not key[0].startswith("/meshcat") and key != _ANIMATION
            if not _is_gone(key) and not (setting and key in old and old[key][1] == command):
                commands.append(command)
        return commands

    def commands(self) -> dict[Key, dict[str, Any]]:
        """The scene as decoded commands: what tests and exports read."""
        with self._lock:
            entries = sorted((number, key, command) for key, (number, command) in self._entries.items())
        return {key: umsgpack.unpackb(command) for _, key, command in entries if not _is_gone(key)}

    def lasting(self) -> list[bytes]:
        """The commands that a file can hold: without what is gone, and without controls, which need someone to answer."""
        with self._lock:
            entries = sorted((number, key, command) for key, (number, command) in self._entries.items())
        return [command for _, key, command in entries if not _is_gone(key) and not key[1].endswith("_control")]

    def __len__(self) -> int:
        return len(self._entries)

    @property
    def is_empty(self) -> bool:
        """Whether nothing is drawn; the page's settings do not count."""
        with self._lock:
            return not any(kind == "set_object" for _, kind, _ in self._entries)

    def _forget_below(self, path: str, number: int) -> None:
        """Drop what a delete has overtaken, and the deletes that every viewer has carried out."""
        below = "/" if path == "/" else path + "/"
        for key, (when, _) in list(self._entries.items()):
            overtaken = when < number and (key[0] == path or key[0].startswith(below))
            carried_out = _is_gone(key) and when <= self.seen_by_all
            if overtaken or carried_out:
                self._entries.pop(key, None)


def _is_gone(key: Key) -> bool:
    """Whether the entry only says that something of ours is gone (the page's own grid and axes have to be told)."""
    return key[1] == "delete" and key[0].startswith("/meshcat")
