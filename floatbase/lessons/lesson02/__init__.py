"""Lesson 02, Equations of motion and contact."""

from floatbase.lessons.lesson02.helpers import (
    disc_state,
    foot_displacement,
    load_disc,
    parking_states,
    rolling_wheel,
    run_constant_torques,
    shoved_go2,
    tool_displacement,
)
from floatbase.lessons.lesson02.pictures import (
    draw_equation,
    force_panel,
    parking_panel,
    play_tool_comparison,
    stabilization_panel,
)
