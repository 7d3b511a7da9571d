"""Points of random classes, against the rules of docs/teaching.md on paper."""

import csv
import json
import math
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, timezone
from functools import cache

import numpy as np
import pytest
from hints import right_answer

from floatbase.lessons import all_exercises, progress
from floatbase.lessons.publish import gradebook
from floatbase.lessons.publish.__main__ import main

DUE = datetime(2026, 5, 31, 18, tzinfo=UTC)
EXERCISES = ("00.1", "01.1", "01.2", "06.2")
OWN = [name for name in EXERCISES if all_exercises()[name].own]
CLASSES = 10

pytestmark = pytest.mark.usefixtures("learner")


@cache
def right_entry(name, student):
    """What `hand_in` stores for a right answer with a student's numbers."""
    return progress.as_json(right_answer(name, student))


@dataclass
class File:
    """What a file of a random class says, and who wrote it."""

    student: int
    lesson: str  # "" for all
    time: datetime
    has_time: bool
    rights: dict  # exercise -> whether it is right; as the file says, and with own numbers required

    def points(self, lesson, required):
        return sum(r[required] for name, r in self.rights.items() if name[:2] == lesson)

    def has(self, lesson):
        return self.lesson in ("", lesson)


def write_file(rng, path, student, when):
    """Write a random file of a student, who says the id in capitals or only the name."""
    chosen = str(rng.choice(["", "00", "01", "06"]))
    says_id = rng.random() < 0.8
    exercises, rights = {}, {}
    for name in EXERCISES:
        if chosen not in ("", name[:2]) or rng.random() < 0.2:
            continue
        numbers, answers = (
            f"s{student if rng.random() < 0.7 else rng.integers(8)}" if rng.random() < 0.6 else ""
            for _ in range(2)
        )
        is_right = rng.random() < 0.7
        entry = {"tries": int(rng.integers(1, 9)), "right": int(rng.random() < 0.5)}
        if name in OWN:
            own = all_exercises()[name].own
            of = [own.value(name, s) if s else own.printed for s in (numbers, answers)]
            with_id = own.value(name, f"s{student}")
            rights[name] = is_right and of[0] == of[1], is_right and says_id and of[1] == with_id
            entry |= {"numbers": numbers.upper()} if numbers or rng.random() < 0.5 else {}
        else:
            answers, rights[name] = "", (is_right, is_right)
        entry["answer"] = right_entry(name, answers) if is_right else 0.123
        exercises[name] = entry
    zone = timezone(timedelta(hours=int(rng.integers(-11, 12))))
    has_time = rng.random() < 0.95
    found = {
        "form": "answers to the floatbase course", "name": rng.choice(["Ada  B{}", "ADA b{}"]),
        "id": rng.choice(["s{}", " S{}"]) if says_id else "", "lesson": chosen,
        "time": when.astimezone(zone).isoformat() if has_time else "yesterday",
        "exercises": exercises, "predictions": {},
    }  # fmt: skip
    found |= {key: found[key].format(student) for key in ("name", "id")}
    path.write_text(json.dumps(found))
    return File(student, chosen, when, has_time, rights)


def random_class(rng, folder):
    """Write the files of a class of eight, some of them twice and some damaged."""
    files = {}
    for number in range(rng.integers(1, 25)):
        path = folder / f"{number}.json"
        # no two at once
        when = DUE + timedelta(days=float(rng.choice([-9, -1, 0, 1, 2, 4])), minutes=-number)
        files[path] = write_file(rng, path, int(rng.integers(8)), when)
        if rng.random() < 0.2:
            copy = folder / f"{number} (1).json"
            copy.write_bytes(path.read_bytes())
            files[copy] = files[path]
    damaged = folder / "damaged.json"
    damaged.write_text("{")
    paths = [*files, damaged]
    return files, [paths[i] for i in rng.permutation(len(paths))]


def points_on_paper(files, lessons, late_days, required, due=DUE, latest=None, created=None):
    """Points of a student, or None without a file that counts, as teaching.md says."""

    def counts(file):
        time = created or (file.time if file.has_time else None)
        days = math.inf if time is None else math.ceil((time - due).total_seconds() / 86_400)
        return days <= late_days or (time is not None and latest is not None and time <= latest)

    total = None
    for lesson in lessons:
        here = [file for file in files if file.has(lesson) and counts(file)]
        if here:
            answered = [f for f in here if any(name[:2] == lesson for name in f.rights)]
            last = max(answered or here, key=lambda file: (file.has_time, file.time))
            total = (total or 0) + last.points(lesson, required)
    return total


def grade(files, *options):
    try:
        main(["grade", *map(str, files), *map(str, options)])
    except SystemExit as ended:
        if ended.code != 1:  # 1: a file is damaged
            raise


def check_gradebook(rng, folder, files, order):
    """The column of a gradebook."""
    lessons = sorted(rng.choice(["00", "01", "06"], rng.integers(1, 4), replace=False))
    late_days, required = int(rng.integers(4)), bool(rng.random() < 0.5)
    (folder / "roster.csv").write_text(
        "Student,ID,SIS Login ID,Section\n    Points Possible,,,\n"
        + "".join(f'"B{i}, Ada",{i},s{i},A\n' for i in range(8))
    )
    grade(
        order, "--lessons", *lessons, "--late-days", late_days, "--due", DUE.isoformat(),
        "--gradebook", "canvas", "--roster", folder / "roster.csv", "--column", "Week",
        "--table", folder / "points.csv", *["--own-numbers"] * required,
        *["--latest"] * bool(rng.random() < 0.5),  # changes nothing
    )  # fmt: skip
    with (folder / "points.csv").open() as table:
        found = {row["SIS Login ID"]: row["Week"] for row in csv.DictReader(table)}
    known = all_exercises()
    assert found.pop("") == str(sum(name.split(".")[0] in lessons for name in known))
    for i in range(8):
        own = [file for file in files.values() if file.student == i]
        points = points_on_paper(own, lessons, late_days, required)
        assert found.get(f"s{i}") == (None if points is None else str(points)), (i, lessons)


def check_gradescope(rng, folder, path, file):
    """The score in Gradescope, with dates for a group of which some have an extension."""
    lessons, late_days = ["00", "01", "06"][: rng.integers(1, 4)], int(rng.integers(3))
    zone = timezone(timedelta(hours=-7))

    def date(chance=0.5):
        days = timedelta(days=float(rng.integers(-3, 6)))
        return DUE + days if rng.random() < chance else None

    def written(when):
        odd = rng.choice(np.array([None, "", 5, [], "soon"], dtype=object))
        return when.astimezone(zone).isoformat() if when else odd

    created, of_class, class_late = date(0.9), date(), date(0.5)
    students = [(date(), date(0.5)) for _ in range(rng.integers(3))]
    keys = ("due_date", "late_due_date")
    metadata = {
        "created_at": written(created),
        "assignment": dict(zip(keys, map(written, (of_class, class_late)), strict=True)),
        "users": [
            {"sid": "x", "assignment": dict(zip(keys, map(written, own), strict=True))}
            for own in students
        ] or rng.choice(np.array([None, {}, "x"], dtype=object)),
    }  # fmt: skip
    (folder / "meta.json").write_text(json.dumps(metadata))
    grade(
        [path], "--lessons", *lessons, "--late-days", late_days, "--due", DUE.isoformat(),
        "--results", folder / "results.json", "--metadata", folder / "meta.json",
    )  # fmt: skip
    found = json.loads((folder / "results.json").read_text())
    students = students or [(None, None)]
    due = max(own or of_class or DUE for own, _ in students)
    latest = [own or class_late for _, own in students if own or class_late]
    points = points_on_paper(
        [file], lessons, late_days, False, due, max(latest, default=None), created
    )
    assert found["score"] == (points or 0), (metadata, file)


@pytest.mark.parametrize("seed", range(CLASSES))
def test_each_student_gets_the_points_of_the_rules(tmp_path, seed):
    rng = np.random.default_rng(seed)
    files, order = random_class(rng, tmp_path)
    check_gradebook(rng, tmp_path, files, order)
    for path, file in [*files.items()][:8]:
        check_gradescope(rng, tmp_path, path, file)


@pytest.mark.parametrize("lesson_of_last", ["00", "01", ""])
def test_files_of_a_student_are_joined_and_a_lost_point_is_told(tmp_path, capsys, lesson_of_last):
    found = {"form": "answers to the floatbase course", "name": "Ada", "predictions": {}}
    paths = [tmp_path / "first.json", tmp_path / "last.json"]
    wrong = {"tries": 1, "right": 1, "answer": 3.0}
    right = wrong | {"answer": right_entry("00.1", "")}
    last = {"00.1": wrong} if lesson_of_last == "00" else {"01.2": wrong}
    for path, day, lesson, exercises in zip(
        paths, (1, 2), ("00", lesson_of_last), ({"00.1": right}, last), strict=True
    ):
        time = f"2026-05-0{day}T12:00+00:00"
        path.write_text(
            json.dumps(found | {"time": time, "lesson": lesson, "exercises": exercises})
        )
    for order in (paths, paths[::-1]):
        grade(order, "--latest", "--lessons", "00", "--table", tmp_path / "marks.csv")
        printed = capsys.readouterr().out
        (row,) = csv.DictReader((tmp_path / "marks.csv").open())
        is_lost = lesson_of_last == "00"
        assert (row["exercise"], row["result"]) == ("00.1", "wrong" if is_lost else "right")
        assert ("first.json: 00.1 right" in printed) == is_lost


def test_a_table_replaces_only_an_unchanged_table_and_never_the_roster(tmp_path):
    answers, roster, table = (tmp_path / name for name in ("a.json", "roster.csv", "points.csv"))
    write_file(np.random.default_rng(0), answers, 1, DUE)
    roster.write_text("Student,SIS Login ID\n")
    options = [answers, "--gradebook", "canvas", "--roster", roster, "--column", "Week", "--table"]
    for _ in range(2):
        grade(options, table)
    ours = table.read_bytes()
    header = ours.splitlines()[0]
    edited = [header.replace(b'"', b""), ours + b"\n", ours.replace(b"Week", b"Other")]
    edited += [header + b',"x']
    for changed in [*edited, b'"x', b"\xff", b"my,own\r\n", b"\0"]:
        table.write_bytes(changed)
        with pytest.raises(SystemExit):
            grade(options, table)
        assert table.read_bytes() == changed
    roster.write_bytes(ours)  # also if the roster has the form of a table
    (tmp_path / "link.csv").symlink_to(roster)
    for path in (roster, tmp_path / "link.csv"):
        with pytest.raises(SystemExit):
            grade(options, path)
    assert roster.read_bytes() == ours


METADATA = (
    {}, [], None, 5, "x", {"users": None}, {"users": {"sid": 1}, "assignment": None},
    {"users": [None, 5, {"assignment": [], "sid": 7, "email": None}], "assignment": "x"},
    {"created_at": 5, "assignment": {"due_date": None}},
    {"created_at": "2026-05-31T17:00:00-07:00", "assignment": {"due_date": "2026-05-31T18:00"}},
    {"created_at": "2026-06-05T17", "users": [{"assignment": {"due_date": "2026-06-05T18:00Z"}}]},
    {"created_at": "0001-01-01T00:00+14:00", "users": [{"name": ["x"], "sid": {}}]},
)  # fmt: skip


@pytest.mark.parametrize("metadata", METADATA, ids=range(len(METADATA)))
def test_odd_metadata_of_gradescope_costs_no_points(tmp_path, metadata):
    path = tmp_path / "a.json"
    entry = {"tries": 1, "right": 1, "answer": right_entry("00.1", "")}
    found = {"form": "answers to the floatbase course", "name": "Ada", "time": DUE.isoformat()}
    path.write_text(json.dumps(found | {"exercises": {"00.1": entry}, "predictions": {}}))
    (tmp_path / "meta.json").write_text(json.dumps(metadata))
    policy = gradebook.Policy(due=DUE)
    gradebook.write_gradescope_results(
        [path], tmp_path / "out.json", metadata=tmp_path / "meta.json", policy=policy
    )
    assert json.loads((tmp_path / "out.json").read_text())["score"] == 1
