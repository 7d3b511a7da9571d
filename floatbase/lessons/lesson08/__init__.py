"""Lesson 08, Standing, shifting, stepping, walking."""

from floatbase.lessons.lesson08.exercises import EXERCISES
from floatbase.lessons.lesson08.helpers import (
    largest_tilt,
    make_controller,
    mean_velocity,
    run_crawl,
    run_go2,
    shortest_com_shift,
    smallest_support_margin,
    state_with_moved_body,
    uneven_stance,
)
from floatbase.lessons.lesson08.pictures import (
    PushComparison,
    plot_pendulum_fall,
    plot_support_triangles,
    show_foothold,
    show_shifted_loads,
)

__all__ = [
    "EXERCISES",
    "PushComparison",
    "largest_tilt",
    "make_controller",
    "mean_velocity",
    "plot_pendulum_fall",
    "plot_support_triangles",
    "run_crawl",
    "run_go2",
    "shortest_com_shift",
    "show_foothold",
    "show_shifted_loads",
    "smallest_support_margin",
    "state_with_moved_body",
    "uneven_stance",
]  # fmt: skip
