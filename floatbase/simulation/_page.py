"""What a web page needs to know of the physics: its model, and when a robot has fallen."""

from floatbase.simulation.after_fall import joint_damping
from floatbase.simulation.build import build_spec
from floatbase.simulation.physics import FALLEN_COSINE, FALLEN_HEIGHT_FRACTION

__all__ = ["FALLEN_COSINE", "FALLEN_HEIGHT_FRACTION", "build_spec", "joint_damping"]
