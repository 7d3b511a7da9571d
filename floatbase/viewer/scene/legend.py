"""The legend of a picture: what its colours mean."""

from __future__ import annotations

from functools import lru_cache

from floatbase.viewer.scene import protocol
from floatbase.viewer.scene.colours import LEGEND, LEGEND_SYMBOLS, RGB, hex_code

Entry = tuple[str, RGB, str]  # kind of items, colour, meaning


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
