"""Prepare lessons for the site: run them, and replace what needs a kernel."""

from __future__ import annotations

import hashlib
import html
import re
from collections.abc import Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Protocol

import nbformat
from nbformat.v4 import new_code_cell, new_markdown_cell, new_output

import floatbase
from floatbase.lessons.exercises import all_exercises
from floatbase.lessons.predictions import RESULT_MIME
from floatbase.lessons.publish.notebooks import execute_notebook, read_notebook
from floatbase.lessons.publish.site.answers import (
    as_markdown,
    exercise_form,
    prediction_form,
    results,
    review_element,
)
from floatbase.lessons.publish.site.folds import fold_claims, fold_results
from floatbase.lessons.publish.site.recall import recall_box
from floatbase.lessons.publish.site.references import add_links
from floatbase.lessons.questions import all_questions

RUN_PAGE = "../installation.md"
PARALLEL_RUNS = 2  # lessons
_HIGH_RESOLUTION = "%config InlineBackend.figure_format = 'retina'"
_INLINE = "module://matplotlib_inline.backend_inline"
_NO_PICTURE = (
    "This site was built without running its lessons, so the picture of this cell is missing"
)
_WIDGET_MIME = "application/vnd.jupyter.widget-view+json"
_TERMINAL_CODES = re.compile(r"\x1b\[[0-9;]*m")
_CHECKED = re.compile(r'check\("(\w+\.\w+)"')
# their output is about the learner
_LEARNER_CALLS = re.compile(r"^(?:review|show_progress|reveal)\(", re.MULTILINE)


class PicturePlacer(Protocol):
    """Protocol of an object that puts pictures into the site."""

    def place(self, data: Mapping[str, Any], alt: str) -> str | None:
        """Return HTML for the data of an output that holds a picture, or None."""


def run_lessons(lessons: Iterable[Path], cache: Path) -> dict[Path, Any]:
    """Run lessons and return path -> notebook with outputs. Unchanged lessons are not run again."""
    cache.mkdir(parents=True, exist_ok=True)
    source = _digest_of_package()
    files = {
        path: cache / f"{path.stem}-{_digest(path.read_bytes() + source)}.ipynb" for path in lessons
    }
    new = {path: file for path, file in files.items() if not file.exists()}
    with ProcessPoolExecutor(PARALLEL_RUNS, mp_context=get_context("spawn")) as pool:
        for path in pool.map(_run_lesson, new, new.values()):
            print(f"run: {path.name}", flush=True)
    for path, file in files.items():
        for former in cache.glob(f"{path.stem}-*.ipynb"):
            if former != file:
                former.unlink()
    return {path: read_notebook(file) for path, file in files.items()}


def _run_lesson(path: Path, file: Path) -> Path:
    notebook = read_notebook(path)
    notebook.cells.insert(0, new_code_cell(_HIGH_RESOLUTION))
    execute_notebook(notebook, path.parent, FLOATBASE_VIEWER="site", MPLBACKEND=_INLINE)
    notebook.cells.pop(0)
    part = file.with_suffix(".part")  # an interrupted build leaves no partial file
    nbformat.write(notebook, part)
    part.replace(file)
    return path


def _digest_of_package() -> bytes:
    package = Path(floatbase.__file__).parent
    files = (
        path
        for path in sorted(package.rglob("*.*"))
        if not {"publish", "node_modules"} & set(path.relative_to(package).parts)
        and path.suffix in (".py", ".json", ".toml", ".js", ".html")
    )
    return b"".join(path.read_bytes() for path in files)


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]


def prepare_lesson(notebook: Any, pictures: PicturePlacer, lessons: Mapping[str, str]) -> Any:
    """Prepare a lesson for Sphinx, in place."""
    about = _description(notebook)
    shown = results(notebook.cells)
    cells: list[Any] = []
    for cell in fold_claims(fold_results(notebook.cells)):
        if cell.cell_type == "markdown":
            cell.source = add_links(cell.source, lessons)
            cells.append(cell)
            continue
        cells.append(_prepare_code_cell(cell, pictures, shown))
        if "picture" in cell.metadata.get("tags", []) and not cell.outputs:
            cells.append(new_markdown_cell(_live_lesson_note(_NO_PICTURE)))
    notebook.cells = cells
    notebook.metadata.pop("widgets", None)  # widgets need a kernel
    notebook.metadata["myst"] = {"html_meta": {"description": about}}
    return notebook


def _description(notebook: Any) -> str:
    """Return the first paragraph of a lesson, which search engines show."""
    text = next(cell.source for cell in notebook.cells if cell.cell_type == "markdown")
    paragraph = next(part for part in text.split("\n\n")[1:] if part.strip())
    return " ".join(re.sub(r"\[([^\]]*)\]\([^)]*\)|[*$`\\]", r"\1", paragraph).split())[:200]


def _prepare_code_cell(cell: Any, pictures: PicturePlacer, shown: dict[str, Any]) -> Any:
    tags = cell.metadata.get("tags", [])
    if name := cell.metadata.get("prediction"):
        question = all_questions()[name]
        form = prediction_form(question, shown.get(name))
        asked = f"**{name}**, your prediction: {question.form}. You can make it in the live lesson"
        return form or new_markdown_cell(_live_lesson_note(asked))
    if "check" in tags:
        checked = all_exercises().get(_CHECKED.findall(cell.source)[0])
        if checked and (form := exercise_form(checked)):
            return form
        return new_markdown_cell(_live_lesson_note("Checks and hints are in the live lesson"))
    if cell.source.startswith("recall("):
        return new_markdown_cell(as_markdown(recall_box("../_static/")))
    if form := review_element(cell.source):
        return form
    if _LEARNER_CALLS.search(cell.source):
        return new_markdown_cell(
            _live_lesson_note("Your predictions and solutions appear here in the live lesson")
        )
    alt = cell.metadata.get("alt", "")
    outputs = (_site_outputs(output, pictures, alt) for output in cell.outputs)
    cell.outputs = [part for parts in outputs for part in parts]
    _describe_figure(cell, alt)
    return cell


def _live_lesson_note(text: str) -> str:
    return f":::{{div}} live\n{text}: [how to run it]({RUN_PAGE}).\n:::"


def _site_outputs(output: Any, pictures: PicturePlacer, alt: str) -> list[Any]:
    """Return the parts of an output that a page can show, as a list."""
    if output.output_type == "stream":
        output.text = _TERMINAL_CODES.sub("", output.text)
        return [output] if output.name == "stdout" else []
    if output.output_type == "error":
        return [output]
    if RESULT_MIME in output.data:
        return [new_output("stream", name="stdout", text=f"{output.data['text/plain']}\n")]
    placed = pictures.place(output.data, alt)
    if placed is not None:
        return [new_output("display_data", {"text/html": placed})]
    data = {kind: value for kind, value in output.data.items() if kind != _WIDGET_MIME}
    if _WIDGET_MIME in output.data and "image/png" not in data:
        return []
    if alt and "text/html" in data:
        label = html.escape(alt)
        data["text/html"] = f'<div role="figure" aria-label="{label}">{data["text/html"]}</div>'
    return [new_output("display_data", data, metadata=output.metadata)]


def _describe_figure(cell: Any, alt: str) -> None:
    """Add alternative text and width to a figure, which has two dots per pixel."""
    figures = [
        output
        for output in cell.outputs
        if "image/png" in output.get("data", {}) and "text/html" not in output.data
    ]
    if figures:
        wide = figures[0].metadata.get("image/png", {}).get("width")
        cell.metadata["mystnb"] = {
            "image": {"alt": alt, **({"width": f"{wide}px"} if wide else {})}
        }
