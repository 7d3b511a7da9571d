"""The 3-D pictures of a page: all share one copy of the viewer and of every command that more than one of them uses.

Robots stay the same from picture to picture, so a page of eight pictures of one robot holds its meshes once.
"""

from __future__ import annotations

import html
import json
import re
from collections.abc import Mapping
from typing import Any

from floatbase.viewer import page, wire

_FRAME = re.compile(r'<iframe srcdoc="([^"]*)" title="([^"]*)" style="[^"]*?height: (\d+)px[^"]*"></iframe>')
_CHILD = "IPY_MODEL_"


class Pictures:
    """What the pictures of one page are drawn from. `placed` takes them out of HTML, `held` packs them into the page."""

    def __init__(self) -> None:
        self._numbers: dict[bytes, int] = {}  # command -> its number, in the order of first use
        self._n = 0

    def placed(self, text: str) -> str:
        """HTML with a place for a picture instead of every frame that holds a scene, as `Viewer` writes them."""
        return _FRAME.sub(self._place, text)

    def panel(self, widgets: Mapping[str, Any], model: str) -> str:
        """A panel of ipywidgets as HTML: its picture and its notes, and in words which controls the live lesson has.

        widgets: the state of all widgets of a notebook, as nbformat keeps it. model: which of them to show.
        """
        controls: list[str] = []
        shown = self._widget(widgets, model, controls)
        words = f'<p class="live">In the live lesson this answers to {_listed(controls)}.</p>' if controls else ""
        return f'<div class="panel">{shown}{words}</div>'

    def held(self) -> str:
        """Scripts that hold the viewer and the scenes; nothing when there is no picture."""
        if not self._n:
            return ""
        inner = page.held("inner-page", page.inner_page().encode())
        return page.held_viewer_code() + inner + page.held("commands", wire.frame(self._numbers))

    def _place(self, frame: re.Match[str]) -> str:
        text, title, height = frame.groups()
        commands = page.scene_in(html.unescape(text))
        numbers = [self._numbers.setdefault(command, len(self._numbers)) for command in commands]
        self._n += 1
        return (
            f'<figure class="scene" style="--height: {height}px" data-commands="{json.dumps(numbers, separators=(",", ":"))}" '
            f'data-title="3-D picture of {title}"><p>A 3-D picture of {title} comes here; it needs JavaScript.</p></figure>'
        )

    def _widget(self, widgets: Mapping[str, Any], model: str, controls: list[str]) -> str:
        """A widget and all below it; what is worked by hand goes to `controls` in words."""
        about = widgets[model]
        kind, state = about["model_name"].removesuffix("Model"), about["state"]
        if kind in ("VBox", "HBox"):
            parts = [self._widget(widgets, child.removeprefix(_CHILD), controls) for child in state["children"]]
            return f'<div class="{kind.lower()}">{"".join(parts)}</div>'
        if kind == "HTML":
            return f"<div>{self.placed(state['value'])}</div>"
        if kind.endswith("Slider"):
            low, high, now = (_number(state[name]) for name in ("min", "max", "value"))
            controls.append(f"the slider <b>{html.escape(state['description'])}</b>, from {low} to {high} (here {now})")
        elif kind == "Button":
            controls.append(f"the button <b>{html.escape(state['description'])}</b>")
        return ""


def _number(value: float) -> str:
    return f"{value:g}".replace("-", "−")


def _listed(words: list[str]) -> str:
    """First, second and third."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
