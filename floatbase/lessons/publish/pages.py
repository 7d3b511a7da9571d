"""Lessons as pages to read without a kernel: each one HTML file with its formulas, figures and 3-D pictures.

`make pages` writes them. This needs the extra `pages`.
"""

from __future__ import annotations

import html
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from nbformat.v4 import new_code_cell

from floatbase.errors import InputError
from floatbase.lessons.publish.contents import title_of
from floatbase.lessons.publish.notebooks import execute, read
from floatbase.lessons.publish.pictures import Pictures
from floatbase.lessons.publish.prose import code_style, coloured, formula_font, to_html
from floatbase.lessons.publish.workspace import FOLDER

_SHARP = "%config InlineBackend.figure_format = 'retina'"
_INLINE = "module://matplotlib_inline.backend_inline"
_NOTICE = (
    "floatbase, a course on robots that are not bolted to the ground. This is a page to read; in the live lesson pictures "
    "answer to sliders and exercises check themselves."
)
_CLAIMS = "claims of the text above, as code that fails if one is wrong"
_WIDGET = "application/vnd.jupyter.widget-view+json"
_WIDGETS = "application/vnd.jupyter.widget-state+json"
_TERMINAL = re.compile(r"\x1b\[[0-9;]*m")


def build(source: Path, folder: Path) -> Path:
    """Write the page of a lesson, or of a text in Markdown, into `folder`, which is made; the page's path.

    source: a notebook, which is run, or a .md file. Raises `InputError` when there is no such file.
    """
    if not source.is_file():
        raise InputError(f"there is no lesson {source}; the course's lessons are in {FOLDER}.")
    pictures = Pictures()
    body = (
        _lesson(source, pictures) if source.suffix == ".ipynb" else f"<section>{to_html(source.read_text('utf-8'))}</section>"
    )
    target = folder / f"{source.stem}.html"
    folder.mkdir(parents=True, exist_ok=True)
    target.write_text(_page(source, body, pictures.held()), encoding="utf-8")
    return target


def _lesson(source: Path, pictures: Pictures) -> str:
    """Everything a lesson says and shows, run with pictures that need no kernel."""
    notebook = read(source)
    notebook.cells.insert(0, new_code_cell(_SHARP))
    execute(notebook, source.parent, FLOATBASE_VIEWER="static", MPLBACKEND=_INLINE)
    widgets = notebook.metadata.get("widgets", {}).get(_WIDGETS, {}).get("state", {})
    return "\n".join(_cell(cell, widgets, pictures) for cell in notebook.cells[1:])


def _cell(cell: Any, widgets: dict[str, Any], pictures: Pictures) -> str:
    if cell.cell_type != "code":
        return f"<section>{to_html(cell.source)}</section>"
    tags = cell.metadata.get("tags", [])
    if "claims" in tags:
        return f'<details class="cell"><summary>{_CLAIMS}</summary>{coloured(cell.source)}</details>'
    # what a check says about the placeholder, and a prediction that nobody has made, are nothing to read
    shown = "" if {"check", "predict"} & set(tags) else _outputs(cell.outputs, widgets, pictures)
    kind = "cell exercise" if {"exercise", "predict"} & set(tags) else "cell"
    return f'<div class="{kind}">{coloured(cell.source)}{shown}</div>'


def _outputs(outputs: Sequence[Any], widgets: dict[str, Any], pictures: Pictures) -> str:
    """What a cell printed and showed; prints that follow one another are one."""
    shown: list[str] = []
    printed = ""
    for output in outputs:
        if output.output_type == "stream":
            printed += output.text if output.name == "stdout" else ""  # what else was said is about this run, not the lesson
        else:
            shown += [_text(printed), _data(output, widgets, pictures)]
            printed = ""
    return "".join([*shown, _text(printed)])


def _data(output: Any, widgets: dict[str, Any], pictures: Pictures) -> str:
    """The richest form of one output that a page can show."""
    data = output.data
    if _WIDGET in data:
        return pictures.panel(widgets, data[_WIDGET]["model_id"])
    if "text/html" in data:
        return f'<div class="shown">{pictures.placed(data["text/html"])}</div>'
    if "image/png" in data:
        size = "".join(f' {name}="{value}"' for name, value in output.metadata.get("image/png", {}).items())
        picture = "".join(data["image/png"].split())
        return f'<img class="figure" alt="figure drawn by the code above" src="data:image/png;base64,{picture}"{size}>'
    return _text(data.get("text/plain", ""))


def _text(text: str) -> str:
    return f'<pre class="printed">{html.escape(_TERMINAL.sub("", text))}</pre>' if text.strip() else ""


def _page(source: Path, body: str, held: str) -> str:
    """The whole file."""
    title, way = html.escape(title_of(source)), _way(source)
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="data:,"><title>{title}</title><style>{code_style()}{_own("pages.css")}{formula_font(body)}</style></head>
<body><nav class="top"><span>{_NOTICE}</span>
<button id="print" hidden>print</button></nav>
<main>{body}</main>
<nav class="way">{way}</nav>
{held}<script>{_own("pages.js") if held else ""}</script></body></html>
"""


def _way(source: Path) -> str:
    """Links to the pages of the lessons before and after."""
    lessons = sorted(source.parent.glob("*.ipynb"))
    if source not in lessons:
        return ""
    at = lessons.index(source)
    before, after = lessons[at - 1 : at] if at else [], lessons[at + 1 : at + 2]
    links = [f'<a rel="prev" href="{path.stem}.html">← {html.escape(title_of(path))}</a>' for path in before]
    links += [f'<a rel="next" href="{path.stem}.html">{html.escape(title_of(path))} →</a>' for path in after]
    return "".join(links)


def _own(name: str) -> str:
    return Path(__file__).with_name(name).read_text(encoding="utf-8")
