"""Forms for predictions and exercises in the pages of the site, judged in the reader's browser.

A page has the intervals and choices that count as right. They come from the results that the lesson
prints and from the judges of its exercises.
"""

from __future__ import annotations

import html
import json
import re
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from nbformat.v4 import new_markdown_cell

from floatbase.lessons.exercises import Exercise
from floatbase.lessons.judges import NEAR_MISS, NumericJudge, ShapeJudge, general_hint
from floatbase.lessons.predictions import accepted, lesson_name
from floatbase.lessons.questions import predict_call
from floatbase.lessons.submission import FILE_FORMAT

MAX_NUMBERS = 4  # of an answer that is typed into a page
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e-?\d+)?")
_LIVE = "../installation.md"
_LINK = f'<a href="{_LIVE.removesuffix(".md")}.html">the live lesson</a>'


def printed_results(cells: Iterable[Any]) -> dict[str, str]:
    """Return the results that the cells of a lesson print with `compare`, by prediction."""
    found = {}
    for cell in cells:
        for output in cell.get("outputs", []):
            if output.output_type == "stream":
                lines = re.findall(r"^(\w+\.[a-z]): (.+)$", output.text, re.MULTILINE)
                found.update({name: text for name, text in lines if not text.startswith("skipped")})
    return found


def prediction_form(source: str, results: dict[str, str]) -> Any | None:
    """Return the form of a prediction as a cell, or None if its result is not known."""
    name, given = predict_call(source)
    data = answer_data(name, results.get(name, ""), **given)
    text = f"{name}, your prediction. You can make it in {_LINK}."
    return element("prediction", data, text) if data else None


def answer_data(
    name: str, printed: str, choices: Sequence[str] = (), unit: str = "", count: int = 1
) -> dict[str, Any] | None:
    """Return what a page needs to ask for a prediction and to judge it."""
    result = _read_result(printed, choices, unit, count)
    if result is None:
        return None
    return {
        "name": name, "unit": unit, "count": count, "choices": list(choices), "result": result,
        "right": accepted(result, unit), "shown": printed,
    }  # fmt: skip


def _read_result(printed: str, choices: Sequence[str], unit: str, count: int) -> Any:
    """Return the result that a lesson prints, or None if it cannot be read."""
    if choices:
        return printed if printed in choices else None
    texts = _NUMBER.findall(printed.removesuffix(unit))
    if len(texts) != count:
        return None
    numbers = [float(text) if re.search("[.e]", text) or unit else int(text) for text in texts]
    return numbers[0] if count == 1 else numbers


def exercise_form(exercise: Exercise) -> Any | None:
    """Return the form of an exercise as a cell, or None if its answer is not a few numbers."""
    judge = exercise.judge.judge if isinstance(exercise.judge, ShapeJudge) else exercise.judge
    if not isinstance(judge, NumericJudge):
        return None
    right = np.asarray(judge.right(), dtype=np.float64)
    if right.ndim > 1 or right.size > MAX_NUMBERS:
        return None
    cases = [{"right": _interval(right, judge.tolerance), "text": judge.praise}]
    for _, wrong, text in judge.mistakes():
        value = np.asarray(wrong, dtype=np.float64)
        if value.shape == right.shape:
            cases.append({"right": _interval(value, judge.tolerance), "text": text})
    if not judge.is_count:
        near, sign = max(NEAR_MISS, judge.tolerance), -right
        cases.append({"right": _interval(right, near), "text": general_hint("nearly")})
        cases.append({"right": _interval(sign, judge.tolerance), "text": general_hint("sign")})
    data = {
        "name": exercise.name, "unit": "", "count": right.size, "choices": [], "cases": cases,
        "otherwise": general_hint("unknown_count" if judge.is_count else "unknown"),
    }  # fmt: skip
    return element("exercise", data, f"{exercise.name}: you can check your answer in {_LINK}.")


def _interval(value: Any, tolerance: float) -> list[tuple[float, float]]:
    """Return the lowest and the highest number that a judge takes as each number of a value."""
    numbers = np.atleast_1d(value)
    margin = tolerance * (1e-9 + np.max(np.abs(numbers)))
    return [(float(x - margin), float(x + margin)) for x in numbers]


def review_element(source: str) -> Any | None:
    """Return the list of the reader's answers as a cell, or None if the cell shows no review."""
    found = re.search(r'^review\((?:"(\w+)")?\)', source, re.MULTILINE)
    if not found:
        return None
    data = {"lesson": lesson_name(found[1] or ""), "form": FILE_FORMAT}
    return element("review", data, f"Your predictions appear here, and in {_LINK}.")


def element(kind: str, data: dict[str, Any], text: str) -> Any:
    """Return a cell that the page's script fills. Without a script, the cell shows `text`."""
    return new_markdown_cell(as_markdown(element_html(kind, data, text)))


def element_html(kind: str, data: dict[str, Any], text: str) -> str:
    """Return an element that the page's script fills; see `element`."""
    written = html.escape(json.dumps(data, ensure_ascii=False))
    return f'<div class="live answers-{kind}" data-answers="{written}"><p>{text}</p></div>'


def as_markdown(raw: str) -> str:
    """Return HTML as a part of a Markdown page."""
    return f"```{{raw}} html\n{raw}\n```"
