"""The folder of the live robots: everything that a web page needs to run them, and nothing else.

Any web server can serve it. The site contains it, and a teacher can copy it beside slides.
"""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

from floatbase.errors import InputError
from floatbase.live import robots, scenes, wasm
from floatbase.robots import load
from floatbase.viewer.web import pages

WEB = pages.DIST.parent
_MUJOCO = WEB / "node_modules" / "@mujoco" / "mujoco"
_CUSTOM_SECTION = 0  # of a WebAssembly module; MuJoCo's has 1.7 MB of names for debuggers
_HEADER_SIZE = 8
_INDEX = """<!DOCTYPE html>
<html lang="en">
<head><meta charset="utf-8"><title>floatbase: live robots</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>
body {{ font-family: system-ui, sans-serif; margin: 1em auto; max-width: 60em; padding: 0 1em; }}
floatbase-robot {{ height: 60vh; margin: 1em 0; }}</style>
<script src="floatbase-live.js"></script></head>
<body><h1>Live robots</h1>
<p>Drag a robot to push it. <a href="robot.html">All controls</a></p>
{robots}
</body></html>
"""


def install_mujoco() -> Path | None:
    """Install MuJoCo for JavaScript from npm, as the lock file says, if it is not installed."""
    if not (_MUJOCO / "mujoco.wasm").is_file():
        npm = shutil.which("npm")
        if npm is None:
            return None
        command = [npm, "ci", "--no-audit", "--no-fund", "--loglevel=error"]
        if subprocess.run(command, cwd=WEB, capture_output=True).returncode:
            return None
    return _MUJOCO if (_MUJOCO / "mujoco.wasm").is_file() else None


def write(folder: Path, names: tuple[str, ...] = robots.ROBOTS) -> None:
    """Write the folder of the live robots."""
    mujoco = install_mujoco()
    if mujoco is None:
        raise InputError(
            "Live robots need MuJoCo for JavaScript, which npm installs. Install Node.js 20 or "
            "later, and run `npm ci` in floatbase/viewer/web."
        )
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        robot = load(name)
        scene, image, drawing = scenes.scene_files(robot)
        data = robots.robot_json(robot, {"drawing": drawing})
        (folder / f"{name}.json").write_text(data, encoding="utf-8")
        (folder / f"{name}.scene").write_bytes(scene)
        (folder / f"{name}.png").write_bytes(image)
    for name in ("robot.js", "engine.js", "floatbase-live.js"):
        shutil.copy(pages.DIST / name, folder / name)
    (folder / "robot.html").write_text(pages.robot_page(names), encoding="utf-8")
    (folder / "meshcat.js").write_bytes(pages.viewer_code())
    (folder / "mujoco.js").write_bytes((mujoco / "mujoco.js").read_bytes())
    (folder / "mujoco.wasm").write_bytes(stripped((mujoco / "mujoco.wasm").read_bytes()))
    shutil.copy(wasm.MODULE, folder / "tick.wasm")
    version = json.loads((mujoco / "package.json").read_text())["version"]
    (folder / "LICENSES.txt").write_text(
        f"MuJoCo {version} (mujoco.js, mujoco.wasm): Apache License 2.0, "
        "https://github.com/google-deepmind/mujoco\n"
        "MeshCat (meshcat.js): MIT License, https://github.com/meshcat-dev/meshcat\n"
        "The rest is part of floatbase: BSD 3-Clause License; the robots' meshes keep their own "
        "licences.\n",
        encoding="utf-8",
    )
    elements = "\n".join(
        f'<h2>{name}</h2>\n<floatbase-robot name="{name}"></floatbase-robot>' for name in names
    )
    (folder / "index.html").write_text(_INDEX.format(robots=elements), encoding="utf-8")


def stripped(module: bytes) -> bytes:
    """Return a WebAssembly module without its custom sections, which do not affect what it does."""
    kept, at = [module[:_HEADER_SIZE]], _HEADER_SIZE
    while at < len(module):
        begin, size, shift = at, 0, 0
        at += 1
        while True:  # an unsigned number in LEB128
            byte = module[at]
            size |= (byte & 0x7F) << shift
            at, shift = at + 1, shift + 7
            if byte < 0x80:
                break
        at += size
        if module[begin] != _CUSTOM_SECTION:
            kept.append(module[begin:at])
    return b"".join(kept)
