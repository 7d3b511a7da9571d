"""Robot models and their states.

[FBR]_, §1 and §2.
"""

from floatbase.errors import explain_arguments
from floatbase.robots._checks import UNIT_NORM_TOLERANCE
from floatbase.robots.floating import PLATE_SIZE, with_floating_base
from floatbase.robots.loading import catalogue, load, load_mjcf, load_urdf
from floatbase.robots.robot import Foot, Robot
from floatbase.robots.state import State

__all__ = [
    "PLATE_SIZE", "UNIT_NORM_TOLERANCE", "Foot", "Robot", "State", "catalogue",
    "load", "load_mjcf", "load_urdf", "with_floating_base",
]  # fmt: skip

explain_arguments(globals())
