"""What the lessons share: predictions, exercises that check themselves, panels that do not block the kernel, controllers."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from floatbase.lessons import progress
from floatbase.lessons.controllers import ConstantTorques, Torques, joint_servo
from floatbase.lessons.exercises import Exercise, Numeric, Shaped, Verdict, all_exercises, check, numbers, reveal, show_progress
from floatbase.lessons.predictions import compare, predict, review
from floatbase.lessons.rounding import about

if TYPE_CHECKING:
    from floatbase.lessons.panels import SliderPanel, live, push_panel, slider_panel

_PANELS = ("SliderPanel", "live", "push_panel", "slider_panel")  # imported at first use: they load physics and pictures

__all__ = [
    "ConstantTorques", "Exercise", "Numeric", "Shaped", "SliderPanel", "Torques", "Verdict", "about", "all_exercises", "check",
    "compare", "joint_servo", "live", "numbers", "predict", "progress", "push_panel", "reveal", "review", "show_progress",
    "slider_panel",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name not in _PANELS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module("floatbase.lessons.panels"), name)
