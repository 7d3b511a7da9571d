"""The learner's work is kept, whatever happens to the course; `make lab` is quick to prepare it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_notebook, new_output

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


def test_a_copy_is_the_notebook_as_jupyter_writes_it(course: Path, tmp_path: Path) -> None:
    """So that saving without a change changes nothing."""
    prepare(course)
    copy, again = course / MINE / "00_a.ipynb", tmp_path / "again"
    nbformat.write(nbformat.read(copy, as_version=4), again)
    assert copy.read_text(encoding="utf-8") == again.read_text(encoding="utf-8")


def test_preparing_loads_no_physics_no_pictures_and_no_kernel() -> None:
    heavy = ("mujoco", "meshcat", "matplotlib", "ipywidgets", "nbformat", "nbclient", "mistune")
    code = f"import sys, floatbase.lessons.publish.__main__; print([m for m in {heavy} if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
