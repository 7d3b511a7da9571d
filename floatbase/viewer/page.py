"""The two pages: the live one, which listens to a window, and the file that holds its scene and needs no server.

Both load meshcat's own viewer and feed it the same frames (see `wire.frame`).
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

_STYLE = """
body { margin: 0; overflow: hidden; font-family: sans-serif; }
#meshcat-pane { width: 100vw; height: 100vh; overflow: hidden; }
#notice { position: absolute; left: 8px; bottom: 8px; padding: 4px 10px; border-radius: 4px; background: #fff8e0;
          color: #444; font-size: 13px; display: none; }
#title { position: absolute; left: 12px; top: 8px; font-size: 18px; color: #222; pointer-events: none;
         text-shadow: 0 0 4px #fff; white-space: pre; }
body.dark #title { color: #f2f2f2; text-shadow: 0 0 4px #000; }
"""

# our own commands beside meshcat's; and frames: commands drawn together, of which one that fails does not stop the others
_APPLY = """
function start() {
  const viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"));
  const own = {
    set_camera(command) {
      viewer.camera.fov = command.fov;
      viewer.camera.position.fromArray(command.position);
      viewer.controls.target.fromArray(command.target);
    },
    set_title(command) {
      document.getElementById("title").textContent = command.text;
    },
  };
  const meshcat = viewer.handle_command.bind(viewer);
  viewer.handle_command = (command) => {
    (own[command.type] || meshcat)(command);
    viewer.set_dirty();
  };
  return viewer;
}
function apply(frame) {
  const view = new DataView(frame);
  for (let at = 0; at < frame.byteLength;) {
    const length = view.getUint32(at, true);
    try {
      viewer.handle_command_bytearray(new Uint8Array(frame, at + 4, length));
    } catch (error) {
      console.error("floatbase: a drawing command failed", error);
    }
    at += 4 + length;
  }
}
"""

_LIVE = """
var viewer = start();
const notice = document.getElementById("notice");
function answer(request) {
  if (request.type == "capture") {
    viewer.set_3d_pane_size();
    viewer.connection.send(JSON.stringify({type: "image", id: request.id, data: viewer.capture_image()}));
  }
}
function connect() {
  const socket = new WebSocket(`${location.protocol == "https:" ? "wss" : "ws"}://${location.host}/socket`);
  socket.binaryType = "arraybuffer";
  viewer.connection = socket;
  socket.onmessage = (message) => {
    if (typeof message.data == "string") {
      answer(JSON.parse(message.data));
    } else {
      apply(message.data);
      viewer.num_messages_received++;
      socket.send('{"type": "done"}');
    }
  };
  socket.onclose = () => {
    notice.style.display = "block";
    come_back();
  };
}
async function come_back() {
  try {
    if ((await fetch("/", {cache: "no-store"})).ok) return location.reload();
  } catch (error) { /* still closed */ }
  setTimeout(come_back, 500);
}
connect();
"""

_FILE = """
async function unpack(id) {
  const packed = Uint8Array.from(atob(document.getElementById(id).textContent), (c) => c.charCodeAt(0));
  return new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
}
var viewer;
(async () => {
  const script = document.createElement("script");
  script.textContent = new TextDecoder().decode(await unpack("viewer-code"));
  document.body.appendChild(script);
  viewer = start();
  apply(await unpack("scene"));
  viewer.set_3d_pane_size();
})();
"""


def viewer_root() -> Path:
    """The folder of the installed meshcat package that holds its viewer."""
    spec = find_spec("meshcat")
    if spec is None or not spec.submodule_search_locations:
        raise ViewerError("meshcat is not installed; the viewer needs it. Install it with: pip install meshcat")
    return Path(spec.submodule_search_locations[0]) / "viewer" / "dist"


@cache
def viewer_code() -> bytes:
    """meshcat's viewer, one JavaScript file."""
    return (viewer_root() / "main.min.js").read_bytes()


@cache
def live_page() -> str:
    """The page that a window serves: it follows the window's scene, and comes back by itself when the window does."""
    return _page(
        f'<script src="main.min.js"></script><script>{_APPLY}{_LIVE}</script>',
        notice="The viewer is closed. This page comes back when it is opened again.",
    )


def file_page(commands: Iterable[bytes], title: str = "floatbase") -> str:
    """A page that holds the viewer and a scene, and needs neither server nor network: 0.3 MB and the scene."""
    held = _held("viewer-code", _packed_code()) + _held("scene", _packed(wire.frame(commands)))
    return _page(f"{held}<script>{_APPLY}{_FILE}</script>", title=title)


@cache
def _packed_code() -> str:
    return _packed(viewer_code())


def _packed(data: bytes) -> str:
    return base64.b64encode(gzip.compress(data, 9, mtime=0)).decode()


def _held(name: str, text: str) -> str:
    return f'<script type="text/plain" id="{name}">{text}</script>'


def _page(body: str, title: str = "floatbase", notice: str = "") -> str:
    return (
        f'<!DOCTYPE html><html><head><meta charset="utf-8"><link rel="icon" href="data:,"><title>{html.escape(title)}</title>'
        f'<style>{_STYLE}</style></head><body><div><div id="meshcat-pane"></div></div>'
        f'<div id="title"></div><div id="notice">{notice}</div>{body}</body></html>'
    )
