"""Robots, and the states they can be in (§1, §2 of the document)."""

from floatbase.robots.loading import PLATE, catalogue, load, load_urdf, unbolted
from floatbase.robots.robot import UNIT_LENGTH_TOLERANCE, Foot, Robot, check_unit_lengths, checked_corners, torque_limits_of
from floatbase.robots.state import State

# fmt: off
__all__ = [
    "PLATE", "UNIT_LENGTH_TOLERANCE", "Foot", "Robot", "State", "catalogue", "check_unit_lengths", "checked_corners", "load",
    "load_urdf", "torque_limits_of", "unbolted",
]
