"""The command line: `floatbase`, or `python -m floatbase`."""

from __future__ import annotations

import argparse
import shlex
import signal
import sys
import threading
import warnings
import webbrowser
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import floatbase as fb

if TYPE_CHECKING:
    from floatbase.playground import Playground

# of `python -m floatbase.lessons.publish`, which describes their options
COURSE_COMMANDS = {
    "site": "build the course as a web site",
    "grade": "grade the files that learners handed in",
    "assign": "write a package with some lessons for students",
    "solutions": "write the lessons with solutions, for teachers",
    "lecture": "write the questions for the lecture as slides",
}
_POLL_INTERVAL = 0.05  # s between checks for a connected page: short enough for a reader


def _parser() -> argparse.ArgumentParser:
    """Return the parser of the command line, without the options of other programs."""
    parser = argparse.ArgumentParser(
        prog="floatbase", description="Control of floating-base robots."
    )
    parser.suggest_on_error = True  # type: ignore[attr-defined]  # since Python 3.14
    parser.add_argument("--version", action="version", version=f"floatbase {fb.__version__}")
    commands = parser.add_subparsers(dest="command")
    commands.add_parser("robots", help="list the available robots and their uses")
    view = commands.add_parser("view", help="show a live robot in the browser (Ctrl-C to stop)")
    view.add_argument(
        "robot", help="name of a robot, as listed by `robots`, or path of a URDF or MJCF file"
    )
    view.add_argument(
        "--feet",
        nargs="*",
        metavar="LINK",
        help="links of the file that touch the ground, with soles or balls as in their collision "
        "shapes (default: the lowest ends of the limbs)",
    )
    view.add_argument(
        "--foot-radius", type=float, metavar="M", help="radius of ball feet at these links [m]"
    )
    view.add_argument(
        "--posture",
        nargs="+",
        default=[],
        metavar="JOINT=ANGLE",
        help="joint positions [rad or m]; a * stands for any characters, as in '*_knee=0.6'; or "
        "the name of a keyframe in an MJCF",
    )
    meshes = "folders of a URDF's meshes named package://…"
    view.add_argument("--package-dirs", nargs="+", default=[], metavar="FOLDER", help=meshes)
    view.add_argument(
        "--fixed", action="store_true", help="fix the root link of the file to the ground"
    )
    friction = "friction coefficient of the ground (default: 0.7)"
    view.add_argument("--friction", type=float, default=0.7, help=friction)
    view.add_argument("--background", default="light", help="white, light or dark (default: light)")
    view.add_argument("--port", type=int, default=0, help="port of the page (default: a free port)")
    view.add_argument(
        "--no-browser", action="store_true", help="print the address without opening a browser"
    )
    commands.add_parser(
        "compile", help="compile the controller in advance, so that the first one starts quickly"
    )
    commands.add_parser("recall", help="ask questions of lessons that you have worked through")
    lab = commands.add_parser("lab", help="open the course in JupyterLab")
    folder = "your copy of the lessons (default: this folder)"
    lab.add_argument("folder", nargs="?", type=Path, default=Path(), help=folder)
    lab.usage = (
        "floatbase lab [FOLDER] [options of JupyterLab, such as --no-browser or --port=9000]"
    )
    commands.add_parser("doctor", help="show what is installed, what is missing, and how to get it")
    for name, text in COURSE_COMMANDS.items():
        commands.add_parser(name, help=text, add_help=False)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line."""
    parser = _parser()
    options, further = parser.parse_known_args(arguments)
    if options.command is None:
        parser.print_help()
        return 0
    if options.command in COURSE_COMMANDS:
        from floatbase.lessons.publish.__main__ import main as run_course_command

        run_course_command([options.command, *further], program="floatbase")
        return 0
    if further and options.command != "lab":
        parser.error(f"unrecognized arguments: {' '.join(further)}")
    given = sys.argv[1:] if arguments is None else arguments
    warnings.showwarning = lambda message, *_, **__: print(
        f"floatbase: {message}", file=sys.stderr, flush=True
    )
    if options.command == "lab" and _folder_may_be_a_value(given[1:]):
        parser.error("Name the folder of `lab` first, and write options as in --port=9000.")
    try:
        return _run(options, further, given)
    except fb.FloatbaseError as error:
        print(f"floatbase: {error}", file=sys.stderr)
        return 2


def _folder_may_be_a_value(arguments: Sequence[str]) -> bool:
    """Return whether an option comes before what may be a folder, as in `--port 9000`."""
    first, *rest = arguments or [""]
    return first.startswith("-") and not all(text.startswith("-") for text in rest)


def _run(options: argparse.Namespace, further: Sequence[str], given: Sequence[str]) -> int:
    """Run a command; `further` are options for JupyterLab, `given` all arguments."""
    if options.command == "robots":
        print("\n".join(f"{name:14} {text}" for name, text in fb.catalogue().items()))
        return 0
    if options.command == "compile":
        from floatbase.behaviours import Gait, Walk  # not needed by the other commands
        from floatbase.control.tick import compiling_ahead

        go2 = fb.load("go2")
        with compiling_ahead():
            controller = fb.WholeBodyController(
                go2, fb.Contacts.points(go2), fb.standing_tasks(go2.standing())
            )
            Walk(go2, fb.Contacts.points(go2), Gait.trot(go2))  # compiles its targets
        print(f"The controller uses its {controller.backend} backend: {controller.backend_reason}.")
        return 0
    if options.command == "recall":
        from floatbase.lessons.recalling import ask  # reads the lessons

        ask()
        return 0
    if options.command == "lab":
        from floatbase.lessons.lab import open_lab

        open_lab(options.folder, further)
    if options.command == "doctor":
        from floatbase.doctor import report

        print(report())
        return 0
    return _run_viewer(options, given)


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


def _run_viewer(options: argparse.Namespace, given: Sequence[str]) -> int:
    """Show a robot until Ctrl-C or SIGTERM; `given` are the arguments of the command line."""
    # imports MuJoCo and the viewer, which the other commands do not need
    from floatbase.playground import Playground, Settings

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
    return 0


if __name__ == "__main__":
    sys.exit(main())
