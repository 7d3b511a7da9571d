"""Lesson 04, One cost, many spaces."""

from floatbase.lessons.lesson04.helpers import (
    DESIRED_ACCELERATION,
    MinimumCostController,
    measured_acceleration,
    rescaled_space,
)
from floatbase.lessons.lesson04.pictures import cost_slices, level_curves, show_torques
