"""Lesson 04: its pictures, helpers and exercises."""

from floatbase.lessons.lesson04.pictures import (
    ARROW,
    EXERCISES,
    LEVELS,
    RISE_TIME,
    VALLEY,
    WANTED,
    LeastCost,
    counted_in,
    effort_picture,
    level_curves,
    measured_acceleration,
    show_torques,
    slices,
    tilted,
)

__all__ = [
    "ARROW",
    "EXERCISES",
    "LEVELS",
    "RISE_TIME",
    "VALLEY",
    "WANTED",
    "LeastCost",
    "counted_in",
    "effort_picture",
    "level_curves",
    "measured_acceleration",
    "show_torques",
    "slices",
    "tilted",
]
