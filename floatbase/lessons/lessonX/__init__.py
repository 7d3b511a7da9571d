"""Lesson X, The crash investigation."""

from floatbase.lessons.lessonX.black_box import BlackBox
from floatbase.lessons.lessonX.cases import (
    FAULTS,
    Case,
    InjectedFault,
    black_boxes,
    case_zero,
    crash_test,
    faultless_boxes,
    faultless_cases,
    random_cases,
    record_box,
)
from floatbase.lessons.lessonX.diagnostics import (
    accelerations,
    foot_centres,
    ground_normal,
    lagged,
    required_forces,
    sliding_friction_ratios,
)
from floatbase.lessons.lessonX.exercises import EXERCISES, kicked_box
from floatbase.lessons.lessonX.pictures import (
    draw_torque_comparison,
    play_box,
    plot_residual_force,
    show_instant,
)
from floatbase.lessons.lessonX.verdicts import COUNTER_EVIDENCE, judge_line, named_fault

__all__ = [
    "COUNTER_EVIDENCE",
    "EXERCISES",
    "FAULTS",
    "BlackBox",
    "Case",
    "InjectedFault",
    "accelerations",
    "black_boxes",
    "case_zero",
    "crash_test",
    "draw_torque_comparison",
    "faultless_boxes",
    "faultless_cases",
    "foot_centres",
    "ground_normal",
    "judge_line",
    "kicked_box",
    "lagged",
    "named_fault",
    "play_box",
    "plot_residual_force",
    "random_cases",
    "record_box",
    "required_forces",
    "show_instant",
    "sliding_friction_ratios",
]  # fmt: skip
