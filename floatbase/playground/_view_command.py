"""The command `floatbase view`: a live robot in the browser."""

from __future__ import annotations

import argparse
import shlex
import signal
import sys
import threading
import webbrowser
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import floatbase as fb
from floatbase.playground.page import Playground
from floatbase.playground.settings import Settings

_POLL_INTERVAL = 0.05  # s between checks for a connected page: short enough for a reader


def _load_robot(options: argparse.Namespace) -> fb.Robot:
    """Load the robot named on the command line."""
    described: dict[str, Any] = {
        "feet": options.feet,
        "foot_radius": options.foot_radius,
        "posture": _posture(options.posture, options.robot),
    }
    if options.fixed:
        described["floating"] = False
    if options.package_dirs:
        described["package_dirs"] = options.package_dirs
    return fb.load(options.robot, **described)


def _posture(entries: Sequence[str], robot: str) -> dict[str, float] | str | None:
    """Return joint positions given as JOINT=ANGLE, the name of a keyframe, or None by default."""
    is_mjcf = robot.lower().endswith((".xml", ".mjcf"))
    if is_mjcf and len(entries) == 1 and "=" not in entries[0]:
        return entries[0]
    angles = {}
    for entry in entries:
        joint, equals, angle = entry.rpartition("=")
        try:
            if not equals or joint in angles:
                raise ValueError
            angles[joint] = float(angle)
        except ValueError:
            raise fb.FloatbaseError(
                f"--posture has {entry!r}. Write the name of each joint once with its position, as "
                f"in '*_knee=0.6', or only the name of a keyframe of an MJCF."
            ) from None
    return angles or None


def _restart_message(given: Sequence[str], requested_port: int, port: int) -> str:
    """Return the text of the page after the program has ended.

    `given` are the arguments of the command line, and `requested_port` is the port among them or 0.
    """
    is_script = Path(sys.argv[0]).name == "floatbase"  # which need not be on the path
    program = [sys.argv[0]] if is_script else [sys.executable, "-m", "floatbase"]
    command = shlex.join([*program, *given, *([] if requested_port else ["--port", str(port)])])
    return (
        f"The program has ended. Start it again with\n{command}\n"
        f"and this page reconnects by itself."
    )


def start_when_connected(page: Playground, ended: threading.Event) -> None:
    """Start the robot when a page connects, so that the robot does not fall or pause earlier."""
    while not (page.view.window.n_pages or ended.wait(_POLL_INTERVAL)):
        pass
    if not ended.is_set():
        page.start()


def run(options: argparse.Namespace, given: Sequence[str]) -> None:
    """Show a robot until Ctrl-C or SIGTERM; `given` are the arguments of the command line."""
    ended = threading.Event()
    before = {
        number: signal.signal(number, lambda *_: ended.set())
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        robot = _load_robot(options)
        settings = Settings(friction=(options.friction, options.friction))
        page = Playground(robot, settings, background=options.background, port=options.port)
        with closing(page):
            page.view.show(page.session.sim.state)
            page.view.set_disconnect_message(
                _restart_message(given, options.port, page.view.window.port)
            )
            print(f"{robot.name} at {page.url} (Ctrl-C to stop)", flush=True)
            if not options.no_browser:
                webbrowser.open(page.url, new=2)
            start_when_connected(page, ended)
            ended.wait()
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
