"""Whole-body control as a quadratic program (§4 of the document)."""

from floatbase.control.analytic import AnalyticController
from floatbase.control.controller import Command, Limits, WholeBodyController, build_qp

__all__ = [
    "AnalyticController",
    "Command",
    "Limits",
    "WholeBodyController",
    "build_qp",
]
