"""Handing in: files keep the answers, grading judges them again, and no file runs code."""

import csv
import json
import os
import sys
from datetime import UTC, datetime
from pathlib import Path

import nbformat
import numpy as np
import pytest
from hints import LIFTED, ODD
from nbformat.v4 import new_code_cell, new_notebook

import floatbase as fb
from floatbase.errors import InputError
from floatbase.lessons import (
    all_exercises,
    check,
    hand_in,
    import_answers,
    predict,
    progress,
    submission,
)
from floatbase.lessons.publish import NOTEBOOKS, grades, read_notebook, write_solutions
from floatbase.lessons.publish.__main__ import main

pytestmark = pytest.mark.usefixtures("learner")


def through_a_file(answer):
    return progress.from_json(json.loads(json.dumps(progress.as_json(answer))))


def same(a, b):
    if isinstance(a, fb.Quadratic):
        a, b = (a.H, a.g, a.c), (b.H, b.g, b.c)
    if isinstance(a, tuple):
        return isinstance(b, tuple) and all(same(*pair) for pair in zip(a, b, strict=True))
    return bool(np.array_equal(a, b))


def test_a_file_keeps_every_kind_of_answer_to_the_last_bit():
    placeholders = {name: exercise.placeholder() for name, exercise in all_exercises().items()}
    answers = {name: answer for name, answer in placeholders.items() if not callable(answer)}
    assert len(answers) > 30
    back = {name: through_a_file(answer) for name, answer in answers.items()}
    assert [name for name, answer in answers.items() if not same(answer, back[name])] == []


def test_a_file_keeps_odd_answers_in_some_form():
    endless = []
    endless.append(endless)
    for odd in [*ODD.values(), endless, np.zeros((1000, 1000)), lambda x: x]:
        json.dumps(progress.as_json(odd))


def test_grading_judges_the_answers_and_not_the_claims_of_a_file(learner, capsys):
    for answer in (3.0, LIFTED, 4.0):
        check("00.1", answer)
    check("03.1", 5)
    predict("02.c", 12.5, unit="mm")
    path = hand_in("Ada Lovelace")
    assert path.name == "answers-Ada_Lovelace.json" and "1 of" in capsys.readouterr().out
    graded = grades.grade_file(path)
    marks = {mark.exercise: mark for mark in graded.results}
    assert (marks["00.1"].result, marks["00.1"].tries) == ("right", 3)
    assert (marks["03.1"].result, marks["01.1"].result, graded.predicted) == ("wrong", "·", 1)
    claimed = json.loads(path.read_text())
    claimed["exercises"]["00.1"]["answer"] = 7.0
    claimed["exercises"]["01.1"] = {"tries": 1, "right": 1, "answer": [0.0, 0.0, 0.0]}
    path.write_text(json.dumps(claimed))
    marks = {mark.exercise: mark for mark in grades.grade_file(path).results}
    assert marks["00.1"].result == marks["01.1"].result == "wrong"


def test_hand_in_asks_to_check_again_answers_that_were_not_kept(learner, capsys):
    progress.append("00.1", {"tries": 1, "right": 1})
    progress.append("99.1", {"tries": 1, "right": 1})  # of another course
    hand_in("Ada")
    said = capsys.readouterr().out
    assert "1 of" in said and "your answers to 00.1. Check them once more" in said
    check("00.1", LIFTED)
    hand_in("Ada")
    assert "once more" not in capsys.readouterr().out


def test_grading_shows_code_and_never_runs_it(learner):
    ran = []

    def row_to_drop(W, prices):
        ran.append(W)

    check("C.3", row_to_drop)
    before = len(ran)
    path = hand_in("Ada")
    out = grades.code_to_read([grades.grade_file(path)])
    assert len(ran) == before > 0
    assert "    def row_to_drop" in out
    assert [line for line in out.splitlines() if line[:4].strip()] == ["--- Ada, C.3"]


HOSTILE = (
    {"tuple": 3}, {"H": [[1.0]], "g": "a", "c": None}, {"tuple": [[[1.0], [1.0, 2.0]]]},
    {"code": 5}, {}, [[[[]]]],
    "a" * 10_000, {"other": "object"}, None, True, 1e400, [float("nan")] * 12, {"__import__": "os"},
)  # fmt: skip


@pytest.mark.parametrize("kept", HOSTILE, ids=range(len(HOSTILE)))
def test_grading_accepts_an_answer_of_any_form(learner, kept):
    entry = {"tries": 1, "right": 1, "answer": kept}
    found = {"form": "answers to the floatbase course", "name": "\x1b[2J=1", "predictions": {}}
    path = learner / "a.json"
    exercises = dict.fromkeys(all_exercises(), entry) | {"99.1": 5}
    path.write_text(json.dumps(found | {"exercises": exercises}))
    handed_in = grades.grade_file(path)
    assert {mark.result for mark in handed_in.results} == {"wrong"}
    assert handed_in.name.isprintable()


NO_FILE = (
    "", "null", "[]", "{", '{"form": 5}', "[" * 100_000,
    '{"form": "answers to the floatbase course", "name": 5}',
)  # fmt: skip


@pytest.mark.parametrize("text", NO_FILE, ids=range(len(NO_FILE)))
def test_grading_refuses_files_that_hand_in_did_not_write(learner, text):
    (learner / "a.json").write_text(text)
    with pytest.raises(InputError, match="was not written by hand_in"):
        grades.grade_file(learner / "a.json")
    with pytest.raises(InputError, match="cannot be read"):
        grades.grade_file(learner / "none.json")


def test_hand_in_needs_an_answer_a_name_and_a_folder(learner):
    with pytest.raises(InputError, match="nothing to hand in yet"):
        hand_in("Ada")
    check("00.1", 3.0)
    for name in ("", " ", "..", "a\nb"):
        with pytest.raises(InputError, match="name must be the name"):
            hand_in(name)
    with pytest.raises(InputError, match="cannot be written"):
        hand_in("Ada", learner / "none")
    assert hand_in("../../Ada").parent == Path(".")


def test_a_class_becomes_one_table(learner, capsys):
    check("00.1", LIFTED)
    files = [str(hand_in(name)) for name in ("Ada", "Émilie du Châtelet", "=1+1", "a;=2")]
    (learner / "holiday.json").write_text("{}")
    capsys.readouterr()
    with pytest.raises(SystemExit) as ended:
        main(["grade", "holiday.json", *files, "--table", "marks.csv"])
    assert ended.value.code == 1  # a file could not be read
    printed = capsys.readouterr()
    assert printed.out.count("1 of ") == 4 and "Émilie du Châtelet" in printed.out
    assert "holiday.json was not written" in printed.err
    rows = list(csv.DictReader((learner / "marks.csv").open(encoding="utf-8")))
    assert len(rows) == 4 * len(all_exercises())
    assert {row["file"] for row in rows} == {Path(file).name for file in files}
    assert {row["name"] for row in rows} == {"Ada", "Émilie du Châtelet", "'=1+1", "a,=2"}
    with pytest.raises(InputError, match="There is no file to grade"):
        grades.grade_files([learner / "holiday.json"])


def test_a_pipe_or_a_device_among_the_files_is_reported(learner, capsys):
    check("00.1", LIFTED)
    os.mkfifo(learner / "pipe.json")
    (learner / "zero.json").symlink_to("/dev/zero")
    good = hand_in("Ada")
    found, unread = grades.grade_files([learner / "pipe.json", learner / "zero.json", good])
    assert [one.name for one in found] == ["Ada"] and unread == 2
    told = capsys.readouterr().err
    assert "pipe.json" in told and "zero.json" in told


def test_learners_with_similar_names_keep_their_own_files(learner):
    check("00.1", LIFTED)
    (learner / "answers-A_B.json").write_text("notes")
    names = ["A.B", "A B", "A_B"]
    paths = [hand_in(name) for name in names]
    assert [path.name for path in paths] == [f"answers-A_B-{n}.json" for n in (2, 3, 4)]
    assert [hand_in(name) for name in reversed(names)] == paths[::-1]
    assert [json.loads(path.read_text())["name"] for path in paths] == names
    assert (learner / "answers-A_B.json").read_text() == "notes"
    os.mkfifo(learner / "answers-Eve.json")
    os.symlink(learner / "nowhere", learner / "answers-Eve-2.json")
    assert hand_in("Eve").name == "answers-Eve-3.json"


def test_learners_with_similar_names_can_hand_in_at_once(learner, monkeypatch):
    check("00.1", LIFTED)
    submission = sys.modules[hand_in.__module__]
    write = submission.write_whole

    def write_after_another(path, text):
        monkeypatch.setattr(submission, "write_whole", write)
        hand_in("A B")  # between the choice of the first one's file and its writing
        write(path, text)

    monkeypatch.setattr(submission, "write_whole", write_after_another)
    hand_in("A.B")
    names = [json.loads(path.read_text())["name"] for path in learner.glob("answers-*.json")]
    assert sorted(names) == ["A B", "A.B"]


@pytest.mark.parametrize("folder", [5, None, "a\0b", "\ud800", ["."]])
def test_hand_in_refuses_a_folder_that_is_not_a_path(learner, folder):
    check("00.1", LIFTED)
    with pytest.raises(InputError, match="folder"):
        hand_in("Ada", folder)


def test_the_last_of_two_files_of_a_learner_counts(learner, capsys):
    check("00.1", LIFTED)
    files = []
    for time in ("2026-05-02T10:00:00+00:00", "2026-05-01T10:00:00+00:00"):
        data = json.loads(hand_in("Ada").read_text()) | {"time": time}
        files.append(learner / f"{time[:10]}.json")
        files[-1].write_text(json.dumps(data))
    noon = datetime(2026, 5, 1, 12, tzinfo=UTC)
    for options, kept in (
        ({}, {"2026-05-01.json", "2026-05-02.json"}),
        ({"latest": True}, {"2026-05-02.json"}),
        ({"latest": True, "before": noon}, {"2026-05-01.json"}),
    ):
        found, _ = grades.grade_files(files, **options)
        assert {one.file for one in found} == kept
    files[-1].write_text(files[-1].read_text().replace("2026-05-01T", "May 1, "))
    capsys.readouterr()
    with pytest.raises(InputError):
        grades.grade_files(files, before=noon)
    printed = capsys.readouterr().out
    assert all(path.name in printed for path in files)  # both are left out


def test_a_file_keeps_the_last_right_answer_or_else_the_last(learner):
    for answer in (1.0, 2.0):
        check("00.1", answer)
    assert progress.answers() == {"00.1": 2.0}
    for answer in (LIFTED, 3.0):
        check("00.1", answer)
    assert progress.answers() == {"00.1": LIFTED}


@pytest.mark.parametrize("tried", [[], [3.0]])
def test_a_right_answer_from_the_site_counts_before_and_after_wrong_ones(learner, tried):
    """The site counts the tries of an exercise, so an entry may have been right twice."""
    entry = {"tries": 3, "right": 2, "answer": LIFTED}
    saved = {"form": submission.FILE_FORMAT, "predictions": {}, "exercises": {"00.1": entry}}
    Path("saved.json").write_text(json.dumps(saved))
    for answer in tried:
        check("00.1", answer)
    for _ in range(2):
        import_answers("saved.json")
    check("00.1", 4.0)
    assert progress.load()["00.1"] == {"tries": 4 + len(tried), "right": 2}
    assert grades.grade_file(hand_in("Ada")).right == {"00.1"}


def test_lessons_for_teachers_hold_the_solutions(learner):
    lesson = NOTEBOOKS / "02_equations_of_motion.ipynb"
    path = learner / "solutions" / f"{lesson.stem}.solved.ipynb"
    assert write_solutions(path.parent, [lesson]) == [f"{path.name}: new"]
    cells = read_notebook(path).cells
    solutions = {name: e.solution for name, e in all_exercises().items() if name.startswith("02.")}
    shown = {c.metadata["exercise"]: c.source for c in cells if "exercise" in c.metadata}
    assert shown == solutions
    explained = sum(bool(all_exercises()[name].explanation) for name in solutions)
    assert len(cells) == len(read_notebook(lesson).cells) + explained


def test_annotated_solutions_are_kept(learner):
    lesson = NOTEBOOKS / "02_equations_of_motion.ipynb"
    write_solutions(learner, [lesson])
    assert write_solutions(learner, [lesson]) == []
    path = learner / f"{lesson.stem}.solved.ipynb"
    annotated = path.read_text().replace("**Why.**", "**Why?**")
    path.write_text(annotated)
    assert write_solutions(learner, [lesson]) == []
    changed = learner / lesson.name
    changed.write_text(lesson.read_text().replace("motion", "movement"))
    (message,) = write_solutions(learner, [changed])
    assert message.endswith(f"{lesson.stem}.solved.new.ipynb")
    assert path.read_text() == annotated
    assert (learner / f"{lesson.stem}.solved.new.ipynb").read_text() != annotated


def test_a_table_replaces_only_an_earlier_table(learner):
    """`grade --table *.json`, without the name of the table, must not cost a learner's answers."""
    check("00.1", 3.0)
    answers, table = hand_in("Ada"), learner / "marks.csv"
    submissions, kept = [grades.grade_file(answers)], answers.read_bytes()
    with pytest.raises(InputError):
        grades.write_table(submissions, answers)
    assert answers.read_bytes() == kept
    for _ in range(2):
        grades.write_table(submissions, table)
    assert len(table.read_text().splitlines()) > len(all_exercises())


@pytest.mark.parametrize(
    "arguments",
    [
        ["run", "nowhere.ipynb"],
        ["run", "text"],
        ["run", "."],
        ["site", "no.ipynb", "--to", "site"],
        ["solutions", "--to", "text"],
        ["grade", "text", "--before", "0001-01-01T00:00"],
        ["grade", "text", "--before", "9999-12-31T23:59"],
    ],
)
def test_the_command_line_ends_with_a_message_and_no_traceback(learner, arguments):
    (learner / "text").write_text("no notebook")
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    assert (learner / "text").read_text() == "no notebook"


def test_a_cell_that_takes_too_long_ends_the_command_with_its_source(learner, monkeypatch, capsys):
    monkeypatch.setattr("floatbase.lessons.publish.notebooks.CELL_TIMEOUT", 1)
    cells = [new_code_cell("import time; time.sleep(99)")]
    nbformat.write(new_notebook(cells=cells), learner / "slow.ipynb")
    with pytest.raises(SystemExit):
        main(["run", "slow.ipynb"])
    assert "time.sleep(99)" in capsys.readouterr().err
