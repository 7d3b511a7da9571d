"""Grade the files of `hand_in`: an overview of all learners, and a table of all results.

No code of a learner is run.
"""

from __future__ import annotations

import csv
import io
import json
import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from textwrap import indent
from typing import Any

import numpy as np
from tqdm import tqdm

from floatbase._files import read_file, write_whole
from floatbase.errors import InputError
from floatbase.lessons import progress
from floatbase.lessons.exercises import all_exercises
from floatbase.lessons.predictions import aligned
from floatbase.lessons.submission import FILE_FORMAT

_LARGEST_FILE = 20_000_000  # bytes; all answers of the course take less than 0.1 MB
_REQUIRED_KEYS = {"name": str, "exercises": dict, "predictions": dict}
_INDENT = "    "  # of code, so that no line of it looks like a heading
_NOT_TRIED, _TO_BE_READ = "·", "to be read"
_COLUMNS = ("file", "name", "time", "exercise", "result", "tries", "feedback")
# a spreadsheet may evaluate text that begins with one of these
_FORMULA_STARTS = tuple("=+-@\t\r\n＝＋－＠")


@dataclass(frozen=True)
class ExerciseResult:
    """Result of one exercise of one learner."""

    exercise: str
    tries: int = 0
    result: str = _NOT_TRIED
    feedback: str = ""


@dataclass(frozen=True)
class Submission:
    """Grades of one file of `hand_in`."""

    file: str
    name: str
    id: str
    time: str
    results: tuple[ExerciseResult, ...]
    predicted: int
    inventory: dict[str, Any]


def grade_file(path: str | Path, *, own_numbers: bool = False) -> Submission:
    """Judge again every answer of a file that `hand_in` wrote."""
    found = _read(Path(path))
    student = _one_line(found.get("id") or "").strip()
    return Submission(
        file=_one_line(Path(path).name),
        name=_one_line(found["name"]),
        id=student,
        time=_one_line(found.get("time")),
        results=tuple(_exercise_results(found["exercises"], student if own_numbers else "")),
        predicted=len(found["predictions"]),
        inventory=given if isinstance(given := found.get("inventory"), dict) else {},
    )


def _read(path: Path) -> dict[str, Any]:
    """Read a file of `hand_in`."""
    try:
        found = json.loads(read_file(path, _LARGEST_FILE))
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
            f"{path} was not written by hand_in(…), or it is incomplete. Ask the learner to send "
            f"it again."
        )
    return found


def _exercise_results(entries: dict[str, Any], student: str) -> Iterator[ExerciseResult]:
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
                verdict = exercise.judge_for(student)(progress.from_json(kept))
        # a file may hold anything, and one answer must not end the others' judgement
        except Exception as error:
            text = f"The answer cannot be judged: {_one_line(error)}"
            yield ExerciseResult(name, tries, "wrong", text)
        else:
            yield ExerciseResult(name, tries, "right" if verdict.right else "wrong", verdict.text)


def _one_line(value: Any) -> str:
    """Turn any value into text on one short line."""
    return "".join(letter if letter.isprintable() else " " for letter in str(value))[:80]


def grade_files(
    files: Sequence[Path],
    *,
    latest: bool = False,
    before: datetime | None = None,
    own_numbers: bool = False,
) -> tuple[list[Submission], int]:
    """Judge files in their order, and report the files that `hand_in` did not write."""
    submissions, unread = [], 0
    for path in tqdm(files, desc="grading", unit="file", leave=False, disable=None):
        try:
            submissions.append(grade_file(path, own_numbers=own_numbers))
        except InputError as error:
            print(error, file=sys.stderr)
            unread += 1
    if before:
        times = [time_of(one.time) for one in submissions]
        submissions = [
            one for one, time in zip(submissions, times, strict=True) if time and time <= before
        ]
    if latest:
        last = {(one.id or one.name): one for one in sorted(submissions, key=time_order)}
        submissions = [one for one in submissions if last[one.id or one.name] is one]
    if not submissions:
        raise InputError(
            "There is no file to grade. Name files that learners wrote with hand_in(…)."
        )
    return submissions, unread


def time_of(text: str) -> datetime | None:
    """Read a time in ISO format; None if it is no time."""
    try:
        return datetime.fromisoformat(text).astimezone()
    except (ValueError, OverflowError):  # also local times before year 1 or after 9999
        return None


def time_order(submission: Submission) -> float:
    """Return when a file was written, for sorting; a file that does not say so comes first."""
    time = time_of(submission.time)
    return time.timestamp() if time else -math.inf


def overview(submissions: Sequence[Submission]) -> str:
    """Write one line per learner: correct exercises per lesson and in total, and unread code."""
    lessons = sorted({mark.exercise.split(".")[0] for mark in submissions[0].results})
    names = [one.name for one in submissions]
    rows = [("", *lessons, "all", "to be read", "predictions")]
    for one in submissions:
        rights = [mark.exercise.split(".")[0] for mark in one.results if mark.result == "right"]
        unread = sum(mark.result == _TO_BE_READ for mark in one.results)
        counts = [rights.count(lesson) for lesson in lessons]
        name = one.name if names.count(one.name) == 1 else f"{one.name} ({one.file})"
        solved = f"{len(rights)} of {len(one.results)}"
        rows.append((name, *map(str, counts), solved, str(unread), str(one.predicted)))
    return aligned(rows, "  ")


def code_to_read(submissions: Sequence[Submission]) -> str:
    """Return all code that was handed in, indented."""
    return "\n".join(
        f"--- {one.name}, {mark.exercise}\n{indent(_printable(mark.feedback), _INDENT)}"
        for one in submissions
        for mark in one.results
        if mark.result == _TO_BE_READ
    )


def _printable(code: str) -> str:
    """Replace characters that would control the terminal."""
    return "".join(letter if letter.isprintable() or letter in "\n\t" else "?" for letter in code)


def write_table(submissions: Sequence[Submission], path: Path) -> None:
    """Write a row per learner and exercise as CSV."""
    rows = [
        (one.file, one.name, one.time, m.exercise, m.result, m.tries, m.feedback)
        for one in submissions
        for m in one.results
    ]
    try:
        if path.is_file() and path.stat().st_size and not _is_table(path):
            raise InputError(
                f"{path} was not written by an earlier grading, so it is not replaced. Give "
                f"another file: --table CSV."
            )
        text = io.StringIO(newline="")
        writer = csv.writer(text)
        writer.writerow(_COLUMNS)
        writer.writerows([csv_safe(part) for part in row] for row in rows)
        write_whole(path, text.getvalue().encode(), keep_link=True)
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror}.") from None


def _is_table(path: Path) -> bool:
    """Return whether a file begins like one of `write_table`."""
    header = ",".join(_COLUMNS).encode()
    with path.open("rb") as file:
        return file.read(len(header)) == header


def csv_safe(value: object) -> object:
    """Keep a spreadsheet from reading a value as a formula, even if it splits cells at ";"."""
    if not isinstance(value, str):
        return value
    value = value.replace(";", ",")
    return f"'{value}" if value.startswith(_FORMULA_STARTS) else value
