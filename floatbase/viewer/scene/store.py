"""The scene that a window shows: the newest command of every key."""

from __future__ import annotations

import threading
from collections.abc import Iterable
from typing import Any

import umsgpack

from floatbase.errors import ViewerError
from floatbase.viewer.scene.protocol import Key, Update, checked_control_value, encode


class Scene:
    """The newest command of every key, each with the number of the change that brought it.

    A page that has seen change n is brought up to date by `since(n)`, whatever it missed. Any
    thread may write. A change is one assignment under a lock, so an interrupt during a write loses
    at most that write. No loop stands under the lock itself: where a loop jumps back from an `if`,
    Python 3.12 and 3.13 leave the lock locked when an interrupt comes just there.
    """

    def __init__(self) -> None:
        self.newest = 0
        self.sent_to_all = 0
        self._lock = threading.Lock()
        self._entries: dict[Key, tuple[int, bytes]] = {}

    def put(self, updates: Iterable[Update]) -> int:
        """Store updates and return the number of the last one. Readers see all of them or none."""
        with self._lock:
            return self._store(updates)

    def set_control_value(self, name: object, value: Any, page: str) -> Any:
        """Store the value that a page reports for a control, for all pages to show, and return it
        as the control allows it.

        page: a name of that page, which the command has, so that the page knows its own report.
        Raises `ViewerError` where there is no such control, or when it cannot have such a value.
        """
        control = self.command(("/", "set_control", name)) if isinstance(name, str) else None
        if control is None:
            raise ViewerError(f"there is no control {name!r}.")
        value = checked_control_value(control, value)
        if value is not None:
            self.put(
                [encode({"type": "set_control_value", "name": name, "value": value, "by": page})]
            )
        return value

    def since(self, number: int) -> tuple[int, list[bytes]]:
        """The number of the newest change, and in order the commands that came after change
        `number`.
        """
        with self._lock:
            newest, entries = self.newest, list(self._entries.values())
        return newest, [
            command for _, command in sorted(entry for entry in entries if entry[0] > number)
        ]

    def command(self, key: Key) -> dict[str, Any] | None:
        """The command of a key, decoded; None where there is none."""
        with self._lock:
            entry = self._entries.get(key)
        return None if entry is None else umsgpack.unpackb(entry[1])

    def commands(self) -> dict[Key, dict[str, Any]]:
        """The scene as decoded commands."""
        return {key: umsgpack.unpackb(command) for key, command in self._sorted_entries()}

    def file_commands(self) -> list[bytes]:
        """The commands that a file can hold: all but those of the panel, which needs a program that
        answers it.
        """
        return [command for _, command in self.file_entries()]

    def file_entries(self) -> list[tuple[Key, bytes]]:
        """The same with their keys."""
        return [
            entry
            for entry in self._sorted_entries()
            if not entry[0][1].endswith(
                ("_control", "_control_value", "set_text", "add_plot_point")
            )
        ]

    def __len__(self) -> int:
        return len(self._entries)

    @property
    def is_empty(self) -> bool:
        """Whether nothing is drawn. Settings of the page do not count."""
        with self._lock:
            return not any(kind == "set_object" for _, kind, _ in self._entries)

    def _sorted_entries(self) -> list[tuple[Key, bytes]]:
        """Keys and commands, oldest first, without those that only report that an object of ours
        was deleted.
        """
        with self._lock:
            entries = sorted(
                (number, key, command) for key, (number, command) in self._entries.items()
            )
        return [(key, command) for _, key, command in entries if not _is_deletion(key)]

    def _store(self, updates: Iterable[Update]) -> int:
        for key, command in updates:
            self.newest += 1
            self._entries[key] = (self.newest, command)
            if key[1] == "delete":
                self._drop_below(key[0], self.newest)
        return self.newest

    def _drop_below(self, path: str, number: int) -> None:
        """Drop the entries that the deletion `number` of `path` makes void, and deletions that
        every page has carried out.
        """
        below = "/" if path == "/" else path + "/"
        for key, (when, _) in list(self._entries.items()):
            is_void = when < number and (key[0] == path or key[0].startswith(below))
            is_done = _is_deletion(key) and when <= self.sent_to_all
            if is_void or is_done:
                self._entries.pop(key, None)


def _is_deletion(key: Key) -> bool:
    """Whether the entry deletes an object of ours. (The page's own grid and axes lie elsewhere: new
    pages must be told.)
    """
    return key[1] == "delete" and key[0].startswith("/meshcat")
