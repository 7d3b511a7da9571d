"""Handing in: write answers and predictions to a file for the teacher. Nothing is sent."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import floatbase as fb
from floatbase._files import read_file, write_whole
from floatbase._validation import as_string, short_repr
from floatbase.errors import InputError
from floatbase.lessons import inventory, progress
from floatbase.lessons.exercises import all_exercises, folded, student_id
from floatbase.lessons.predictions import lesson_name
from floatbase.lessons.questions import all_questions

FILE_FORMAT = "answers to the floatbase course"


def hand_in(name: str, folder: str | Path = ".", *, id: str = "", lesson: str = "") -> Path:
    """Write your answers and predictions to a file for your teacher.

    A file that you have handed in before is replaced. If another learner's file or any other file
    has the same name, it is kept, and yours gets a number.

    Parameters
    ----------
    name : str
        Your name, as your teacher knows it.
    folder : str or Path, optional
        Folder of the file. By default the current folder, which in a lesson is the folder of the
        lessons.
    id : str, optional
        Your id in the class, if your teacher asks for it. By default the id that you gave to
        `own_numbers`.
    lesson : str, optional
        Name of a lesson, such as "05": hand in this lesson only. By default all lessons.

    Returns
    -------
    Path
        Path of the file.

    Raises
    ------
    InputError
        If the name, the folder, the id or the lesson is invalid, if there is nothing to hand in
        yet, or if the file cannot be written.
    """
    if not re.search(r"\w", as_string("name", name)) or not name.isprintable():
        raise InputError(
            'name must be the name by which your teacher knows you, as in hand_in("Ada Lovelace").'
        )
    if not isinstance(folder, (str, Path)) or "\0" in str(folder):
        raise InputError(f"folder must be the path of a folder, not {short_repr(folder)}.")
    student = student_id(id) if id else progress.student()
    lesson = lesson_name(lesson)
    known = {key: entry for key, entry in all_exercises().items() if _is_of(key, lesson)}
    tried = {key: entry for key, entry in progress.load().items() if _is_of(key, lesson)}
    predicted = {key: e for key, e in progress.predictions().items() if _is_of(key, lesson)}
    answers, letters = progress.answers(), inventory.stored_letters()
    if not tried and not predicted and not letters:
        raise InputError(
            f"There is nothing to hand in yet: {progress.path()} contains no answers and no "
            f"predictions{f' in lesson {lesson}' if lesson else ''}. {progress.storage_problem()}"
        )
    numbers = progress.numbers()
    exercises = {
        key: {**entry, "answer": answers.get(key), "numbers": numbers.get(key, "")}
        for key, entry in tried.items()
    }
    written = {
        "form": FILE_FORMAT, "name": name.strip(), "id": student, "lesson": lesson,
        "floatbase": fb.__version__,
        "time": progress.now(), "exercises": exercises,
        "predictions": predicted, "inventory": letters,
    }  # fmt: skip
    try:
        path = _own_path(Path(folder), name.strip(), lesson)
        try:
            write_whole(path, json.dumps(written, indent=1).encode())
        except OSError:
            if not path.stat().st_size:  # it was only reserved
                path.unlink()
            raise
    except (OSError, ValueError) as error:  # ValueError: a path that no file can have
        raise InputError(
            f"{getattr(error, 'filename', None) or short_repr(folder)} cannot be written: "
            f"{getattr(error, 'strerror', error)}. Choose another folder: hand_in(…, folder=…)."
        ) from None
    # an older course may have had other exercises
    solved = [key for key, entry in tried.items() if entry["right"] and key in known]
    done = f"{len(solved)} of {len(known)} exercises solved, {len(predicted)} predictions"
    print(f"{path}: {done}. Give this file to your teacher.")
    if lost := [key for key in solved if key not in answers]:
        print(
            f"An older version of floatbase did not save your answers to {', '.join(lost)}. Check "
            f"them once more, then hand in again."
        )
    personal = [key for key in tried if key in known and known[key].own]
    others = [key for key in personal if folded(numbers.get(key, "")) != folded(student)]
    if others and (progress.student() or any(numbers.values())):
        print(
            f"{', '.join(others)}: your answers do not use the numbers of {student}. If your "
            f'teacher requires them, run own_numbers("{student}") and check these answers again.'
        )
    return path


def import_answers(path: str | Path) -> None:
    """Add the answers that a page of the site saved to your progress.

    `review`, `recall`, `show_progress` and `hand_in` then know them. What is known already stays,
    but a right answer to an exercise replaces a wrong one.

    Parameters
    ----------
    path : str or Path
        File that *Save my answers* wrote.

    Raises
    ------
    InputError
        If the file cannot be read, or if it is not such a file.
    """
    try:
        found = json.loads(read_file(Path(path)))
    except (OSError, TypeError, ValueError, RecursionError) as error:
        reason = getattr(error, "strerror", None) or "it is not a file of answers"
        raise InputError(f"{path} cannot be read: {reason}.") from None
    kinds = ("predictions", "exercises")
    is_ours = isinstance(found, dict) and found.get("form") == FILE_FORMAT
    if not is_ours or not all(isinstance(found.get(kind), dict) for kind in kinds):
        raise InputError(f"{path} is not a file of answers.")
    entries = [*_predictions_in(found), *_tries_in(found), *_recalled_in(found)]
    progress.extend(entries)
    print(f"{len(entries)} answers and predictions were added.")


def _predictions_in(found: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield predictions in a page's file that are not known, and results of those that are."""
    known = progress.predictions()
    for name, entry in found["predictions"].items():
        if name not in all_questions() or not isinstance(entry, dict):
            continue
        if name not in known:
            yield name, entry
        elif "is" in entry and "is" not in known[name]:
            yield name, {"is": entry["is"]}


def _tries_in(found: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield tries in a page's file of exercises that were not tried, or not solved until now."""
    tried = progress.load()
    for name, entry in found["exercises"].items():
        if name not in all_exercises() or not isinstance(entry, dict):
            continue
        if name not in tried or (entry.get("right") and not tried[name]["right"]):
            yield name, entry


def _recalled_in(found: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield those answers to `recall` in a page's file that are not known yet."""
    recalled, known = found.get("recalled"), progress.history()
    for name, entries in recalled.items() if isinstance(recalled, dict) else ():
        if name not in all_questions() or not isinstance(entries, list):
            continue
        for entry in entries:
            if not isinstance(entry, dict) or not progress.is_answer(entry.get("recalled")):
                continue
            kept = {key: entry[key] for key in ("recalled", "knew", "time") if key in entry}
            if kept not in known.get(name, []):
                yield name, kept


def _is_of(name: str, lesson: str) -> bool:
    """Return whether an exercise or a prediction is part of a lesson; "" means all lessons."""
    return lesson in ("", name.split(".")[0])


def _own_path(folder: Path, name: str, lesson: str) -> Path:
    """Return the path of a learner's file: the first one that is free or holds this name."""
    stem = "answers-" + "_".join(re.findall(r"\w+", name)) + (lesson and f"-lesson{lesson}")
    path, number = folder / f"{stem}.json", 1
    while True:
        try:
            path.open("x").close()
        except FileExistsError:
            if _name_inside(path) != name:
                number += 1
                path = folder / f"{stem}-{number}.json"
                continue
        return path


def _name_inside(path: Path) -> str | None:
    """Return the learner's name in a file of answers, or None for another kind of file."""
    try:
        written: Any = None if path.is_symlink() else json.loads(read_file(path))
    except (OSError, ValueError, RecursionError):
        return None
    is_ours = isinstance(written, dict) and written.get("form") == FILE_FORMAT
    return written.get("name") if is_ours else None
