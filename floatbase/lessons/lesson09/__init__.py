"""Lesson 09, Feet with area: the humanoid."""

from floatbase.lessons.lesson09.exercises import EXERCISES, ankle_sensor, leaned
from floatbase.lessons.lesson09.helpers import (
    ROSE_WATCH,
    corner_forces,
    held,
    leaning,
    pressure,
    rose_controller,
    standing_rose_controller,
    talos,
)
from floatbase.lessons.lesson09.pictures import (
    ONE_SOLE,
    SOLES,
    kinds_of,
    play_resultants,
    plot_lean,
    plot_walk,
    show_sole,
    show_soles,
    soles_from_above,
)

__all__ = [
    "EXERCISES", "ONE_SOLE", "ROSE_WATCH", "SOLES", "ankle_sensor", "corner_forces", "held", "kinds_of", "leaned", "leaning",
    "play_resultants", "plot_lean", "plot_walk", "pressure", "rose_controller", "show_sole", "show_soles", "soles_from_above",
    "standing_rose_controller", "talos",
]  # fmt: skip
