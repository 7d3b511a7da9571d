"""The lessons as files: they print their stored outputs, and their exercises can be solved."""

import ast
import contextlib
import json
import os
import re
import time
from pathlib import Path

import nbformat
import psutil
import pytest
from lesson_runs import MARK, LessonRunner
from nbformat.v4 import new_code_cell, new_notebook
from panels import moved_sliders

from floatbase.lessons import all_exercises, check, progress
from floatbase.lessons.publish import NOTEBOOKS, read_notebook, run_and_store, with_solutions

HOME = 'os.environ["FLOATBASE_HOME"]'
LESSONS = sorted(NOTEBOOKS.glob("*.ipynb"))
# processor time [s]: a lesson takes at most 9 with all its answers, and three times as long on a
# slow or busy machine
LIMIT = 25.0


@pytest.fixture(scope="module")
def lessons():
    """The program that runs the lessons. The processes of a lesson carry its mark."""
    runner = LessonRunner(mark=str(os.getpid()))
    yield runner
    runner.stop()


def ids(path):
    return path.stem


def left_behind(runner):
    """Processes with the mark that outlive their lesson, whoever their parent is now."""
    found = []
    for _ in range(50):  # those about to end may take 5 s to do so
        found = []
        for process in psutil.process_iter():
            with contextlib.suppress(psutil.Error):
                if process.pid != runner.pid and process.environ().get(MARK) == str(os.getpid()):
                    found.append(" ".join(process.cmdline()))
        if not found:
            break
        time.sleep(0.1)
    return found


# before a lesson, so that what it compares can be compared once more
WATCH = """
import floatbase.lessons as __lessons
__compare, __compared = __lessons.compare, {}
def __watched(name, value):
    __compared[name] = value
    __compare(name, value)
__lessons.compare = __watched
"""


# the last thing that a learner does, and what a teacher does with the file
HAND_IN = """
import json
from pathlib import Path
from floatbase.lessons import hand_in
from floatbase.lessons.publish import grades
__results = grades.grade_file(hand_in("Ada")).results
Path("grades.json").write_text(json.dumps({one.exercise: one.result for one in __results}))
"""


def followed_by_its_learner(path):
    """A lesson, and after it what a learner would do: predict, solve all exercises, hand in."""
    notebook, answers = read_notebook(path), with_solutions(read_notebook(path)).cells
    after = [
        f"import os; assert os.listdir({HOME}) == []  # no exercise was tried, no prediction made",
        moved_sliders(notebook),
    ]
    predicting = [cell for cell in notebook.cells if "prediction" in cell.metadata]
    after += [with_an_answer(cell.source) for cell in predicting]
    after += ["for __name, __value in __compared.items(): __compare(__name, __value)"]
    after += [cell.source for cell in answers if "exercise" in cell.metadata]
    after += [
        re.sub(r"^check\((.*)\)$", r"assert check(\1).right, check(\1)", cell.source, flags=re.M)
        for cell in checks(answers)
    ]
    after += [HAND_IN]
    ignored = {"tags": ["nbval-ignore-output"]}
    cells = [new_code_cell(source, metadata=ignored) for source in [WATCH, *after]]
    notebook.cells = [cells[0], *notebook.cells, *cells[1:]]
    return notebook


def checks(cells):
    return [cell for cell in cells if "check" in cell.metadata.get("tags", [])]


def with_an_answer(source):
    """A prediction's cell with some answer in place of its ...."""
    call = next(node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call))
    given = {part.arg: ast.literal_eval(part.value) for part in call.keywords}
    numbers = [1.0] * given["count"] if "count" in given else 1.0
    answer = given["choices"][0] if "choices" in given else numbers
    return source.replace("...", repr(answer), 1)


@pytest.mark.parametrize("path", LESSONS, ids=ids)
def test_a_lesson_prints_what_is_stored_and_its_learner_can_answer_everything(
    path, lessons, tmp_path, monkeypatch
):
    home = tmp_path / "home"
    home.mkdir()
    notebook = followed_by_its_learner(path)
    nbformat.write(notebook, tmp_path / path.name)
    run = lessons.run(tmp_path / path.name, home)
    assert run.status == 0 and "passed" in run.printed, run.printed[-6000:]
    assert left_behind(lessons) == []
    print(f"{path.stem}: {run.seconds:.1f} s")
    assert 0.2 < run.seconds < LIMIT  # a run of zero seconds was not measured
    monkeypatch.setenv("FLOATBASE_HOME", str(home))
    names = [
        cell.metadata["prediction"] for cell in notebook.cells if "prediction" in cell.metadata
    ]
    kept = progress.predictions()
    assert sorted(kept) == sorted(names)
    assert all({"said", "is"} <= set(entry) for entry in kept.values())
    number = path.stem.split("_")[0]
    solved_now = {name for name, entry in progress.load().items() if entry["right"]}
    assert solved_now == {name for name in all_exercises() if name.startswith(f"{number}.")}
    grades = json.loads((tmp_path / "grades.json").read_text())
    right = {name for name, grade in grades.items() if grade in ("right", "to be read")}
    assert right == solved_now, grades


def lines_after_imports(source):
    imports = [n for n in ast.parse(source).body if isinstance(n, ast.Import | ast.ImportFrom)]
    return len(source.splitlines()) - sum(n.end_lineno - n.lineno + 1 for n in imports)


@pytest.mark.parametrize("path", LESSONS, ids=ids)
def test_a_stored_lesson_is_small_and_has_short_cells_without_pictures(path):
    assert path.stat().st_size < 1_000_000
    notebook = read_notebook(path)
    assert "widgets" not in notebook.metadata
    for cell in notebook.cells:
        if cell.cell_type == "code":
            assert lines_after_imports(cell.source) <= 15, cell.source
            for output in cell.outputs:
                assert "text/html" not in output.get("data", {}), cell.source
                assert output.output_type != "error"


@pytest.mark.parametrize("path", LESSONS, ids=ids)
def test_a_lesson_starts_from_the_stubs_of_its_exercises(path):
    known = all_exercises()
    cells = [cell for cell in read_notebook(path).cells if "exercise" in cell.metadata]
    stubs = {cell.metadata["exercise"]: cell.source for cell in cells}
    number = path.stem.split("_")[0]
    assert stubs == {n: e.stub for n, e in known.items() if n.startswith(f"{number}.")}


def test_run_and_store_keeps_the_output_and_does_not_count_as_a_try(tmp_path):
    spoken = 'import sys\nprint("of this run", file=sys.stderr)\nprint("of the lesson")'
    tried = 'from floatbase.lessons import check, progress\ncheck("00.1", 1.0)'
    shown = "print(progress.load(), progress.path())"
    lesson = tmp_path / "lesson.ipynb"
    cells = [new_code_cell(source) for source in (spoken, tried, shown)]
    nbformat.write(new_notebook(cells=cells), lesson)
    check("00.1", 2.0)
    before = progress.load()
    run_and_store(lesson)
    said, _, counted = (cell.outputs for cell in read_notebook(lesson).cells)
    assert [output["text"] for output in said] == ["of the lesson\n"]
    assert counted[0].text.startswith("{'00.1': {'tries': 1, 'right': 0}}")
    assert str(progress.path()) not in counted[0].text
    assert progress.load() == before


def test_tests_do_not_touch_the_progress_of_their_user():
    assert Path.home() not in progress.path().parents
