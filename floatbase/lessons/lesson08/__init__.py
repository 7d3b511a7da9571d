"""Lesson 08, Standing, shifting, stepping, walking."""

from floatbase.lessons.lesson08.helpers import (
    largest_tilt,
    make_controller,
    mean_velocity,
    run_crawl,
    run_go2,
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
