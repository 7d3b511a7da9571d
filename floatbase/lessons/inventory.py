"""Concept inventory for contact and floating bases: 27 questions before and after the course.

The questions are in `inventory.toml`. The inventory has not been validated on a class.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any

from floatbase._validation import as_string
from floatbase.errors import InputError
from floatbase.lessons import progress
from floatbase.lessons.records import read_toml, records

TIMES = ("before", "after")
LETTERS = "abcd"
SKIPPED = "-"
_ENTRY = "inventory {}"  # in the progress file


@dataclass(frozen=True)
class InventoryQuestion:
    """Question with four answers, and the known mistakes behind the wrong answers, by letter."""

    concept: str
    text: str
    a: str
    b: str
    c: str
    d: str
    right: str
    mistakes: dict[str, str] = field(default_factory=dict)

    @property
    def answers(self) -> dict[str, str]:
        """The four answers by letter."""
        return {"a": self.a, "b": self.b, "c": self.c, "d": self.d}


_FILE = Path(__file__).with_name("inventory.toml")
QUESTIONS = records(read_toml(_FILE)["question"], InventoryQuestion)
CONCEPTS = {
    concept: list(some) for concept, some in groupby(QUESTIONS, lambda question: question.concept)
}
KEY = "".join(question.right for question in QUESTIONS)


def inventory(time: str = "", letters: str = "") -> None:
    """Print the questions of the concept inventory, or store your answers to them."""
    if not time:
        for number, question in enumerate(QUESTIONS, 1):
            print(f"{number}. {question.text}")
            for letter, answer in question.answers.items():
                print(f"   {letter}) {answer}")
        print(f'Answer with inventory("before", "…"), {len(QUESTIONS)} letters, - for no answer.')
        return
    if time not in TIMES:
        raise InputError(f"time must be one of {', '.join(TIMES)}, not {time!r}.")
    given = "".join(as_string("letters", letters).lower().split())
    if not _are_letters(given):
        raise InputError(
            f"letters must be {len(QUESTIONS)} letters from {LETTERS}, or {SKIPPED} for no answer; "
            f"you gave {len(given)}."
        )
    progress.append(_ENTRY.format(time), {"letters": given, "time": progress.now()})
    print(f"hand_in(…) includes your answers {time} the course.")


def _are_letters(given: Any) -> bool:
    return (
        isinstance(given, str)
        and len(given) == len(QUESTIONS)
        and set(given) <= {*LETTERS, SKIPPED}
    )


def stored_letters() -> dict[str, str]:
    """Return the learner's last answers, by time."""
    found = {time: progress.last(_ENTRY.format(time), "letters") for time in TIMES}
    return {time: letters for time, letters in found.items() if _are_letters(letters)}


def scores(letters: Any) -> dict[str, int] | None:
    """Return the number of right answers for each concept, or None if these are no answers."""
    if not _are_letters(letters):
        return None
    marks = iter(given == right for given, right in zip(letters, KEY, strict=True))
    return {name: sum(next(marks) for _ in some) for name, some in CONCEPTS.items()}


def mistakes(letters: str) -> list[str]:
    """Return the mistakes that led to wrong answers, such as "00.1:weight_alone"."""
    return [
        question.mistakes[letter]
        for letter, question in zip(letters, QUESTIONS, strict=True)
        if letter in question.mistakes
    ]


def gain_report(answers: list[dict[str, Any]]) -> str:
    """Write the gain of a class for each concept."""
    found = [(scores(one.get("before")), scores(one.get("after"))) for one in answers]
    both = [(first, last) for first, last in found if first is not None and last is not None]
    if not both:
        raise InputError("There is no file with answers to the inventory before and after.")
    lines = [f"{'concept':24}before  after  gain ({len(both)} learners)"]
    rows = {name: [name] for name in CONCEPTS} | {"all": list(CONCEPTS)}
    for label, names in rows.items():
        most = len(both) * sum(len(CONCEPTS[name]) for name in names)
        first, last = (sum(one[i][name] for one in both for name in names) for i in (0, 1))
        gain = f"{(last - first) / (most - first):5.2f}" if first < most else "    -"
        lines.append(f"{label:24}{first / most:6.0%} {last / most:6.0%} {gain}")
    return "\n".join(lines)
