"""The learner's work is kept, whatever happens to the course; `make lab` is quick to prepare it."""

import subprocess
import sys

import nbformat
import pytest
from disk import full_disk
from nbformat.v4 import new_code_cell, new_notebook, new_output

from floatbase.errors import InputError
from floatbase.lessons.publish import MY_FOLDER, prepare_workspace

LESSON, NEW, NEW2 = "00_a.ipynb", "00_a.new.ipynb", "00_a.new2.ipynb"


def write(path, source, output=""):
    cell = new_code_cell(source, id="a")
    if output:
        cell.outputs = [new_output("stream", text=output)]
    nbformat.write(new_notebook(cells=[cell]), path)


def source(path):
    return nbformat.read(path, as_version=4).cells[0].source


def files(folder):
    return {path.name for path in folder.iterdir()} - {".from.json"}


@pytest.fixture
def course(tmp_path):
    write(tmp_path / LESSON, "first = 1")
    return tmp_path


@pytest.fixture
def mine(course):
    """The learner's folder, prepared."""
    (course / "page.md").write_text("a page, 1")
    write(course / "01_b.ipynb", "first = 1")
    prepare_workspace(course)
    return course / MY_FOLDER


def update(course, n=2):
    for lesson in course.glob("*.ipynb"):
        write(lesson, f"first = {n}")
    (course / "page.md").write_text(f"a page, {n}")


def test_a_copy_has_no_outputs(course):
    write(course / LESSON, "first = 1", output="1\n")
    prepare_workspace(course)
    assert nbformat.read(course / MY_FOLDER / LESSON, as_version=4).cells[0].outputs == []


def test_a_copy_keeps_predictions_and_folded_claims(course):
    predicts = {"tags": ["predict"], "prediction": "00.a"}
    question = new_code_cell('predict("00.a", ..., unit="mm")', metadata=predicts)
    folded = {"tags": ["claims"], "jupyter": {"source_hidden": True}}
    claims = new_code_cell("assert True", metadata=folded)
    nbformat.write(new_notebook(cells=[question, claims]), course / LESSON)
    prepare_workspace(course)
    copied = nbformat.read(course / MY_FOLDER / LESSON, as_version=4).cells
    assert [cell.source for cell in copied] == [question.source, claims.source]
    assert [cell.metadata for cell in copied] == [predicts, folded]

    copied[0].source = 'predict("00.a", 40, unit="mm")'
    nbformat.write(new_notebook(cells=copied), course / MY_FOLDER / LESSON)
    update(course)
    prepare_workspace(course)
    # what was predicted is the learner's writing
    assert source(course / MY_FOLDER / LESSON) == copied[0].source


def test_learners_of_one_installed_course_have_separate_copies(course, tmp_path):
    folders = [tmp_path / "homes" / name / "course" for name in ("ada", "bob")]
    for folder in folders:
        assert prepare_workspace(course, folder) == [f"{LESSON}: new"]
    write(folders[0] / LESSON, "first = 'my answer'")
    write(course / LESSON, "first = 2")
    (told,) = prepare_workspace(course, folders[0])
    assert told == f"{LESSON}: your copy is kept; the new text is in {NEW}"
    assert prepare_workspace(course, folders[1]) == [f"{LESSON}: updated"]
    assert not (course / MY_FOLDER).exists()


def test_the_program_that_lesson_07_names_is_copied_beside_the_lessons(tmp_path):
    course, program = tmp_path / "notebooks", tmp_path / "examples" / "wbc.py"
    for folder in (course, program.parent):
        folder.mkdir()
    write(course / LESSON, "first = 1")
    program.write_text("q = 1\n")
    assert prepare_workspace(course) == [f"{LESSON}: new", "wbc.py: new"]
    assert (course / MY_FOLDER / "wbc.py").read_text() == program.read_text()


def test_a_package_without_lessons_is_refused(tmp_path):
    with pytest.raises(InputError, match="notebooks"):
        prepare_workspace(tmp_path / "notebooks", tmp_path)


@pytest.mark.parametrize("forget", [False, True])
def test_newer_lessons_are_put_beside_edited_copies(mine, forget):
    """Whichever file the learner continues in, and also when the record of copies is lost."""
    write(mine / LESSON, "first = 'my answer'")
    for n, name in ((2, NEW), (3, NEW2)):
        update(mine.parent, n)
        if forget:
            (mine / ".from.json").unlink()
        told = f"{LESSON}: your copy is kept; the new text is in {name}"
        assert told in prepare_workspace(mine.parent)
        assert source(mine / name) == f"first = {n}"
        write(mine / name, f"first = 'an hour of work in {name}'")
        (mine / "page.md").write_text("my notes")
    update(mine.parent, 3)
    assert prepare_workspace(mine.parent) == []
    assert [source(mine / name)[9:-1] for name in (LESSON, NEW, NEW2)] == [
        "my answer", f"an hour of work in {NEW}", f"an hour of work in {NEW2}",
    ]  # fmt: skip
    assert (mine / "page.md").read_text() == "my notes"


def test_an_unedited_new_text_is_updated_and_not_restored_once_removed(mine):
    write(mine / LESSON, "first = 'my answer'")
    for n in (2, 3):
        update(mine.parent, n)
        prepare_workspace(mine.parent)
        assert source(mine / NEW) == f"first = {n}"
    assert files(mine) == {LESSON, NEW, "01_b.ipynb", "page.md"}
    (mine / NEW).unlink()
    assert prepare_workspace(mine.parent) == []
    assert not (mine / NEW).exists()


PICTURE = {"a.png": {"image/png": "AAAA"}}
RUN = {"execution_count": 3, "outputs": [new_output("stream", text="1")]}
LOOKS = {
    "execution": {"iopub.status.busy": "now"}, "jupyter": {"source_hidden": True},
    "collapsed": True, "scrolled": True, "trusted": True,
}  # fmt: skip
KERNEL = {"kernelspec": {"name": "p", "display_name": "P"}, "widgets": {"a": 1}}
CHANGES = {
    "an attached picture": (True, lambda book: book.cells[0].update(attachments=PICTURE)),
    "a tag": (True, lambda book: book.cells[0].metadata.update(tags=["mine"])),
    "a title": (True, lambda book: book.metadata.update(title="mine")),
    "a cell": (True, lambda book: book.cells.append(new_code_cell("mine"))),
    "another kind of cell": (True, lambda book: book.cells[0].update(cell_type="raw")),
    "an empty cell, as after Shift+Enter": (False, lambda book: book.cells.append(new_code_cell())),
    "a run": (False, lambda book: book.cells[0].update(RUN)),
    "times and looks": (False, lambda book: book.cells[0].metadata.update(LOOKS)),
    "a kernel": (False, lambda book: book.metadata.update(KERNEL)),
}


@pytest.mark.parametrize("change", CHANGES)
def test_only_edits_of_a_learner_count_as_writing(course, change):
    counts, make = CHANGES[change]
    prepare_workspace(course)
    copy = course / MY_FOLDER / LESSON
    book = nbformat.read(copy, as_version=4)
    make(book)
    nbformat.write(book, copy)
    before = copy.read_bytes()
    write(course / LESSON, "first = 2")
    prepare_workspace(course)
    assert (copy.read_bytes() == before, (copy.parent / NEW).exists()) == (counts, counts)


@pytest.mark.parametrize(
    "text", ["null", "5", "[1]", '{"00_a.ipynb": [1]}', "[" * 100_000, "", "\0"]
)
def test_a_damaged_record_keeps_everything_written(mine, text):
    (mine / LESSON).write_text("half a noteb")
    (mine / ".from.json").write_text(text)
    update(mine.parent)
    prepare_workspace(mine.parent)
    assert (mine / LESSON).read_text() == "half a noteb"
    assert source(mine / NEW) == source(mine / "01_b.new.ipynb") == "first = 2"
    assert prepare_workspace(mine.parent) == []
    (mine / LESSON).rename(mine / "away")
    assert prepare_workspace(mine.parent) == [f"{LESSON}: new"]


def linked(path, to):
    path.unlink(missing_ok=True)
    path.symlink_to(to)


def folder(path):
    path.unlink(missing_ok=True)
    path.mkdir()


def written(text):
    return lambda mine: (mine.parent / LESSON).write_text(text)


OBSTACLES = {
    "a merge conflict in the course": written("<<<<<<< HEAD\n{}"),
    "another form of JSON in the course": written('{"cells": [5], "metadata": null}'),
    "a broken link in the course": lambda mine: linked(mine.parent / LESSON, mine / "nowhere"),
    "a folder": lambda mine: folder(mine / LESSON),
    "a broken link": lambda mine: linked(mine / LESSON, mine.parent / "nowhere.ipynb"),
    "a memory that cannot be stored": lambda mine: folder(mine / ".from.json"),
}


@pytest.mark.parametrize("obstacle", OBSTACLES)
def test_an_obstacle_to_one_file_is_reported_and_the_others_are_updated(mine, obstacle):
    update(mine.parent)
    OBSTACLES[obstacle](mine)
    before = files(mine)
    for _ in range(2):
        (told,) = [line for line in prepare_workspace(mine.parent) if "not updated" in line]
        assert told.startswith((f"{LESSON}: ", ".from.json: "))
    assert files(mine) - before <= {NEW, "01_b.new.ipynb", "page.new.md"}
    texts = {path.read_text() for path in mine.glob("page*.md")}
    assert "a page, 2" in texts
    assert not (mine.parent / "nowhere.ipynb").exists()


def test_links_are_neither_followed_nor_replaced(mine):
    (mine.parent / "elsewhere").mkdir()
    for name in (LESSON, "page.md", NEW):
        kept = mine.parent / "elsewhere" / name
        kept.write_bytes((mine / name).read_bytes() if name != NEW else b"mine")
        linked(mine / name, kept)
    before = {path.name: path.read_bytes() for path in (mine.parent / "elsewhere").iterdir()}
    update(mine.parent)
    prepare_workspace(mine.parent)
    for name, content in before.items():
        assert (mine.parent / "elsewhere" / name).read_bytes() == content
    assert all((mine / name).is_symlink() for name in before)
    assert source(mine / NEW2) == "first = 2"


@pytest.mark.parametrize(
    "make", [lambda path: path.write_text("mine"), lambda path: path.symlink_to("nowhere")]
)
def test_a_folder_that_cannot_be_created_is_reported(course, make):
    make(course / MY_FOLDER)
    with pytest.raises(InputError, match="can write to"):
        prepare_workspace(course)


def test_a_full_disk_keeps_whole_files_and_later_updates(mine):
    long = "x" * 10_000
    write(mine.parent / LESSON, long)
    with full_disk(5_000):  # room for the record, none for the lesson
        assert "not updated: File too large" in prepare_workspace(mine.parent)[0]
    assert source(mine / LESSON) == "first = 1"
    assert files(mine) == {LESSON, "01_b.ipynb", "page.md"}
    write(mine / LESSON, "first = 'my answer'")
    prepare_workspace(mine.parent)
    assert (source(mine / LESSON), source(mine / NEW)) == ("first = 'my answer'", long)


def test_a_copy_has_the_form_that_jupyter_writes(course, tmp_path):
    """So that saving without a change changes nothing."""
    prepare_workspace(course)
    copy, again = course / MY_FOLDER / LESSON, tmp_path / "again"
    nbformat.write(nbformat.read(copy, as_version=4), again)
    assert copy.read_text(encoding="utf-8") == again.read_text(encoding="utf-8")


def test_preparing_a_workspace_imports_no_heavy_package():
    heavy = ("mujoco", "meshcat", "matplotlib", "ipywidgets", "nbformat", "nbclient", "mistune")
    loaded = f"print([m for m in {heavy} if m in sys.modules])"
    code = f"import sys, floatbase.lessons.publish.__main__; {loaded}"
    assert subprocess.check_output([sys.executable, "-c", code], text=True) == "[]\n"
