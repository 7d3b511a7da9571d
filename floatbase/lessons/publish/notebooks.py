"""The lessons as files: run them and keep their outputs, without pictures; put solutions in place of stubs.

`python -m floatbase.lessons.publish.notebooks` runs every lesson and stores what it printed (for those who write lessons).
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path
from typing import Any

import nbformat

from floatbase.lessons import all_exercises

FOLDER = Path(__file__).parents[3] / "notebooks"


def read(path: Path) -> Any:
    """A notebook."""
    return nbformat.read(path, as_version=4)


def without_outputs(notebook: Any) -> Any:
    """The notebook as if it had never been run. Changes it in place."""
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.outputs, cell.execution_count = [], None
    notebook.metadata.pop("widgets", None)
    return notebook


def solved(notebook: Any) -> Any:
    """The notebook with the solution in place of each exercise's stub. Changes it in place."""
    known = all_exercises()
    for cell in notebook.cells:
        name = cell.metadata.get("exercise")
        if name is not None:
            cell.source = known[name].solution
    return notebook


def execute(notebook: Any, folder: Path, **settings: str) -> Any:
    """Run all cells in a fresh kernel in `folder`, in place; an error in a cell is raised.

    The kernel has a home of its own, so that what the notebook answers is not counted as a learner's progress.
    settings: more of the kernel's environment.
    """
    from nbclient import NotebookClient

    quiet = ["--IPKernelApp.log_level=40"]  # its warning that this machine's loopback is not encrypted says nothing here
    where = {"metadata": {"path": str(folder)}}
    client = NotebookClient(notebook, timeout=120, resources=where, extra_arguments=quiet, coalesce_streams=True)
    with tempfile.TemporaryDirectory(prefix="floatbase-") as home:
        return client.execute(env={**os.environ, "FLOATBASE_HOME": home, **settings})


def run(path: Path) -> None:
    """Run a lesson and store its printed outputs; pictures are drawn anew by whoever opens it, so they are not stored."""
    notebook = execute(read(path), path.parent)
    for cell in notebook.cells:
        if cell.cell_type != "code":
            continue
        cell.metadata.pop("execution", None)  # times of day
        picture = "picture" in cell.metadata.get("tags", [])
        # what went to the error stream is about this run, not the lesson
        cell.outputs = [] if picture else [output for output in cell.outputs if output.get("name") != "stderr"]
    notebook.metadata.pop("widgets", None)
    nbformat.write(notebook, path)


if __name__ == "__main__":
    for lesson in sorted(FOLDER.glob("*.ipynb")) if len(sys.argv) == 1 else map(Path, sys.argv[1:]):
        print(lesson.name)
        run(lesson)
