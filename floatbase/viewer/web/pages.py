"""The page in its four modes, put together from the built files in `dist`.

The live page and that in a notebook follow a window. The file contains a scene and needs no server.
The page in a frame shows the scenes that a page around it gives it, one after the other. All load
meshcat's viewer and draw the same frames (see `protocol.frame`). `make web` builds `dist` from
`src`, where page.js says more about the modes.
"""

from __future__ import annotations

import base64
import gzip
import html
import json
import re
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from floatbase.viewer.scene import protocol
from floatbase.viewer.scene.colours import BACKGROUNDS, DARK_SHADES, hex_code

DIST = Path(__file__).with_name("dist")


@cache
def viewer_code() -> bytes:
    """meshcat's viewer, one JavaScript file; vendor/README.md says where it comes from."""
    return Path(__file__).with_name("vendor").joinpath("meshcat.min.js").read_bytes()


@cache
def live_page() -> str:
    """The page that a window serves."""
    return _page("live", '<script src="main.min.js"></script>')


def file_page(commands: Iterable[bytes], title: str = "floatbase") -> str:
    """A page that contains the viewer (0.3 MB) and a scene, and needs neither server nor network.

    commands: of the scene, as `Scene.file_commands` gives them.
    """
    scene = _embedded_data("scene", protocol.frame(commands))
    return _page("file", _embedded_viewer_code() + scene, title)


@cache
def embedded_page(code: str) -> str:
    """A page for a frame inside another page, which gives it scenes. code: address of meshcat's
    viewer.
    """
    return _page("frame", f'<script src="{html.escape(code)}"></script>')


@cache
def notebook_page() -> str:
    """A page for a frame in a notebook, which gives it meshcat and a port to the kernel."""
    return _page("notebook")


@cache
def asset(name: str) -> str:
    """The text of a built file."""
    return (DIST / name).read_text(encoding="utf-8")


@cache
def _embedded_viewer_code() -> str:
    return _embedded_data("viewer-code", viewer_code())


def _embedded_data(name: str, data: bytes) -> str:
    """Data as a script element with the id `name`: gzip in base64, as loader.js unpacks it."""
    packed = base64.b64encode(gzip.compress(data, 9, mtime=0)).decode()
    return f'<script type="text/plain" id="{name}">{packed}</script>'


def _page(mode: str, data: str = "", title: str = "floatbase") -> str:
    """The page in one of its modes. data: script elements that come before its own."""
    config = {
        "mode": mode,
        "backgrounds": {name: [*map(hex_code, colours)] for name, colours in BACKGROUNDS.items()},
        "shades": {hex_code(colour): hex_code(shade) for colour, shade in DARK_SHADES.items()},
    }
    parts = {
        "title": html.escape(title),
        "style": asset("page.css"),
        "data": data,
        "script": f"{asset('page.js')}floatbase.open({json.dumps(config)});",
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda match: parts[match[1]], asset("page.html"))
