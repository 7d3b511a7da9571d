"""Whole-body control as a quadratic program (§4 of the document)."""

from floatbase.control.analytic import AnalyticController
from floatbase.control.command import Command
from floatbase.control.controller import WholeBodyController
from floatbase.control.problem import Limits, Problem, build_qp

__all__ = [
    "AnalyticController",
    "Command",
    "Limits",
    "Problem",
    "WholeBodyController",
    "build_qp",
]
