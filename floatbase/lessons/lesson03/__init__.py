"""Lesson 03, The space of possible motions."""

from floatbase.lessons.lesson03.helpers import (
    beta_direction,
    rising_solo8_eom,
    standing_go2_eom,
    standing_still_beta,
    tilted_go2_eom,
    upright_solo12,
)
from floatbase.lessons.lesson03.pictures import matrix_picture, motion_bars, show_beta, show_knee
