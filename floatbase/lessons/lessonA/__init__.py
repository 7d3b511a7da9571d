"""Lesson A, Fictitious forces."""

from floatbase.lessons.lessonA.exercises import EXERCISES
from floatbase.lessons.lessonA.helpers import circling, figure_of_eight, tool_error
from floatbase.lessons.lessonA.pictures import AT_TABLE, SIDEWAYS, play_travel, plot_errors, show_ride, show_tumble

__all__ = [
    "AT_TABLE", "EXERCISES", "SIDEWAYS", "circling", "figure_of_eight", "play_travel", "plot_errors", "show_ride",
    "show_tumble", "tool_error",
]  # fmt: skip
