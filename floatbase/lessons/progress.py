"""Which exercises a learner has tried and solved, stored in a file of the learner's own.

Every try is one line at the end of the file, written at once: processes and threads that write together need no lock, and
an interrupt or a full disk costs that one try at most. Nothing that stands in the file is ever changed.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path

_NAME = "progress.jsonl"
_BEFORE = "progress.json"  # one object for all tries, written by floatbase up to 0.2.0: read, and left as it is


def path() -> Path:
    """Where it is stored: progress.jsonl in the folder that FLOATBASE_HOME names, ~/.floatbase by default.

    Raises `RuntimeError` where there is no home folder either.
    """
    return Path(os.environ.get("FLOATBASE_HOME") or Path.home() / ".floatbase") / _NAME


def load() -> dict[str, dict[str, int]]:
    """For each exercise that was tried: {"tries": n, "right": m}. What is damaged is left out, the rest is counted."""
    tried: dict[str, dict[str, int]] = {}
    for text in _texts():
        for name, tries, right in _counts(text):
            entry = tried.setdefault(name, {"tries": 0, "right": 0})
            entry["tries"] += tries
            entry["right"] += right
    return tried


def record(name: str, right: bool) -> None:
    """Count a try of the exercise `name`. Where the file cannot be written the try is forgotten, without an error."""
    # the line end comes first: a line that a full disk cut short before this one stays alone
    line = "\n" + json.dumps({name: {"tries": 1, "right": int(right)}})
    _append(line.encode())


def obstacle() -> str:
    """Why tries cannot be kept, and what to do; "" where they can. Makes no file."""
    return _append(b"")


def _append(line: bytes) -> str:
    """Write a line at the end of the file; what prevented it, or "". Without a line only whether one could be written."""
    advice = "Set FLOATBASE_HOME to a folder that you may write to"
    try:
        path().parent.mkdir(parents=True, exist_ok=True)
        if not line and not path().exists():
            return "" if os.access(path().parent, os.W_OK) else f"Tries cannot be kept in {path().parent}. {advice}."
        file = os.open(path(), os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
        try:
            os.write(file, line)
        finally:
            os.close(file)
    except OSError as error:
        return f"Tries cannot be kept in {path().parent}: {error.strerror}. {advice}."
    except RuntimeError:
        return f"Tries cannot be kept: there is no home folder. {advice}."
    return ""


def _texts() -> Iterator[bytes]:
    """Each is an object of counts: all of the file from before, then line by line what came since."""
    yield _read(_BEFORE)
    yield from _read(_NAME).split(b"\n")


def _read(name: str) -> bytes:
    try:
        return path().with_name(name).read_bytes()
    except (OSError, RuntimeError):
        return b""


def _counts(text: bytes) -> Iterator[tuple[str, int, int]]:
    """Name, tries and right ones of each exercise in a text of any form."""
    try:
        counts = json.loads(text)
    except (ValueError, RecursionError):
        return
    for name, entry in counts.items() if isinstance(counts, dict) else ():
        tries, right = (entry.get("tries"), entry.get("right")) if isinstance(entry, dict) else (None, None)
        if type(tries) is int and type(right) is int and 0 <= right <= tries > 0:
            yield name, tries, right
