"""Robots, and the states they can be in (§1, §2 of the document)."""

from floatbase.robots.catalogue import load, load_urdf, robots
from floatbase.robots.robot import Foot, Robot
from floatbase.robots.state import State

__all__ = ["Foot", "Robot", "State", "load", "load_urdf", "robots"]
