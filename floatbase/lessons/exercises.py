"""Exercises that check themselves: `check` says right, or what kind of mistake it looks like,
without giving the answer.

An exercise stands once, in the file `exercises` of its lesson: statement, stub, solution, judge.
The judge computes the right value by other expressions than the solution does.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np

from floatbase.affine import Quadratic
from floatbase.errors import unknown_name
from floatbase.lessons import progress
from floatbase.lessons.judges import Example, Verdict, array_or_verdict

TRIES_BEFORE_REVEAL = 2  # so many before `reveal` shows a solution


@dataclass(frozen=True, eq=False)
class Exercise:
    """One exercise of a lesson.

    name: of the lesson, and its own number, "01.2" or "C.2".
    statement: what is to be found, with shape, unit and frame.
    stub: the code that a learner starts from; it runs.
    solution: the code that replaces the stub.
    judge: answer -> `Verdict`.
    examples: gives answers, and the names of the hints that they must get, beside those that the
        judge gives itself.
    explanation: why the solution is right, shown with it.
    namespace: gives what the stub uses of the lesson, name -> value; numpy it has.
    """

    name: str
    statement: str
    stub: str
    solution: str
    judge: Callable[[Any], Verdict]
    explanation: str = ""
    namespace: Callable[[], Mapping[str, Any]] = dict
    examples: Callable[[], Iterable[Example]] = tuple

    def placeholder(self) -> Any:
        """What stands there before anybody answers: the stub's variable, or a tuple of them."""
        made: dict[str, Any] = {}
        exec(self.stub, {"np": np, **self.namespace()}, made)
        return tuple(made.values()) if len(made) > 1 else next(iter(made.values()))


def all_exercises() -> dict[str, Exercise]:
    """All exercises of all lessons: name, such as "00.1", -> `Exercise`."""
    found: dict[str, Exercise] = {}
    for module in pkgutil.iter_modules([str(Path(__file__).parent)]):
        if module.name.startswith("lesson"):
            for exercise in import_module(f"floatbase.lessons.{module.name}.exercises").EXERCISES:
                found[exercise.name] = exercise
    return dict(sorted(found.items()))


def check(name: str, answer: Any) -> Verdict:
    """Judge an answer to the exercise of that name, such as "00.1", and count the try; an unchanged
    stub is none.

    Raises `UnknownNameError` for a name that does not exist.
    """
    exercise = _find_exercise(name)
    verdict = exercise.judge(answer)
    if (
        answer is not None
        and answer is not Ellipsis
        and not _is_placeholder(answer, exercise.placeholder())
    ):
        progress.record_try(name, verdict.right, answer)
    return verdict


def reveal(name: str) -> None:
    """Print the solution of an exercise and why, once it has been tried twice or solved."""
    exercise, tried = _find_exercise(name), progress.load().get(name, {"tries": 0, "right": 0})
    if tried["tries"] < TRIES_BEFORE_REVEAL and not tried["right"]:
        remaining = TRIES_BEFORE_REVEAL - tried["tries"]
        print(
            f'Try {"once" if remaining == 1 else "twice"} more first: run check("{name}", …) on an '
            f"answer of your own."
        )
        return
    print(exercise.solution)
    if exercise.explanation:
        print(f"\n{exercise.explanation}")


def show_progress() -> None:
    """Print what was solved, lesson by lesson: ✓ solved, ✗ tried, · not tried; and why tries cannot
    be kept, if so.
    """
    tried, known = progress.load(), all_exercises()
    marks = {name: _progress_mark(tried.get(name)) for name in known}
    for lesson in sorted({name.split(".")[0] for name in known}):
        here = [name for name in known if name.startswith(f"{lesson}.")]
        print(f"lesson {lesson}  " + "  ".join(f"{name} {marks[name]}" for name in here))
    print(f"solved: {sum(mark == '✓' for mark in marks.values())} of {len(known)}")
    if problem := progress.storage_problem():
        print(problem)


def _is_placeholder(answer: Any, placeholder: Any) -> bool:
    """Whether an answer is the placeholder still, up to the rounding of another machine; a function
    by its code.
    """
    if isinstance(placeholder, FunctionType):
        return _bytecode(answer) == _bytecode(placeholder)
    if isinstance(placeholder, list) and all(isinstance(part, str) for part in placeholder):
        return isinstance(answer, list) and list(map(str, answer)) == placeholder
    if isinstance(placeholder, Quadratic):
        parts = ("H", "g", "c")
        return isinstance(answer, Quadratic) and all(
            _is_placeholder(getattr(answer, p), getattr(placeholder, p)) for p in parts
        )
    given = array_or_verdict(answer, np.shape(placeholder))
    return not isinstance(given, Verdict) and np.allclose(given, placeholder, rtol=1e-6, atol=1e-6)


def _bytecode(function: Any) -> tuple[Any, ...] | None:
    """What a function does, whatever it is called and wherever it stands; None for anything but a
    function in Python.
    """
    code = getattr(function, "__code__", None)
    return code and (code.co_code, code.co_consts, code.co_names, code.co_varnames)


def _progress_mark(tried: dict[str, int] | None) -> str:
    return "·" if tried is None else "✓" if tried["right"] else "✗"


def _find_exercise(name: str) -> Exercise:
    known = all_exercises()
    if name not in known:
        raise unknown_name("exercise", name, known)
    return known[name]
