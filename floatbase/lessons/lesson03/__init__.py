"""Lesson 03, The space of possible motions."""

from floatbase.lessons.lesson03.exercises import EXERCISES
from floatbase.lessons.lesson03.helpers import (
    direction,
    rising_solo8,
    space_of,
    standing_go2,
    standing_still,
    tilted_squeeze,
    upright,
)
from floatbase.lessons.lesson03.pictures import bars, matrix_picture, show_beta, show_knee

__all__ = [
    "EXERCISES", "bars", "direction", "matrix_picture", "rising_solo8", "show_beta", "show_knee", "space_of", "standing_go2",
    "standing_still", "tilted_squeeze", "upright",
]  # fmt: skip
