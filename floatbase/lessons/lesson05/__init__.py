"""Lesson 05, Steering the centre of mass."""

from floatbase.lessons.lesson05.exercises import EXERCISES
from floatbase.lessons.lesson05.helpers import (
    ConstantForceController,
    arm_robot_eom,
    com_in_base,
    friction_ratios,
    make_controller,
    moving_and_goal_state,
    rotation_error,
    squeeze_forces,
    squeezed_standing_forces,
    stretched_arm_state,
)
from floatbase.lessons.lesson05.pictures import (
    plot_constrained_minimum,
    plot_planned_pull,
    show_forces,
    show_moved_com,
)
from floatbase.lessons.lesson05.verdicts import inclined_design

__all__ = [
    "EXERCISES",
    "ConstantForceController",
    "arm_robot_eom",
    "com_in_base",
    "friction_ratios",
    "inclined_design",
    "make_controller",
    "moving_and_goal_state",
    "plot_constrained_minimum",
    "plot_planned_pull",
    "rotation_error",
    "show_forces",
    "show_moved_com",
    "squeeze_forces",
    "squeezed_standing_forces",
    "stretched_arm_state",
]  # fmt: skip
