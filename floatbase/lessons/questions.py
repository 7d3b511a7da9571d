"""The questions that the lessons ask, read from the notebooks."""

from __future__ import annotations

import ast
import json
import re
from dataclasses import dataclass
from functools import cache
from typing import Any

from floatbase.lessons.publish import NOTEBOOKS
from floatbase.lessons.question_texts import CONTEXTS, TEXTS

_BOLD = re.compile(r"\*\*Predict (\w+\.\w+)\*\*: ?")


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


def predict_call(source: str) -> tuple[str, dict[str, Any]]:
    """Return the name and the keyword arguments of the call of `predict` in a cell."""
    call = next(
        node
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "predict"
    )
    given = {str(keyword.arg): ast.literal_eval(keyword.value) for keyword in call.keywords}
    return ast.literal_eval(call.args[0]), given


@cache
def all_questions() -> dict[str, Question]:
    """Return the predictions of all lessons, by name."""
    found = {}
    for path in sorted(NOTEBOOKS.glob("*.ipynb")):
        above, topic = "", ""
        for cell in json.loads(path.read_bytes())["cells"]:
            source = "".join(cell["source"])
            if cell["cell_type"] == "markdown":
                above = source
                topic = (re.findall(r"^#+ (.+)$", source, re.MULTILINE) or [topic])[-1]
            elif "predict" in cell["metadata"].get("tags", []):
                name, given = predict_call(source)
                given["choices"] = tuple(given.get("choices", ()))
                context, text = _question_in(above)
                context, text = CONTEXTS.get(name, context), TEXTS.get(name, text)
                found[name] = Question(name, topic, context, text, **given)
    return found


def _question_in(text: str) -> tuple[str, str]:
    """Return the paragraph before a question, if it is one, and the question."""
    before, _, question = _BOLD.split(text, maxsplit=1)
    paragraphs = [part for part in before.strip().split("\n\n") if part]
    last = paragraphs[-1] if paragraphs else ""
    is_text = not last.startswith(("#", "$$", "|", "<", "- "))
    return " ".join(last.split()) if is_text else "", " ".join(question.split())
