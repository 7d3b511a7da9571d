"""Grade the files of `hand_in`: an overview of all learners, and a table of all results.

No code of a learner is run.
"""

from __future__ import annotations

import csv
import io
import json
import math
import sys
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, tzinfo
from pathlib import Path
from textwrap import indent
from typing import Any

import numpy as np
from tqdm import tqdm

from floatbase._files import read_file, write_whole
from floatbase.errors import InputError
from floatbase.lessons import progress
from floatbase.lessons.exercises import PRINTED_NUMBER, Exercise, all_exercises, folded
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
    numbers: str = ""  # id of the student whose numbers the answer uses
    hint: str = ""

    @property
    def lesson(self) -> str:
        """Name of the lesson."""
        return lesson_of(self.exercise)


@dataclass(frozen=True)
class Submission:
    """Grades of one file of `hand_in`, or of several files of one student."""

    file: str
    name: str
    id: str
    time: str
    results: tuple[ExerciseResult, ...]  # of the lessons that were handed in
    predictions: frozenset[str]
    inventory: dict[str, Any]

    @property
    def student(self) -> str:
        """Who handed in: the id, or the name if there is no id."""
        return folded(self.id or self.name)

    @property
    def predicted(self) -> int:
        """Number of predictions."""
        return len(self.predictions)

    @property
    def right(self) -> set[str]:
        """Exercises with a right answer."""
        return {mark.exercise for mark in self.results if mark.result == "right"}


def lesson_of(name: str) -> str:
    """Return the lesson of an exercise."""
    return name.split(".")[0]


def exercises_of(lessons: Collection[str]) -> dict[str, Exercise]:
    """Return the exercises of some lessons, or of all lessons if `lessons` is empty."""
    return {
        name: exercise
        for name, exercise in all_exercises().items()
        if not lessons or lesson_of(name) in lessons
    }


def grade_file(
    path: str | Path, *, lessons: Collection[str] = (), own_numbers: bool = False
) -> Submission:
    """Judge again every answer of a file that `hand_in` wrote, in some lessons or in all.

    Each answer is judged by the numbers that it uses. With `own_numbers`, it must use those of the
    file's id.
    """
    found = _read(Path(path))
    student = _one_line(found.get("id") or "").strip()
    lesson = str(found.get("lesson"))
    is_whole = not exercises_of([lesson])
    results = [
        _exercise_result(exercise, found["exercises"].get(name), student if own_numbers else None)
        for name, exercise in exercises_of(lessons).items()
        if is_whole or lesson_of(name) == lesson
    ]
    return Submission(
        file=_one_line(Path(path).name),
        name=_one_line(found["name"]),
        id=student,
        time=_one_line(found.get("time")),
        results=tuple(results),
        predictions=frozenset(found["predictions"]),
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


def _exercise_result(exercise: Exercise, entry: Any, required: str | None) -> ExerciseResult:
    """Judge an entry of a file, by the numbers of the id `required` if it is not None."""
    name, entry = exercise.name, entry if isinstance(entry, dict) else {}
    tries, kept = entry.get("tries"), entry.get("answer")
    numbers = _one_line(entry.get("numbers") or "").strip() if exercise.own else ""
    if type(tries) is not int or tries < 1:
        return ExerciseResult(name)
    if isinstance(kept, dict) and isinstance(code := kept.get("code"), str):
        return ExerciseResult(name, tries, _TO_BE_READ, code)
    if exercise.own and required == "":
        text = "Your teacher requires your own numbers. Run own_numbers(…) and check this again."
        return ExerciseResult(name, tries, "wrong", text, numbers)
    try:
        with np.errstate(all="ignore"):
            answer = progress.from_json(kept)
            verdict = exercise.verdict_on(answer, numbers if required is None else required)
    # a file may hold anything, and one answer must not end the others' judgement
    except Exception as error:
        text = f"The answer cannot be judged: {_one_line(error)}"
        return ExerciseResult(name, tries, "wrong", text, numbers)
    result = "right" if verdict.right else "wrong"
    return ExerciseResult(name, tries, result, verdict.text, numbers, verdict.hint)


def _one_line(value: Any) -> str:
    """Turn any value into text on one short line."""
    return "".join(letter if letter.isprintable() else " " for letter in str(value))[:80]


def grade_files(
    files: Sequence[Path],
    *,
    latest: bool = False,
    before: datetime | None = None,
    lessons: Collection[str] = (),
    own_numbers: bool = False,
) -> tuple[list[Submission], int]:
    """Judge files in their order, and report the files that `hand_in` did not write.

    With `latest`, the files of each learner are joined.
    """
    submissions, unread = [], 0
    for path in tqdm(files, desc="grading", unit="file", leave=False, disable=None):
        try:
            submissions.append(grade_file(path, lessons=lessons, own_numbers=own_numbers))
        except InputError as error:
            print(error, file=sys.stderr)
            unread += 1
    if before:
        all_files, submissions = submissions, []
        for one in all_files:
            time = time_of(one.time)
            if time and time <= before:
                submissions.append(one)
            else:
                print(f"{one.file}: left out, written {one.time}.")
    if latest:
        submissions, messages = join_students(submissions)
        for line in messages:
            print(line)
    if not submissions:
        raise InputError(
            "There is no file to grade. Name files that learners wrote with hand_in(…)."
        )
    return submissions, unread


def last_files(files: Collection[Submission]) -> dict[str, Submission]:
    """Return for each lesson the file of one student that counts: the last one with an answer."""
    found = {}
    for lesson in sorted({mark.lesson for one in files for mark in one.results}):
        parts = [
            (one, [mark.result for mark in one.results if mark.lesson == lesson]) for one in files
        ]
        # of files of the same time, the one with more right answers
        found[lesson], _ = max(
            ((one, results) for one, results in parts if results),
            key=lambda part: (
                set(part[1]) != {_NOT_TRIED}, time_order(part[0]), part[1].count("right")
            ),
        )  # fmt: skip
    return found


def join_files(files: Collection[Submission]) -> tuple[Submission, list[str]]:
    """Join the files of one student, and return messages about files that disagree.

    In each lesson, the last file with an answer counts.
    """
    files, counting = sorted(files, key=time_order), last_files(files)
    last = files[-1]
    messages = [
        f"{one.file}: another name for the id of {last.file}."
        for one in files
        if folded(one.name) != folded(last.name)
    ]
    for lesson, counts in counting.items():
        for one in files:
            lost = [name for name in sorted(one.right - counts.right) if lesson_of(name) == lesson]
            if lost:
                messages.append(
                    f"{one.file}: {', '.join(lost)} right, but {counts.file} counts in lesson "
                    f"{lesson}, because it is newer."
                )
    used = [one for one in files if one in counting.values()] or [last]
    joined = replace(
        last,
        file=", ".join(dict.fromkeys(one.file for one in used)),
        time=used[-1].time,
        results=tuple(
            mark
            for lesson, counts in counting.items()
            for mark in counts.results
            if mark.lesson == lesson
        ),
        predictions=frozenset().union(*(one.predictions for one in files)),
        inventory={time: letters for one in files for time, letters in one.inventory.items()},
    )
    return joined, messages


def join_students(files: Iterable[Submission]) -> tuple[list[Submission], list[str]]:
    """Join the files of each student; see `join_files`."""
    files_of: dict[str, list[Submission]] = {}
    for one in files:
        files_of.setdefault(one.student, []).append(one)
    joined = [join_files(some) for some in files_of.values()]
    return [one for one, _ in joined], [line for _, lines in joined for line in lines]


def number_messages(submissions: Sequence[Submission], own_numbers: bool) -> list[str]:
    """Return messages about answers with the lesson's number or with numbers of another id.

    Unless `own_numbers` are required, an answer may use the lesson's number if its file says so.
    """
    messages = []
    for one in submissions:
        messages += [
            f"{one.file}: {mark.exercise}: {mark.feedback}"
            for mark in one.results
            if mark.hint == PRINTED_NUMBER
        ]
        found = [
            mark.exercise
            for mark in one.results
            if mark.hint != PRINTED_NUMBER
            and all_exercises()[mark.exercise].own
            and (not one.id or folded(mark.numbers) != folded(one.id))
            and (mark.result == "wrong" if own_numbers else mark.numbers)
        ]
        if found:
            whose = f"those of its id, {one.id}" if one.id else "those of an id"
            messages.append(f"{one.file}: the numbers in {', '.join(found)} are not {whose}.")
    return messages


def time_of(text: str, zone: tzinfo | None = None) -> datetime | None:
    """Read a time in ISO format, local or of `zone` unless it says otherwise; None if not one."""
    try:
        time = datetime.fromisoformat(text)
        return time.replace(tzinfo=time.tzinfo or zone).astimezone()
    except (ValueError, OverflowError):  # also local times before year 1 or after 9999
        return None


def time_order(submission: Submission) -> float:
    """Return when a file was written, for sorting; a file that does not say so comes first."""
    time = time_of(submission.time)
    return time.timestamp() if time else -math.inf


def overview(submissions: Sequence[Submission]) -> str:
    """Write one line per learner: correct exercises per lesson and in total, and unread code."""
    lessons = sorted({mark.lesson for one in submissions for mark in one.results})
    names = [one.name for one in submissions]
    rows = [("", *lessons, "all", "to be read", "predictions")]
    for one in submissions:
        rights = [lesson_of(name) for name in one.right]
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
    write_csv(path, _COLUMNS, rows)


def write_csv(path: Path, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Write a table as CSV. Only an unchanged table of an earlier grading is replaced."""
    data = _as_csv([header, *([_csv_safe(part) for part in row] for row in rows)])
    try:
        if path.is_file() and not _is_table(read_file(path), header):
            raise InputError(
                f"{path} is not an unchanged table of an earlier grading with these columns, so it "
                f"is not replaced. Choose another file: --table CSV."
            )
        write_whole(path, data, keep_link=True)
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror}.") from None


def _as_csv(rows: Iterable[Sequence[object]]) -> bytes:
    """Write rows as CSV with quotes around every cell, by which `_is_table` knows our tables."""
    text = io.StringIO(newline="")
    csv.writer(text, quoting=csv.QUOTE_ALL).writerows(rows)
    return text.getvalue().encode()


def _is_table(data: bytes, header: Sequence[str]) -> bool:
    """Return whether a file is empty, or is a table of `write_csv` as it was written."""
    try:
        rows = [*csv.reader(io.StringIO(data.decode(), newline=""))]
    except (UnicodeDecodeError, csv.Error):
        return False
    return not data or (rows[0] == [*header] and _as_csv(rows) == data)


def _csv_safe(value: object) -> object:
    """Keep a spreadsheet from reading a value as a formula, even if it splits cells at ";"."""
    if not isinstance(value, str):
        return value
    value = value.replace(";", ",")
    return f"'{value}" if value.startswith(_FORMULA_STARTS) else value
