"""Lesson B, Torque is an abstraction."""

from floatbase.lessons.lessonB.bench import Bench, held_then_turned, run_loop
from floatbase.lessons.lessonB.exercises import EXERCISES
from floatbase.lessons.lessonB.helpers import comes_back
from floatbase.lessons.lessonB.pictures import (
    AT_JOINT,
    plot_lever,
    plot_sway,
    plot_torques,
    plot_watts,
    show_crank,
    show_step,
)

__all__ = [
    "AT_JOINT", "EXERCISES", "Bench", "comes_back", "held_then_turned", "plot_lever", "plot_sway", "plot_torques",
    "plot_watts", "run_loop", "show_crank", "show_step",
]  # fmt: skip
