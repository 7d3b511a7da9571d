"""Store of the scene that a window shows."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import msgpack

from floatbase._locks import InterruptibleLock
from floatbase.errors import ViewerError
from floatbase.viewer.scene.protocol import Key, Update, checked_control_value, encode


class Scene:
    """Newest command of each key, with the number of the change that stored it."""

    def __init__(self) -> None:
        self.newest = 0
        self.sent_to_all = 0
        self._lock = InterruptibleLock()
        self._entries: dict[Key, tuple[int, bytes]] = {}

    def put(self, updates: Iterable[Update]) -> int:
        """Store updates; readers see all of them or none."""
        with self._lock:
            return self._store(updates)

    def set_control_value(self, name: object, value: Any, page: str) -> Any:
        """Store the value that a page reports for a control, so that all pages show it."""
        control = self.command(("/", "set_control", name)) if isinstance(name, str) else None
        if control is None:
            raise ViewerError(f"There is no control {name!r}.")
        value = checked_control_value(control, value)
        if value is not None:
            command = {"type": "set_control_value", "name": name, "value": value, "by": page}
            self.put([encode(command)])
        return value

    def since(self, number: int) -> tuple[int, list[bytes]]:
        """Return the commands stored after a change."""
        with self._lock:
            newest, entries = self.newest, list(self._entries.values())
        return newest, [command for when, command in sorted(entries) if when > number]

    def command(self, key: Key) -> dict[str, Any] | None:
        """Return the decoded command of a key."""
        with self._lock:
            entry = self._entries.get(key)
        return None if entry is None else msgpack.unpackb(entry[1])

    def commands(self) -> dict[Key, dict[str, Any]]:
        """Return the scene as decoded commands."""
        return {key: msgpack.unpackb(command) for key, command in self._sorted_entries()}

    def file_commands(self) -> list[bytes]:
        """Return the commands that a file can hold."""
        return [command for _, command in self.file_entries()]

    def file_entries(self) -> list[tuple[Key, bytes]]:
        """Return keys and commands of `file_commands`."""
        of_panel = ("_control", "_control_value", "set_text", "add_plot_point")
        return [entry for entry in self._sorted_entries() if not entry[0][1].endswith(of_panel)]

    def __len__(self) -> int:
        return len(self._entries)

    @property
    def is_empty(self) -> bool:
        """Whether nothing is drawn. Settings of the page do not count."""
        with self._lock:
            return not any(kind == "set_object" for _, kind, _ in self._entries)

    def _sorted_entries(self) -> list[tuple[Key, bytes]]:
        """Return keys and commands, oldest first, without deletions of the viewer's own objects."""
        with self._lock:
            entries = sorted(
                (number, key, command) for key, (number, command) in self._entries.items()
            )
        return [(key, command) for _, key, command in entries if not _is_deletion(key)]

    def _store(self, updates: Iterable[Update]) -> int:
        """Store updates and return the number of the last one."""
        for key, command in updates:
            self.newest += 1
            self._entries[key] = (self.newest, command)
            if key[1] == "delete":
                self._drop_below(key[0], self.newest)
        return self.newest

    def _drop_below(self, path: str, number: int) -> None:
        """Drop the entries below `path` that the deletion `number` makes void."""
        below = "/" if path == "/" else path + "/"
        for key, (when, _) in list(self._entries.items()):
            is_void = when < number and (key[0] == path or key[0].startswith(below))
            is_done = _is_deletion(key) and when <= self.sent_to_all
            if is_void or is_done:
                self._entries.pop(key, None)


def _is_deletion(key: Key) -> bool:
    """Return whether the entry deletes one of our objects."""
    return key[1] == "delete" and key[0].startswith("/meshcat")
