"""Lesson X, The crash investigation."""

from floatbase.lessons.lessonX.box import BlackBox
from floatbase.lessons.lessonX.cases import (
    FAULTS,
    Case,
    Mistake,
    black_boxes,
    case_zero,
    crash_test,
    drawn_cases,
    innocent_boxes,
    innocent_cases,
    recorded,
)
from floatbase.lessons.lessonX.exercises import EXERCISES, kicked_box
from floatbase.lessons.lessonX.pictures import draw_orders, film, plot_missed, show_moment
from floatbase.lessons.lessonX.tools import accelerations, feet, ground_normal, lagged, needed, sliding
from floatbase.lessons.lessonX.verdicts import AGAINST, fault_in, judged

__all__ = [
    "AGAINST", "EXERCISES", "FAULTS", "BlackBox", "Case", "Mistake", "accelerations", "black_boxes", "case_zero", "crash_test",
    "draw_orders", "drawn_cases", "fault_in", "feet", "film", "ground_normal", "innocent_boxes", "innocent_cases", "judged",
    "kicked_box", "lagged", "needed", "plot_missed", "recorded", "show_moment", "sliding",
]  # fmt: skip
