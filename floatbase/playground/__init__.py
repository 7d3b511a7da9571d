"""The playground: a live robot with all that a controller may know or mistake, in a notebook and on a page of its own."""

from floatbase.playground.cards import CARDS, Card, Judge
from floatbase.playground.equation import EQUATION, SYMBOLS, Term
from floatbase.playground.pace import Pace
from floatbase.playground.page import Playground, gap, playground
from floatbase.playground.session import PERIOD, BaseMotors, Session, nodding
from floatbase.playground.settings import GAITS, Settings
from floatbase.playground.terms import arrows

__all__ = [
    "CARDS",
    "EQUATION",
    "GAITS",
    "PERIOD",
    "SYMBOLS",
    "BaseMotors",
    "Card",
    "Judge",
    "Pace",
    "Playground",
    "Session",
    "Settings",
    "Term",
    "arrows",
    "gap",
    "nodding",
    "playground",
]
