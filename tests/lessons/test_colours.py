"""One colour has one meaning: lessons take colours from the viewer."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import floatbase as fb
from floatbase.lessons.publish import NOTEBOOKS, read_notebook
from floatbase.viewer.scene.colours import ALARM, CALM, CONE, WARNING

LESSONS = Path(fb.__file__).parent / "lessons"
CODE = r"(?<!&)#(?:[0-9A-Fa-f]{6}|[0-9A-Fa-f]{3})\b"


def sources() -> Iterator[tuple[str, str]]:
    """Name and text of all code of the lessons, modules and cells."""
    for path in sorted(LESSONS.rglob("*.py")):
        if path.name == "lecture.py":  # slides: white pages of text
            continue
        yield path.name, path.read_text(encoding="utf-8")
    for path in sorted(NOTEBOOKS.glob("*.ipynb")):
        yield from (
            (path.name, cell.source)
            for cell in read_notebook(path).cells
            if cell.cell_type == "code"
        )


def test_lessons_use_the_viewers_colours_and_not_those_of_cones():
    texts = list(sources())
    assert len(texts) > 100
    assert [(name, found) for name, text in texts for found in re.findall(CODE, text)] == []
    of_cones = {
        name
        for name, value in vars(fb.viewer.colours).items()
        if value in (CALM, WARNING, ALARM, CONE)
    } | {"CONE_ALPHA"}
    assert of_cones >= {"CALM", "WARNING", "ALARM", "CONE"}
    for name, text in texts:
        if name in ("figures.py", "props.py"):
            continue  # they draw cones, and a marked spoke
        tree = ast.parse(re.sub(r"^\s*[%!].*$", "", text, flags=re.M))
        named = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
        assert not named & of_cones, name
