"""Live robots in the pages of the site: their script, and the robots of lessons.

The metadata "live_robot" of a notebook has the name of a robot, a text, and any other attribute of
the element. The robot appears at the end of the lesson, or in place of the panel of the cell with
the tag "live-robot".
"""

from __future__ import annotations

import html
from typing import Any

from nbformat.v4 import new_markdown_cell

LIVE_FOLDER = "live"  # in the site's static files
METADATA = "live_robot"  # of a notebook
TAG = "live-robot"  # of a cell with a panel
_HEIGHT = "26rem"


def robot_script(static: str) -> str:
    """Return the element that loads the script of live robots."""
    return f'<script src="{static}{LIVE_FOLDER}/floatbase-live.js"></script>'


def robot_element(attributes: dict[str, str], instead: str = "") -> str:
    """Return the element of a live robot."""
    written = " ".join(f'{name}="{html.escape(value)}"' for name, value in attributes.items())
    style = f"display: block; margin: 1rem 0; {'min-' if instead else ''}height: {_HEIGHT}"
    words = "A live robot is loading. It needs a browser with WebAssembly and a page from a server."
    shown = instead or f"<p>{words}</p>"
    return f'<floatbase-robot {written} style="{style}">{shown}</floatbase-robot>'


def add_robot(notebook: Any, robot: dict[str, str]) -> None:
    """Add the live robot to a lesson, in place of a panel or at the end."""
    attributes, script = dict(robot), robot_script("../_static/")
    about = attributes.pop("text")
    panels = [cell for cell in notebook.cells if TAG in cell.metadata.get("tags", [])]
    outputs = [output.get("data", {}) for cell in panels for output in cell.outputs]
    for data in outputs:
        if "text/html" in data:  # stored outputs have no pictures
            element = robot_element(attributes, data["text/html"])
            data["text/html"] = f"{script}\n{element}\n<p>{about}</p>"
            return
    raw = f"{script}\n{robot_element(attributes)}"
    text = (
        f"## Live: push {attributes['name']}\n\n{about}\n\n```{{raw}} html\n{raw}\n```\n\n"
        "[All controls and robots](../live.md)"
    )
    notebook.cells.append(new_markdown_cell(text))
