"""Physics that shares no code with the controller: MuJoCo, built from the same URDF."""

from floatbase.simulation.build import Ground
from floatbase.simulation.conversion import Conversion
from floatbase.simulation.live import SEEN, Live, advice
from floatbase.simulation.physics import Push, Simulation
from floatbase.simulation.record import Rollout
from floatbase.simulation.rollout import Actuators, Controller, rollout

__all__ = [
    "SEEN", "Actuators", "Controller", "Conversion", "Ground", "Live", "Push", "Rollout", "Simulation", "advice", "rollout",
]  # fmt: skip
