"""Progress of a learner: tries, answers and predictions, stored in the learner's own file.

Every try and every prediction is one line, appended to the file in a single write. Processes and
threads that write at the same time need no lock, and an interrupt loses at most that line. What
cannot be written is kept in memory, and the learner is told. Lines in the file are never changed.
"""

from __future__ import annotations

import errno
import inspect
import json
import os
from collections import deque
from collections.abc import Iterable, Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

from floatbase._files import LARGEST_DATA, open_file, read_file
from floatbase._validation import MAX_MAGNITUDE, numeric_copy
from floatbase.affine import Quadratic

STUDENT = "student"  # name of the entry that holds the learner's id
_FILE_NAME = "progress.jsonl"
# characters of a stored answer; the longest right answer in the course has less than 20 000
_MAX_ANSWER_LENGTH = 100_000
unsaved: deque[bytes] = deque()  # lines of this process that could not be written, in order


def path() -> Path:
    """Return the path of the file in which progress is stored, which may not exist yet.

    The file is progress.jsonl in the folder that the environment variable FLOATBASE_HOME names, by
    default ~/.floatbase. Without a home folder either, this is a `RuntimeError`.
    """
    return Path(os.environ.get("FLOATBASE_HOME") or Path.home() / ".floatbase") / _FILE_NAME


def load() -> dict[str, dict[str, int]]:
    """Return {"tries": n, "right": m} for each exercise that was tried; ignore damaged lines."""
    tried: dict[str, dict[str, int]] = {}
    for text in _lines():
        for name, tries, right in _try_counts(text):
            entry = tried.setdefault(name, {"tries": 0, "right": 0})
            entry["tries"] += tries
            entry["right"] += right
    return tried


def record_try(name: str, right: bool, answer: Any = None, numbers: str = "") -> None:
    """Record a try of an exercise; see `append`.

    Numbers and names of an answer are stored as they are, a function as its source code, which is
    never run. numbers: id of the student whose numbers were used; "" for those in the lesson.
    """
    entry = {"tries": 1, "right": int(right), "answer": as_json(answer)}
    append(name, entry | ({"numbers": numbers} if numbers else {}))


def answers() -> dict[str, Any]:
    """Return the last right answer to each exercise, or the last answer if none was right.

    The answers have the form of `as_json`.
    """
    return {name: entry["answer"] for name, entry in _kept_tries().items()}


def numbers() -> dict[str, str]:
    """Return whose numbers each of the `answers` uses: a student's id, or "" for the lesson's."""
    kept = {name: str(entry.get("numbers", "")) for name, entry in _kept_tries().items()}
    return {name: student if student.isprintable() else "" for name, student in kept.items()}


def _kept_tries() -> dict[str, dict[str, Any]]:
    """Return the last right try of each exercise, or the last try if none was right."""
    found: dict[str, dict[str, Any]] = {}
    for text in _lines():
        for name, entry in _entries(text):
            is_better = _rights(entry) > 0 or _rights(found.get(name, {})) == 0
            if "answer" in entry and is_better:
                found[name] = entry
    return found


def predictions() -> dict[str, dict[str, Any]]:
    """Return {"said": …, "unit": …, "sure": …, "is": …} of the latest predictions; see `append`."""
    found: dict[str, dict[str, Any]] = {}
    for text in _lines():
        for name, entry in _entries(text):
            usable = {"said": is_answer, "is": is_answer, "unit": _is_text, "sure": _is_bool}
            kept = {
                key: entry[key] for key, fits in usable.items() if key in entry and fits(entry[key])
            }
            if kept and _is_text(name):
                found.setdefault(name, {}).update(kept)
    return found


def history() -> dict[str, list[dict[str, Any]]]:
    """Return all entries about each prediction, in the order in which they were written.

    These are the entries with a usable "said", "is" or "recalled".
    """
    found: dict[str, list[dict[str, Any]]] = {}
    for text in _lines():
        for name, entry in _entries(text):
            if any(is_answer(entry.get(key)) for key in ("said", "is", "recalled")):
                found.setdefault(name, []).append(entry)
    return found


def last(name: str, key: str) -> Any:
    """Return the last value that was stored for an entry under a key, or None."""
    found = None
    for text in _lines():
        for other, entry in _entries(text):
            if other == name and key in entry:
                found = entry[key]
    return found


def now() -> str:
    """Return the present time in ISO format, with the zone."""
    return datetime.now().astimezone().isoformat(timespec="seconds")


def student() -> str:
    """Return the id that was given to `own_numbers` last, or ""."""
    found = last(STUDENT, "id")
    return found if _is_text(found) else ""


def append(name: str, entry: dict[str, Any]) -> None:
    """Append a line about an exercise or a prediction to the file.

    If the file cannot be written, the reason is printed. The line is then kept in memory until a
    later call can write it. In predictions, "said" and "is" are a number, a list of numbers or a
    string, "unit" is a string, and "sure" is True or False.
    """
    extend([(name, entry)])


def extend(entries: Iterable[tuple[str, dict[str, Any]]]) -> None:
    """Append a line for each entry; see `append`."""
    # starts with the line end, so that a line that a full disk cut short spoils no other
    unsaved.extend(("\n" + json.dumps({name: entry})).encode() for name, entry in entries)
    if problem := storage_problem():
        print(problem)


def storage_problem() -> str:
    """Write what could not be written before; return why it cannot be and what to do, or "".

    This function does not create the file if there is nothing to write.
    """
    lost = "Tries and predictions cannot be saved"
    advice = (
        "They are lost when this program or notebook ends. Set FLOATBASE_HOME to a folder that you "
        "can write to."
    )
    try:
        path().parent.mkdir(parents=True, exist_ok=True)
        if path().exists():
            read_file(path(), LARGEST_DATA)
        elif not os.access(path().parent, os.W_OK):
            raise OSError(errno.EACCES, os.strerror(errno.EACCES))
        _write_unsaved()
    except OSError as error:
        return f"{lost} in {path().parent}: {error.strerror}. {advice}"
    except RuntimeError:
        return f"{lost}: there is no home folder. {advice}"
    return ""


def _write_unsaved() -> None:
    """Write the lines that are not in the file yet, each in a single write."""
    while True:
        try:
            line = unsaved.popleft()
        except IndexError:  # another thread may have written the last one
            return
        try:
            with open(path(), "ab", buffering=0, opener=open_file) as file:
                if file.write(line) < len(line):
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except BaseException:
            unsaved.appendleft(line)
            raise


def as_json(answer: Any) -> Any:
    """Convert an answer to a form that can be stored: numbers, strings, lists or a dict.

    `from_json` returns an answer that a judge treats in the same way. For a function, only the
    source code is kept.
    """
    try:
        kept = _as_json(answer)
        fits = len(json.dumps(kept)) <= _MAX_ANSWER_LENGTH
    except RecursionError:  # a list that contains itself
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
        return "(source code not available)"


def from_json(kept: Any) -> Any:
    """Restore an answer that `as_json` converted.

    A damaged form is a `ValueError` or another error of Python.
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


def _lines() -> list[bytes]:
    """Return the lines of the file, and those that could not be written yet."""
    try:
        written = read_file(path(), LARGEST_DATA).split(b"\n")
    except (OSError, RuntimeError):  # `storage_problem` says why
        written = []
    return [*written, *unsaved]


def _entries(text: bytes) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield name and entry of each exercise and prediction in a line, which may be damaged."""
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
    """Yield name, tries and right answers of each exercise in a line, which may be damaged."""
    for name, entry in _entries(text):
        tries, right = entry.get("tries"), entry.get("right")
        if type(tries) is int and type(right) is int and 0 <= right <= tries > 0:
            yield name, tries, right


def is_answer(value: Any) -> bool:
    """Return whether a value can be an answer: a number, a list of numbers, or a text."""
    numbers = value if isinstance(value, list) else [value]
    return _is_text(value) or (
        bool(numbers) and all(type(x) in (int, float) and abs(x) <= MAX_MAGNITUDE for x in numbers)
    )


def _rights(entry: dict[str, Any]) -> int:
    """Return how many tries of an entry were right; an entry from the site holds several tries."""
    right = entry.get("right")
    return right if type(right) is int else 0


def _is_bool(value: Any) -> bool:
    return isinstance(value, bool)


def _is_text(value: Any) -> bool:
    return isinstance(value, str) and value.isprintable()
