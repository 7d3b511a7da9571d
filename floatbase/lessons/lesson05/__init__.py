"""Lesson 05, Steering the centre of mass."""

from floatbase.lessons.lesson05.exercises import EXERCISES
from floatbase.lessons.lesson05.helpers import (
    GivenForces,
    arm_robot,
    com_in_base,
    leans,
    pressed,
    reaching,
    rose_controller,
    squeezes,
    three_feet,
)
from floatbase.lessons.lesson05.pictures import planned_pull, show_forces, show_moved_com

__all__ = [
    "EXERCISES", "GivenForces", "arm_robot", "com_in_base", "leans", "planned_pull", "pressed",
    "reaching", "rose_controller", "show_forces", "show_moved_com", "squeezes", "three_feet",
]  # fmt: skip
