"""Lesson 02, Equations of motion and contact."""

from floatbase.lessons.lesson02.exercises import EXERCISES
from floatbase.lessons.lesson02.helpers import (
    Motion,
    disc,
    park,
    run_constant,
    strayed,
    tool_path,
    upright,
    wheel,
)
from floatbase.lessons.lesson02.pictures import (
    draw_equation,
    force_panel,
    parking_panel,
    play_collapse,
    play_tools,
    plot_both,
    plot_strayed,
)

__all__ = [
    "EXERCISES", "Motion", "disc", "draw_equation", "force_panel", "park", "parking_panel", "play_collapse", "play_tools",
    "plot_both", "plot_strayed", "run_constant", "strayed", "tool_path", "upright", "wheel",
]  # fmt: skip
