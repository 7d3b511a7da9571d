"""The learner's work is kept, whatever happens to the course."""

from __future__ import annotations

from pathlib import Path

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_notebook, new_output

from floatbase.lessons import all_exercises, check, progress, reveal, show_progress
from floatbase.lessons.publish import MINE, prepare


def write(path: Path, source: str, output: str = "") -> None:
    cell = new_code_cell(source, id="a")
    if output:
        cell.outputs = [new_output("stream", text=output)]
    nbformat.write(new_notebook(cells=[cell]), path)


def source(path: Path) -> str:
    return nbformat.read(path, as_version=4).cells[0].source


@pytest.fixture
def course(tmp_path: Path) -> Path:
    write(tmp_path / "00_a.ipynb", "first = 1")
    return tmp_path


def test_a_copy_does_not_answer_what_it_asks_the_learner_to_predict(course: Path) -> None:
    write(course / "00_a.ipynb", "first = 1", output="1\n")
    prepare(course)
    assert nbformat.read(course / MINE / "00_a.ipynb", as_version=4).cells[0].outputs == []


def test_a_lesson_is_copied_once_and_then_left_alone(course: Path) -> None:
    assert prepare(course) == ["00_a.ipynb: new"]
    write(course / MINE / "00_a.ipynb", "first = 'my answer'")
    assert prepare(course) == []
    assert source(course / MINE / "00_a.ipynb") == "first = 'my answer'"


def test_a_newer_lesson_replaces_one_that_was_only_run(course: Path) -> None:
    prepare(course)
    write(course / MINE / "00_a.ipynb", "first = 1", output="1\n")
    write(course / "00_a.ipynb", "first = 2")
    assert prepare(course) == ["00_a.ipynb: updated"]
    assert source(course / MINE / "00_a.ipynb") == "first = 2"


def test_a_newer_lesson_is_laid_beside_one_that_was_written_in(course: Path) -> None:
    prepare(course)
    write(course / MINE / "00_a.ipynb", "first = 'my answer'")
    write(course / "00_a.ipynb", "first = 2")
    assert "yours is kept" in prepare(course)[0]
    assert source(course / MINE / "00_a.ipynb") == "first = 'my answer'"
    assert source(course / MINE / "00_a.new.ipynb") == "first = 2"
    assert prepare(course) == []


@pytest.mark.parametrize("damage", ["not json", ""])
def test_damaged_files_cost_nothing_that_was_written(course: Path, damage: str) -> None:
    prepare(course)
    (course / MINE / "00_a.ipynb").write_text("half a noteb")
    (course / MINE / ".from.json").write_text(damage)
    prepare(course)
    assert (course / MINE / "00_a.ipynb").read_text() == "half a noteb"


def test_solutions_are_shown_after_two_tries(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FLOATBASE_HOME", str(tmp_path))
    solution = all_exercises()["00.1"].solution
    for left in ("twice", "once"):
        reveal("00.1")
        printed = capsys.readouterr().out
        assert f"Try {left} more first" in printed
        assert solution not in printed
        check("00.1", 1.0)
    reveal("00.1")
    assert solution in capsys.readouterr().out


def test_progress_is_kept_and_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FLOATBASE_HOME", str(tmp_path))
    show_progress()
    assert "00.1 ·" in capsys.readouterr().out
    check("00.1", None)
    assert progress.load() == {}
    check("00.1", 3.0)
    show_progress()
    assert "00.1 ✗" in capsys.readouterr().out
    check("00.1", 9.81 * 16.085)
    show_progress()
    assert "00.1 ✓" in capsys.readouterr().out


def test_a_place_that_cannot_be_written_to_costs_only_the_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("FLOATBASE_HOME", str(tmp_path / "file"))
    assert not check("00.1", 3.0).right
    assert progress.load() == {}


@pytest.mark.parametrize(
    ("answer", "hint"),
    [
        (16.085, "a mass in kg"),
        (-9.81 * 16.085, "what the robot does to the ground"),
        (9.81 * 16.085 / 4, "share of one foot"),
        ([1.0, 2.0], "shape"),
        (float("nan"), "not finite"),
        ("heavy", "should be numbers"),
        (..., "no answer yet"),
        (1.0, "Neither right nor a mistake this check knows"),
    ],
)
def test_wrong_answers_to_00_1_get_the_hint_that_fits(answer: object, hint: str) -> None:
    verdict = check("00.1", answer)
    assert not verdict.right
    assert hint in verdict.text
