"""Lesson 06, Friction cones."""

from floatbase.lessons.lesson06.helpers import (
    ConeController,
    accelerate,
    com_beside_feet,
    constrained_minimizer,
    make_controller,
    state_with_feet_at,
)
from floatbase.lessons.lesson06.pictures import (
    SINGLE_FOOT_VIEW,
    compass_row,
    region_picture,
    show_force,
    show_polyhedron,
    show_region,
    show_slope,
    slope_normal,
)
