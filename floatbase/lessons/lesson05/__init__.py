"""Lesson 05, Steering the centre of mass."""

from floatbase.lessons.lesson05.exercises import inclined_design
from floatbase.lessons.lesson05.helpers import (
    ConstantForceController,
    com_in_base,
    friction_ratios,
    make_controller,
    moving_and_goal_state,
    rotation_error,
    squeeze_forces,
    stretched_arm_state,
)
from floatbase.lessons.lesson05.pictures import (
    plot_constrained_minimum,
    plot_planned_pull,
    show_forces,
    show_moved_com,
)
