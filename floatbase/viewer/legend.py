"""The legend of a picture: what its colours mean."""

from __future__ import annotations

from functools import lru_cache

from floatbase.viewer import wire
from floatbase.viewer.colours import LEGEND, RGB, SYMBOLS, hexadecimal

Line = tuple[str, RGB, str]  # kind of items, colour, meaning


@lru_cache(maxsize=64)  # most pictures show what the one before did
def command(shown: frozenset[str], ghost_name: str, text: RGB, own: tuple[Line, ...] = ()) -> wire.Update:
    """The command for the legend of these kinds of items.

    shown: the kinds. ghost_name: what the ghost is called.
    text: colour of what is drawn as texts are.
    own: lines beside those of `LEGEND`.
    """
    colours = dict.fromkeys(("push", "price", "zmp"), text)
    items = [
        [hexadecimal(colours.get(kind, colour)), ghost_name if kind == "ghost" else words, SYMBOLS.get(kind, "patch")]
        for kind, colour, words in (*LEGEND, *own)
        if kind in shown
    ]
    return wire.page_command("set_legend", items=items)
