"""Lesson 02, Equations of motion and contact."""

from floatbase.lessons.lesson02.exercises import EXERCISES
from floatbase.lessons.lesson02.helpers import (
    Motion,
    collapse,
    disc,
    park,
    pins,
    run_constant,
    strayed,
    tool_path,
    turning_about_its_tool,
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
    "EXERCISES", "Motion", "collapse", "disc", "draw_equation", "force_panel", "park", "parking_panel", "pins",
    "play_collapse", "play_tools", "plot_both", "plot_strayed", "run_constant", "strayed", "tool_path",
    "turning_about_its_tool", "upright", "wheel",
]  # fmt: skip
