"""Lesson 01, "What is a floating base?"."""

from floatbase.lessons.lesson01.helpers import (
    LIFT_URDF,
    base_rotation,
    joint_circle,
    joint_turn,
    weightless_simulation,
)
from floatbase.lessons.lesson01.pictures import (
    PRESSING_POSTURE,
    com_panel,
    play_floating,
    play_pressing,
    pressing_panel,
    show_arm,
    stance_panel,
    thruster_panel,
)
