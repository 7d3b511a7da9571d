"""Lesson 09, Feet with area: the humanoid."""

from floatbase.lessons.lesson09.exercises import ankle_sensor_reading, run_lean
from floatbase.lessons.lesson09.helpers import (
    PUSH_RECOVERY_WATCH_TIME,
    centre_of_pressure_path,
    corner_forces,
    leaning_controller,
    load_talos,
    make_controller,
    make_standing_controller,
    outcome_text,
    run_standing,
    single_support_rows,
)
from floatbase.lessons.lesson09.pictures import (
    ONE_SOLE_VIEW,
    SOLES_VIEW,
    limit_kinds,
    play_resultants,
    plot_walk,
    show_sole,
    show_soles,
    soles_picture,
)
