"""What the lessons share: panels that do not block the kernel, and exercises that check themselves."""

from floatbase.lessons.exercises import Exercise, Numeric, Shaped, Verdict, all_exercises, check, numbers, reveal, show_progress
from floatbase.lessons.panels import slider_panel
from floatbase.lessons.sliders import live, push_panel

__all__ = [
    "Exercise",
    "Numeric",
    "Shaped",
    "Verdict",
    "all_exercises",
    "check",
    "live",
    "numbers",
    "push_panel",
    "reveal",
    "show_progress",
    "slider_panel",
]
