"""The questions that the lessons ask, read from the notebooks."""

from __future__ import annotations

import ast
import json
import re
from dataclasses import dataclass
from functools import cache
from typing import Any

from floatbase.errors import InputError
from floatbase.lessons.progress import is_answer
from floatbase.lessons.publish.workspace import lesson_notebooks

# what the metadata "question" of a prediction's cell may contain, for use outside the lesson
_METADATA = {"context": str, "text": str, "reason": str, "recall": bool, "lecture": bool}


@dataclass(frozen=True)
class Question:
    """Prediction that a lesson asks for."""

    name: str
    topic: str
    context: str
    text: str
    choices: tuple[str, ...] = ()
    unit: str = ""
    count: int = 1
    reason: str = ""  # for the result, if the text of the lesson relies on pictures
    recall: bool = False  # whether it can be asked again without the lesson's pictures
    lecture: bool = False  # whether a class votes on it

    @property
    def lesson(self) -> str:
        """Name of the lesson."""
        return self.name.split(".")[0]

    @property
    def form(self) -> str:
        """What to answer, in words."""
        if self.choices:
            return " / ".join(self.choices)
        many = "a number" if self.count == 1 else f"{self.count} numbers"
        return many + (f", in {self.unit}" if self.unit else "")

    def fits(self, result: Any) -> bool:
        """Return whether a result is one of the choices, or has the right count of numbers."""
        if self.choices or not is_answer(result) or isinstance(result, str):
            return result in self.choices
        return len(result if isinstance(result, list) else [result]) == self.count


@cache
def all_questions() -> dict[str, Question]:
    """Return the predictions of all lessons, by name."""
    found = {}
    for path in lesson_notebooks().values():
        above, topic = "", ""
        for cell in json.loads(path.read_bytes())["cells"]:
            source = "".join(cell["source"])
            if cell["cell_type"] == "markdown":
                above = source
                topic = (re.findall(r"^#+ (.+)$", source, re.MULTILINE) or [topic])[-1]
            elif name := cell["metadata"].get("prediction"):
                context, text = _question_in(above, name)
                outside = _checked_metadata(name, cell["metadata"].get("question", {}))
                given = {"context": context, "text": text} | _predict_arguments(source) | outside
                found[name] = Question(name, topic, **given)
    return found


def _predict_arguments(source: str) -> dict[str, Any]:
    """Return choices, unit and count from the call of `predict` in a cell."""
    call = next(
        node
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "predict"
    )
    given = {str(keyword.arg): ast.literal_eval(keyword.value) for keyword in call.keywords}
    return given | {"choices": tuple(given.get("choices", ()))}


def _checked_metadata(name: str, given: dict[str, Any]) -> dict[str, Any]:
    for key, value in given.items():
        if key not in _METADATA or not isinstance(value, _METADATA[key]):
            known = ", ".join(f"{key} ({kind.__name__})" for key, kind in _METADATA.items())
            raise InputError(
                f"The metadata of prediction {name} has the entry {key!r}: {value!r}. "
                f"The entries of a question are {known}."
            )
    return given


def _question_in(text: str, name: str) -> tuple[str, str]:
    """Return the paragraph before a question, if it is one, and the question."""
    before, _, question = text.partition(f"**Predict {name}**:")
    paragraphs = [part for part in before.strip().split("\n\n") if part]
    last = paragraphs[-1] if paragraphs else ""
    is_text = not last.startswith(("#", "$$", "|", "<", "- "))
    return " ".join(last.split()) if is_text else "", " ".join(question.split())
