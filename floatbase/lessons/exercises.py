"""Exercises that check themselves and give hints without giving the answer away.

Each exercise is defined once, in the module `exercises` of its lesson, with its stub, solution
and judge. The judge computes the right value in a different way from the solution.
"""

from __future__ import annotations

import hashlib
import pkgutil
import unicodedata
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np

from floatbase._validation import as_string
from floatbase.affine import Quadratic
from floatbase.errors import InputError, unknown_name
from floatbase.lessons import assignment, progress
from floatbase.lessons.judges import NO_ANSWER, Example, Verdict, array_or_verdict

PRINTED_NUMBER = "printed_number"  # hint of an answer that is right for the lesson's number
TRIES_BEFORE_REVEAL = 2  # tries before `reveal` shows a solution


@dataclass(frozen=True, eq=False)
class OwnNumber:
    """Number in an exercise that can differ from student to student."""

    quantity: str  # such as "the acceleration"
    unit: str
    printed: float  # the number in the lesson
    values: Sequence[float]
    judge: Callable[[float], Callable[[Any], Verdict]]

    def value(self, exercise: str, student: str) -> float:
        """Return the number of a student, which is always the same on every machine."""
        digest = hashlib.sha256(f"{exercise} {folded(student)}".encode()).digest()
        return self.values[int.from_bytes(digest[:4]) % len(self.values)]

    def amount(self, value: float) -> str:
        """Write a number with its unit."""
        return f"{value:g} {self.unit}".strip()


@dataclass(frozen=True, eq=False)
class Exercise:
    """Exercise of a lesson."""

    name: str
    stub: str
    solution: str
    judge: Callable[[Any], Verdict]
    explanation: str = ""
    namespace: Callable[[], Mapping[str, Any]] = dict
    examples: Callable[[], Iterable[Example]] = tuple
    own: OwnNumber | None = None

    def verdict_on(self, answer: Any, student: str) -> Verdict:
        """Judge an answer by a student's own number; without a student, by the printed number."""
        if self.own is None or not student:
            return self.judge(answer)
        value = self.own.value(self.name, student)
        verdict = self.own.judge(value)(answer)
        if verdict.right or not self.judge(answer).right:
            return verdict
        printed, own = self.own.amount(self.own.printed), self.own.amount(value)
        text = f"This is right for {printed}, but your number is {own}."
        return Verdict(False, text, PRINTED_NUMBER)

    def own_number(self, student: str) -> str:
        """Return a student's own number in words, or "" if there is none."""
        if self.own is None or not student:
            return ""
        return f"{self.own.quantity} is {self.own.amount(self.own.value(self.name, student))}"

    def placeholder(self) -> Any:
        """Return the answer in the stub: its variable, or a tuple if it has several."""
        made: dict[str, Any] = {}
        exec(self.stub, {"np": np, **self.namespace()}, made)
        return tuple(made.values()) if len(made) > 1 else next(iter(made.values()))


def all_exercises() -> dict[str, Exercise]:
    """Return all exercises of all lessons.

    Returns
    -------
    dict of str to Exercise
        The exercises by name, such as "00.1", in order.
    """
    found: dict[str, Exercise] = {}
    for module in pkgutil.iter_modules([str(Path(__file__).parent)]):
        if module.name.startswith("lesson"):
            for exercise in import_module(f"floatbase.lessons.{module.name}.exercises").EXERCISES:
                found[exercise.name] = exercise
    return dict(sorted(found.items()))


def check(name: str, answer: Any) -> Verdict:
    """Check an answer to an exercise and record the try.

    An unchanged stub does not count as a try; its comment begins with "Your turn".

    Parameters
    ----------
    name : str
        Name of the exercise, such as "00.1".
    answer : object
        The answer: a number, an array or whatever the exercise asks for.

    Returns
    -------
    Verdict
        Whether the answer is right, and a comment. A notebook shows it as a line of text.

    Raises
    ------
    UnknownNameError
        If there is no such exercise.
    """
    exercise, student = _find_exercise(name), progress.student()
    verdict = exercise.verdict_on(answer, student)
    if answer is None or answer is Ellipsis or _is_placeholder(answer, exercise.placeholder()):
        if verdict.hint.startswith("unknown"):
            verdict = NO_ANSWER
        verdict = replace(verdict, is_try=False)
    else:
        numbers = student if exercise.own else ""
        progress.record_try(name, verdict.right, answer, numbers)
    number = exercise.own_number(student)
    if verdict.right or verdict.hint == PRINTED_NUMBER or not number:
        return verdict
    return replace(verdict, text=f"{verdict.text} With your number, {number}.")


def reveal(name: str) -> None:
    """Print the solution of an exercise and its explanation, after two tries or a right answer.

    Parameters
    ----------
    name : str
        Name of the exercise, such as "00.1".

    Raises
    ------
    UnknownNameError
        If there is no such exercise.

    Notes
    -----
    The package of a class may have no solutions. It then says when they appear and who has them.
    """
    exercise, tried = _find_exercise(name), progress.load().get(name, {"tries": 0, "right": 0})
    if tried["tries"] < TRIES_BEFORE_REVEAL and not tried["right"]:
        remaining = TRIES_BEFORE_REVEAL - tried["tries"]
        print(
            f'Try {"once" if remaining == 1 else "twice"} more first: run check("{name}", …) with '
            f"your own answer."
        )
        return
    if not exercise.solution:
        print(assignment.where_solutions_are(name))
        return
    print(exercise.solution)
    if number := exercise.own_number(progress.student()):
        print(f"\nThis is the solution with the number in the lesson. With yours, {number}.")
    if exercise.explanation:
        print(f"\n{exercise.explanation}")


def own_numbers(student: str) -> None:
    """Use your own numbers in the exercises that allow it, and print these numbers.

    `check` uses them from now on, until another id is given.

    Parameters
    ----------
    student : str
        Your id in the class, such as "s123456". Upper and lower case are the same.

    Raises
    ------
    InputError
        If the id is empty, too long or not printable.
    """
    student = student_id(student)
    progress.append(progress.STUDENT, {"id": student})
    print(f"Numbers of {student}:")
    for name, exercise in all_exercises().items():
        if number := exercise.own_number(student):
            print(f"{name}: {number}.")


def student_id(given: Any) -> str:
    """Check a student's id and return it without spaces around it."""
    text = as_string("id", given).strip()
    if not text or not text.isprintable() or len(text) > 80:
        raise InputError('id must be your id in the class, such as "s123456".')
    return text


def folded(name: str) -> str:
    """Return a name or an id in a form that ignores upper case, spaces and the kind of accents."""
    return " ".join(unicodedata.normalize("NFKC", name).casefold().split())


def show_progress() -> None:
    """Print the progress in each lesson: ✓ solved, ✗ tried, · not tried.

    If tries cannot be saved, the reason is printed as well.
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
    """Return whether an answer is still the placeholder."""
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
    """Return the code of a Python function without its name and place; None for anything else."""
    code = getattr(function, "__code__", None)
    return code and (code.co_code, code.co_consts, code.co_names, code.co_varnames)


def _progress_mark(tried: dict[str, int] | None) -> str:
    return "·" if tried is None else "✓" if tried["right"] else "✗"


def _find_exercise(name: str) -> Exercise:
    known = all_exercises()
    if not isinstance(name, str) or name not in known:
        raise unknown_name("exercise", name, known)
    return known[name]
