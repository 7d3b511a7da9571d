"""Which exercises a learner has tried and solved, and what was predicted, stored in a file of the
learner's own.

Every try and every prediction is one line at the end of the file, written at once: processes and
threads that write together need no lock, and an interrupt or a full disk costs that one line at
most. Nothing that stands in the file is ever changed.
"""

from __future__ import annotations

import errno
import inspect
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from floatbase._validation import MAX_MAGNITUDE, numeric_copy
from floatbase.affine import Quadratic

_FILE_NAME = "progress.jsonl"
# characters of an answer that is kept; the longest right one of the course takes less than 20 000
_MAX_ANSWER_LENGTH = 100_000


def path() -> Path:
    """Where it is stored: progress.jsonl in the folder that FLOATBASE_HOME names, ~/.floatbase by
    default.

    Raises `RuntimeError` where there is no home folder either.
    """
    return Path(os.environ.get("FLOATBASE_HOME") or Path.home() / ".floatbase") / _FILE_NAME


def load() -> dict[str, dict[str, int]]:
    """For each exercise that was tried: {"tries": n, "right": m}. What is damaged is left out, the
    rest is counted.
    """
    tried: dict[str, dict[str, int]] = {}
    for text in _lines():
        for name, tries, right in _try_counts(text):
            entry = tried.setdefault(name, {"tries": 0, "right": 0})
            entry["tries"] += tries
            entry["right"] += right
    return tried


def record_try(name: str, right: bool, answer: Any = None) -> None:
    """Count a try of the exercise `name`. Where the file cannot be written the try is forgotten,
    without an error.

    answer: what was answered; it is kept as the numbers or names that it is, or as the text of a
        function, and is never run.
    """
    append(name, {"tries": 1, "right": int(right), "answer": as_json(answer)})


def answers() -> dict[str, Any]:
    """For each exercise that was tried: the last right answer `as_json`, or where none was right
    the last.
    """
    found: dict[str, Any] = {}
    solved = set()
    for text in _lines():
        for name, entry in _entries(text):
            right = entry.get("right") == 1
            if "answer" in entry and (right or name not in solved):
                found[name] = entry["answer"]
                solved |= {name} if right else set()
    return found


def predictions() -> dict[str, dict[str, Any]]:
    """For each prediction: {"said": …, "unit": …, "is": …}, the latest of each, as far as there is
    one; see `append`.
    """
    found: dict[str, dict[str, Any]] = {}
    for text in _lines():
        for name, entry in _entries(text):
            usable = {"said": _is_answer, "is": _is_answer, "unit": _is_text}
            kept = {
                key: entry[key] for key, fits in usable.items() if key in entry and fits(entry[key])
            }
            if kept and _is_text(name):
                found.setdefault(name, {}).update(kept)
    return found


def append(name: str, entry: dict[str, Any]) -> str:
    """Add a line about the exercise or prediction `name`; what prevented it, and what to do, or "".

    entry: of a prediction "said" and "is" are a number, a list of numbers or a text; "unit" is a
        text.
    """
    # the line end comes first: a line that a full disk cut short before this one stays alone
    return _append_line(("\n" + json.dumps({name: entry})).encode())


def storage_problem() -> str:
    """Why tries and predictions cannot be saved, and what to do, else "". Makes no file."""
    return _append_line(b"")


def as_json(answer: Any) -> Any:
    """An answer in the form in which it is kept: numbers, texts, lists; else an object that says
    what it is.

    `from_json` gives back an answer that a judge takes for the same; only of a function no more
    than its code is left.
    """
    try:
        kept = _as_json(answer)
        fits = len(json.dumps(kept)) <= _MAX_ANSWER_LENGTH
    except RecursionError:  # a list that holds itself
        fits = False
    return kept if fits else {"too long": type(answer).__name__}


def _as_json(answer: Any) -> Any:
    if isinstance(answer, Quadratic):
        return {"H": answer.H.tolist(), "g": answer.g.tolist(), "c": answer.c}
    if isinstance(answer, str):
        return answer
    if isinstance(answer, tuple):
        return {"tuple": [_as_json(part) for part in answer]}
    if (array := numeric_copy(answer)) is not None:
        return array.tolist()
    if isinstance(answer, list):
        return [_as_json(part) for part in answer]
    return {"code": _source_of(answer)} if callable(answer) else {"other": type(answer).__name__}


def _source_of(function: Any) -> str:
    try:
        return inspect.getsource(function)
    except (OSError, TypeError):
        return "(its code is not known)"


def from_json(kept: Any) -> Any:
    """The answer that `as_json` kept. Raises `ValueError` or another error of Python where it is
    damaged.
    """
    if isinstance(kept, list) and (array := numeric_copy(kept)) is not None:
        return array
    if isinstance(kept, list):
        return [from_json(part) for part in kept]
    if isinstance(kept, dict):
        return (
            tuple(map(from_json, kept["tuple"]))
            if "tuple" in kept
            else Quadratic(kept["H"], kept["g"], kept["c"])
        )
    return kept


def _append_line(line: bytes) -> str:
    """Write a line at the end of the file; what prevented it, or "". Without a line only whether
    one could be written.
    """
    lost, advice = (
        "Tries and predictions cannot be kept",
        "Set FLOATBASE_HOME to a folder that you may write to",
    )
    try:
        path().parent.mkdir(parents=True, exist_ok=True)
        if not line and not path().exists():
            return (
                "" if os.access(path().parent, os.W_OK) else f"{lost} in {path().parent}. {advice}."
            )
        file = os.open(path(), os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
        try:
            if os.write(file, line) < len(line):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        finally:
            os.close(file)
    except OSError as error:
        return f"{lost} in {path().parent}: {error.strerror}. {advice}."
    except RuntimeError:
        return f"{lost}: there is no home folder. {advice}."
    return ""


def _lines() -> list[bytes]:
    try:
        return path().read_bytes().split(b"\n")
    except (OSError, RuntimeError):
        return []


def _entries(text: bytes) -> Iterator[tuple[str, dict[str, Any]]]:
    """Name and entry of each exercise and prediction in a text of any form."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return
    yield from (
        ((name, entry) for name, entry in found.items() if isinstance(entry, dict))
        if isinstance(found, dict)
        else ()
    )


def _try_counts(text: bytes) -> Iterator[tuple[str, int, int]]:
    """Name, tries and right ones of each exercise in a text of any form."""
    for name, entry in _entries(text):
        tries, right = entry.get("tries"), entry.get("right")
        if type(tries) is int and type(right) is int and 0 <= right <= tries > 0:
            yield name, tries, right


def _is_answer(value: Any) -> bool:
    numbers = value if isinstance(value, list) else [value]
    return _is_text(value) or (
        bool(numbers) and all(type(x) in (int, float) and abs(x) <= MAX_MAGNITUDE for x in numbers)
    )


def _is_text(value: Any) -> bool:
    return isinstance(value, str) and value.isprintable()
