"""Lesson X, The crash investigation."""

from floatbase.lessons.lessonX.box import BlackBox
from floatbase.lessons.lessonX.cases import FAULTS, black_boxes, case_zero, crash_test, innocent_boxes
from floatbase.lessons.lessonX.exercises import EXERCISES, kicked_box
from floatbase.lessons.lessonX.pictures import draw_orders, film, plot_missed, show_moment
from floatbase.lessons.lessonX.tools import accelerations, feet, ground_normal, lagged, needed, sliding

__all__ = [
    "EXERCISES", "FAULTS", "BlackBox", "accelerations", "black_boxes", "case_zero", "crash_test", "draw_orders", "feet", "film",
    "ground_normal", "innocent_boxes", "kicked_box", "lagged", "needed", "plot_missed", "show_moment", "sliding",
]  # fmt: skip
