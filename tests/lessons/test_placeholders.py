"""An exercise that nobody has touched is not one that was tried."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from nbformat.v4 import new_code_cell

import floatbase as fb
from floatbase.lessons import all_exercises, check, progress, reveal, show_progress
from floatbase.lessons.publish import FOLDER, execute, read

LESSONS = sorted(FOLDER.glob("*.ipynb"))


@pytest.fixture(autouse=True)
def learner(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """One who has just begun."""
    monkeypatch.setenv("FLOATBASE_HOME", str(tmp_path))


def changed(answer: Any) -> Any:
    """Another answer of the same kind."""
    if isinstance(answer, fb.Quadratic):
        return fb.Quadratic(answer.H, answer.g + 1e-3, answer.c)
    if isinstance(answer, tuple):
        return tuple(changed(part) for part in answer)
    return answer + 1


@pytest.mark.parametrize("name", all_exercises())
def test_a_placeholder_gets_its_hint_and_counts_no_try(name: str) -> None:
    placeholder = all_exercises()[name].placeholder()
    said = check(name, placeholder)
    assert not said.right
    assert said.text == all_exercises()[name].judge(placeholder).text
    assert progress.load() == {}


@pytest.mark.parametrize("name", all_exercises())
def test_an_answer_beside_the_placeholder_is_a_try(name: str) -> None:
    answer = changed(all_exercises()[name].placeholder())
    assert not check(name, answer).right
    assert progress.load() == {name: {"tries": 1, "right": 0}}


@pytest.mark.timeout(200)
@pytest.mark.parametrize("path", LESSONS, ids=lambda path: path.stem)
def test_running_all_cells_with_nothing_answered_leaves_every_exercise_untried(path: Path, tmp_path: Path) -> None:
    notebook = read(path)
    notebook.cells.append(new_code_cell("from floatbase.lessons import progress\nprint(progress.load())"))
    execute(notebook, tmp_path)
    assert [output.text for output in notebook.cells[-1].outputs] == ["{}\n"]


def test_placeholders_do_not_use_up_the_tries_before_a_solution_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    for _ in range(3):
        check("02.1", (3, 8))
        check("02.1", np.array([3.0, 8.0]))
    show_progress()
    assert "02.1 ·" in capsys.readouterr().out
    reveal("02.1")
    assert capsys.readouterr().out.startswith("Try twice more first")
    check("02.1", (9, 8))
    show_progress()
    assert "02.1 ✗" in capsys.readouterr().out
    reveal("02.1")
    assert capsys.readouterr().out.startswith("Try once more first")
