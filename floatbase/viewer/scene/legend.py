"""The legend of a picture: what its colours mean."""

from __future__ import annotations

from functools import lru_cache

from floatbase.viewer.scene import protocol, shapes
from floatbase.viewer.scene.colours import LEGEND, LEGEND_SYMBOLS, RGB, hex_code
from floatbase.viewer.scene.shapes import Picture

Entry = tuple[str, RGB, str]  # kind of items, colour, meaning


def kinds(picture: Picture) -> set[str]:
    """What a picture shows, in the words of `LEGEND`: the first part of each path; a cone without a
    force is an "idle cone".
    """
    idle = shapes.cone_colour("idle")
    return {
        "idle cone" if item.colour == idle else path.strip("/").split("/")[0]
        for path, item in picture.items()
    }


@lru_cache(maxsize=64)  # most pictures show what the one before did
def command(
    shown: frozenset[str], ghost_name: str, text: RGB, user_entries: tuple[Entry, ...] = ()
) -> protocol.Update:
    """The command for the legend of these kinds of items.

    shown: the kinds. ghost_name: what the ghost is called.
    text: colour of what is drawn as texts are.
    user_entries: lines beside those of `LEGEND`.
    """
    colours = dict.fromkeys(("push", "multiplier", "zmp"), text)
    items = [
        [
            hex_code(colours.get(kind, colour)),
            ghost_name if kind == "ghost" else meaning,
            LEGEND_SYMBOLS.get(kind, "patch"),
        ]
        for kind, colour, meaning in (*LEGEND, *user_entries)
        if kind in shown
    ]
    return protocol.page_command("set_legend", items=items)
