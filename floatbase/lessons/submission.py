"""Handing in: write answers and predictions to a file for the teacher. Nothing is sent."""

from __future__ import annotations

import json
import re
from datetime import datetime
from pathlib import Path

import floatbase as fb
from floatbase._validation import as_string
from floatbase.errors import InputError
from floatbase.lessons import progress
from floatbase.lessons.exercises import all_exercises

FILE_FORMAT = "answers to the floatbase course"


def hand_in(name: str, folder: str | Path = ".") -> Path:
    """Write your answers and predictions to a file for your teacher.

    A file that you have handed in before is replaced.

    Parameters
    ----------
    name : str
        Your name, as your teacher knows it.
    folder : str or Path, optional
        Folder of the file. By default the current folder, which in a lesson is the folder of the
        lessons.

    Returns
    -------
    Path
        Path of the file.

    Raises
    ------
    InputError
        If there is nothing to hand in yet, or if the file cannot be written.
    """
    if not re.search(r"\w", as_string("name", name)) or not name.isprintable():
        raise InputError(
            'name must be the name by which your teacher knows you, as in hand_in("Ada Lovelace").'
        )
    tried, answers, predicted = progress.load(), progress.answers(), progress.predictions()
    if not tried and not predicted:
        raise InputError(
            f"There is nothing to hand in yet: {progress.path()} contains no answers and no "
            f"predictions."
        )
    exercises = {key: {**entry, "answer": answers.get(key)} for key, entry in tried.items()}
    written = {
        "form": FILE_FORMAT, "name": name.strip(), "floatbase": fb.__version__,
        "time": datetime.now().astimezone().isoformat(timespec="seconds"), "exercises": exercises,
        "predictions": predicted,
    }  # fmt: skip
    file_name = "_".join(re.findall(r"\w+", name))
    path = Path(folder) / f"answers-{file_name}.json"
    try:
        path.write_text(json.dumps(written, indent=1), encoding="utf-8")
    except OSError as error:
        raise InputError(
            f"{path} cannot be written: {error.strerror}. Choose another folder: "
            f"hand_in(…, folder=…)."
        ) from None
    known = all_exercises()  # an older course may have had others
    solved = [key for key, entry in tried.items() if entry["right"] and key in known]
    done = f"{len(solved)} of {len(known)} exercises solved, {len(predicted)} predictions"
    print(f"{path}: {done}. Give this file to your teacher.")
    if lost := [key for key in solved if key not in answers]:
        print(
            f"An older version of floatbase did not save your answers to {', '.join(lost)}. Check "
            f"them once more, then hand in again."
        )
    return path
