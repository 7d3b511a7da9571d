"""Whole-body control as a quadratic program."""

from floatbase.control.analytic import AnalyticController
from floatbase.control.capture_point import capture_point_inequality
from floatbase.control.command import Command, CommandBatch
from floatbase.control.controller import WholeBodyController
from floatbase.control.joint_limits import JointLimits
from floatbase.control.limits import Limits, LinearInequality
from floatbase.control.problem import Problem, build_qp
from floatbase.errors import explain_arguments

__all__ = [
    "AnalyticController", "Command", "CommandBatch", "JointLimits", "Limits", "LinearInequality",
    "Problem", "WholeBodyController", "build_qp", "capture_point_inequality",
]  # fmt: skip

explain_arguments(globals(), without=["Command"])  # made in every control step
