"""The playground: a live robot with all that a controller may know or mistake, in a notebook and on a page of its own."""

from floatbase.playground.cards import CARDS, Card, Judge
from floatbase.playground.page import Pace, Playground, gap, playground
from floatbase.playground.session import PERIODS, BaseMotors, Session, control_period, nodding
from floatbase.playground.settings import GAITS, Settings
from floatbase.playground.terms import SYMBOLS, arrows

__all__ = [
    "CARDS",
    "GAITS",
    "PERIODS",
    "SYMBOLS",
    "BaseMotors",
    "Card",
    "Judge",
    "Pace",
    "Playground",
    "Session",
    "Settings",
    "arrows",
    "control_period",
    "gap",
    "nodding",
    "playground",
]
