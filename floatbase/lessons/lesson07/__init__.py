"""Lesson 07, Control as a quadratic program."""

from floatbase.lessons.lesson07.helpers import (
    WithConstraints,
    WithoutInequalities,
    leaning_controller,
    make_controller,
    median_time_ms,
    run_with_push,
)
from floatbase.lessons.lesson07.pictures import multiplier_text, plot_one_foot, plot_ways_out
