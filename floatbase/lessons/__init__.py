"""Shared parts of the lessons: predictions, exercises, slider panels and simple controllers."""

import os
from importlib import import_module
from typing import TYPE_CHECKING, Any

from floatbase.errors import MissingDependencyError, explain_arguments
from floatbase.lessons import progress
from floatbase.lessons.controllers import ConstantTorques, TorqueCommand, joint_servo
from floatbase.lessons.exercises import all_exercises, check, own_numbers, reveal, show_progress
from floatbase.lessons.judges import NumericJudge
from floatbase.lessons.predictions import compare, predict, review
from floatbase.lessons.rounding import rounded

if TYPE_CHECKING:
    from floatbase.lessons import props, qp_plots, slider_samples, static_export
    from floatbase.lessons.figures import FIGURES
    from floatbase.lessons.panels import SliderPanel, live_run, push_panel, slider_panel
    from floatbase.lessons.push_recovery import (
        controller_factory,
        measured_push_recovery,
        plot_push_recovery,
    )
    from floatbase.lessons.recalling import recall
    from floatbase.lessons.submission import hand_in, import_answers

# imported on first use, because they load the physics and the viewer
_LAZY = {
    "hand_in": "submission",
    "import_answers": "submission",
    "recall": "recalling",
    **dict.fromkeys(("SliderPanel", "live_run", "push_panel", "slider_panel"), "panels"),
    **dict.fromkeys(
        ("measured_push_recovery", "plot_push_recovery", "controller_factory"), "push_recovery"
    ),
    "slider_samples": "slider_samples",
    "FIGURES": "figures",
    **{name: name for name in ("props", "qp_plots", "static_export")},
}

__all__ = [
    "FIGURES",
    "ConstantTorques",
    "NumericJudge",
    "SliderPanel",
    "TorqueCommand",
    "all_exercises",
    "check",
    "compare",
    "controller_factory",
    "hand_in",
    "import_answers",
    "joint_servo",
    "live_run",
    "measured_push_recovery",
    "own_numbers",
    "plot_push_recovery",
    "predict",
    "progress",
    "props",
    "push_panel",
    "qp_plots",
    "recall",
    "reveal",
    "review",
    "rounded",
    "show_progress",
    "slider_panel",
    "slider_samples",
    "static_export",
]  # fmt: skip

explain_arguments(globals())


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}.")
    try:
        module = import_module(f"floatbase.lessons.{_LAZY[name]}")
    except ModuleNotFoundError as error:
        if str(error.name).startswith("floatbase"):
            raise
        raise MissingDependencyError(
            f"The course needs {error.name}, which is not installed. Install it with "
            'pip install "floatbase[course]".'
        ) from None
    return module if name == _LAZY[name] else getattr(module, name)


if os.environ.get("FLOATBASE_VIEWER") == "site":
    import_module("floatbase.lessons.static_export")  # registers how viewers display themselves
