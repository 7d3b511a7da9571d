"""Pictures, recordings and panels of the site: HTML, and the files that a browser draws them from.

All pictures share one copy of the viewer, and the pictures of a robot share one copy of its meshes.
The name of every other file is a digest of its contents, so files of an earlier build remain valid.
The files are scripts, which a browser can also load from disk.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import html
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

from floatbase.lessons import static_export
from floatbase.viewer.scene import protocol
from floatbase.viewer.web import pages

_MIN_SHARED_SIZE = 1500  # bytes of a command that pictures share; a smaller one each has itself
_COMMON_FRACTION = 0.3  # of a robot's pictures
_FOLDER = "pictures"  # beside pictures.js
_DATA_KEYS = ("keys", "first", "stops", "notes", "together")  # the HTML has everything else
_NO_SCRIPT_TEXT = "This turns and moves where JavaScript is on."


class Pictures:
    """The pictures of a site."""

    def __init__(self, folder: Path):
        self._folder = folder / _FOLDER
        self._placed: dict[str, tuple[dict[str, Any], list[bytes]]] = {}

    def place(self, data: Mapping[str, Any], alt: str = "") -> str | None:
        """Return HTML for the mimebundle of an output, or None if it has no picture.

        alt: says what is seen.
        """
        if static_export.MIME not in data:
            return None
        description = dict(data[static_export.MIME])
        commands = static_export.commands(description)
        del description["commands"]
        name = _file_name("picture", json.dumps(description, sort_keys=True).encode(), *commands)
        self._placed[name] = description, commands
        return _figure_html(name, description, alt)

    def write(self) -> None:
        """Write the files, after all pictures have been placed."""
        self._folder.mkdir(parents=True, exist_ok=True)
        self._folder.joinpath("viewer.html").write_text(
            pages.embedded_page("viewer.js"), encoding="utf-8"
        )
        self._folder.joinpath("viewer.js").write_bytes(pages.viewer_code())
        groups = self._shared_files()
        for name, commands in groups.items():
            self._write(name, commands)
        at = {command: name for name, commands in groups.items() for command in commands}
        for name, (description, commands) in self._placed.items():
            shared = sorted({at[command] for command in commands if command in at})
            own = [command for command in commands if command not in at]
            loaded = [*chain.from_iterable(groups[group] for group in shared), *own]
            numbers = {command: i for i, command in enumerate(loaded)}
            head = {key: description[key] for key in _DATA_KEYS}
            head |= {"shared": shared, "at": [numbers[command] for command in commands]}
            self._write(name, [json.dumps(head, separators=(",", ":")).encode(), *own])

    def _shared_files(self) -> dict[str, list[bytes]]:
        """Collect large commands that several pictures use: name of a file -> commands."""
        placed = self._placed.values()
        pictures = [(set(about["names"]), set(commands)) for about, commands in placed]
        uses = Counter(chain.from_iterable(commands for _, commands in pictures))
        found: dict[str, list[bytes]] = {}
        for command in sorted(uses):
            if len(command) < _MIN_SHARED_SIZE or uses[command] == 1:
                continue
            robots = set[str]().union(*(names for names, has in pictures if command in has))
            (robot,) = robots if len(robots) == 1 else ("robots",)
            usual = uses[command] >= _COMMON_FRACTION * sum(robot in names for names, _ in pictures)
            found.setdefault(robot if usual else f"{robot}-more", []).append(command)
        return {_file_name(name, *commands): commands for name, commands in found.items()}

    def _write(self, name: str, parts: Sequence[bytes]) -> None:
        packed = base64.b64encode(gzip.compress(protocol.frame(parts), 9, mtime=0)).decode()
        text = f'floatbasePictures.take("{name}","{packed}")\n'
        self._folder.joinpath(f"{name}.js").write_text(text, encoding="ascii")


def _file_name(begin: str, *parts: bytes) -> str:
    """Name a file after a digest of its contents."""
    return f"{begin}-{hashlib.sha256(protocol.frame(parts)).hexdigest()[:12]}"


def _figure_html(name: str, description: dict[str, Any], alt: str) -> str:
    """Write the figure before its script loads: first images, note, and disabled controls."""
    heights, names, stills = (description[key] for key in ("heights", "names", "stills"))
    titles = description["titles"] or [""] * len(names)
    alts = [title or name for title, name in zip(titles, names, strict=True)]
    alts[:1] = [alt]  # it is about all scenes
    scenes = "".join(map(_scene_html, heights, alts, stills, titles))
    if scenes:
        scenes = f'<div class="floatbase-scenes">{scenes}</div>'
    first = ",".join(str(control["first"]) for control in description["controls"])
    note = ""
    if first in description["stops"]:
        note = description["notes"][description["stops"][first][0]]
    controls = "".join(map(_control_html, description["controls"]))
    label = "" if scenes else f' aria-label="{html.escape(alt)}"'  # a drawing in the note
    words = html.escape(description["words"])
    if words:
        words = f'<p class="floatbase-words">{words}</p>'
    return (
        f'<figure class="floatbase-picture{" floatbase-beside" if description["beside"] else ""}" '
        f'data-picture="{name}"{label}>'
        f'<div class="floatbase-seen">{scenes}'
        f'<div class="floatbase-note" aria-live="polite">{note}</div></div>'
        f'<div class="floatbase-controls">{controls}</div>{words}'
        f"<noscript><p>{_NO_SCRIPT_TEXT}</p></noscript></figure>"
    )


def _scene_html(height: int, alt: str, image: str, title: str) -> str:
    heading = f"<b>{html.escape(title)}</b>" if title else ""
    return (
        f'<div class="floatbase-scene" style="--height:{height}px">{heading}'
        f'<div><img alt="{html.escape(alt)}" '
        f'src="data:image/png;base64,{image}"></div></div>'
    )


def _control_html(control: dict[str, Any]) -> str:
    """Write a control as a plain HTML element. Its value is the index of a slider sample."""
    name, unit, first = html.escape(control["name"]), html.escape(control["unit"]), control["first"]
    named = f"{name} [{unit}]" if unit else name
    if control["kind"] == "switch":
        return (
            f'<label class="floatbase-switch"><input type="checkbox" '
            f"disabled{' checked' if first else ''}>{named}</label>"
        )
    if control["kind"] == "choice":
        texts = [html.escape(value) for value in control["values"]]
        options = "".join(
            f"<option{' selected' if i == first else ''}>{text}</option>"
            for i, text in enumerate(texts)
        )
        return (
            f'<label class="floatbase-choice"><span>{named}</span><select '
            f"disabled>{options}</select></label>"
        )
    values = html.escape(json.dumps(control["values"], ensure_ascii=False))
    now = html.escape(control["values"][first])
    last = len(control["values"]) - 1
    return (
        f'<label><span>{named}</span><input type="range" min="0" max="{last}" value="{first}" '
        f'disabled aria-label="{named}" '
        f'aria-valuetext="{now} {unit}" data-unit="{unit}" '
        f'data-values="{values}"><output>{now}</output></label>'
    )
