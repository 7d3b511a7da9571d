"""Lesson 10, A horizon."""

from floatbase.lessons.lesson10.helpers import (
    PUSH_RECOVERY_WATCH_TIME,
    angular_momentum,
    make_controller,
    make_walking_controller,
    mean_load,
)
from floatbase.lessons.lesson10.pictures import plot_loads, plot_push_recovery_maps, plot_step
