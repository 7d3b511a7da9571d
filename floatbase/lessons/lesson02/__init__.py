"""Lesson 02, Equations of motion and contact."""

from floatbase.lessons.lesson02.exercises import EXERCISES
from floatbase.lessons.lesson02.helpers import (
    MotionSolver,
    disc_state,
    foot_displacement,
    load_disc,
    parking_states,
    rolling_wheel,
    run_constant_torques,
    tool_displacement,
)
from floatbase.lessons.lesson02.pictures import (
    draw_equation,
    force_panel,
    parking_panel,
    play_collapse_comparison,
    play_tool_comparison,
)

__all__ = [
    "EXERCISES",
    "MotionSolver",
    "disc_state",
    "draw_equation",
    "foot_displacement",
    "force_panel",
    "load_disc",
    "parking_panel",
    "parking_states",
    "play_collapse_comparison",
    "play_tool_comparison",
    "rolling_wheel",
    "run_constant_torques",
    "tool_displacement",
]  # fmt: skip
