"""Lesson A, Fictitious forces."""

from floatbase.lessons.lessonA.helpers import elliptic_rotation, figure_of_eight, tool_error
from floatbase.lessons.lessonA.pictures import (
    SIDE_VIEW,
    TABLE_VIEW,
    play_travelling_feet,
    plot_errors,
    show_tumble,
    show_turntable,
)
