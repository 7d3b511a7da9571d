"""Ask questions from earlier lessons again in the pages of the site, some days later.

The pages load one script with the texts and the results of these questions. The reader's browser
decides which questions are due, by the rule of `floatbase.lessons.recalling`.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from datetime import timedelta
from pathlib import Path
from typing import Any

from floatbase._files import write_whole
from floatbase.lessons import recalling
from floatbase.lessons.publish.notebooks import read_notebook
from floatbase.lessons.publish.site.answers import answer_data, element_html, results
from floatbase.lessons.publish.site.inline import inline_html
from floatbase.lessons.publish.workspace import lesson_notebooks
from floatbase.lessons.questions import Question, all_questions

SCRIPT = "recall-questions.js"  # in the site's static files
_NOTE = "Questions from earlier lessons come back here and in the live lesson."


def recall_data(lessons: Iterable[Path]) -> dict[str, Any]:
    """Return the questions that may be asked again, and the rule that decides when."""
    addresses = {path.name.split("_")[0]: f"lessons/{path.stem}.html" for path in lessons}
    found: dict[str, Any] = {}
    for path in lesson_notebooks().values():
        found |= results(read_notebook(path).cells)
    questions = {}
    for name, question in all_questions().items():
        data = answer_data(question, found.get(name)) if question.recall else None
        if data:
            questions[name] = data | _texts(question) | {"address": addresses.get(question.lesson)}
    return {"rule": rule(), "questions": questions}


def rule() -> dict[str, Any]:
    """Return the numbers of the rule that decides which questions are due; pauses in hours."""
    hour = timedelta(hours=1)
    return {
        "perDay": recalling.PER_DAY,
        "first": recalling.FIRST_PAUSE / hour,
        "growth": recalling.GROWTH,
        "longest": recalling.LONGEST_PAUSE / hour,
        "missed": recalling.MISSED_PAUSE / hour,
        "sureAndMissed": recalling.SURE_AND_MISSED_PAUSE / hour,
        "old": recalling.OLD / hour,
        "time": recalling.TIME,
    }


def _texts(question: Question) -> dict[str, str]:
    return {
        "lesson": question.lesson,
        "topic": inline_html(question.topic),
        "context": inline_html(question.context),
        "text": inline_html(recalling.capitalized(question.text)),
    }


def recall_box(static: str, offers_first: bool = False) -> str:
    """Return the box that asks the questions that are due, as HTML.

    offers_first: whether it asks a reader who has predicted nothing yet a first question.
    """
    box = element_html("recall", {"offersFirst": offers_first}, _NOTE)
    return f'<script src="{static}{SCRIPT}"></script>\n{box}'


def write_script(lessons: Iterable[Path], folder: Path) -> None:
    """Write the script with the questions."""
    text = json.dumps(recall_data(lessons), ensure_ascii=False, separators=(",", ":"))
    write_whole(folder / SCRIPT, f"globalThis.floatbaseRecall = {text};\n".encode())
