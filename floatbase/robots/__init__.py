"""Robots, and the states they can be in (§1, §2 of the document)."""

from floatbase.robots.loading import Entry, catalogue, limb_ends, load, load_urdf
from floatbase.robots.robot import Foot, Robot, check_turns, spread_corners, torque_limits_of
from floatbase.robots.standing import stand
from floatbase.robots.state import State

__all__ = [
    "Entry",
    "Foot",
    "Robot",
    "State",
    "catalogue",
    "check_turns",
    "limb_ends",
    "load",
    "load_urdf",
    "spread_corners",
    "stand",
    "torque_limits_of",
]
