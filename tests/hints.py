"""What the exercises of a lesson say about answers."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from floatbase.lessons import all_exercises


def right(name: str, answer: Any) -> bool:
    """Whether an answer to the exercise of that name is right."""
    return all_exercises()[name].judge(answer).right


def missed(name: str, wrong: Iterable[tuple[Any, str]]) -> list[tuple[str, str]]:
    """Of wrong answers and what their hints must say, those that are told something else: what is missing, what is said."""
    said = [(hint, all_exercises()[name].judge(answer)) for answer, hint in wrong]
    return [(hint, repr(verdict)) for hint, verdict in said if verdict.right or hint not in verdict.text]
