"""Lesson 02, Equations of motion and contact."""

from floatbase.lessons.lesson02.helpers import (
    disc_state,
    foot_displacement,
    load_disc,
    parking_states,
    rolling_wheel,
    run_constant_torques,
    tool_displacement,
)
from floatbase.lessons.lesson02.pictures import (
    draw_equation,
    force_panel,
    parking_panel,
    play_collapse_comparison,
    play_tool_comparison,
)
