"""The four pages: the live page, the notebook's page, the file, and the inner page.

The live page and that in a notebook follow a window. The file contains a scene and needs no server.
The inner page shows the scenes that a page around it gives it, one after the other. All load
meshcat's viewer and give it the same messages (see `protocol.frame`); page.js holds the rest.
"""

from __future__ import annotations

import base64
import gzip
import html
import json
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from floatbase.viewer.scene import protocol
from floatbase.viewer.scene.colours import BACKGROUNDS, DARK_SHADES, hex_code

_BODY = """
<div><div id="meshcat-pane"></div></div>
<div id="tools"><button type="button" aria-label="first view" title="back to the first view (key: h)">⌂</button>
<details><summary title="other views, and what is shown">view</summary><div></div></details></div>
<div id="board" role="group" aria-label="terms of the equation of motion"></div>
<button id="fold" type="button" aria-label="panel" aria-expanded="true" title="fold the panel"></button><div id="panel"></div>
<div id="title"></div>
<div id="legend"><div id="lines"></div><button aria-controls="lines" aria-expanded="false"><span></span>legend</button></div>
<div id="notice">The viewer is closed, or its kernel was restarted: run its cell again. A page with the same address \
comes back by itself.</div>
<div id="player"><button title="play or pause">▶</button><input type="range" min="0" step="0.001" title="time">
<output></output><select title="speed"><option value="1">1×</option><option value="0.5">½×</option>
<option value="0.25">¼×</option><option value="0.1">⅒×</option></select></div>
"""


@cache
def viewer_code() -> bytes:
    """meshcat's viewer, one JavaScript file; vendor/README.md says where it comes from."""
    return Path(__file__).with_name("vendor").joinpath("meshcat.min.js").read_bytes()


@cache
def live_page() -> str:
    """The page that a window serves."""
    # the window may close while the page loads
    start = "window.MeshCat ? startWhenSeen(follow) : comeBack();"
    return _page(
        f'<script src="main.min.js"></script><script>{_scripts()}{start}</script>', "floatbase"
    )


def file_page(commands: Iterable[bytes], title: str = "floatbase") -> str:
    """A page that contains the viewer (0.3 MB) and a scene, and needs neither server nor network.

    commands: of the scene, as `Scene.file_commands` gives them.
    """
    text = embedded_viewer_code() + embedded_data("scene", protocol.frame(commands))
    return _page(f"{text}<script>{_scripts()}open();</script>", title)


@cache
def embedded_page(code: str) -> str:
    """A page for a frame inside another page, which gives it scenes (see page.js). code: address of
    meshcat's viewer.
    """
    return _page(
        f'<script src="{html.escape(code)}"></script><script>{_scripts()}waitForScenes();</script>',
        "floatbase",
    )


@cache
def notebook_page() -> str:
    """A page for a frame in a notebook, which gives it the viewer's code and a port to the kernel
    (see page.js).
    """
    return _page(f"<script>{_scripts()}waitForPort();</script>", "floatbase")


@cache
def embedded_viewer_code() -> str:
    """meshcat's viewer as a script element with the id "viewer-code"; see `embedded_data`."""
    return embedded_data("viewer-code", viewer_code())


def embedded_data(name: str, data: bytes) -> str:
    """Data as a script element with the id `name`: compressed, in base64. `unpack(name)` in page.js
    reads it.
    """
    packed = base64.b64encode(gzip.compress(data, 9, mtime=0)).decode()
    return f'<script type="text/plain" id="{name}">{packed}</script>'


@cache
def asset(name: str) -> str:
    """The text of one of the scripts and style sheets beside this file."""
    return Path(__file__).with_name(name).read_text(encoding="utf-8")


def _scripts() -> str:
    return "".join(map(asset, ("page.js", "panel.js", "interaction.js", "theme.js"))) + _colours()


def _colours() -> str:
    """The backgrounds, and the shades of the dark one, for theme.js."""
    backgrounds = {
        name: [hex_code(colour) for colour in parts] for name, parts in BACKGROUNDS.items()
    }
    night = {hex_code(colour): hex_code(shade) for colour, shade in DARK_SHADES.items()}
    return f"const BACKGROUNDS = {json.dumps(backgrounds)}, DARK_SHADES = {json.dumps(night)};"


def _page(scripts: str, title: str) -> str:
    return (
        '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1"><link rel="icon" '
        'href="data:,">'
        f"<title>{html.escape(title)}</title><style>{asset('page.css')}</style></head><body>{_BODY}{scripts}</body></html>"
    )
