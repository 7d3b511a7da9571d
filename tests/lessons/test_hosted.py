"""Lessons on Colab and similar services: the cell that installs the course, and the links."""

import shutil
from contextlib import redirect_stdout
from importlib.machinery import ModuleSpec
from io import StringIO
from pathlib import Path
from unittest.mock import Mock

import nbformat
import pytest
from IPython.core.interactiveshell import InteractiveShell
from packaging.requirements import Requirement

import floatbase as fb
from floatbase.lessons.publish import (
    NOTEBOOKS,
    hosted,
    lesson_file,
    lesson_table,
    prepare_workspace,
    read_notebook,
    run_and_store,
)

LESSON = NOTEBOOKS / "00_start_here.ipynb"
ROOT = NOTEBOOKS.parent


def install_cells(path):
    cells = nbformat.read(path, as_version=4).cells
    return [(i, cell) for i, cell in enumerate(cells) if "install" in cell.metadata.get("tags", [])]


@pytest.fixture
def course(tmp_path, monkeypatch):
    """A copy of the course with one lesson, which a test may write to."""
    (tmp_path / "notebooks").mkdir()
    shutil.copy(ROOT / "environment.txt", tmp_path)
    monkeypatch.setattr("floatbase.lessons.publish.notebooks.NOTEBOOKS", tmp_path / "notebooks")
    monkeypatch.setattr(hosted, "NOTEBOOKS", tmp_path / "notebooks")
    return Path(shutil.copy(LESSON, tmp_path / "notebooks"))


def run_install_cell(monkeypatch, found):
    """Run the cell of a lesson; return what it asks pip for, and what it prints."""
    ((_, cell),) = install_cells(LESSON)
    shell, pip, printed = InteractiveShell(), Mock(), StringIO()
    shell.register_magic_function(pip, magic_name="pip")
    monkeypatch.setattr("importlib.util.find_spec", lambda name: found)
    with redirect_stdout(printed):
        shell.run_cell(cell.source).raise_error()
    return [call.args[0] for call in pip.call_args_list], printed.getvalue()


def test_the_cell_installs_the_course_where_it_is_missing_and_does_nothing_elsewhere(monkeypatch):
    spec = ModuleSpec("floatbase", None, origin="floatbase/__init__.py", is_package=True)
    assert run_install_cell(monkeypatch, spec) == ([], "")
    ((asked,), _) = run_install_cell(monkeypatch, None)
    course, numba = map(Requirement, asked.replace('"', "").removeprefix("install -q ").split())
    assert (course.name, str(course.specifier)) == ("floatbase", f"=={fb.__version__}")
    # a wheel has compiled code for this numba alone
    assert str(numba) in (ROOT / "environment.txt").read_text(encoding="utf-8").splitlines()
    # a folder named floatbase, such as a clone beside the notebook, is not the course
    folder = ModuleSpec("floatbase", None, is_package=True)
    assert run_install_cell(monkeypatch, folder)[0] == [asked]


def test_only_the_files_of_the_course_have_the_cell(course, tmp_path):
    assert [i for i, _ in install_cells(course)] == [1]
    assert [cell.cell_type for cell in read_notebook(course).cells[:2]] == ["markdown", "code"]
    prepare_workspace(course.parent, tmp_path / "mine")
    assert install_cells(tmp_path / "mine" / course.name) == []
    own = shutil.copy(course, tmp_path / "own.ipynb")
    assert lesson_file(Path(own)) != lesson_file(course)


def test_running_a_lesson_keeps_the_cell_and_gives_it_to_a_new_lesson(course):
    text = 'print("rolls")'
    cells = [nbformat.v4.new_markdown_cell("# 11 · Wheels"), nbformat.v4.new_code_cell(text)]
    new = course.with_name("11_wheels.ipynb")
    nbformat.write(nbformat.v4.new_notebook(cells=cells), new)
    for _ in range(2):
        run_and_store(new)
        ((at, cell),) = install_cells(new)
        assert at == 1 and cell.outputs == [] and cell.execution_count is None
        assert cell.source == install_cells(LESSON)[0][1].source


def test_lessons_link_to_colab_only_if_the_address_of_the_repository_is_known(course, tmp_path):
    project = tmp_path / "pyproject.toml"
    colab = f"https://colab.research.google.com/github/a/b/blob/v{fb.__version__}/notebooks/"
    for address, expected in {
        "": "",
        "https://example.org/a/b": "",  # Colab opens files from GitHub
        "https://github.com/a": "",
        "https://github.com/a/b": colab + course.name,
        "https://github.com/a/b.git": colab + course.name,
        "https://github.com/a/b/": colab + course.name,
    }.items():
        project.write_text(f'[project.urls]\nRepository = "{address}"\n', encoding="utf-8")
        assert hosted.colab_address(course) == expected
        assert lesson_table().count("colab.research") == (16 if expected else 0)
    project.unlink()
    assert hosted.colab_address(course) == ""
