"""Legged locomotion: gaits, footholds, centre-of-mass plans, `Walk`, `Stand`, `MPC` and `Jump`."""

from floatbase.behaviours.footholds import (
    capture_point,
    neutral_point,
    step_adjustment,
    support_margin,
)
from floatbase.behaviours.gait import Gait
from floatbase.behaviours.horizon import STATE_WEIGHTS, HorizonMotion, HorizonQP
from floatbase.behaviours.jump import Jump, JumpPlan
from floatbase.behaviours.lipm import LIPM, CoMPlan
from floatbase.behaviours.mpc import MPC
from floatbase.behaviours.options import Gains
from floatbase.behaviours.orientation import pitch_and_yaw
from floatbase.behaviours.plan import WEIGHT_SHIFT_TIME, StepPlan
from floatbase.behaviours.raibert import raibert_foothold
from floatbase.behaviours.stand import Stand
from floatbase.behaviours.swing import Swing, SwingPath
from floatbase.behaviours.terrain import Terrain
from floatbase.behaviours.walk import Walk

__all__ = [
    "LIPM",
    "MPC",
    "STATE_WEIGHTS",
    "WEIGHT_SHIFT_TIME",
    "CoMPlan",
    "Gains",
    "Gait",
    "HorizonMotion",
    "HorizonQP",
    "Jump",
    "JumpPlan",
    "Stand",
    "StepPlan",
    "Swing",
    "SwingPath",
    "Terrain",
    "Walk",
    "capture_point",
    "neutral_point",
    "pitch_and_yaw",
    "raibert_foothold",
    "step_adjustment",
    "support_margin",
]  # fmt: skip
