"""The learner's own copy of the lessons: what the learner wrote is never overwritten, the rest
follows the course.

`make lab` prepares it before it opens the course there. Notebooks are read as the JSON that they
are, which is quick.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from glob import escape
from itertools import count
from pathlib import Path
from typing import Any

from floatbase.errors import InputError

NOTEBOOKS = Path(__file__).parents[3] / "notebooks"  # of the course
MY_FOLDER = "my"
_RECORD_FILE = ".from.json"
_PART_NAME = (
    ".floatbase-",
    ".part",
)  # how the hidden name begins and ends that a file has until all of it is written
_DAMAGED_NOTEBOOK = (
    ValueError,
    LookupError,
    TypeError,
    AttributeError,
    RecursionError,
)  # what JSON that is no notebook raises
_CHECK_TEXT = "Check that you may read and write {} and {}, then start again."
_FAILED_TEXT = "{}: not brought up to date"
# what JupyterLab writes when a notebook is only run and looked at; all else is the learner's
# writing
_OUTPUT_KEYS = {"execution_count", "id", "outputs"}
_CELL_KEYS = {
    "collapsed",
    "execution",
    "jp-MarkdownHeadingCollapsed",
    "jupyter",
    "scrolled",
    "trusted",
}
_NOTEBOOK_KEYS = {"kernelspec", "language_info", "orig_nbformat", "signature", "widgets"}


def prepare_workspace(folder: Path = NOTEBOOKS, mine: Path | None = None) -> list[str]:
    """Bring the learner's copies up to date; returns a line for each file that changed, or could
    not be.

    folder: of the course. mine: of the learner's copies, folder/my by default.

    A lesson or page that is not there is copied. One that the learner has not written in is
    replaced when the course has a newer text. One that the learner has written in stays as it is;
    the course's newer text is laid beside it as NAME.new.ipynb, or NAME.new2.ipynb where the
    learner has gone on in the first, and so on. Outputs do not count as writing.

    However this ends, each file is whole, the old or the new one, and the next call does the rest.
    Raises `InputError` where there can be no such folder, and where the course is not: the package
    alone, as a wheel has it, has no lessons.
    """
    if not folder.is_dir():
        raise InputError(
            f"there are no lessons in {folder}. Install floatbase from its repository, by `pip "
            f"install -e`."
        )
    mine = folder / MY_FOLDER if mine is None else mine
    try:
        mine.mkdir(exist_ok=True)
    except FileExistsError:
        raise InputError(
            f"{mine} is a file or a broken link; it must be a folder. Move it away, then start "
            f"again."
        ) from None
    except OSError as error:
        message = (
            f"{mine} cannot be made: {error.strerror}. Check that the disk has room and "
            f"that you may write there."
        )
        raise InputError(message) from None
    with _folder_lock(mine):
        record, messages = _CopyRecord(mine / _RECORD_FILE), []
        for source in [*sorted(folder.glob("*.ipynb")), *sorted(folder.glob("*.md"))]:
            copy = mine / source.name
            try:
                messages += _update_copy(copy, _course_text(source), record)
            except OSError as error:
                messages.append(
                    f"{_FAILED_TEXT.format(source.name)}: {error.strerror}. "
                    f"{_CHECK_TEXT.format(source, copy)}"
                )
            except _DAMAGED_NOTEBOOK:
                messages.append(
                    f"{_FAILED_TEXT.format(source.name)}: the course's own is no notebook. `git "
                    f"status` may say why."
                )
        return [*messages, *record.messages]


def _without_outputs(notebook: Any) -> Any:
    """The notebook as if it had never been run. Changes it in place."""
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            cell["outputs"], cell["execution_count"] = [], None
    notebook["metadata"].pop("widgets", None)
    return notebook


class _CopyRecord:
    """What the course laid in the learner's folder, name by name.

    laid: digests of all its texts that the file of this name may hold; one that holds another is
        the learner's. offered: the
    newest that the learner has got for this lesson, in the copy or beside it. Where they are lost
    or damaged, all but the course's present text is the learner's. messages: a line when they
    cannot be stored.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.messages = path, list[str]()
        self.laid: dict[str, list[Any]] = {}
        self.offered: dict[str, Any] = {}
        with suppress(OSError, *_DAMAGED_NOTEBOOK):
            found = json.loads(path.read_bytes())
            self.laid = {
                name: digests
                for name, digests in found["laid"].items()
                if isinstance(digests, list)
            }
            self.offered = dict(found["offered"])

    def remember_copied(self, name: str, digest: str) -> None:
        if digest not in self.laid.setdefault(name, []):
            self.laid[name].append(digest)
            self._store()

    def remember_offered(self, name: str, digest: str) -> None:
        if self.offered.get(name) != digest:
            self.offered[name] = digest
            self._store()

    def _store(self) -> None:
        self.messages = []
        try:
            _write_atomically(
                self.path,
                json.dumps({"laid": self.laid, "offered": self.offered}, indent=1).encode(),
            )
        except OSError as error:
            self.messages = [
                f"{self.path.name}: cannot be stored: {error.strerror}. Nothing of yours is lost, "
                f"but a later update takes "
                f"every lesson for written in. Check that you may read and write {self.path}, then "
                f"start again."
            ]

    def may_replace(self, path: Path) -> bool:
        """Whether nothing is lost when another file takes this one's name. A link is the learner's,
        whatever it leads to.
        """
        return not os.path.lexists(path) or (
            not path.is_symlink() and _file_digest(path) in self.laid.get(path.name, [])
        )


def _update_copy(copy: Path, text: bytes, record: _CopyRecord) -> list[str]:
    """Bring one copy to the course's present text, or lay that beside it; what happened, in a line
    or none.
    """
    present, is_new, messages = _digest(copy.name, text), not os.path.lexists(copy), list[str]()
    if not is_new and not copy.is_file():
        return [
            f"{_FAILED_TEXT.format(copy.name)}: a folder or a broken link has its name. Move "
            f"{copy} away, then start again."
        ]
    if copy.suffix == ".ipynb" and copy.is_file() and _authored_text(copy.read_bytes()) is None:
        messages = [
            f"{copy.name}: yours is empty or damaged; to get the course's again, move it away and "
            f"start again"
        ]
    if _file_digest(copy) == present:
        record.remember_copied(copy.name, present)
    elif record.may_replace(copy):
        _place_copy(copy, text, record)
        messages = [f"{copy.name}: {'new' if is_new else 'updated'}"]
    elif record.offered.get(copy.name) == present:
        return messages
    elif present not in [
        _file_digest(path) for path in copy.parent.glob(f"{escape(copy.stem)}.new*{copy.suffix}")
    ]:
        names = (copy.with_suffix(f".new{n if n > 1 else ''}{copy.suffix}") for n in count(1))
        target = next(path for path in names if record.may_replace(path))
        _place_copy(target, text, record)
        messages += [f"{copy.name}: yours is kept; the course's new text is in {target.name}"]
    record.remember_offered(copy.name, present)
    return messages


def _place_copy(target: Path, text: bytes, record: _CopyRecord) -> None:
    """Put a text of the course under a name that is free, or that another text of the course has."""
    # remembered first: after an interrupt in between, what was laid must not count as the learner's
    record.remember_copied(target.name, _digest(target.name, text))
    _write_atomically(target, text, lambda: record.may_replace(target))


def _write_atomically(
    target: Path, text: bytes, may_replace: Callable[[], bool] = lambda: True
) -> None:
    """All of a file or nothing. may_replace: asked at the last moment, for the learner may save
    just now.
    """
    part = target.with_name(secrets.token_hex(4).join(_PART_NAME))
    try:
        with part.open("xb") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        if not may_replace():
            raise FileExistsError(0, "it was written in just now", str(target))
        os.replace(part, target)
    finally:
        part.unlink(missing_ok=True)


@contextmanager
def _folder_lock(folder: Path) -> Iterator[None]:
    """Other processes wait, and what killed ones left is removed; without a lock where the file
    system has none.
    """
    lock = None
    with suppress(OSError):
        lock = os.open(folder, os.O_RDONLY)
        fcntl.flock(lock, fcntl.LOCK_EX)
        for part in folder.glob("*".join(_PART_NAME)):
            part.unlink()
    try:
        yield
    finally:
        if lock is not None:
            os.close(lock)


def _course_text(source: Path) -> bytes:
    """A lesson is laid without its outputs: they would answer what the learner is asked to predict."""
    data = source.read_bytes()
    if source.suffix != ".ipynb":
        return data
    return (
        json.dumps(_without_outputs(json.loads(data)), indent=1, ensure_ascii=False, sort_keys=True)
        + "\n"
    ).encode()


def _digest(name: str, data: bytes) -> str:
    """A digest of what is written in a file: of a notebook without what Jupyter writes, of all
    bytes of any other.
    """
    written = _authored_text(data) if name.endswith(".ipynb") else None
    return hashlib.sha256(
        data if written is None else written
    ).hexdigest()  # a damaged notebook is still the learner's


def _authored_text(data: bytes) -> bytes | None:
    """What is written in a notebook, without what Jupyter writes; None where it is no notebook."""
    with suppress(*_DAMAGED_NOTEBOOK):
        return json.dumps(_authored_content(json.loads(data)), sort_keys=True).encode()
    return None


def _file_digest(path: Path) -> str | None:
    """The digest of a file; None where there is no file."""
    return _digest(path.name, path.read_bytes()) if path.is_file() else None


def _authored_content(notebook: Any) -> Any:
    """What is written in a notebook: cells and metadata. Empty cells are not: Shift+Enter in the
    last one adds such.
    """
    cells = []
    for cell in notebook["cells"]:
        metadata = {key: value for key, value in cell["metadata"].items() if key not in _CELL_KEYS}
        parts = {**cell, "source": "".join(cell["source"]), "metadata": metadata}
        parts = {key: value for key, value in parts.items() if value and key not in _OUTPUT_KEYS}
        if len(parts) > 1:  # more than its type
            cells.append(parts)
    return cells, {
        key: value for key, value in notebook["metadata"].items() if key not in _NOTEBOOK_KEYS
    }
