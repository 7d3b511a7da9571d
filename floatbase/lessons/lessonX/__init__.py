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
    ground_normal,
    lagged,
    required_forces,
    sliding_friction_ratios,
)
from floatbase.lessons.lessonX.exercises import kicked_box
from floatbase.lessons.lessonX.pictures import (
    draw_torque_comparison,
    play_box,
    plot_residual_force,
    show_instant,
)
from floatbase.lessons.lessonX.verdicts import judge_line
