"""Lesson 07, Control as a quadratic program."""

from floatbase.lessons.lesson07.exercises import EXERCISES
from floatbase.lessons.lesson07.helpers import WithoutRows, WithRows, leaning, milliseconds, pushed, rose_controller, tuned
from floatbase.lessons.lesson07.pictures import named, plot_rounds, plot_ways

__all__ = [
    "EXERCISES", "WithRows", "WithoutRows", "leaning", "milliseconds", "named", "plot_rounds", "plot_ways", "pushed",
    "rose_controller", "tuned",
]  # fmt: skip
