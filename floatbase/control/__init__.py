"""Whole-body control as a quadratic program (§4 of the document)."""

from floatbase.control.analytic import AnalyticController
from floatbase.control.belief import Belief
from floatbase.control.command import Command
from floatbase.control.controller import WholeBodyController
from floatbase.control.limits import Limits, Rows
from floatbase.control.problem import Problem, build_qp

__all__ = [
    "AnalyticController",
    "Belief",
    "Command",
    "Limits",
    "Problem",
    "Rows",
    "WholeBodyController",
    "build_qp",
]
