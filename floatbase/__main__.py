"""The command line: `floatbase`, or `python -m floatbase`."""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path

import floatbase as fb

# of `python -m floatbase.lessons.publish`, which describes their options
COURSE_COMMANDS = {
    "site": "build the course as a web site",
    "grade": "grade the files that learners handed in",
    "assign": "write a package with some lessons for students",
    "solutions": "write the lessons with solutions, for teachers",
    "lecture": "write the questions for the lecture as slides",
}


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
    # imports MuJoCo and the viewer, which the other commands do not need
    from floatbase.playground._view_command import run

    run(options, given)
    return 0


if __name__ == "__main__":
    sys.exit(main())
