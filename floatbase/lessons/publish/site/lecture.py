"""Questions for the lecture: some predictions of each lesson, as a page and as slides."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from floatbase._files import write_whole
from floatbase.errors import InputError
from floatbase.lessons.publish.contents import title_of
from floatbase.lessons.publish.notebooks import read_notebook
from floatbase.lessons.publish.site.answers import results
from floatbase.lessons.publish.site.inline import inline_html
from floatbase.lessons.publish.site.live_robots import METADATA as LIVE_ROBOT
from floatbase.lessons.publish.workspace import lesson_notebooks
from floatbase.lessons.questions import Question, all_questions
from floatbase.lessons.recalling import capitalized

SLIDES = "lecture.html"  # in the site's static files
_ANNOUNCEMENT = re.compile(r"(?<=[.!?*]) [^.!?]*:$")  # of the cell below
_WHY = re.compile(r"\*\*Why\??\*\*:? *")


class LectureQuestion(NamedTuple):
    """Question for a lecture, with its answer."""

    question: Question
    result: str
    reason: str


@cache
def lecture_questions() -> dict[str, list[LectureQuestion]]:
    """Return the questions of each lesson, by its name."""
    found = {}
    for lesson, path in lesson_notebooks().items():
        cells = read_notebook(path).cells
        shown = results(cells)
        asked = [one for one in all_questions().values() if one.lecture and one.lesson == lesson]
        if missing := [question.name for question in asked if question.name not in shown]:
            raise InputError(
                f"{path.name} has no stored result of {missing[0]}. Run `python -m "
                f"floatbase.lessons.publish run {path}`."
            )
        found[lesson] = [
            LectureQuestion(one, shown[one.name]["shown"], one.reason or _reason(cells, one.name))
            for one in asked
        ]
    return found


def _reason(cells: list[Any], name: str) -> str:
    """Return the paragraph "Why?" below the result of a prediction, or the first paragraph."""
    paragraphs: list[str] = []
    is_shown = False
    for cell in cells:
        if is_shown and "prediction" in cell.metadata:
            break  # of the next question
        is_shown |= name in results([cell])
        if is_shown and cell.cell_type == "markdown":
            paragraphs += [" ".join(part.split()) for part in cell.source.split("\n\n")]
    why = (part for part in paragraphs if _WHY.match(part))
    usable = (part for part in paragraphs if part[:1] not in "#$|<" and not part.endswith(":"))
    reason = _WHY.sub("", next(why, "") or next(usable, ""), count=1)
    return capitalized(_ANNOUNCEMENT.sub("", reason))


def page() -> str:
    """Write the page with all questions, in Markdown."""
    *most, last = (lesson for lesson in lesson_notebooks() if _has_robot(lesson))
    robots = f"{', '.join(most)} and {last}"
    lines = [
        "# Questions for the lecture",
        "",
        "Four questions of each lesson, for a vote before the explanation. Ask, let students vote, "
        "discuss with their neighbours, and vote again. Then show the answer.",
        "",
        f'<a href="_static/{SLIDES}">All questions as slides</a> are one file that needs no '
        "network. The arrow keys turn the pages, and the space bar shows the answer. For lessons "
        f"{robots}, the live robot on the lesson's page is the best answer: change one "
        "thing, and push.",
    ]
    for lesson, path in lesson_notebooks().items():
        lines += ["", f"## {title_of(path)}"]
        for number, (question, result, reason) in enumerate(lecture_questions()[lesson], 1):
            options = f" *{question.form}*" if question.choices else f" ({question.form})"
            lines += [
                "",
                f"**{number}.** {question.context} **{_question(question)}**{options}",
                "",
                f":::{{dropdown}} Answer ({question.name})\n{result}. {reason}\n:::",
            ]
    return "\n".join(lines) + "\n"


def _has_robot(lesson: str) -> bool:
    return LIVE_ROBOT in read_notebook(lesson_notebooks()[lesson]).metadata


def _question(question: Question) -> str:
    return capitalized(question.text.replace("**", ""))


def slides(in_site: bool = False) -> str:
    """Write all questions as slides, in one HTML file; in the site they link to live robots."""
    made = []
    for lesson, path in lesson_notebooks().items():
        made.append(f"<section><h1>{inline_html(title_of(path))}</h1></section>")
        for question, result, reason in lecture_questions()[lesson]:
            options = f"<p>({inline_html(question.form)})</p>"
            if question.choices:
                listed = "".join(f"<li>{inline_html(choice)}</li>" for choice in question.choices)
                options = f"<ol type=A>{listed}</ol>"
            live = ""
            if in_site and _has_robot(lesson):
                address = f"../lessons/{path.stem}.html"
                live = f"<p>Try it: <a href='{address}'>the live robot</a> of this lesson.</p>"
            made.append(
                f"<section><p class=context>{inline_html(question.context)}</p>"
                f"<h2>{inline_html(_question(question))}</h2>{options}"
                f"<div class=answer><p><strong>{inline_html(result)}</strong></p>"
                f"<p>{inline_html(reason)}</p>{live}</div>"
                f"<footer>{question.name}</footer></section>"
            )
    page = Path(__file__).with_name("slides.html").read_text(encoding="utf-8")
    return page.replace("SECTIONS", "\n".join(made))


def write_slides(path: Path, in_site: bool = False) -> None:
    """Write the slides to a file; see `slides`."""
    write_whole(path, slides(in_site).encode())
