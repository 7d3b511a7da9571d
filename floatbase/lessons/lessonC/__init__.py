"""Lesson C, How a QP solver thinks."""

from floatbase.lessons.controllers import SolverController
from floatbase.lessons.lessonC.exercises import rounds_from_guess
from floatbase.lessons.lessonC.helpers import (
    LimitedActiveSet,
    answer_or_default,
    beale_problem,
    braking_qp,
    corner_table,
    hexagon_table,
    longest_step,
    row_to_drop,
    run_with_push,
    standing_controller,
    table_top,
)
from floatbase.lessons.lessonC.pictures import (
    PUZZLES,
    ActiveSetGame,
    check_active_set,
    plot_problem,
    show_solver_path,
    show_table,
)
