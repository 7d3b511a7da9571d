"""Points for a gradebook: late days, and files that Canvas, Moodle and Gradescope import."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

from floatbase._files import read_file, write_whole
from floatbase.errors import InputError
from floatbase.lessons.exercises import all_exercises
from floatbase.lessons.predictions import lesson_name
from floatbase.lessons.publish.grades import (
    ExerciseResult,
    Submission,
    csv_safe,
    grade_file,
    time_of,
    time_order,
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

    def results(self, submission: Submission) -> list[ExerciseResult]:
        """Return the results of the exercises that count."""
        return [
            result
            for result in submission.results
            if not self.lessons or result.exercise.split(".")[0] in self.lessons
        ]

    def points(self, submission: Submission) -> int:
        """Return the points of a file: one for each right exercise."""
        return sum(result.result == "right" for result in self.results(submission))

    def days_late(self, time: datetime | None) -> int:
        """Return the started days after the due date, or a day too many if the time is unknown."""
        if self.due is None:
            return 0
        if time is None:
            return self.late_days + 1
        return max(0, math.ceil((time - self.due) / _DAY))

    def is_too_late(self, time: datetime | None) -> bool:
        """Return whether a file of that time no longer counts."""
        return self.days_late(time) > self.late_days


def lessons_with_exercises(names: Sequence[str]) -> tuple[str, ...]:
    """Return the lessons of these names, such as "01", "1" or "c"."""
    known = {name.split(".")[0] for name in all_exercises()}
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
    """Write a CSV file that Canvas or Moodle imports."""
    header, rows = _read_roster(kind, roster)
    kept = [name for name in _COLUMNS[kind] if name in header]
    full = next((name for name in header if _is_column(name, column)), column)
    students = [row for row in rows if not _is_points_row(row)]
    chosen: dict[int, Submission] = {}
    messages = []
    for one in sorted(submissions, key=time_order):
        found = [i for i, row in enumerate(students) if _matches(kind, row, one)]
        if len(found) != 1:
            many = "more than one student" if found else "nobody"
            messages.append(f"{one.file}: {one.name} {one.id} matches {many} in {roster.name}.")
        elif policy.is_too_late(time_of(one.time)):
            messages.append(f"{one.file}: too late, written {one.time}.")
        else:
            if found[0] in chosen and chosen[found[0]].name != one.name:
                messages.append(f"{one.file}: another name for the id of {chosen[found[0]].file}.")
            chosen[found[0]] = one
    total = max((len(policy.results(one)) for one in submissions), default=0)
    written, number = [], 0
    for row in rows:
        points = total
        if not _is_points_row(row):
            number += 1
            if number - 1 not in chosen:
                continue
            one = chosen[number - 1]
            points = policy.points(one)
            if days := policy.days_late(time_of(one.time)):
                messages.append(f"{one.file}: late days used: {days}.")
        written.append([*(row[name] for name in kept), points])
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow([*kept, full])
    writer.writerows([csv_safe(part) for part in row] for row in written)
    if table.exists() and table.suffix.lower() != ".csv":
        raise InputError(f"{table} is not a CSV file, so it is not replaced. Give another file.")
    try:
        write_whole(table, text.getvalue().encode(), keep_link=True)
    except OSError as error:
        raise InputError(f"{table} cannot be written: {error.strerror}.") from None
    return messages


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
            f"{path} has none of the columns {', '.join(_IDS[kind])}. Give the CSV file that "
            f"{kind.capitalize()} exports."
        )
    rows = [dict(zip(header, [*line, *[""] * len(header)], strict=False)) for line in lines if line]
    return header, rows


def _is_points_row(row: Mapping[str, str]) -> bool:
    """Return whether a row of Canvas tells the points of each column."""
    return "Points Possible" in row.get("Student", row.get("LastName", ""))


def _is_column(name: str, column: str) -> bool:
    """Return whether a header names an assignment; Canvas adds its number in parentheses."""
    return name == column or (name.startswith(f"{column} (") and name.endswith(")"))


def _matches(kind: str, row: Mapping[str, str], submission: Submission) -> bool:
    if submission.id:
        ids = {row.get(name, "").strip().casefold() for name in _IDS[kind]} - {""}
        return submission.id.casefold() in ids
    wanted = submission.name.casefold().split()
    last, _, first = row.get("Student", "").partition(",")
    names = [
        f"{first} {last}",
        f"{row.get('First name', '')} {row.get('Last name', '')}",
        f"{row.get('FirstName', '')} {row.get('LastName', '')}",
    ]
    return bool(wanted) and wanted in [name.casefold().split() for name in names]


def write_gradescope_results(
    files: Iterable[Path],
    target: Path,
    *,
    metadata: Path | None = None,
    policy: Policy | None = None,
    own_numbers: bool = False,
) -> None:
    """Grade what one student submitted to Gradescope, and write its results.json."""
    policy = policy or Policy()
    known = _read_metadata(metadata)
    due = time_of(str(known["assignment"].get("due_date"))) if known else policy.due
    policy = Policy(policy.lessons, due, policy.late_days)
    graded, errors = [], []
    for path in files:
        try:
            graded.append(grade_file(path, own_numbers=own_numbers))
        except InputError as error:
            errors.append(str(error))
    if len(graded) != 1:
        wrong = "\n".join(errors) if not graded else "Submit one file of hand_in(…) only."
        found: dict[str, Any] = {"score": 0, "output": wrong or "No file was submitted."}
    else:
        (one,) = graded
        time = time_of(str(known.get("created_at"))) if known else time_of(one.time)
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
            for result in policy.results(one)
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
            "output": f"{one.name}.{told}",
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
    is_usable = isinstance(found, dict) and isinstance(found.get("assignment"), dict)
    return found if isinstance(found, dict) and is_usable else {}


def _identity(submission: Submission, metadata: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Tell the teacher alone if a file's id or name is not that of the student who submitted it."""
    users = [user for user in metadata.get("users", ()) if isinstance(user, dict)]
    if not users:
        return []
    given = (submission.id or submission.name).casefold()
    ids = [str(user.get(key)).casefold() for user in users for key in ("sid", "email", "name")]
    ids += [name.partition("@")[0] for name in ids if "@" in name]
    if given in ids:
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
    options += [f"--lessons {' '.join(policy.lessons)}"] if policy.lessons else []
    options += ["--own-numbers"] if own_numbers else []
    scripts = {"setup.sh": _SETUP, "run_autograder": _RUN.format(options=" ".join(options))}
    with package_copy(folder):
        for name, text in scripts.items():
            (folder / name).write_text(text, encoding="utf-8")
            (folder / name).chmod(0o755)
