"""Points for a gradebook: late days, and files that Canvas, Moodle and Gradescope import."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta, tzinfo
from pathlib import Path
from typing import Any

from floatbase._files import read_file, write_whole
from floatbase.errors import InputError
from floatbase.lessons.exercises import all_exercises, folded
from floatbase.lessons.predictions import lesson_name
from floatbase.lessons.publish.grades import (
    ExerciseResult,
    Submission,
    exercises_of,
    grade_file,
    join_files,
    last_files,
    lesson_of,
    time_of,
    write_csv,
)

_DAY = timedelta(days=1)
# for each gradebook: columns that identify a student, and those of them that hold an id
_COLUMNS = {
    "canvas": ("Student", "LastName", "FirstName", "ID", "SIS User ID", "SIS Login ID", "Section"),
    "moodle": ("First name", "Last name", "ID number", "Username", "Email address"),
}
_IDS = {
    "canvas": ("SIS User ID", "SIS Login ID", "ID"),
    "moodle": ("ID number", "Username", "Email address"),
}
_RESULT = {"right": "passed", "wrong": "failed", "·": "failed", "to be read": "failed"}


@dataclass(frozen=True)
class Policy:
    """What an assignment asks for."""

    lessons: tuple[str, ...] = ()
    due: datetime | None = None
    late_days: int = 0
    late_due: datetime | None = None  # files count until then, too

    def days_late(self, time: datetime | None) -> int:
        """Return the started days after the due date, or a day too many if the time is unknown."""
        if self.due is None:
            return 0
        if time is None:
            return self.late_days + 1
        return max(0, math.ceil((time - self.due) / _DAY))

    def is_too_late(self, time: datetime | None) -> bool:
        """Return whether a file of that time no longer counts."""
        if time and self.late_due and time <= self.late_due:
            return False
        return self.days_late(time) > self.late_days


def lessons_with_exercises(names: Sequence[str]) -> tuple[str, ...]:
    """Return the lessons of these names, such as "01", "1" or "c"."""
    known = {*map(lesson_of, all_exercises())}
    found = tuple(map(lesson_name, names))
    if unknown := [name for name in found if name not in known]:
        raise InputError(
            f"There is no lesson {unknown[0]!r} with exercises. The lessons are "
            f"{', '.join(sorted(known))}."
        )
    return found


def write_gradebook(
    kind: str,
    submissions: Sequence[Submission],
    roster: Path,
    table: Path,
    *,
    column: str,
    policy: Policy,
) -> list[str]:
    """Write a CSV file that Canvas or Moodle imports; return messages for the teacher.

    The submissions hold the results of the policy's lessons only.
    """
    header, rows = _read_roster(kind, roster)
    if table.exists() and table.samefile(roster):
        raise InputError(f"{table} is the roster, so it is not replaced. Choose another --table.")
    kept = [name for name in _COLUMNS[kind] if name in header]
    full = next((name for name in header if _is_column(name, column)), column)
    if full in kept:
        raise InputError(
            f"{column} is a column that identifies students, so it cannot hold points. Pass the "
            f"name of the assignment: --column NAME."
        )
    files_of: dict[int, list[Submission]] = {}
    messages = []
    for one in submissions:
        found = [
            i for i, row in enumerate(rows) if not _is_points_row(row) and _matches(kind, row, one)
        ]
        if len(found) == 1:
            files_of.setdefault(found[0], []).append(one)
        else:
            many = "more than one student" if found else "nobody"
            messages.append(f"{one.file}: {one.name} {one.id} matches {many} in {roster.name}.")
    written = []
    for i, row in enumerate(rows):
        if _is_points_row(row):
            points: int | None = len(exercises_of(policy.lessons))
        else:
            points, more = _points(files_of.get(i, ()), policy)
            messages += more
        if points is not None:
            written.append([*(row[name] for name in kept), points])
    write_csv(table, [*kept, full], written)
    return messages


def _points(files: Sequence[Submission], policy: Policy) -> tuple[int | None, list[str]]:
    """Return the points of one student, None without a file that counts, and messages."""
    messages = [
        f"{one.file}: too late, written {one.time}."
        for one in files
        if one.results and policy.is_too_late(time_of(one.time))
    ]
    counted = [one for one in files if one.results and not policy.is_too_late(time_of(one.time))]
    if not counted:
        others = ", ".join(one.file for one in files if not one.results)
        return None, messages or ([f"{others}: of other lessons only."] if others else [])
    joined, more = join_files(counted)
    late = {one.file: policy.days_late(time_of(one.time)) for one in last_files(counted).values()}
    messages += [f"{file}: late days used: {days}." for file, days in late.items() if days]
    return len(joined.right), messages + more


def _read_roster(kind: str, path: Path) -> tuple[list[str], list[dict[str, str]]]:
    """Read the header and the rows of a gradebook's export."""
    try:
        # with line ends of any system
        text = io.StringIO(read_file(path).decode("utf-8-sig"), newline=None).getvalue()
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from None
    except UnicodeDecodeError:
        raise InputError(f"{path} is not text in UTF-8. Export the roster as CSV.") from None
    for separator in ",;\t":
        try:
            header, *lines = [*csv.reader(io.StringIO(text), delimiter=separator)] or [[]]
        except csv.Error:  # such as an open quotation mark
            continue
        # older Moodles say Surname
        header = [{"Surname": "Last name"}.get(name.strip(), name.strip()) for name in header]
        if set(_IDS[kind]) & set(header):
            break
    else:
        raise InputError(
            f"{path} has none of the columns {', '.join(_IDS[kind])}. Pass the CSV file that "
            f"{kind.capitalize()} exports."
        )
    rows = [dict(zip(header, [*line, *[""] * len(header)], strict=False)) for line in lines if line]
    return header, rows


def _is_points_row(row: Mapping[str, str]) -> bool:
    """Return whether a row of Canvas tells the points of each column."""
    return "Points Possible" in row.get("Student", row.get("LastName", ""))


def _is_column(name: str, column: str) -> bool:
    """Return whether a header names an assignment; Canvas adds its number in parentheses."""
    return re.fullmatch(rf"{re.escape(column)}( \(\d+\))?", name) is not None


def _matches(kind: str, row: Mapping[str, str], submission: Submission) -> bool:
    if submission.id:
        names = [row.get(name, "") for name in _IDS[kind]]
    else:
        last, _, first = row.get("Student", "").partition(",")
        names = [
            f"{first} {last}",
            f"{row.get('First name', '')} {row.get('Last name', '')}",
            f"{row.get('FirstName', '')} {row.get('LastName', '')}",
        ]
    return submission.student in {folded(name) for name in names} - {""}


def write_gradescope_results(
    files: Iterable[Path],
    target: Path,
    *,
    metadata: Path | None = None,
    policy: Policy | None = None,
    own_numbers: bool = False,
) -> None:
    """Grade what one student submitted to Gradescope, and write its results.json."""
    known = _read_metadata(metadata)
    created, policy = _with_dates(policy or Policy(), known)
    graded, lines = [], []
    for path in files:
        try:
            graded.append(grade_file(path, lessons=policy.lessons, own_numbers=own_numbers))
        except InputError as error:
            lines.append(str(error))
    if not graded and not lines:
        lines.append("No file was submitted.")
    students, has_results = {one.student for one in graded}, any(one.results for one in graded)
    if len(students) > 1:
        lines.append("The files are of different students. Submit files with your id only.")
    elif graded and not has_results:
        lines.append(f"Hand in lesson {' or '.join(policy.lessons)}. Your files do not contain it.")
    if len(students) != 1 or not has_results:
        found: dict[str, Any] = {"score": 0, "output": "\n".join(lines)}
    else:
        one, more = join_files(graded)
        lines += more
        results = {result.exercise: result for result in one.results}
        time = created or time_of(one.time)
        late = policy.is_too_late(time)
        tests = [
            {
                "name": result.exercise,
                "score": int(result.result == "right" and not late),
                "max_score": 1,
                "status": _RESULT[result.result],
                "output": _comment(result),
                "visibility": "visible",
            }
            for result in (
                results.get(name, ExerciseResult(name)) for name in exercises_of(policy.lessons)
            )
        ]
        days = policy.days_late(time)
        told = f" Late days used: {days}." if days else ""
        if late and time is None:
            told = " The time of this file cannot be read, so the file does not count."
        elif late:
            told = (
                f" Too late: {days} {'day' if days == 1 else 'days'}. Files count up to "
                f"{policy.late_days} days late."
            )
        found = {
            "score": sum(test["score"] for test in tests if isinstance(test["score"], int)),
            "output": "\n".join([f"{one.name}.{told}", *lines]),
            "tests": [*tests, *_identity(one, known)],
            "extra_data": {"late_days": days, "predictions": one.predicted},
        }
    write_whole(target, json.dumps({"visibility": "visible", **found}, indent=1).encode())


def _comment(result: ExerciseResult) -> str:
    return {
        "·": "Not tried.",
        "to be read": "Your teacher reads this code.\n\n" + result.feedback,
    }.get(result.result, result.feedback)


def _read_metadata(path: Path | None) -> dict[str, Any]:
    """Read Gradescope's metadata, or return {} if there are none."""
    try:
        found = json.loads(read_file(path)) if path else None
    except (OSError, ValueError, RecursionError):
        found = None
    return _as_dict(found)


def _as_dict(value: Any) -> dict[str, Any]:
    """Return a dict as it is, and anything else as {}: metadata may lack any part."""
    return value if isinstance(value, dict) else {}


def _users(metadata: Mapping[str, Any]) -> list[dict[str, Any]]:
    users = metadata.get("users")
    return [user for user in users if isinstance(user, dict)] if isinstance(users, list) else []


def _with_dates(policy: Policy, metadata: Mapping[str, Any]) -> tuple[datetime | None, Policy]:
    """Return when files were submitted, and the policy with the dates of their students.

    A student's own date comes before the date of the class, and this one before that of the policy.
    A group has the latest date of its students. A date without a zone has the zone of the others.
    """
    class_dates = _as_dict(metadata.get("assignment"))
    own_dates = [_as_dict(user.get("assignment")) for user in _users(metadata)] or [{}]
    keys = ("due_date", "late_due_date")
    given = [str(metadata.get("created_at"))]
    given += [str(dates.get(key)) for dates in (class_dates, *own_dates) for key in keys]
    zone = next((found for found in map(_zone, given) if found), None)

    def latest(key: str, default: datetime | None) -> datetime | None:
        of_class = time_of(str(class_dates.get(key)), zone) or default
        of_students = [time_of(str(dates.get(key)), zone) or of_class for dates in own_dates]
        return max((date for date in of_students if date), default=None)

    due, late_due = latest("due_date", policy.due), latest("late_due_date", policy.late_due)
    return time_of(given[0], zone), replace(policy, due=due, late_due=late_due)


def _zone(text: str) -> tzinfo | None:
    try:
        return datetime.fromisoformat(text).tzinfo
    except ValueError:
        return None


def _identity(submission: Submission, metadata: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Tell the teacher alone if a file's id or name is not that of the student who submitted it."""
    keys = ("sid", "email", "name")
    ids = [str(user[key]) for user in _users(metadata) for key in keys if user.get(key)]
    local_parts = [name.partition("@")[0] for name in ids if "@" in name]
    if not ids or submission.student in map(folded, [*ids, *local_parts]):
        return []
    text = f"The file is of {submission.name} {submission.id}, and {ids[-1]} submitted it."
    return [
        {
            "name": "whose file", "score": 0, "max_score": 0, "status": "failed", "output": text,
            "visibility": "hidden",
        }
    ]  # fmt: skip


_SETUP = """#!/usr/bin/env bash
# installs floatbase; Gradescope runs this once, when it builds the autograder
set -e
cd "${AUTOGRADER:-/autograder}/source"
if ! python3 -c 'import sys, ensurepip; sys.exit(sys.version_info[:2] < (3, 11))'; then
    apt-get update
    apt-get install -y python3.11 python3.11-venv
fi
"$(command -v python3.11 || command -v python3)" -m venv .venv
.venv/bin/pip install --quiet -c environment.txt ".[course]"
.venv/bin/python -m floatbase compile
"""

_RUN = """#!/usr/bin/env bash
# grades one submission; no code of the student is run
place="${{AUTOGRADER:-/autograder}}"
cd "$place/source"
.venv/bin/python -m floatbase.lessons.publish grade "$place"/submission/* {options} \\
    --results "$place/results/results.json" --metadata "$place/submission_metadata.json"
"""


def write_autograder(folder: Path, *, policy: Policy, own_numbers: bool = False) -> None:
    """Write the folder whose contents, zipped, are an autograder of Gradescope."""
    from floatbase.lessons.publish.package import package_copy

    options = [f"--late-days {policy.late_days}"]
    options += [f"--due {policy.due.isoformat()}"] if policy.due else []
    options += [f"--lessons {' '.join(policy.lessons)}"] if policy.lessons else []
    options += ["--own-numbers"] if own_numbers else []
    scripts = {"setup.sh": _SETUP, "run_autograder": _RUN.format(options=" ".join(options))}
    with package_copy(folder):
        for name, text in scripts.items():
            (folder / name).write_text(text, encoding="utf-8")
            (folder / name).chmod(0o755)
