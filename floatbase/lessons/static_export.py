"""Pictures for pages without a kernel: the first scene of some viewers, and the changes from it.

If the environment has FLOATBASE_VIEWER=site, a display adds this to the output beside its image, as
plain data: the commands of the scenes (see `protocol`), each stored once, and numbers that refer to
them.
"""

from __future__ import annotations

import base64
import gzip
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from floatbase.errors import ViewerError
from floatbase.viewer.export import thumbnail
from floatbase.viewer.export.display_mode import MIMEBUNDLES
from floatbase.viewer.scene import protocol
from floatbase.viewer.scene.store import Scene

if TYPE_CHECKING:
    from floatbase.viewer import Viewer

MODE = "site"  # value of `display_mode`
MIME = "application/vnd.floatbase.picture+json"
REMOVED = -1  # instead of the number of a command: the scene has none with this key
_KINDS = ("range", "choice", "switch")
_END = (protocol.ANIMATION[0], protocol.ANIMATION[1], "end")


@dataclass(frozen=True)
class Control:
    """Control on a static page, with a fixed number of positions.

    `values` are the labels of the positions, and `first` is the index of the initial one. The kind
    "range" is a slider, "choice" selects one of several, and "switch" is off or on.
    """

    name: str
    values: tuple[str, ...]
    first: int
    kind: str = "range"
    unit: str = ""

    def __post_init__(self) -> None:
        if self.kind not in _KINDS or not 0 <= self.first < len(self.values):
            raise ViewerError(
                f"A control of the kind {self.kind!r} cannot start at position {self.first} of "
                f"{self.values}. The kind must be one of {', '.join(_KINDS)}, and the "
                f"position must exist."
            )


class StaticExport:
    """Scenes that viewers show now, and those at other positions of the controls.

    The views are side by side, with a note to their right if `beside`. `words` is a text below
    them, such as what only the live lesson can do.
    """

    def __init__(
        self,
        views: Sequence[Viewer],
        *,
        beside: bool = False,
        words: str = "",
        titles: Sequence[str] = (),
    ):
        self._views = list(views)
        self._commands: dict[bytes, int] = {}
        self._keys: dict[protocol.Key, int] = {}
        self._notes: dict[str, int] = {}
        self._first = [_entries(view.window.scene) for view in self._views]
        self._thumbnails = [
            thumbnail.render_png(view.renderer.picture, view.window.scene, view.height)
            for view in self._views
        ]
        self._samples: dict[str, list[Any]] = {}
        self._head = {
            "titles": list(titles), "names": [view.robot.name for view in self._views],
            "heights": [view.height for view in self._views], "beside": beside, "words": words,
            "stills": [base64.b64encode(one).decode() for one in self._thumbnails],
            "first": [self._changes({}, first) for first in self._first],
        }  # fmt: skip

    def add_sample(self, at: Iterable[int], note: str = "") -> None:
        """Add what the viewers show now as the picture at one position of the controls.

        at: index of the position of each control. note: HTML.
        """
        scenes = [_entries(view.window.scene) for view in self._views]
        changed = [
            self._changes(first, scene) for first, scene in zip(self._first, scenes, strict=True)
        ]
        number = self._notes.setdefault(note, len(self._notes))
        self._samples[",".join(map(str, at))] = [number, *changed]

    def bundle(self, controls: Sequence[Control] = (), together: bool = True) -> dict[str, Any]:
        """Return the mimebundle of the display.

        together: whether there is a picture for every combination of positions.
        """
        packed = gzip.compress(protocol.frame(self._commands), 6, mtime=0)
        data = {
            **self._head, "controls": [asdict(control) for control in controls],
            "together": together, "stops": self._samples,
            "notes": list(self._notes), "keys": [list(key) for key in self._keys],
            "commands": base64.b64encode(packed).decode(),
        }  # fmt: skip
        shown: dict[str, Any] = {
            MIME: data,
            "text/plain": ", ".join(map(repr, self._views)) or "a panel",
        }
        if self._thumbnails:
            image = thumbnail.side_by_side(self._thumbnails)
            shown["image/png"] = base64.b64encode(image).decode()
        return shown

    def _numbers(self, key: protocol.Key, command: bytes | None) -> tuple[int, int]:
        number = REMOVED
        if command is not None:
            number = self._commands.setdefault(command, len(self._commands))
        return self._keys.setdefault(key, len(self._keys)), number

    def _changes(
        self, first: dict[protocol.Key, bytes], now: dict[protocol.Key, bytes]
    ) -> list[int]:
        """Return the numbers of key and command, in turn, of all that differs from the first."""
        gone = [self._numbers(key, None) for key in first if key not in now]
        fresh = [
            self._numbers(key, command) for key, command in now.items() if first.get(key) != command
        ]
        return [number for pair in (*gone, *fresh) for number in pair]


def commands(data: dict[str, Any]) -> list[bytes]:
    """Return the commands in the data of a bundle, in the order of their numbers."""
    return protocol.unframe(gzip.decompress(base64.b64decode(data["commands"])))


def _entries(scene: Scene) -> dict[protocol.Key, bytes]:
    """Return the scene without animations that have ended."""
    ended = protocol.no_animation()[1]
    return {
        key: command for key, command in scene.file_entries() if key != _END and command != ended
    }


def bundle(view: Viewer, words: str = "") -> dict[str, Any]:
    """Return the mimebundle of what a viewer shows now, with text below it."""
    return StaticExport([view], words=words).bundle()


MIMEBUNDLES[MODE] = bundle
