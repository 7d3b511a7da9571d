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
    graded.add_argument("files", nargs="+", type=Path, metavar="FILE")
    graded.add_argument(
        "--table", type=Path, metavar="CSV", help="also write a row per learner and exercise"
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
        elif given.command == "solutions":
            _solutions(given.to)
        elif given.command == "grade":
            unread = _grade(given.files, given.table, given.code, given.latest, given.before)
            if unread:
                parser.exit(1, f"{unread} of {len(given.files)} files could not be read.\n")
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


def _solutions(folder: Path) -> None:
    for line in write_solutions(folder):
        print(line)
    print(f"The solutions are in {folder}.")


def _grade(
    files: Sequence[Path], table: Path | None, code: bool, latest: bool, before: datetime | None
) -> int:
    from floatbase.lessons.publish import grades

    submissions, unread = grades.grade_files(files, latest=latest, before=before)
    print(grades.overview(submissions))
    if code:
        print(grades.code_to_read(submissions))
    if table:
        grades.write_table(submissions, table)
        print(f"All marks: {table}")
    return unread


def _site(lessons: Sequence[Path] | None, folder: Path | None, stored: bool) -> None:
    from floatbase.lessons.publish import site

    print(site.build(folder or site.SITE, lessons, stored))


if __name__ == "__main__":
    main()
