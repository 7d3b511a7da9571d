"""Lesson 01, What is a floating base?"""

from floatbase.lessons.lesson01.exercises import EXERCISES
from floatbase.lessons.lesson01.helpers import LIFT, base_turn, turn, wave, weightless
from floatbase.lessons.lesson01.pictures import (
    PRESSING,
    centre_panel,
    play_floating,
    play_pressing,
    pressing_panel,
    show_arm,
    stance_panel,
    thruster_panel,
)

__all__ = [
    "EXERCISES", "LIFT", "PRESSING", "base_turn", "centre_panel", "play_floating",
    "play_pressing", "pressing_panel", "show_arm", "stance_panel", "thruster_panel", "turn", "wave",
    "weightless",
]  # fmt: skip
