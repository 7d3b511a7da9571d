"""Live robots in the pages of the site: their script, and the robots of lessons."""

from __future__ import annotations

import html
from typing import Any, NamedTuple

from nbformat.v4 import new_markdown_cell

LIVE_FOLDER = "live"  # in the site's static files
_HEIGHT = "26rem"


class LessonRobot(NamedTuple):
    """A live robot in a lesson."""

    name: str
    attributes: dict[str, str]
    text: str
    panel_call: str = ""


# number of a lesson -> its live robot. Only lesson 00 has a push panel with the page's controller
LESSON_ROBOTS = {
    "00": LessonRobot(
        "go2", {}, "Once the robot is live, drag it where you like.", panel_call="push_panel("
    ),
    "05": LessonRobot(
        "go2",
        {"panel": "1"},
        "Push the centre of mass. *push-recovery map* computes the largest push that go2 survives "
        "in each direction. Open *stance*, move the centre of mass, and compute the map "
        "again.",
    ),
    "06": LessonRobot(
        "go2",
        {"panel": "1", "mu": "0.3"},
        "The friction coefficient is 0.3, so a moderate push brings forces to the facets of their "
        "cones. Open *model and reality*, and let the controller assume more friction than there "
        "is.",
    ),
    "07": LessonRobot(
        "go2",
        {"panel": "1"},
        "Open *quadratic program*, and read the multipliers of the active constraints while you "
        "push. Then lower the torque limits until one becomes active.",
    ),
    "09": LessonRobot(
        "talos",
        {"panel": "1"},
        "Talos stands on two flat feet, with four forces at each. Push it, and see which corners "
        "of its feet lose their force first.",
    ),
    "P": LessonRobot(
        "go2",
        {"panel": "1"},
        "Open *terms of eq. (7)*, and switch off gravity in the model. The robot sags, because "
        "only its position error makes the controller push up. Stand the robot up, and switch "
        "gravity off in reality instead. The page has only those switches of the playground that "
        "keep the form of the controller's QP.",
    ),
}  # fmt: skip


def robot_script(static: str) -> str:
    """Return the element that loads the script of live robots."""
    return f'<script src="{static}{LIVE_FOLDER}/floatbase-live.js"></script>'


def robot_element(robot: LessonRobot, instead: str = "") -> str:
    """Return the element of a live robot."""
    attributes = {"name": robot.name} | robot.attributes
    written = " ".join(f'{name}="{html.escape(value)}"' for name, value in attributes.items())
    style = f"display: block; margin: 1rem 0; {'min-' if instead else ''}height: {_HEIGHT}"
    words = "A live robot appears here in a browser with WebAssembly, if the page is on a server."
    shown = instead or f"<p>{words}</p>"
    return f'<floatbase-robot {written} style="{style}">{shown}</floatbase-robot>'


def add_robot(notebook: Any, number: str) -> None:
    """Add the live robot of a lesson, in place: over its push panel, or at its end."""
    robot = LESSON_ROBOTS[number]
    if robot.panel_call:
        (cell,) = (cell for cell in notebook.cells if robot.panel_call in cell.source)
        pages = [data for each in cell.outputs if "text/html" in (data := each.get("data", {}))]
        if pages:  # stored outputs have no pictures
            element = robot_element(robot, pages[0]["text/html"])
            script = robot_script("../_static/")
            pages[0]["text/html"] = f"{script}\n{element}\n<p>{robot.text}</p>"
            return
    raw = f"{robot_script('../_static/')}\n{robot_element(robot)}"
    text = (
        f"## Live: push {robot.name}\n\n{robot.text}\n\n```{{raw}} html\n{raw}\n```\n\n"
        "[All controls and robots](../live.md)"
    )
    notebook.cells.append(new_markdown_cell(text))
