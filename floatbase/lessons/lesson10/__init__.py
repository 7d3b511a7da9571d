"""Lesson 10, A horizon."""

from floatbase.lessons.lesson10.helpers import (
    PUSH_RECOVERY_WATCH_TIME,
    angular_momentum,
    make_controller,
    make_short_controller,
    make_walking_controller,
    mean_load,
    plan_pendulum,
)
from floatbase.lessons.lesson10.pictures import as_svg, plot_curves, plot_stances
