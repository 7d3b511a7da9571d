"""Lesson 08, Standing, shifting, stepping, walking."""

from floatbase.lessons.lesson08.helpers import (
    foothold,
    largest_tilt,
    make_controller,
    mean_velocity,
    run_go2,
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
