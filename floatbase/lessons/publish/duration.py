"""How long a lesson takes to work through, by one rule for all lessons."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

from floatbase.lessons.publish.notebooks import read_notebook

WORDS_PER_MINUTE = 110  # text with formulas
LINES_PER_MINUTE = 8  # code that is read and run
MINUTES_PER_PREDICTION = 1.5
MINUTES_PER_PICTURE = 1.25  # a 3-D picture, a panel with sliders or a plot in a cell of its own
MINUTES_PER_EXERCISE = 9.0

_OPTIONAL = re.compile(r"<details.*?</details>", re.DOTALL)
_NOT_WORDS = re.compile(r"```.*?```|\$\$.*?\$\$|\$[^$\n]*\$|`[^`\n]*`|<[^>]*>", re.DOTALL)
_WORD = re.compile(r"[^\W\d_]{2,}|\b[aAI]\b")


def lesson_minutes(path: Path) -> int:
    """Compute how long a lesson takes, from its text, code, predictions, pictures and exercises."""
    counts = lesson_counts(path)
    minutes = (
        counts["words"] / WORDS_PER_MINUTE
        + counts["code lines"] / LINES_PER_MINUTE
        + counts["predictions"] * MINUTES_PER_PREDICTION
        + counts["pictures"] * MINUTES_PER_PICTURE
        + counts["exercises"] * MINUTES_PER_EXERCISE
    )
    return 5 * math.ceil(minutes / 5)


def lesson_counts(path: Path) -> dict[str, int]:
    """Count the words, visible code lines, predictions, pictures and exercises of a lesson."""
    cells = read_notebook(path).cells
    text = "\n\n".join(cell.source for cell in cells if cell.cell_type == "markdown")
    plain = _NOT_WORDS.sub(" ", _OPTIONAL.sub(" ", text))
    tags = [tag for cell in cells for tag in cell.metadata.get("tags", [])]
    return {
        "words": len(_WORD.findall(plain)),
        "code lines": sum(_visible_lines(cell) for cell in cells if cell.cell_type == "code"),
        "predictions": tags.count("predict"),
        "pictures": tags.count("picture"),
        "exercises": tags.count("exercise"),
    }


def _visible_lines(cell: Any) -> int:
    """Count the lines of code that a learner reads in a cell."""
    hidden = cell.metadata.get("jupyter", {}).get("source_hidden", False)
    if hidden or {"claims", "predict", "exercise", "check"} & set(cell.metadata.get("tags", [])):
        return 0
    return sum(bool(line.strip()) for line in cell.source.splitlines())
