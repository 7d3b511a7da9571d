"""Keep the learner's own copy of the lessons up to date without overwriting the learner's work.

`floatbase lab` does this before it opens the course. Notebooks are read as JSON, which is fast.
"""

from __future__ import annotations

import hashlib
import json
import os
from itertools import count
from pathlib import Path
from typing import Any

from floatbase._files import LARGEST_DATA, read_file, write_whole
from floatbase.errors import InputError

_INSTALLED = Path(__file__).parents[2] / "_notebooks"
# of the course: inside an installed package, or else at the top of the repository
NOTEBOOKS = _INSTALLED if _INSTALLED.is_dir() else Path(__file__).parents[3] / "notebooks"
MY_FOLDER = "my"
INSTALL_TAG = "install"  # of the cell that installs the course, see `hosted`
_RECORD_FILE = ".from.json"  # file name -> digest of the text that the learner received last
# exceptions that such JSON raises
_NOT_A_NOTEBOOK = (ValueError, LookupError, TypeError, AttributeError)
# what JupyterLab writes when a notebook is only run and viewed; all else is the learner's work
_RUN_KEYS = {"kernelspec", "language_info", "orig_nbformat", "signature", "widgets"}
_RUN_CELL_KEYS = {
    "collapsed", "execution", "jp-MarkdownHeadingCollapsed", "jupyter", "scrolled", "trusted",
}  # fmt: skip


def lesson_notebooks() -> dict[str, Path]:
    """Return the notebook of each lesson, by the name of the lesson, such as "02" or "C"."""
    return {path.name.split("_")[0]: path for path in sorted(NOTEBOOKS.glob("*.ipynb"))}


def prepare_workspace(folder: Path = NOTEBOOKS, mine: Path | None = None) -> list[str]:
    """Copy new lessons to the learner's folder, and update those that were not edited."""
    if not folder.is_dir():
        raise InputError(
            f"There are no lessons in {folder}. The installation is incomplete: install floatbase "
            f"again."
        )
    mine = folder / MY_FOLDER if mine is None else mine
    try:
        mine.mkdir(parents=True, exist_ok=True)
        mine.resolve()  # fails if the present folder is gone
    except OSError as error:
        reason = "it is a file" if mine.is_file() else error.strerror
        raise InputError(
            f"The folder {mine} cannot be created: {reason}. Choose one that you can write to."
        ) from None
    record, messages = read_record(mine), []
    one_file = folder.parent.glob("examples/wbc.py")  # the end of lesson 07 names it
    for source in [*sorted(folder.glob("*.ipynb")), *sorted(folder.glob("*.md")), *one_file]:
        try:
            messages += update_copy(mine / source.name, _course_text(source), record)
        except OSError as error:
            messages.append(_failure(source.name, error))
        except _NOT_A_NOTEBOOK:
            messages.append(
                f"{source.name}: not updated, because the course's file is not a notebook. `git "
                f"status` may show why."
            )
    try:
        write_record(mine, record)
    except OSError as error:
        messages.append(_failure(_RECORD_FILE, error))
    return messages


def _failure(name: str, error: OSError) -> str:
    return (
        f"{name}: not updated: {error.strerror}. Check that you can read and write "
        f"{error.filename}, then start again."
    )


def update_copy(copy: Path, text: bytes, record: dict[str, str]) -> list[str]:
    """Save the course's text under the first name that is free or holds an unedited copy."""
    present, last = _digest(copy.name, text), record.get(copy.name)
    beside = (copy.with_suffix(f".new{n if n > 1 else ''}{copy.suffix}") for n in count(1))
    target, message = copy, f"{copy.name}: updated"
    if not os.path.lexists(copy):
        message = f"{copy.name}: new"
    elif last == present:
        return []
    while os.path.lexists(target):
        found = _digest(copy.name, read_file(target, LARGEST_DATA))
        if found == present:
            record[copy.name] = present
            return []
        if found == last and not target.is_symlink():  # a link may point to any file of the learner
            break
        target = next(beside)
        message = f"{copy.name}: your copy is kept; the new text is in {target.name}"
    write_whole(target, text)
    record[copy.name] = present
    return [message]


def read_record(folder: Path) -> dict[str, str]:
    """Read a folder's record of digests. Without it, every other text counts as edited."""
    try:
        found = json.loads(read_file(folder / _RECORD_FILE))
    except (OSError, ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def write_record(folder: Path, record: dict[str, str]) -> None:
    """Write a folder's record of digests."""
    write_whole(folder / _RECORD_FILE, json.dumps(record, indent=1).encode())


def write_without_outputs(source: Path, target: Path) -> None:
    """Copy a lesson without outputs, or another text as it is."""
    write_whole(target, _course_text(source))


def _course_text(source: Path) -> bytes:
    """Read a lesson without outputs, which would give predictions away."""
    if source.suffix != ".ipynb":
        return source.read_bytes()
    notebook = _without_outputs(json.loads(source.read_bytes()))
    notebook["cells"] = without_install_cell(notebook["cells"])
    return (json.dumps(notebook, indent=1, ensure_ascii=False, sort_keys=True) + "\n").encode()


def without_install_cell(cells: list[Any]) -> list[Any]:
    """Return the cells of a lesson without the one that installs the course."""
    return [cell for cell in cells if INSTALL_TAG not in cell["metadata"].get("tags", [])]


def _without_outputs(notebook: Any) -> Any:
    """Remove all outputs of a notebook, in place."""
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            cell["outputs"], cell["execution_count"] = [], None
    notebook["metadata"].pop("widgets", None)
    return notebook


def _digest(name: str, data: bytes) -> str:
    """Compute a digest of a file, without what running a notebook adds to it."""
    if name.endswith(".ipynb"):
        try:
            data = json.dumps(_authored_content(json.loads(data)), sort_keys=True).encode()
        except (*_NOT_A_NOTEBOOK, RecursionError):
            pass  # a damaged notebook is still the learner's
    return hashlib.sha256(data).hexdigest()


def _authored_content(notebook: Any) -> tuple[list[Any], dict[str, Any]]:
    """Return cells and metadata without outputs and empty cells."""
    cells = []
    for cell in _without_outputs(notebook)["cells"]:
        if cell["source"] or cell.get("attachments"):
            kept = {key: x for key, x in cell["metadata"].items() if key not in _RUN_CELL_KEYS}
            parts = cell["cell_type"], "".join(cell["source"]), kept, cell.get("attachments")
            cells.append(parts)
    return cells, {key: x for key, x in notebook["metadata"].items() if key not in _RUN_KEYS}
