"""Legged locomotion: gaits, footholds, centre-of-mass plans, `Walk`, `Stand`, `MPC` and `Jump`."""

from floatbase.behaviours.horizon import STATE_WEIGHTS, HorizonMotion, HorizonQP
from floatbase.behaviours.jump import Jump, JumpPlan
from floatbase.behaviours.mpc import MPC
from floatbase.behaviours.orientation import pitch_and_yaw
from floatbase.behaviours.stand import Stand
from floatbase.behaviours.terrain import Terrain
from floatbase.behaviours.walk.footholds import (
    capture_point,
    neutral_point,
    raibert_foothold,
    step_adjustment,
    support_margin,
)
from floatbase.behaviours.walk.gait import Gait
from floatbase.behaviours.walk.lipm import LIPM, CoMPlan
from floatbase.behaviours.walk.options import Gains
from floatbase.behaviours.walk.plan import WEIGHT_SHIFT_TIME, StepPlan
from floatbase.behaviours.walk.swing import Swing, SwingPath
from floatbase.behaviours.walk.walk import Walk
from floatbase.errors import explain_arguments

__all__ = [
    "LIPM", "MPC", "STATE_WEIGHTS", "WEIGHT_SHIFT_TIME", "CoMPlan", "Gains", "Gait",
    "HorizonMotion", "HorizonQP", "Jump", "JumpPlan", "Stand", "StepPlan", "Swing", "SwingPath",
    "Terrain", "Walk", "capture_point", "neutral_point", "pitch_and_yaw", "raibert_foothold",
    "step_adjustment", "support_margin",
]  # fmt: skip

explain_arguments(globals())
