"""Command line of the course: run, map and publish lessons, grade answers, copy lessons."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from floatbase._files import write_whole
from floatbase.errors import InputError
from floatbase.lessons.publish import (
    NOTEBOOKS,
    README,
    prepare_workspace,
    readme_with_table,
    run_and_store,
    write_solutions,
)

SOLUTIONS = Path("build/solutions")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command of the command line, or of `arguments`."""
    parser = argparse.ArgumentParser(
        prog="python -m floatbase.lessons.publish", description=__doc__
    )
    commands = parser.add_subparsers(dest="command", required=True)

    stored = commands.add_parser("run", help="run lessons and store what they print")
    stored.add_argument(
        "lessons", nargs="*", type=Path, metavar="NOTEBOOK", help="the whole course by default"
    )
    commands.add_parser(
        "map", help="write equations.md, conventions.md and the README's table of lessons"
    )
    shown = commands.add_parser("site", help="run the lessons and build the web site")
    shown.add_argument(
        "lessons",
        nargs="*",
        type=Path,
        metavar="NOTEBOOK",
        help="lessons to include; all by default",
    )
    shown.add_argument(
        "--stored", action="store_true", help="run no lessons; use the stored outputs"
    )
    shown.add_argument(
        "--to", type=Path, metavar="FOLDER", help="where to write, build/site by default"
    )
    measured = commands.add_parser(
        "push-recovery", help="measure the push-recovery maps of lessons, such as 05, again"
    )
    measured.add_argument("lessons", nargs="+", metavar="LESSON")
    living = commands.add_parser(
        "live", help="compile the controller for web pages again, if it has changed (needs wasm-ld)"
    )
    living.add_argument(
        "--to",
        type=Path,
        metavar="FOLDER",
        help="also write all files of the live robots there (needs npm)",
    )
    keys = commands.add_parser(
        "solutions", help="write the lessons with solutions in place of exercises, for teachers"
    )
    keys.add_argument(
        "--to",
        type=Path,
        default=SOLUTIONS,
        metavar="FOLDER",
        help=f"where to write, {SOLUTIONS} by default",
    )
    graded = commands.add_parser(
        "grade", help="grade the files that learners wrote with hand_in(…)"
    )
    graded.add_argument("files", nargs="*", type=Path, metavar="FILE")
    graded.add_argument(
        "--table", type=Path, metavar="CSV", help="also write a row per learner and exercise"
    )
    graded.add_argument(
        "--inventory", action="store_true", help="print the gain in the concept inventory"
    )
    graded.add_argument("--code", action="store_true", help="print the code that was handed in")
    graded.add_argument(
        "--latest", action="store_true", help="grade only the last file of each learner"
    )
    graded.add_argument(
        "--before",
        type=_local_time,
        metavar="TIME",
        help="leave out files written after TIME, such as 2026-05-31T18:00",
    )
    graded.add_argument(
        "--lessons", nargs="+", default=[], metavar="LESSON", help="lessons that give points"
    )
    graded.add_argument(
        "--own-numbers", action="store_true", help="judge by the numbers of each student's id"
    )
    graded.add_argument("--due", type=_local_time, metavar="TIME", help="when answers are due")
    graded.add_argument(
        "--late-days", type=int, default=0, metavar="N", help="days on which late files still count"
    )
    graded.add_argument(
        "--gradebook", choices=("canvas", "moodle"), help="write points as CSV to --table"
    )
    graded.add_argument(
        "--roster", type=Path, metavar="CSV", help="the class, as the gradebook exports it"
    )
    graded.add_argument(
        "--column", default="floatbase", metavar="NAME", help="the assignment in the gradebook"
    )
    graded.add_argument(
        "--gradescope",
        type=Path,
        metavar="FOLDER",
        help="write an autograder for Gradescope there; grade nothing",
    )
    graded.add_argument(
        "--results", type=Path, metavar="JSON", help="grade one submission for Gradescope"
    )
    graded.add_argument(
        "--metadata", type=Path, metavar="JSON", help="Gradescope's submission_metadata.json"
    )
    assigned = commands.add_parser("assign", help="write a package with some lessons for students")
    assigned.add_argument("lessons", nargs="+", metavar="LESSON")
    assigned.add_argument("--to", type=Path, required=True, metavar="FOLDER")
    assigned.add_argument(
        "--without-solutions", action="store_true", help="remove all solutions from the package"
    )
    assigned.add_argument(
        "--teacher", default="", metavar="NAME", help="from whom students get the solutions"
    )
    assigned.add_argument(
        "--until", default="", metavar="TIME", help="when students get the solutions"
    )
    voted = commands.add_parser("lecture", help="write the questions for the lecture as slides")
    voted.add_argument("--to", type=Path, default=Path("lecture.html"), metavar="HTML")
    laid = commands.add_parser("workspace", help="update the learner's copy of the course")
    laid.add_argument(
        "--to",
        type=Path,
        default=None,
        metavar="FOLDER",
        help="folder of the copy, notebooks/my by default",
    )

    given = parser.parse_args(arguments)
    try:
        if given.command == "run":
            _run(given.lessons or sorted(NOTEBOOKS.glob("*.ipynb")))
        elif given.command == "map":
            _map()
        elif given.command == "site":
            _site(given.lessons or None, given.to, given.stored)
        elif given.command == "push-recovery":
            _roses(given.lessons)
        elif given.command == "live":
            _live(given.to)
        elif given.command == "solutions":
            _solutions(given.to)
        elif given.command == "grade":
            if unread := _grade(given):
                parser.exit(1, f"{unread} of {len(given.files)} files could not be read.\n")
        elif given.command == "lecture":
            _lecture(given.to)
        elif given.command == "assign":
            _assign(given)
        else:
            for line in prepare_workspace(mine=given.to):
                print(line)
    except InputError as error:
        parser.exit(2, f"{error}\n")
    except OSError as error:
        parser.exit(2, f"{error.filename} cannot be read or written: {error.strerror}.\n")


def _local_time(text: str) -> datetime:
    """Read a time in ISO format, local unless it says otherwise."""
    try:
        return datetime.fromisoformat(text).astimezone()
    except OverflowError as error:
        raise ValueError(text) from error


def _run(lessons: Sequence[Path]) -> None:
    for lesson in lessons:
        print(lesson.name)
        run_and_store(lesson)


def _map() -> None:
    from floatbase.lessons.publish import conventions, equations

    readme = readme_with_table(README.read_text(encoding="utf-8"))
    write_whole(NOTEBOOKS / "equations.md", equations.table().encode())
    write_whole(NOTEBOOKS / "conventions.md", conventions.page().encode())
    write_whole(README, readme.encode())


def _roses(lessons: Sequence[str]) -> None:
    from floatbase.lessons.push_recovery import measure_push_recovery

    for lesson in lessons:
        print(f"{lesson}: {measure_push_recovery(lesson)}")


def _live(folder: Path | None) -> None:
    from floatbase.live import folder as live_folder
    from floatbase.live import wasm

    size = wasm.MODULE.stat().st_size if wasm.is_current() else wasm.build()
    print(f"{wasm.MODULE} is up to date: {size / 1000:.0f} kB.")
    if folder is not None:
        live_folder.write(folder)
        print(f"The live robots are in {folder}; serve it with `python -m http.server`.")


def _solutions(folder: Path) -> None:
    for line in write_solutions(folder):
        print(line)
    print(f"The solutions are in {folder}.")


def _lecture(path: Path) -> None:
    from floatbase.lessons.publish import site

    site.lecture.write_slides(path)
    print(f"The slides are in {path}.")


def _assign(given: argparse.Namespace) -> None:
    from floatbase.lessons.publish import package

    package.write_assignment(
        given.to,
        given.lessons,
        teacher=given.teacher,
        until=given.until,
        with_solutions=not given.without_solutions,
    )
    print(f"The package for students is in {given.to}.")


def _grade(given: argparse.Namespace) -> int:
    """Grade files; return how many could not be read."""
    from floatbase.lessons import inventory
    from floatbase.lessons.publish import gradebook, grades

    policy = gradebook.Policy(
        gradebook.lessons_with_exercises(given.lessons), given.due, given.late_days
    )
    if given.gradescope:
        gradebook.write_autograder(given.gradescope, policy=policy, own_numbers=given.own_numbers)
        print(f"The autograder is in {given.gradescope}; zip what is in this folder.")
        return 0
    if given.results:
        gradebook.write_gradescope_results(
            given.files,
            given.results,
            metadata=given.metadata,
            policy=policy,
            own_numbers=given.own_numbers,
        )
        return 0
    if given.gradebook and not (given.roster and given.table):
        raise InputError("--gradebook needs --roster CSV and --table CSV.")
    submissions, unread = grades.grade_files(
        given.files, latest=given.latest, before=given.before, own_numbers=given.own_numbers
    )
    print(grades.overview(submissions))
    if given.code:
        print(grades.code_to_read(submissions))
    if given.inventory:
        print(inventory.gain_report([one.inventory for one in submissions]))
    if given.gradebook:
        for line in gradebook.write_gradebook(
            given.gradebook,
            submissions,
            given.roster,
            given.table,
            column=given.column,
            policy=policy,
        ):
            print(line)
        print(f"Points for {given.gradebook.capitalize()}: {given.table}")
    elif given.table:
        grades.write_table(submissions, given.table)
        print(f"All marks: {given.table}")
    return unread


def _site(lessons: Sequence[Path] | None, folder: Path | None, stored: bool) -> None:
    from floatbase.lessons.publish import site

    print(site.build(folder or site.SITE, lessons, stored))


if __name__ == "__main__":
    main()
