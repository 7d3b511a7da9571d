"""Lesson 01, What is a floating base?"""

from floatbase.lessons.lesson01.exercises import EXERCISES
from floatbase.lessons.lesson01.helpers import base_turn, turn, wave, weightless
from floatbase.lessons.lesson01.pictures import (
    PLATE,
    PRESSING,
    momentum,
    momentum_rate,
    play_floating,
    play_pressing,
    pressing_panel,
    show_arm,
    stance_panel,
    thruster_panel,
    unbolted,
)

__all__ = [
    "EXERCISES", "PLATE", "PRESSING", "base_turn", "momentum", "momentum_rate", "play_floating",
    "play_pressing", "pressing_panel", "show_arm", "stance_panel", "thruster_panel", "turn", "unbolted", "wave",
    "weightless",
]  # fmt: skip
