"""Legend of a picture: the meaning of its colours."""

from __future__ import annotations

from functools import lru_cache

from floatbase.viewer.scene import protocol, shapes
from floatbase.viewer.scene.colours import CONE, LEGEND, LEGEND_SYMBOLS, RGB, RGBA, hex_code
from floatbase.viewer.scene.shapes import Picture

Entry = tuple[str, RGB, str]  # kind of items, colour, meaning

_CONE_KINDS: dict[RGBA | None, str] = {
    shapes.cone_colour(status): f"{status} cone" for status in CONE
}


def kinds(picture: Picture) -> set[str]:
    """Find which kinds of `LEGEND` a picture shows."""
    found = set()
    for path, item in picture.items():
        kind, *rest = path.strip("/").split("/")
        if kind == "cone" and rest and rest[-1].startswith("facet "):
            kind = "active cone"
        elif kind == "cone" or item.colour == shapes.cone_colour("idle"):
            kind = _CONE_KINDS.get(item.colour, kind)
        found.add(kind)
    return found


@lru_cache(maxsize=64)  # most pictures show the same kinds as the previous one
def command(
    shown: frozenset[str], ghost_name: str, text: RGB, user_entries: tuple[Entry, ...] = ()
) -> protocol.Update:
    """Make the command for a legend."""
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
