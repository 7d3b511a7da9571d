"""What learners have handed in, judged again: a line for each of them, and a table of all marks. No
code of theirs is run.
"""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import indent
from typing import Any

import numpy as np
from tqdm import tqdm

from floatbase.errors import InputError
from floatbase.lessons import progress
from floatbase.lessons.exercises import all_exercises
from floatbase.lessons.submission import FILE_FORMAT

_LARGEST_FILE = 20_000_000  # bytes; all answers of the course take less than 0.1 MB
_REQUIRED_KEYS = {"name": str, "exercises": dict, "predictions": dict}
_INDENT = "    "  # of code, so that no line of it passes for a heading
_NOT_TRIED, _TO_BE_READ = "·", "to be read"
_COLUMNS = ("file", "name", "time", "exercise", "result", "tries", "feedback")
_FORMULA_STARTS = tuple("=+-@\t\r\n＝＋－＠")  # a spreadsheet may run a text that begins so


@dataclass(frozen=True)
class ExerciseResult:
    """What came of one exercise of one learner.

    exercise: its name. tries: how many. result: "right", "wrong", "to be read" for code that the
        learner's own check judged,
    or "·" where it was not tried. feedback: what the check says now, or the code to be read.
    """

    exercise: str
    tries: int = 0
    result: str = _NOT_TRIED
    feedback: str = ""


@dataclass(frozen=True)
class Submission:
    """What a file of `hand_in` is worth. file: its name. name: the learner's. time: when it was
    written.

    results: of every exercise. predicted: how many predictions were made.
    """

    file: str
    name: str
    time: str
    results: tuple[ExerciseResult, ...]
    predicted: int


def grade_file(path: str | Path) -> Submission:
    """Judge every answer of a file that `hand_in` wrote again: what it claims does not count, and
    none of its code is run.

    Raises `InputError` where the file is none of `hand_in`.
    """
    found = _read(Path(path))
    return Submission(
        file=_one_line(Path(path).name),
        name=_one_line(found["name"]),
        time=_one_line(found.get("time")),
        results=tuple(_exercise_results(found["exercises"])),
        predicted=len(found["predictions"]),
    )


def _read(path: Path) -> dict[str, Any]:
    """The content of a file of `hand_in`."""
    try:
        large = path.stat().st_size > _LARGEST_FILE
        found = None if large else json.loads(path.read_bytes())
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from None
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict) or not all(
        isinstance(found.get(key), kind) for key, kind in _REQUIRED_KEYS.items()
    ):
        found = {}
    if found.get("form") != FILE_FORMAT:
        raise InputError(
            f"{path} is not a file that hand_in(…) wrote, or it was cut short. Ask for it again."
        )
    return found


def _exercise_results(entries: dict[str, Any]) -> Iterator[ExerciseResult]:
    for name, exercise in all_exercises().items():
        entry = entries.get(name)
        entry = entry if isinstance(entry, dict) else {}
        tries, kept = entry.get("tries"), entry.get("answer")
        if type(tries) is not int or tries < 1:
            yield ExerciseResult(name)
            continue
        if isinstance(kept, dict) and isinstance(code := kept.get("code"), str):
            yield ExerciseResult(name, tries, _TO_BE_READ, code)
            continue
        try:
            with np.errstate(all="ignore"):
                verdict = exercise.judge(progress.from_json(kept))
        except (
            Exception
        ) as error:  # a file may hold anything, and one answer must not end the others' judgement
            yield ExerciseResult(
                name, tries, "wrong", f"The answer cannot be judged: {_one_line(error)}"
            )
        else:
            yield ExerciseResult(name, tries, "right" if verdict.right else "wrong", verdict.text)


def _one_line(value: Any) -> str:
    """As text on one short line, whatever it is."""
    return "".join(letter if letter.isprintable() else " " for letter in str(value))[:80]


def grade_files(files: Sequence[Path]) -> list[Submission]:
    """Judge the files, in their order. One that `hand_in` did not write is told on the error stream
    and left out.

    Raises `InputError` where none is left.
    """
    submissions = []
    for path in tqdm(files, desc="judging", unit="file", leave=False, disable=None):
        try:
            submissions.append(grade_file(path))
        except InputError as error:
            print(error, file=sys.stderr)
    if not submissions:
        raise InputError("No file is left to judge: give files that learners wrote by hand_in(…).")
    return submissions


def overview(submissions: Sequence[Submission]) -> str:
    """A line for each learner: exercises that are right, lesson by lesson, and all; how much code
    there is to read.
    """
    lessons = sorted({mark.exercise.split(".")[0] for mark in submissions[0].results})
    names = [one.name for one in submissions]
    rows = [("", *lessons, "all", "to be read", "predictions")]
    for one in submissions:
        rights = [mark.exercise.split(".")[0] for mark in one.results if mark.result == "right"]
        unread = sum(mark.result == "to be read" for mark in one.results)
        counts = [rights.count(lesson) for lesson in lessons]
        name = one.name if names.count(one.name) == 1 else f"{one.name} ({one.file})"
        rows.append(
            (
                name,
                *map(str, counts),
                f"{len(rights)} of {len(one.results)}",
                str(unread),
                str(one.predicted),
            )
        )
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  ".join(f"{part:<{width}}" for part, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    )


def code_to_read(submissions: Sequence[Submission]) -> str:
    """All code that was handed in, indented: what a check cannot judge without running it."""
    found = [
        (one.name, mark)
        for one in submissions
        for mark in one.results
        if mark.result == "to be read"
    ]
    return "\n".join(
        f"--- {name}, {mark.exercise}\n{indent(_printable(mark.feedback), _INDENT)}"
        for name, mark in found
    )


def _printable(code: str) -> str:
    """Code without characters that would work the terminal."""
    return "".join(letter if letter.isprintable() or letter in "\n\t" else "?" for letter in code)


def write_table(submissions: Sequence[Submission], path: Path) -> None:
    """Write a row for each learner and exercise, as CSV. Raises `InputError` where the file cannot
    be written.
    """
    rows = [
        (one.file, one.name, one.time, m.exercise, m.result, m.tries, m.feedback)
        for one in submissions
        for m in one.results
    ]
    try:
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(_COLUMNS)
            writer.writerows([_csv_safe(part) for part in row] for row in rows)
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror}.") from None


def _csv_safe(value: object) -> object:
    """A value that a spreadsheet takes for a text and not for a formula."""
    return f"'{value}" if isinstance(value, str) and value.startswith(_FORMULA_STARTS) else value
