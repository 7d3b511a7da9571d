"""Lesson 04, One cost, many spaces."""

from floatbase.lessons.lesson04.exercises import EXERCISES
from floatbase.lessons.lesson04.helpers import DESIRED, LeastCost, counted_in, measured_acceleration, tilted
from floatbase.lessons.lesson04.pictures import effort_picture, level_curves, show_torques, slices

__all__ = [
    "DESIRED", "EXERCISES", "LeastCost", "counted_in", "effort_picture", "level_curves", "measured_acceleration",
    "show_torques", "slices", "tilted",
]  # fmt: skip
