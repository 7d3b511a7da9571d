"""The page in its five modes, assembled from the built files in `dist`.

The live page and the notebook page follow a window. The file page contains a scene and needs no
server. The embedded page shows scenes that the surrounding page gives it, one after the other. The
robot page runs a robot in the browser. All load meshcat's viewer and draw the same frames (see
`protocol.frame`). `make web` builds `dist` from `src`; page.js and robot.js describe the modes.
"""

from __future__ import annotations

import base64
import gzip
import html
import json
import re
from collections.abc import Iterable
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from floatbase.viewer.scene import protocol
from floatbase.viewer.scene.colours import BACKGROUNDS, DARK_SHADES, hex_code

DIST = Path(__file__).with_name("dist")
_MESHCAT = find_spec("meshcat")  # not imported, because it imports IPython
if _MESHCAT is None or _MESHCAT.origin is None:
    raise ModuleNotFoundError("No module named 'meshcat'", name="meshcat")
_VIEWER_CODE = Path(_MESHCAT.origin).with_name("viewer") / "dist" / "main.min.js"


@cache
def viewer_code() -> bytes:
    """Return meshcat's viewer, one JavaScript file of the installed package."""
    return _VIEWER_CODE.read_bytes()


@cache
def live_page() -> str:
    """Return the page that a window serves."""
    return _page("live", '<script src="main.min.js"></script>')


def file_page(commands: Iterable[bytes], title: str = "floatbase") -> str:
    """Return a page with the viewer (0.3 MB) and a scene, which needs no server or network."""
    scene = _embedded_data("scene", protocol.frame(commands))
    return _page("file", _embedded_viewer_code() + scene, title)


@cache
def embedded_page(code: str) -> str:
    """Return a page for a frame inside another page, which gives it scenes."""
    return _page("frame", f'<script src="{html.escape(code)}"></script>')


@cache
def notebook_page() -> str:
    """Return a page for a frame in a notebook, which gives it meshcat and a port to the kernel."""
    return _page("notebook")


def robot_page(robots: tuple[str, ...]) -> str:
    """Return the page with a live robot. It loads its other files from its own folder."""
    scripts = '<script src="meshcat.js"></script><script src="robot.js"></script>'
    page = _page("robot", scripts, "live robot", {"robots": robots})
    return page.replace("<body>", '<body class="robot">')


@cache
def asset(name: str) -> str:
    """Return the text of a built file."""
    return (DIST / name).read_text(encoding="utf-8")


@cache
def _embedded_viewer_code() -> str:
    """Return meshcat's viewer as a script element."""
    return _embedded_data("viewer-code", viewer_code())


def _embedded_data(name: str, data: bytes) -> str:
    """Return data as a script element: gzip in base64, as loader.js unpacks it."""
    packed = base64.b64encode(gzip.compress(data, 9, mtime=0)).decode()
    return f'<script type="text/plain" id="{name}">{packed}</script>'


def _page(
    mode: str, data: str = "", title: str = "floatbase", more: dict[str, Any] | None = None
) -> str:
    """Return the page in one of its modes, with script elements `data` before its own."""
    config = {
        "mode": mode,
        **(more or {}),
        "backgrounds": {name: [*map(hex_code, colours)] for name, colours in BACKGROUNDS.items()},
        "shades": {hex_code(colour): hex_code(shade) for colour, shade in DARK_SHADES.items()},
    }
    parts = {
        "title": html.escape(title),
        "style": asset("page.css"),
        "data": data,
        "script": f"floatbaseRobot.open({json.dumps(config)});"
        if mode == "robot"
        else f"{asset('page.js')}floatbase.open({json.dumps(config)});",
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda match: parts[match[1]], asset("page.html"))
