"""Forms for predictions and exercises in the pages of the site, judged in the reader's browser.

A page has the intervals and choices that count as right. They come from the results that the cells
of the lesson show with `compare`, and from the judges of its exercises.
"""

from __future__ import annotations

import html
import json
import re
from collections.abc import Iterable
from typing import Any

import numpy as np
from nbformat.v4 import new_markdown_cell

from floatbase.lessons.exercises import Exercise
from floatbase.lessons.judges import NEAR_MISS, NumericJudge, ShapeJudge, general_hint
from floatbase.lessons.predictions import RESULT_MIME, accepted, lesson_name
from floatbase.lessons.questions import Question
from floatbase.lessons.submission import FILE_FORMAT

MAX_NUMBERS = 4  # of an answer that is typed into a page
_LIVE = "../installation.md"
_LINK = f'<a href="{_LIVE.removesuffix(".md")}.html">the live lesson</a>'


def results(cells: Iterable[Any]) -> dict[str, dict[str, Any]]:
    """Return the results that the cells of a lesson show with `compare`, by prediction."""
    outputs = (output.get("data", {}) for cell in cells for output in cell.get("outputs", []))
    shown = (data[RESULT_MIME] for data in outputs if RESULT_MIME in data)
    return {result["name"]: result for result in shown}


def prediction_form(question: Question, result: dict[str, Any] | None) -> Any | None:
    """Return the form of a prediction as a cell, or None if its result is not known."""
    data = answer_data(question, result)
    text = f"{question.name}, your prediction. You can make it in {_LINK}."
    return element("prediction", data, text) if data else None


def answer_data(question: Question, result: dict[str, Any] | None) -> dict[str, Any] | None:
    """Return what a page needs to ask for a prediction and to judge it."""
    if result is None or not question.fits(result["result"]):
        return None
    return {
        "name": question.name, "unit": question.unit, "count": question.count,
        "choices": list(question.choices), "result": result["result"],
        "right": accepted(result["result"], question.unit), "shown": result["shown"],
    }  # fmt: skip


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
