"""Run the lessons, store their printed output, and insert solutions."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from floatbase._files import LARGEST_DATA, read_file, write_whole
from floatbase.errors import InputError
from floatbase.lessons.exercises import all_exercises
from floatbase.lessons.publish import hosted
from floatbase.lessons.publish.workspace import (
    NOTEBOOKS,
    lesson_notebooks,
    read_record,
    update_copy,
    without_install_cell,
    write_record,
)

CELL_TIMEOUT = 120  # s
# nbformat and nbclient are imported where they are used: `make lab` needs neither


def read_notebook(path: Path) -> Any:
    """Read a notebook without the cell that installs the course.

    Raises `InputError` if the file is not a notebook.
    """
    import nbformat

    try:
        notebook = nbformat.reads(read_file(path, LARGEST_DATA).decode(), as_version=4)
    except (nbformat.reader.NotJSONError, nbformat.ValidationError, UnicodeDecodeError):
        raise InputError(f"{path} is not a notebook.") from None
    notebook.cells = without_install_cell(notebook.cells)
    return notebook


def lesson_file(path: Path, notebook: Any = None) -> bytes:
    """Return the file of a lesson; one of the course has the cell that installs the course."""
    import nbformat

    notebook = read_notebook(path) if notebook is None else notebook
    if path.resolve().parent == NOTEBOOKS:
        hosted.insert_install_cell(notebook)
    return f"{nbformat.writes(notebook)}\n".encode()


def with_solutions(notebook: Any) -> Any:
    """Replace each exercise's stub with its solution, in place."""
    known = all_exercises()
    for cell in notebook.cells:
        name = cell.metadata.get("exercise")
        if name is not None:
            cell.source = known[name].solution
    return notebook


def execute_notebook(notebook: Any, folder: Path, **settings: str) -> Any:
    """Run all cells in a new kernel in `folder`, in place; an error in a cell is raised."""
    from nbclient import NotebookClient

    # its warning that this machine's loopback is not encrypted says nothing here
    quiet = ["--IPKernelApp.log_level=40"]
    where = {"metadata": {"path": str(folder)}}
    client = NotebookClient(notebook, timeout=CELL_TIMEOUT, resources=where, extra_arguments=quiet)
    with tempfile.TemporaryDirectory(prefix="floatbase-") as home:
        client.execute(env={**os.environ, "FLOATBASE_HOME": home, **settings})
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.outputs = _merged_streams(cell.outputs)
    return notebook


def _merged_streams(outputs: list[Any]) -> list[Any]:
    """Merge consecutive lines of each stream, which a kernel sends in parts of any length."""
    merged: list[Any] = []
    for output in outputs:
        if output.output_type == "stream" and merged and merged[-1].get("name") == output.name:
            merged[-1].text += output.text
        else:
            merged.append(output)
    return merged


def write_solutions(folder: Path, sources: Sequence[Path] = ()) -> list[str]:
    """Write lessons with a solution in place of each exercise, and an explanation below it."""
    import nbformat
    from nbformat.v4 import new_markdown_cell

    known, messages = all_exercises(), []
    folder.mkdir(parents=True, exist_ok=True)
    record = read_record(folder)
    for source in sources or lesson_notebooks().values():
        notebook, cells = with_solutions(read_notebook(source)), []
        for cell in notebook.cells:
            cells.append(cell)
            name = cell.metadata.get("exercise")
            if name and known[name].explanation:
                cells.append(new_markdown_cell(f"**Why.** {known[name].explanation}"))
        notebook.cells = cells
        text = f"{nbformat.writes(notebook)}\n".encode()
        messages += update_copy(folder / f"{source.stem}.solved.ipynb", text, record)
        write_record(folder, record)
    return messages


def run_and_store(path: Path) -> None:
    """Run a lesson and store its printed output. Pictures are drawn again by every reader."""
    notebook = execute_notebook(read_notebook(path), path.parent)
    for cell in notebook.cells:
        if cell.cell_type != "code":
            continue
        cell.metadata.pop("execution", None)  # times of day
        # what went to the error stream is about this run, not the lesson
        kept = [output for output in cell.outputs if output.get("name") != "stderr"]
        is_picture = "picture" in cell.metadata.get("tags", [])
        cell.outputs = [] if is_picture else _merged_streams(kept)
    notebook.metadata.pop("widgets", None)
    write_whole(path, lesson_file(path, notebook))
