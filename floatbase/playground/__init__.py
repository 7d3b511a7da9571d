"""Playground: a live robot whose model and physics can be changed separately.

The playground runs in a notebook or on a separate page.
"""

from floatbase.errors import explain_arguments
from floatbase.playground.build import nodding_rotation
from floatbase.playground.challenges import CHALLENGES, Challenge, Judge
from floatbase.playground.equation import EQUATION, Term
from floatbase.playground.limits import limit_text
from floatbase.playground.mismatch import ModelMismatch
from floatbase.playground.page import Playground, mean_force_error, playground
from floatbase.playground.perturbed import BaseMotors, Perturbation, PerturbedSimulation
from floatbase.playground.real_time_factor import RealTimeFactor
from floatbase.playground.session import PERIOD, Session
from floatbase.playground.settings import GAITS, Settings
from floatbase.playground.term_arrows import term_arrows

__all__ = [
    "CHALLENGES",
    "EQUATION",
    "GAITS",
    "PERIOD",
    "BaseMotors",
    "Challenge",
    "Judge",
    "ModelMismatch",
    "Perturbation",
    "PerturbedSimulation",
    "Playground",
    "RealTimeFactor",
    "Session",
    "Settings",
    "Term",
    "limit_text",
    "mean_force_error",
    "nodding_rotation",
    "playground",
    "term_arrows",
]

explain_arguments(globals())
