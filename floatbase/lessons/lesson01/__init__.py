"""Lesson 01: its pictures, helpers and exercises."""

from floatbase.lessons.lesson01.pictures import (
    EXERCISES,
    PRESSING,
    PRESSING_VIEW,
    Torques,
    base_turn,
    joint_servo,
    play_floating,
    play_pressing,
    pressing_panel,
    show_arm,
    stance_panel,
    thruster_panel,
    turn,
    wave,
    weightless,
)
from floatbase.objectives import momentum, momentum_rate
from floatbase.robots import PLATE, unbolted

__all__ = [
    "EXERCISES",
    "PLATE",
    "PRESSING",
    "PRESSING_VIEW",
    "Torques",
    "base_turn",
    "joint_servo",
    "momentum",
    "momentum_rate",
    "play_floating",
    "play_pressing",
    "pressing_panel",
    "show_arm",
    "stance_panel",
    "thruster_panel",
    "turn",
    "unbolted",
    "wave",
    "weightless",
]
