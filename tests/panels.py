"""What every slider panel of a lesson must do."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import floatbase as fb
from floatbase.robots import Robot


def assert_a_slider_redraws(robot: Robot, panel: Callable[[fb.Viewer], Any]) -> None:
    """Moving the first slider of a panel changes its line and its picture."""
    view = fb.Viewer(robot)
    try:
        made = panel(view)
        note, slider = made.children[1], made.children[2]
        before = (note.value, view.static_html())
        slider.value = slider.max
        assert note.value != before[0]
        assert view.static_html() != before[1]
    finally:
        view.close()
