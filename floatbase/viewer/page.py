"""The two pages: the live one, which follows a window, and the file that holds a scene and needs no server.

Both load meshcat's own viewer and feed it the same frames (see `wire.frame`); what they add to it stands in page.js.
"""

from __future__ import annotations

import base64
import gzip
import html
from collections.abc import Iterable
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from floatbase.errors import ViewerError
from floatbase.viewer import wire

_BODY = """
<div><div id="meshcat-pane"></div></div>
<div id="title"></div><div id="legend"></div>
<div id="notice">The viewer is closed. This page comes back when it is opened again.</div>
<div id="kept" title="This viewer is displayed again further down and live there.">kept picture ·
<button>make live</button></div>
<div id="player"><button title="play or pause">▶</button><input type="range" min="0" step="0.001" title="time">
<output></output><select title="speed"><option value="1">1×</option><option value="0.5">½×</option>
<option value="0.25">¼×</option><option value="0.1">⅒×</option></select></div>
"""


@cache
def viewer_code() -> bytes:
    """meshcat's viewer, one JavaScript file, from the installed package."""
    spec = find_spec("meshcat")
    if spec is None or not spec.submodule_search_locations:
        raise ViewerError("meshcat is not installed; the viewer needs it. Install it with: pip install meshcat")
    return (Path(spec.submodule_search_locations[0]) / "viewer" / "dist" / "main.min.js").read_bytes()


@cache
def live_page() -> str:
    """The page that a window serves."""
    start = "window.MeshCat ? startWhenSeen(follow) : comeBack();"  # the window may close while the page loads
    return _page(f'<script src="main.min.js"></script><script>{_own("page.js")}{start}</script>', "floatbase")


def file_page(commands: Iterable[bytes], title: str = "floatbase") -> str:
    """A page that holds the viewer and a scene, and needs neither server nor network: 0.3 MB and the scene."""
    held = _held("viewer-code", _packed_code()) + _held("scene", _packed(wire.frame(commands)))
    return _page(f"{held}<script>{_own('page.js')}open();</script>", title)


@cache
def _packed_code() -> str:
    return _packed(viewer_code())


@cache
def _own(name: str) -> str:
    return Path(__file__).with_name(name).read_text(encoding="utf-8")


def _packed(data: bytes) -> str:
    return base64.b64encode(gzip.compress(data, 9, mtime=0)).decode()


def _held(name: str, text: str) -> str:
    return f'<script type="text/plain" id="{name}">{text}</script>'


def _page(scripts: str, title: str) -> str:
    return (
        f'<!DOCTYPE html><html><head><meta charset="utf-8"><link rel="icon" href="data:,"><title>{html.escape(title)}'
        f"</title><style>{_own('page.css')}</style></head><body>{_BODY}{scripts}</body></html>"
    )
