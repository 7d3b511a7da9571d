"""Lesson 08, Standing, shifting, stepping, walking."""

from floatbase.lessons.lesson08.exercises import EXERCISES
from floatbase.lessons.lesson08.helpers import (
    crawled,
    least_margin,
    moved_body,
    rose_controller,
    run_of,
    shortest_shift,
    speed,
    tilt,
    torque_jump,
    uneven_stance,
)
from floatbase.lessons.lesson08.pictures import PushTogether, footholds, plot_fall, plot_loads, triangles

__all__ = [
    "EXERCISES", "PushTogether", "crawled", "footholds", "least_margin", "moved_body", "plot_fall", "plot_loads",
    "rose_controller", "run_of", "shortest_shift", "speed", "tilt", "torque_jump", "triangles", "uneven_stance",
]  # fmt: skip
