"""Lesson 03: its pictures, helpers and exercises."""

from floatbase.lessons.lesson03.pictures import (
    EXERCISES,
    FULL,
    GHOST_TIME,
    ConstantTorques,
    bars,
    direction,
    matrix_picture,
    show_beta,
    show_knee,
    space_of,
    standing_go2,
    standing_still,
    tilted_squeeze,
    upright,
)

__all__ = [
    "EXERCISES",
    "FULL",
    "GHOST_TIME",
    "ConstantTorques",
    "bars",
    "direction",
    "matrix_picture",
    "show_beta",
    "show_knee",
    "space_of",
    "standing_go2",
    "standing_still",
    "tilted_squeeze",
    "upright",
]
