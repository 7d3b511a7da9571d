"""Robots, and the states they can be in (§1, §2 of the course text)."""

from floatbase.robots.loading import PLATE_SIZE, catalogue, load, load_urdf, with_floating_base
from floatbase.robots.robot import (
    UNIT_NORM_TOLERANCE,
    Foot,
    Robot,
    as_corners,
    as_torque_limits,
    check_unit_norms,
)
from floatbase.robots.state import State

# fmt: off
__all__ = [
    "PLATE_SIZE", "UNIT_NORM_TOLERANCE", "Foot", "Robot", "State", "as_corners", "as_torque_limits",
    "catalogue",
    "check_unit_norms", "load", "load_urdf", "with_floating_base",
]
