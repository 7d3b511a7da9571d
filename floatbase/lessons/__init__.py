"""What the lessons share: predictions, exercises that check themselves, panels that do not block the kernel, controllers."""

import os
from importlib import import_module
from typing import TYPE_CHECKING, Any

from floatbase.lessons import progress
from floatbase.lessons.controllers import ConstantTorques, Torques, joint_servo
from floatbase.lessons.exercises import Exercise, Numeric, Shaped, Verdict, all_exercises, check, numbers, reveal, show_progress
from floatbase.lessons.predictions import compare, predict, review
from floatbase.lessons.rounding import about

if TYPE_CHECKING:
    from floatbase.lessons import props, qp_plots, static_export, stops
    from floatbase.lessons.figures import FIGURES
    from floatbase.lessons.handing_in import hand_in
    from floatbase.lessons.panels import SliderPanel, live, push_panel, slider_panel
    from floatbase.lessons.roses import draw_roses, measured_rose, plot_roses, rose_controller

# imported at first use: they load physics and pictures
_LAZY = {
    "hand_in": "handing_in",
    **dict.fromkeys(("SliderPanel", "live", "push_panel", "slider_panel"), "panels"),
    **dict.fromkeys(("draw_roses", "measured_rose", "plot_roses", "rose_controller"), "roses"),
    "stops": "stops",
    "FIGURES": "figures",
    **{name: name for name in ("props", "qp_plots", "static_export")},
}

__all__ = [
    "FIGURES",
    "ConstantTorques",
    "Exercise",
    "Numeric",
    "Shaped",
    "SliderPanel",
    "Torques",
    "Verdict",
    "about",
    "all_exercises",
    "check",
    "compare",
    "draw_roses",
    "hand_in",
    "joint_servo",
    "live",
    "measured_rose",
    "numbers",
    "plot_roses",
    "predict",
    "progress",
    "props",
    "push_panel",
    "qp_plots",
    "reveal",
    "review",
    "rose_controller",
    "show_progress",
    "slider_panel",
    "static_export",
    "stops",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = import_module(f"floatbase.lessons.{_LAZY[name]}")
    return module if name == _LAZY[name] else getattr(module, name)


if os.environ.get("FLOATBASE_VIEWER") == "site":
    import_module("floatbase.lessons.static_export")  # tells viewers how they display themselves
