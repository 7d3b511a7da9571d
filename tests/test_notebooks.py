"""The lessons as files: they run, print what is stored, leave nothing behind, and their exercises can be solved."""

from __future__ import annotations

import contextlib
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import nbformat
import psutil
import pytest
from nbformat.v4 import new_code_cell, new_notebook
from panels import with_every_slider_moved

import floatbase as fb
from floatbase.lessons import all_exercises, check, progress
from floatbase.lessons.publish import FOLDER, execute, read, run, solved

MARK = "FLOATBASE_STARTED_BY_TEST"
LESSONS = sorted(FOLDER.glob("*.ipynb"))
LIMIT, LIMIT_FOR_ALL = 30.0, 180.0  # s of one core, which a busy machine does not change: a lesson; all of them, both ways
TOOK: dict[str, float] = {}  # what each run of a lesson took


@pytest.fixture(scope="module", autouse=True)
def compiled() -> None:
    """The controller is compiled before a lesson is measured or compared: where it was not yet, that takes long and is told."""
    robot = fb.load("go2")
    fb.WholeBodyController(robot, fb.Contacts.points(robot), fb.standing_tasks(robot.standing()))


def ids(path: Path) -> str:
    return path.stem


def nbval(path: Path) -> str:
    """Run a lesson by nbval; what it printed."""
    command = [sys.executable, "-m", "pytest", "--nbval", "-q", "-p", "no:cacheprovider", "-c", "/dev/null", str(path)]
    environment = {**os.environ, MARK: str(os.getpid())}
    done = subprocess.run(command, capture_output=True, text=True, cwd=path.parent, timeout=200, env=environment)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]
    return done.stdout


@contextlib.contextmanager
def timed(run: str) -> Iterator[None]:
    """Note the processor time of the processes that are started and ended here, and hold it to the limit."""

    def used() -> float:
        times = os.times()
        return times.children_user + times.children_system

    before = used()
    yield
    TOOK[run] = used() - before
    print(f"{run}: {TOOK[run]:.1f} s")
    assert TOOK[run] < LIMIT


def left_behind() -> list[str]:
    """Processes that a lesson started and that outlived it, whoever their parent is now: they carry the mark."""
    found = []
    for process in psutil.process_iter():
        with contextlib.suppress(psutil.Error):
            if process.environ().get(MARK) == str(os.getpid()):
                found.append(" ".join(process.cmdline()))
    return found


@pytest.mark.timeout(200)
@pytest.mark.parametrize("path", LESSONS, ids=ids)
def test_a_lesson_prints_what_is_stored_and_leaves_nothing_behind(path: Path) -> None:
    with timed(f"{path.stem}, as it stands"):
        assert "passed" in nbval(path)
    time.sleep(0.5)
    assert left_behind() == []


@pytest.mark.timeout(200)
def test_lesson_00_passes_again_right_away() -> None:
    nbval(FOLDER / "00_start_here.ipynb")


@pytest.mark.timeout(200)
@pytest.mark.parametrize("path", LESSONS, ids=ids)
def test_a_lesson_runs_with_its_exercises_solved(path: Path, tmp_path: Path) -> None:
    notebook = with_every_slider_moved(solved(read(path)))
    for cell in notebook.cells:
        if "check" in cell.metadata.get("tags", []):  # a solved lesson proves each check
            cell.source = re.sub(r"^check\((.*)\)$", r"assert check(\1).right, check(\1)", cell.source, flags=re.M)
    with timed(f"{path.stem}, solved"):
        execute(notebook, tmp_path)


def test_all_lessons_together_take_less_than_three_minutes() -> None:
    if len(TOOK) < 2 * len(LESSONS):
        pytest.skip("not all lessons were run here")
    assert 1.0 * len(TOOK) < sum(TOOK.values()) < LIMIT_FOR_ALL  # a run that took nothing was not measured


@pytest.mark.parametrize("path", LESSONS, ids=ids)
def test_a_stored_lesson_is_small_has_short_cells_and_holds_no_picture(path: Path) -> None:
    assert path.stat().st_size < 1_000_000
    notebook = read(path)
    assert "widgets" not in notebook.metadata
    for cell in notebook.cells:
        if cell.cell_type == "code":
            assert len(cell.source.splitlines()) <= 15, cell.source
            assert not any("text/html" in output.get("data", {}) for output in cell.outputs), cell.source
            assert not any(output.output_type == "error" for output in cell.outputs)


@pytest.mark.parametrize("path", LESSONS, ids=ids)
def test_a_lesson_starts_from_the_stubs_of_its_exercises(path: Path) -> None:
    known = all_exercises()
    cells = {c.metadata["exercise"]: c.source for c in read(path).cells if "exercise" in c.metadata}
    number = path.stem.split("_")[0]
    assert set(cells) == {name for name in known if name.startswith(f"{number}.")}
    for name, source in cells.items():
        assert source == known[name].stub


@pytest.mark.parametrize("name", all_exercises())
def test_an_exercise_has_no_answer_at_first_and_says_so(name: str) -> None:
    verdict = check(name, None)
    assert not verdict.right
    assert "no answer yet" in verdict.text


def test_what_a_run_says_on_the_error_stream_is_not_stored(tmp_path: Path) -> None:
    lesson = tmp_path / "lesson.ipynb"
    spoken = 'import sys\nprint("of this run", file=sys.stderr)\nprint("of the lesson")'
    nbformat.write(new_notebook(cells=[new_code_cell(spoken)]), lesson)
    run(lesson)
    assert [output["text"] for output in read(lesson).cells[0].outputs] == ["of the lesson\n"]


def test_running_a_lesson_counts_no_try_of_a_learner(tmp_path: Path) -> None:
    tried = 'from floatbase.lessons.exercises import check\nfrom floatbase.lessons import progress\ncheck("00.1", 1.0)'
    notebook = new_notebook(cells=[new_code_cell(tried), new_code_cell("print(progress.load(), progress.path())")])
    check("00.1", 2.0)
    before = progress.load()
    execute(notebook, tmp_path)
    (printed,) = notebook.cells[1].outputs
    assert printed.text.startswith("{'00.1': {'tries': 1, 'right': 0}}")
    assert str(progress.path()) not in printed.text
    assert progress.load() == before


def test_tests_leave_the_progress_of_whoever_runs_them_alone() -> None:
    assert Path.home() not in progress.path().parents
