"""Questions for the lecture: four predictions of each lesson, as a page and as slides."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import NamedTuple

from floatbase._files import write_whole
from floatbase.lessons.publish.contents import title_of
from floatbase.lessons.publish.notebooks import read_notebook
from floatbase.lessons.publish.site.answers import printed_results
from floatbase.lessons.publish.site.inline import inline_html
from floatbase.lessons.publish.site.live_robots import LESSON_ROBOTS
from floatbase.lessons.publish.site.reasons import REASONS
from floatbase.lessons.publish.workspace import NOTEBOOKS
from floatbase.lessons.questions import Question, all_questions
from floatbase.lessons.recalling import capitalized

SLIDES = "lecture.html"  # in the site's static files
# four predictions of each lesson that a class can vote on without the lesson's pictures
LECTURE = {
    "00": "abcd", "01": "efgh", "02": "acik", "03": "hijm", "04": "adgh", "05": "bcek",
    "06": "beij", "07": "abgh", "08": "abfg", "09": "cfij", "10": "abde", "A": "cdeg", "B": "aefh",
    "C": "abce", "P": "fghi", "X": "bceg",
}  # fmt: skip
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
    for path in sorted(NOTEBOOKS.glob("*.ipynb")):
        lesson = path.name.split("_")[0]
        cells = read_notebook(path).cells
        results = printed_results(cell for cell in cells if cell.cell_type == "code")
        names = [f"{lesson}.{letter}" for letter in LECTURE[lesson]]
        found[lesson] = [
            LectureQuestion(all_questions()[name], results[name], _reason(cells, name))
            for name in names
        ]
    return found


def _reason(cells: list[object], name: str) -> str:
    """Return the paragraph "Why?" below the result of a prediction, or the first paragraph."""
    if name in REASONS:
        return REASONS[name]
    paragraphs: list[str] = []
    is_shown = False
    for cell in cells:
        source, kind = getattr(cell, "source", ""), getattr(cell, "cell_type", "")
        if kind == "code":
            if is_shown and "predict(" in source:
                break  # of the next question
            is_shown |= f'compare("{name}"' in source
        elif is_shown:
            paragraphs += [" ".join(part.split()) for part in source.split("\n\n")]
    why = (part for part in paragraphs if _WHY.match(part))
    usable = (part for part in paragraphs if part[:1] not in "#$|<" and not part.endswith(":"))
    reason = _WHY.sub("", next(why, "") or next(usable, ""), count=1)
    return capitalized(_ANNOUNCEMENT.sub("", reason))


def page() -> str:
    """Write the page with all questions, in Markdown."""
    *most, last = LESSON_ROBOTS
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
    for path in sorted(NOTEBOOKS.glob("*.ipynb")):
        lesson = path.name.split("_")[0]
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


def _question(question: Question) -> str:
    return capitalized(question.text.replace("**", ""))


def slides(in_site: bool = False) -> str:
    """Write all questions as slides, in one HTML file; in the site they link to live robots."""
    made = []
    for path in sorted(NOTEBOOKS.glob("*.ipynb")):
        lesson = path.name.split("_")[0]
        made.append(f"<section><h1>{inline_html(title_of(path))}</h1></section>")
        for question, result, reason in lecture_questions()[lesson]:
            options = "".join(f"<li>{inline_html(choice)}</li>" for choice in question.choices)
            options = (
                f"<ol type=A>{options}</ol>"
                if options
                else f"<p>({inline_html(question.form)})</p>"
            )
            live = ""
            if lesson in LESSON_ROBOTS and in_site:
                address = f"../lessons/{path.stem}.html"
                live = f"<p>Try it: <a href='{address}'>the live robot</a> of this lesson.</p>"
            made.append(
                f"<section><p class=context>{inline_html(question.context)}</p>"
                f"<h2>{inline_html(_question(question))}</h2>{options}"
                f"<div class=answer><p><strong>{inline_html(result)}</strong></p>"
                f"<p>{inline_html(reason)}</p>{live}</div>"
                f"<footer>{question.name}</footer></section>"
            )
    return _PAGE.replace("SECTIONS", "\n".join(made))


def write_slides(path: Path, in_site: bool = False) -> None:
    """Write the slides to a file; see `slides`."""
    write_whole(path, slides(in_site).encode())


_PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>Questions for the lecture</title>
<style>
body { margin: 0; font: 1.7vw/1.45 system-ui, sans-serif; color: #1a1a1a; background: #fff; }
section { display: none; box-sizing: border-box; min-height: 100vh; padding: 7vh 9vw; }
section.now { display: block; }
h1 { margin-top: 30vh; font-size: 3.4vw; text-align: center; }
h2 { font-size: 2.2vw; line-height: 1.3; }
.context { color: #555; }
.answer { visibility: hidden; border-left: .4vw solid #0b6; padding-left: 1.2vw; }
.shown .answer { visibility: visible; }
footer { position: fixed; right: 2vw; bottom: 2vh; color: #777; font-size: 1.1vw; }
@media print {
  section { display: block; page-break-after: always; }
  .answer { visibility: visible; }
}
</style>
SECTIONS
<script>
const pages = [...document.querySelectorAll("section")];
let now = 0;
const go = (to) => {
  pages[now].classList.remove("now", "shown");
  now = Math.min(pages.length - 1, Math.max(0, to));
  pages[now].classList.add("now");
  history.replaceState(null, "", `#${now + 1}`);
};
const toggle = () => pages[now].classList.toggle("shown");
addEventListener("keydown", (event) => {
  if (event.key === "ArrowRight" || event.key === "PageDown") go(now + 1);
  else if (event.key === "ArrowLeft" || event.key === "PageUp") go(now - 1);
  else if (event.key === " ") { event.preventDefault(); toggle(); }
});
addEventListener("click", (event) => { if (!event.target.closest("a")) toggle(); });
go((Number(location.hash.slice(1)) || 1) - 1);
</script>
</html>
"""
