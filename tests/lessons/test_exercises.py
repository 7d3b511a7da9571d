"""Exercises: what counts as a try, when a solution is shown, and where progress is kept."""

import json
import multiprocessing
import os
import threading
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from disk import full_disk
from hints import LIFTED

import floatbase as fb
from floatbase.lessons import (
    all_exercises,
    check,
    compare,
    import_answers,
    own_numbers,
    predict,
    progress,
    recall,
    reveal,
    show_progress,
)
from floatbase.lessons.inventory import KEY, inventory, stored_letters
from floatbase.lessons.submission import FILE_FORMAT

TIMES = 300  # tries of each of those who record at once
SAVED = json.dumps(
    {
        "form": FILE_FORMAT,
        "exercises": {},
        "predictions": {"02.i": {"said": 43.1}, "02.e": {"said": 79}},
    }
)  # by a page of the site


pytestmark = pytest.mark.usefixtures("learner")


def changed(answer):
    """Another answer of the same kind."""
    if isinstance(answer, fb.Quadratic):
        return fb.Quadratic(answer.H, answer.g + 1e-3, answer.c)
    if isinstance(answer, tuple):
        return tuple(changed(part) for part in answer)
    if isinstance(answer, list) and isinstance(answer[0], str):  # of names
        return answer[1:]
    if callable(answer):
        return lambda *given: answer(*given)
    return answer + 1


def test_a_placeholder_gets_its_hint_and_counts_no_try():
    for name, exercise in all_exercises().items():
        placeholder = exercise.placeholder()
        said = check(name, placeholder)
        judged = exercise.judge(placeholder)
        assert not said.right and not said.is_try
        assert said.hint == ("no_answer" if judged.hint.startswith("unknown") else judged.hint)
    assert progress.load() == {}


def test_an_answer_beside_the_placeholder_is_a_try():
    for name, exercise in all_exercises().items():
        said = check(name, changed(exercise.placeholder()))
        assert not said.right and said.is_try
    assert progress.load() == {name: {"tries": 1, "right": 0} for name in all_exercises()}


def test_a_solution_is_shown_after_two_tries_and_placeholders_use_up_none(capsys):
    solution = all_exercises()["00.1"].solution
    for _ in range(3):
        check("00.1", 100)
        check("00.1", np.float64(100.0))
    show_progress()
    assert "00.1 ·" in capsys.readouterr().out
    for times in ("twice", "once"):
        reveal("00.1")
        printed = capsys.readouterr().out
        assert printed.startswith(f"Try {times} more first")
        assert solution not in printed
        check("00.1", 99.0)
    show_progress()
    assert "00.1 ✗" in capsys.readouterr().out
    reveal("00.1")
    assert solution in capsys.readouterr().out


@pytest.mark.parametrize("home", ["FLOATBASE_HOME", "HOME"])
def test_a_home_that_cannot_be_written_is_told_and_costs_only_the_memory(
    tmp_path, monkeypatch, home, capsys
):
    show_progress()
    assert "FLOATBASE_HOME" not in capsys.readouterr().out
    (tmp_path / "file").write_text("")
    monkeypatch.delenv("FLOATBASE_HOME")
    monkeypatch.setenv(home, str(tmp_path / "file"))
    for call in (lambda: check("00.1", LIFTED), show_progress):
        call()
        printed = capsys.readouterr().out
        assert f"{tmp_path / 'file'}" in printed and "FLOATBASE_HOME" in printed
    assert "00.1 ✓" in printed and not progress.path().exists()


def test_without_any_home_a_check_still_works_and_says_what_is_lost(monkeypatch, capsys):
    def none():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setenv("FLOATBASE_HOME", "")
    monkeypatch.setattr(Path, "home", none)
    assert not check("00.1", 3.0).right
    assert "FLOATBASE_HOME" in capsys.readouterr().out
    assert progress.load() == {"00.1": {"tries": 1, "right": 0}}


DAMAGED = (
    "null", "5", "[1]", '"a"', "", "\0", "[" * 100_000, '{"00.1": 5}', '{"00.1": {}}',
    '{"00.1": {"tries": 1}}',
    '{"00.1": {"tries": "1", "right": null}}', '{"00.1": {"tries": 1, "right": 2}}',
    '{"00.1": {"tries": 1e400, "right": 0}}',
    '{"00.1": {"tries": 3, "rig',
)  # fmt: skip


@pytest.mark.parametrize("text", DAMAGED)
def test_damage_is_left_out_and_left_as_it_is(tmp_path, text, capsys):
    (tmp_path / "progress.jsonl").write_text(text)
    check("00.1", 3.0)
    check("00.1", LIFTED)
    assert progress.load() == {"00.1": {"tries": 2, "right": 1}}
    reveal("00.1")
    show_progress()
    assert "00.1 ✓" in capsys.readouterr().out
    assert (tmp_path / "progress.jsonl").read_text().startswith(text)


@pytest.mark.parametrize("room", [0, 12])  # bytes: none, or enough for a part of a line
@pytest.mark.parametrize(
    "store",
    [
        lambda: check("00.1", LIFTED),
        lambda: own_numbers("s1"),
        lambda: predict("02.d", 40, unit="N"),
        lambda: compare("02.d", 69.2),
        lambda: recall("02.d", 69),
        lambda: inventory("before", KEY),
        lambda: import_answers("saved.json"),
    ],
)
def test_a_full_disk_is_told_at_once_and_loses_nothing(learner, store, room, capsys):
    (learner / "saved.json").write_text(SAVED)
    predict("02.d", 30, unit="N")
    compare("02.d", 69.1)
    check("00.1", 3.0)
    capsys.readouterr()
    stored = progress.path()
    with full_disk(stored.stat().st_size + room):
        store()
        assert "FLOATBASE_HOME" in capsys.readouterr().out
        show_progress()
        assert "FLOATBASE_HOME" in capsys.readouterr().out
        known = progress.load(), progress.history(), progress.student(), stored_letters()
    check("00.1", 3.0)  # the disk has room again
    known[0]["00.1"]["tries"] += 1
    assert not progress.unsaved
    assert known == (progress.load(), progress.history(), progress.student(), stored_letters())
    assert "FLOATBASE_HOME" not in capsys.readouterr().out


@pytest.mark.parametrize("kind", [os.mkfifo, os.mkdir, lambda path: path.symlink_to("/dev/null")])
def test_progress_that_is_no_file_is_told_and_never_waits(learner, kind, capsys):
    kind(progress.path())
    assert check("00.1", LIFTED).right
    show_progress()
    printed = capsys.readouterr().out
    assert printed.count(f"{learner}:") == 2 and "00.1 ✓" in printed


def record_often(name):
    for _ in range(TIMES):
        progress.record_try(name, True)


@pytest.mark.parametrize("worker", [threading.Thread, multiprocessing.get_context("fork").Process])
def test_many_at_once_lose_nothing_of_each_other_and_of_what_was_there(tmp_path, worker):
    older = {f"old.{i}": {"tries": 2, "right": 1} for i in range(50)}
    (tmp_path / "progress.jsonl").write_text(json.dumps(older))
    names = ["00.1", "00.1", "01.1"]
    workers = [worker(target=record_often, args=(name,)) for name in names]
    for one in workers:
        one.start()
    for one in workers:
        one.join()
    counts = {name: {"tries": n * TIMES, "right": n * TIMES} for name, n in Counter(names).items()}
    assert progress.load() == older | counts
