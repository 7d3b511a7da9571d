"""Handing in: what a learner has answered and predicted, as one file to give to a teacher. Nothing
is sent.
"""

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
    """Write all answers and predictions of this learner into one file, to be given to a teacher;
    returns where it is.

    name: the learner's, as the teacher knows it. folder: where to; in a lesson, the folder of the
        lessons.
    A file that the same learner has handed in before is replaced. Raises `InputError` where there
    is nothing to hand in yet, or where no file can be written.
    """
    if not re.search(r"\w", as_string("name", name)) or not name.isprintable():
        raise InputError(
            'name must be the name that your teacher knows you by, as in hand_in("Ada Lovelace").'
        )
    tried, answers, predicted = progress.load(), progress.answers(), progress.predictions()
    if not tried and not predicted:
        raise InputError(
            f"there is nothing to hand in yet: no answer and no prediction is kept in "
            f"{progress.path()}."
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
            f"{path} cannot be written: {error.strerror}. Name a folder: hand_in(…, folder=…)."
        ) from None
    known = all_exercises()  # an older course may have had others
    solved = [key for key, entry in tried.items() if entry["right"] and key in known]
    done = f"{len(solved)} of {len(known)} exercises solved, {len(predicted)} predictions"
    print(f"{path}: {done}. Give this file to your teacher.")
    if lost := [key for key in solved if key not in answers]:
        print(
            f"An older floatbase did not keep your answers to {', '.join(lost)}: check them once "
            f"more, then hand in again."
        )
    return path
