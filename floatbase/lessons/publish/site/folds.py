"""Fold the result of each prediction, which a reader opens by predicting, and the claims."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import Any

from nbformat.v4 import new_code_cell, new_markdown_cell

from floatbase.lessons.publish.site.answers import as_markdown, results

_HEADING = re.compile(r"^#+ ", re.MULTILINE)
_WHY = re.compile(r"\*\*Why\b")
_END = re.compile(r"^#+ |^<details|\*\*Predict ")  # of what a paragraph can explain
_ASSERTION = re.compile(r"^ *assert ", re.MULTILINE)
_QUESTION_TAGS = {"exercise", "check"}


def fold_results(cells: Sequence[Any]) -> list[Any]:
    """Fold what follows a prediction: its cells up to the result, and the explanation below it.

    The explanation is the paragraph that asks "Why?", or the first paragraph below the result.
    """
    rest, shown, start = list(cells), list[Any](), 0
    while rest:
        if not results(rest[:1]):
            cell = rest.pop(0)
            shown.append(cell)
            if _is_question(cell) or _has_heading(cell):
                start = len(shown)
            continue
        whole, paragraphs = _explanation(rest)
        inside, rest = shown[start:] + rest[:whole], rest[whole:]
        if paragraphs:
            parts = rest[0].source.split("\n\n")
            inside.append(new_markdown_cell("\n\n".join(parts[:paragraphs])))
            after = "\n\n".join(parts[paragraphs:])
            rest[:1] = [new_markdown_cell(after)] if after else []
        if inside[-1].source.endswith(":") and rest and not _is_question(rest[0]):
            inside.append(rest.pop(0))  # the cell that it announces
        names = " ".join(results(inside))
        summary = f'Result of {names}<span class="unseen">: show without predicting</span>'
        shown[start:] = _folded(f'class="result" data-names="{names}"', summary, inside)
        start = len(shown)
    return shown


def _explanation(cells: Sequence[Any]) -> tuple[int, int]:
    """Return how many cells a result takes, and paragraphs of the cell after them."""
    first = None
    for i, cell in enumerate(cells):
        if i and _is_question(cell):
            break
        if cell.cell_type == "code":
            continue
        paragraphs = cell.source.split("\n\n")
        for number, paragraph in enumerate(paragraphs):
            if _END.search(paragraph):
                return first or (1, 0)
            if first is None or _WHY.search(paragraph):
                end = number + 1
                while end < len(paragraphs) and _continues(*paragraphs[end - 1 : end + 1]):
                    end += 1
                first = first or (i, end)
            if _WHY.search(paragraph):
                return i, end
    return first or (1, 0)


def _continues(paragraph: str, following: str) -> bool:
    """Whether an explanation goes on, with a formula or with what a colon announces."""
    return following.startswith("$$") or paragraph.endswith(":")


def fold_claims(cells: Sequence[Any]) -> Iterator[Any]:
    """Fold the claims of each section into one box, in the place of its last claims."""
    section, claims = 0, defaultdict[int, list[Any]](list)
    for cell in cells:
        section += _has_heading(cell)
        if _is_claims(cell):
            claims[section].append(cell)
    boxes = {id(group[-1]): group for group in claims.values()}
    for cell in cells:
        if id(cell) in boxes:
            code = "\n\n".join(one.source for one in boxes[id(cell)])
            count = len(_ASSERTION.findall(code))
            summary = f"{count} claim{'s' if count > 1 else ''}, as code"
            yield from _folded('class="claims"', summary, [new_code_cell(code)])
        elif not _is_claims(cell):
            yield cell


def _folded(attributes: str, summary: str, cells: Sequence[Any]) -> list[Any]:
    opening = f"<details {attributes}><summary>{summary}</summary>"
    return [
        new_markdown_cell(as_markdown(opening)),
        *cells,
        new_markdown_cell(as_markdown("</details>")),
    ]


def _is_question(cell: Any) -> bool:
    return "prediction" in cell.metadata or bool(_QUESTION_TAGS & set(_tags(cell)))


def _has_heading(cell: Any) -> bool:
    return cell.cell_type == "markdown" and bool(_HEADING.search(cell.source))


def _is_claims(cell: Any) -> bool:
    return "claims" in _tags(cell)


def _tags(cell: Any) -> list[str]:
    return list(cell.metadata.get("tags", []))
