"""The table of contents: the lessons, read from their notebooks."""

from __future__ import annotations

import re
from pathlib import Path

from floatbase.lessons.publish.hosted import colab_address
from floatbase.lessons.publish.notebooks import read_notebook
from floatbase.lessons.publish.workspace import NOTEBOOKS, lesson_notebooks

README = NOTEBOOKS.parent / "README.md"
_BEGIN = "<!-- lessons: made by `python -m floatbase.lessons.publish map` -->\n"
_END = "<!-- end of lessons -->\n"


def lesson_table() -> str:
    """Write the table of lessons as Markdown: number, title, equations, and a link to Colab."""
    lines = ["| | lesson | equations |", "|---|---|---|"]
    for lesson, path in lesson_notebooks().items():
        title, colab = title_of(path).split(" · ")[-1], colab_address(path)
        badge = f" [open in Colab]({colab})" if colab else ""
        lines.append(
            f"| {lesson} | [{title}](notebooks/{path.name}){badge} | {equation_ranges(path)} |"
        )
    return "\n".join(lines).replace("|  |", "| |") + "\n"


def readme_with_table(text: str) -> str:
    """Replace the table of lessons in the text of the README."""
    before, rest = text.split(_BEGIN)
    return f"{before}{_BEGIN}\n{lesson_table()}\n{_END}{rest.split(_END)[1]}"


def title_of(source: Path) -> str:
    """Return the first heading of a lesson or of a Markdown file."""
    if source.suffix == ".ipynb":
        text = next(
            (cell.source for cell in read_notebook(source).cells if cell.cell_type == "markdown"),
            "",
        )
    else:
        text = source.read_text(encoding="utf-8")
    heading = re.search(r"^# (.+)$", text, re.MULTILINE)
    return heading[1] if heading else source.stem


def equations_taught(lesson: Path) -> set[str]:
    """Return the equations that a lesson teaches, from the metadata of its cells."""
    return {
        equation
        for cell in read_notebook(lesson).cells
        for equation in cell.metadata.get("teaches", [])
    }


def equation_ranges(lesson: Path) -> str:
    """Abbreviate the equations that a lesson teaches, as in "(8)-(13), (16), App. A"."""
    taught = equations_taught(lesson)
    numbers = sorted(
        int(equation.strip("()")) for equation in taught if not equation.startswith("App.")
    )
    first = [n for n in numbers if n - 1 not in numbers]
    last = [n for n in numbers if n + 1 not in numbers]
    spans = [
        f"({a})-({b})" if b > a + 1 else f"({a}), ({b})" if b > a else f"({a})"
        for a, b in zip(first, last, strict=True)
    ]
    return ", ".join(
        [*spans, *sorted(equation for equation in taught if equation.startswith("App."))]
    )
