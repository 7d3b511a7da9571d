"""Lesson B, Torque is an abstraction."""

from floatbase.lessons.lessonB.helpers import (
    Bench,
    hold_then_turn,
    push_response,
    run_force_loop,
)
from floatbase.lessons.lessonB.pictures import (
    JOINT_VIEW,
    draw_cylinder,
    plot_com_sway,
    plot_torques,
    show_crank,
    show_torque_step,
)
