"""Lesson C, How a QP solver thinks."""

from floatbase.lessons.lessonC.exercises import EXERCISES, rounds_from
from floatbase.lessons.lessonC.helpers import (
    EveryTick,
    Stopped,
    beale,
    between_walls,
    braking,
    corner_table,
    longest_step,
    pushed,
    right_or,
    row_to_drop,
    six_edges,
    standing,
)
from floatbase.lessons.lessonC.pictures import Game, plot_problem, plot_rounds, show_table, show_way

__all__ = [
    "EXERCISES", "EveryTick", "Game", "Stopped", "beale", "between_walls", "braking", "corner_table", "longest_step",
    "plot_problem", "plot_rounds", "pushed", "right_or", "rounds_from", "row_to_drop", "show_table",
    "show_way", "six_edges", "standing",
]  # fmt: skip
