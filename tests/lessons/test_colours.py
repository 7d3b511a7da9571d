"""One colour, one meaning: what a lesson draws beside forces and cones is grey, and its words have
the page's own colour.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import judges
import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

import floatbase as fb
from floatbase.lessons import ConstantTorques, lesson02, lesson03, lesson04, lesson05
from floatbase.lessons.publish import NOTEBOOKS, read_notebook
from floatbase.viewer import Viewer
from floatbase.viewer.scene.colours import (
    ALARM,
    CALM,
    COM,
    CONE,
    GREYS,
    MEASURED,
    PLANNED,
    WARNING,
    hex_code,
)

LESSONS = Path(fb.__file__).parent / "lessons"
TAKEN = {hex_code(colour) for colour in (MEASURED, PLANNED, COM, *CONE.values())}
CODE = r"(?<!&)#(?:[0-9A-Fa-f]{6}|[0-9A-Fa-f]{3})\b"
BOWL = fb.Quadratic.from_residual([[2.0, 0.0], [0.0, 1.0]], [2.0, 1.0])


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


def test_lessons_take_their_colours_from_the_viewer_and_leave_those_of_cones_to_it() -> None:
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


def lines(figure: Figure) -> set[str]:
    """Colours of all lines and dots of a figure."""
    return {to_hex(line.get_color()).upper() for axis in figure.axes for line in axis.lines}


@pytest.mark.parametrize(
    "draw",
    [
        lambda: lesson02.draw_equation(lesson03.standing_go2_eom()),
        lambda: lesson03.matrix_picture(np.eye(4), {"rows": 4}, {"q̈": 1, "λ": 3}),
        lambda: lesson04.cost_slices(bowl=(BOWL, "x", "y", 2.0)),
        lesson05.plot_constrained_minimum,
    ],
    ids=["equation", "matrix", "slices", "minimum"],
)
def test_a_figure_of_anything_but_forces_has_no_colour_of_a_force_or_a_cone(
    draw: Callable[[], Figure],
) -> None:
    found = lines(draw())
    assert found and not found & TAKEN


def test_only_bars_of_forces_have_the_colour_of_planned_forces_and_none_that_of_cones() -> None:
    base, qdd, tau, forces = lesson03.motion_bars(np.ones(18), np.ones(12), np.ones(12)).split(
        "<svg"
    )[1:]
    assert set(re.findall(CODE, forces)) == {hex_code(PLANNED)}
    assert set(re.findall(CODE, base)) == set(re.findall(CODE, qdd))
    assert len(set(re.findall(CODE, qdd))) == len(set(re.findall(CODE, tau))) == 1
    assert not set(re.findall(CODE, base + qdd + tau)) & TAKEN


def test_words_and_dots_of_svg_have_the_colour_of_the_page_so_that_a_dark_one_can_be_read() -> None:
    for drawn in (
        lesson03.motion_bars(np.ones(18), np.ones(12), np.ones(12)),
        lesson04.level_curves(BOWL, [1, 1], 2.0, "x", "y"),
    ):
        assert 'fill="currentColor"' in drawn
        assert re.findall(r"<(?:text|circle)[^>]*\sfill=", drawn) == []
    assert not set(re.findall(CODE, drawn)) & TAKEN


@pytest.mark.parametrize("background", ["white", "dark"])
def test_a_place_in_a_picture_has_the_colour_of_text_and_a_way_is_grey(background: str) -> None:
    arm = judges.load("ur5")
    still = fb.rollout(fb.Simulation(arm), judges.controller_of("ur5"), 0.1)
    limp = fb.rollout(fb.Simulation(arm), ConstantTorques(np.zeros(6)), 0.1)
    view = Viewer(arm, background=background)
    try:
        lesson02.play_tool_comparison(view, limp, still)
        made = {
            path: c
            for (path, kind, _), c in view.window.scene.commands().items()
            if kind == "set_object"
        }
    finally:
        view.close()
    for part, colour in (("home/pin", view.painter.text_colour), ("way", GREYS[2])):
        (command,) = (
            command for path, command in made.items() if path.startswith(f"/meshcat/{part}")
        )
        assert f"#{command['object']['materials'][0]['color']:06X}" == hex_code(colour)
