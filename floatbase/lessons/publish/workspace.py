"""The learner's own copy of the lessons: made once, never overwritten, kept when the course is updated.

`make lab` prepares it before it opens the course there. Notebooks are read as the JSON that they are, which is quick.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parents[3] / "notebooks"  # of the course
MINE = "my"
_MEMORY = ".from.json"  # for each lesson, the digest of the course's text that the learner's copy started from


def prepare(folder: Path = FOLDER) -> list[str]:
    """Bring the learner's copies in folder/my up to date; returns what happened, a line for each lesson that changed.

    A lesson that is not there is copied. One that the learner has not written in is replaced when the course has a newer
    text. One that the learner has written in stays as it is; the course's newer text is laid beside it as NAME.new.ipynb.
    Outputs do not count as writing.
    """
    mine = folder / MINE
    mine.mkdir(exist_ok=True)
    memory = _memory(mine / _MEMORY)
    said = []
    for lesson in sorted(folder.glob("*.ipynb")):
        copy, now = mine / lesson.name, _digest(lesson)
        if not copy.exists():
            _copy(lesson, copy)
            said.append(f"{lesson.name}: new")
        elif memory.get(lesson.name) == now or _digest(copy) == now:
            pass
        elif _digest(copy) == memory.get(lesson.name):
            _copy(lesson, copy)
            said.append(f"{lesson.name}: updated")
        else:
            _copy(lesson, copy.with_suffix(".new.ipynb"))
            said.append(f"{lesson.name}: yours is kept; the course's new text is in {copy.with_suffix('.new.ipynb').name}")
        memory[lesson.name] = now
    for page in folder.glob("*.md"):
        _copy(page, mine / page.name)
    (mine / _MEMORY).write_text(json.dumps(memory, indent=1), encoding="utf-8")
    return said


def without_outputs(notebook: Any) -> Any:
    """The notebook as if it had never been run. Changes it in place."""
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            cell["outputs"], cell["execution_count"] = [], None
    notebook["metadata"].pop("widgets", None)
    return notebook


def _copy(source: Path, target: Path) -> None:
    """A lesson is copied without its outputs: they would answer what the learner is asked to predict."""
    if source.suffix == ".ipynb":
        notebook = without_outputs(json.loads(source.read_text(encoding="utf-8")))
        target.write_text(json.dumps(notebook, indent=1, ensure_ascii=False, sort_keys=True) + "\n", encoding="utf-8")
    else:
        target.write_bytes(source.read_bytes())


def _memory(path: Path) -> dict[str, str]:
    """The digests stored last time; none when there was no last time or the file was damaged."""
    try:
        return dict(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError):
        return {}


def _digest(path: Path) -> str:
    """A digest of what is written in a notebook's cells, without outputs; of its bytes when it cannot be read."""
    try:
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        text = "\0".join(f"{cell['cell_type']}\0{''.join(cell['source'])}" for cell in cells)
    except (ValueError, LookupError, TypeError):  # a damaged notebook is still the learner's: it counts as written in
        return hashlib.sha256(path.read_bytes()).hexdigest()
    return hashlib.sha256(text.encode()).hexdigest()
