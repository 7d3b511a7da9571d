"""Command line of the course: run, map and publish lessons, grade answers, copy lessons."""

from __future__ import annotations

import shutil
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

from floatbase._files import write_whole
from floatbase.errors import FloatbaseError, InputError
from floatbase.lessons.publish import (
    NOTEBOOKS,
    README,
    lesson_file,
    lesson_notebooks,
    prepare_workspace,
    readme_with_table,
    run_and_store,
    write_solutions,
)

SOLUTIONS = Path("build/solutions")


def main(
    arguments: Sequence[str] | None = None, program: str = "python -m floatbase.lessons.publish"
) -> None:
    """Run the command of the command line, or of `arguments`."""
    parser = ArgumentParser(prog=program, description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    for add_command in _COMMANDS:
        add_command(commands)
    given = parser.parse_args(arguments)
    try:
        unread = given.run(given)
    except FloatbaseError as error:
        parser.exit(2, f"{error}\n")
    except ModuleNotFoundError as error:
        if str(error.name).startswith("floatbase"):
            raise
        extra = "site" if given.command in ("site", "lecture") else "course"
        parser.exit(
            2,
            f"`{given.command}` needs {error.name}, which is not installed. Install it with pip "
            f'install "floatbase[{extra}]".\n',
        )
    except shutil.Error as error:  # of the files of a folder
        parser.exit(2, f"The folder cannot be written: {error.args[0][0][2]}.\n")
    except TimeoutError as error:  # of a cell
        parser.exit(2, f"{error}\nOn a new machine, run `floatbase compile` first.\n")
    except OSError as error:  # the system names no file when a disk is full
        name = error.filename or "A file"
        parser.exit(2, f"{name} cannot be read or written: {error.strerror}.\n")
    if unread:
        parser.exit(1, f"{unread} of {len(given.files)} files could not be read.\n")


def _check_repository(command: str) -> None:
    """Check that files are present that only the repository has."""
    if not (NOTEBOOKS.parent / "pyproject.toml").is_file():
        raise InputError(
            f"`{command}` needs the repository of floatbase. Clone the repository, run `make "
            f"setup` in it, and use .venv/bin/floatbase there."
        )


# one function adds a command and its arguments, and the next one runs it


def _add_run(commands: Any) -> None:
    parser = commands.add_parser("run", help="run lessons and store what they print")
    _add_lessons(parser, "the whole course by default")
    parser.set_defaults(run=_run)


def _run(given: Namespace) -> None:
    for lesson in given.lessons or lesson_notebooks().values():
        print(lesson.name)
        run_and_store(lesson)


def _add_map(commands: Any) -> None:
    text = (
        "write equations.md, conventions.md, the README's table of lessons, and the cell of each "
        "lesson that installs the course"
    )
    commands.add_parser("map", help=text).set_defaults(run=_map)


def _map(given: Namespace) -> None:
    from floatbase.lessons.publish import conventions, equations

    readme = readme_with_table(README.read_text(encoding="utf-8"))
    write_whole(NOTEBOOKS / "equations.md", equations.table().encode())
    write_whole(NOTEBOOKS / "conventions.md", conventions.page().encode())
    write_whole(README, readme.encode())
    for lesson in lesson_notebooks().values():
        write_whole(lesson, lesson_file(lesson))


def _add_site(commands: Any) -> None:
    parser = commands.add_parser("site", help="run the lessons and build the web site")
    _add_lessons(parser, "lessons to include; all by default")
    text = "run no lessons; use the stored outputs"
    parser.add_argument("--stored", action="store_true", help=text)
    _add_folder(parser, "where to write, build/site by default")
    parser.set_defaults(run=_site)


def _site(given: Namespace) -> None:
    _check_repository(given.command)
    from floatbase.lessons.publish import site

    print(site.build(given.to or site.SITE, given.lessons or None, given.stored))


def _add_push_recovery(commands: Any) -> None:
    text = "measure the push-recovery maps of lessons, such as 05, again"
    parser = commands.add_parser("push-recovery", help=text)
    parser.add_argument("lessons", nargs="+", metavar="LESSON")
    parser.set_defaults(run=_push_recovery)


def _push_recovery(given: Namespace) -> None:
    from floatbase.lessons.push_recovery import measure_push_recovery

    for lesson in given.lessons:
        print(f"{lesson}: {measure_push_recovery(lesson)}")


def _add_live(commands: Any) -> None:
    text = "compile the controller for web pages again, if it has changed (needs wasm-ld)"
    parser = commands.add_parser("live", help=text)
    _add_folder(parser, "also write all files of the live robots there (needs npm)")
    parser.set_defaults(run=_live)


def _live(given: Namespace) -> None:
    from floatbase.live import folder as live_folder
    from floatbase.live import wasm

    size = wasm.MODULE.stat().st_size if wasm.is_current() else wasm.build()
    print(f"{wasm.MODULE} is up to date: {size / 1000:.0f} kB.")
    if given.to is not None:
        live_folder.write(given.to)
        print(f"The live robots are in {given.to}; serve it with `python -m http.server`.")


def _add_solutions(commands: Any) -> None:
    text = "write the lessons with solutions in place of exercises, for teachers"
    parser = commands.add_parser("solutions", help=text)
    _add_folder(parser, f"where to write, {SOLUTIONS} by default", default=SOLUTIONS)
    parser.set_defaults(run=_solutions)


def _solutions(given: Namespace) -> None:
    for line in write_solutions(given.to):
        print(line)
    print(f"The solutions are in {given.to}.")


def _add_grade(commands: Any) -> None:
    text = "grade the files that learners wrote with hand_in(…)"
    parser = commands.add_parser("grade", help=text)
    add = parser.add_argument
    add("files", nargs="*", type=Path, metavar="FILE")
    text = "also write a row per learner and exercise"
    add("--table", type=Path, metavar="CSV", help=text)
    add("--inventory", action="store_true", help="print the gain in the concept inventory")
    add("--code", action="store_true", help="print the code that was handed in")
    text = "join the files of each learner: in each lesson, the last one counts"
    add("--latest", action="store_true", help=text)
    text = "leave out files written after TIME, such as 2026-05-31T18:00"
    add("--before", type=_local_time, metavar="TIME", help=text)
    text = "grade these lessons only"
    add("--lessons", nargs="+", default=[], metavar="LESSON", help=text)
    text = "require the numbers of each student's id"
    add("--own-numbers", action="store_true", help=text)
    add("--due", type=_local_time, metavar="TIME", help="when answers are due")
    text = "days on which late files still count"
    add("--late-days", type=_whole_number, default=0, metavar="N", help=text)
    text = "write points as CSV to --table"
    add("--gradebook", choices=("canvas", "moodle"), help=text)
    text = "the class, as the gradebook exports it"
    add("--roster", type=Path, metavar="CSV", help=text)
    text = "the assignment in the gradebook"
    add("--column", default="floatbase", metavar="NAME", help=text)
    text = "write an autograder for Gradescope there; grade nothing"
    add("--gradescope", type=Path, metavar="FOLDER", help=text)
    text = "grade one submission for Gradescope"
    add("--results", type=Path, metavar="JSON", help=text)
    text = "Gradescope's submission_metadata.json"
    add("--metadata", type=Path, metavar="JSON", help=text)
    parser.set_defaults(run=_grade)


def _grade(given: Namespace) -> int:
    """Grade files; return how many could not be read."""
    from floatbase.lessons import inventory
    from floatbase.lessons.publish import gradebook, grades

    policy = gradebook.Policy(
        gradebook.lessons_with_exercises(given.lessons), given.due, given.late_days
    )
    if given.gradescope:
        _check_repository("grade --gradescope")
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
    if (given.due or given.late_days) and not given.gradebook:
        raise InputError("--due and --late-days need --gradebook, --gradescope or --results.")
    submissions, unread = grades.grade_files(
        given.files,
        latest=given.latest and not given.gradebook,  # which joins the files that are in time
        before=given.before,
        lessons=policy.lessons,
        own_numbers=given.own_numbers,
    )
    print(grades.overview(submissions))
    for line in grades.number_messages(submissions, given.own_numbers):
        print(line)
    if given.code:
        print(grades.code_to_read(submissions))
    if given.inventory:
        students, _ = grades.join_students(submissions)
        print(inventory.gain_report([one.inventory for one in students]))
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


def _add_assign(commands: Any) -> None:
    text = "write a package with some lessons for students"
    parser = commands.add_parser("assign", help=text)
    parser.add_argument("lessons", nargs="+", metavar="LESSON")
    _add_folder(parser, required=True)
    text = "remove all solutions from the package"
    parser.add_argument("--without-solutions", action="store_true", help=text)
    text = "from whom students get the solutions"
    parser.add_argument("--teacher", default="", metavar="NAME", help=text)
    text = "when students get the solutions"
    parser.add_argument("--until", default="", metavar="TIME", help=text)
    parser.set_defaults(run=_assign)


def _assign(given: Namespace) -> None:
    _check_repository(given.command)
    from floatbase.lessons.publish import package

    package.write_assignment(
        given.to,
        given.lessons,
        teacher=given.teacher,
        until=given.until,
        with_solutions=not given.without_solutions,
    )
    print(f"The package for students is in {given.to}.")


def _add_lecture(commands: Any) -> None:
    text = "write the questions for the lecture as slides"
    parser = commands.add_parser("lecture", help=text)
    parser.add_argument("--to", type=Path, default=Path("lecture.html"), metavar="HTML")
    parser.set_defaults(run=_lecture)


def _lecture(given: Namespace) -> None:
    from floatbase.lessons.publish import site

    site.lecture.write_slides(given.to)
    print(f"The slides are in {given.to}.")


def _add_workspace(commands: Any) -> None:
    text = "update the learner's copy of the course"
    parser = commands.add_parser("workspace", help=text)
    _add_folder(parser, "folder of the copy, notebooks/my by default")
    parser.set_defaults(run=_workspace)


def _workspace(given: Namespace) -> None:
    for line in prepare_workspace(mine=given.to):
        print(line)


def _add_lessons(parser: ArgumentParser, text: str) -> None:
    parser.add_argument("lessons", nargs="*", type=Path, metavar="NOTEBOOK", help=text)


def _add_folder(parser: ArgumentParser, text: str | None = None, **options: Any) -> None:
    parser.add_argument("--to", type=Path, metavar="FOLDER", help=text, **options)


def _whole_number(text: str) -> int:
    if not text.isdecimal():
        raise ArgumentTypeError(f"{text!r} is not a whole number of at least 0.")
    return int(text)


def _local_time(text: str) -> datetime:
    """Read a time in ISO format, local unless it says otherwise."""
    if text and not set("T ") & set(text):  # a date alone would mean the start of that day
        raise ArgumentTypeError(f"{text!r} has no time of day. Write it as in 2026-05-31T18:00.")
    try:
        return datetime.fromisoformat(text).astimezone()
    except OverflowError as error:
        raise ValueError(text) from error


_COMMANDS = (
    _add_run, _add_map, _add_site, _add_push_recovery, _add_live, _add_solutions, _add_grade,
    _add_assign, _add_lecture, _add_workspace,
)  # fmt: skip

if __name__ == "__main__":
    main()
