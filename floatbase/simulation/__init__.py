"""Physics that shares no code with the controller: MuJoCo, built from the same URDF."""

from floatbase.simulation.conversion import Conversion, body_name
from floatbase.simulation.live import SEEN, Live, advice
from floatbase.simulation.physics import Ground, Push, Simulation
from floatbase.simulation.record import Rollout, Row, joined, recorded
from floatbase.simulation.rollout import Actuators, Controller, rollout

__all__ = [
    "SEEN",
    "Actuators",
    "Controller",
    "Conversion",
    "Ground",
    "Live",
    "Push",
    "Rollout",
    "Row",
    "Simulation",
    "advice",
    "body_name",
    "joined",
    "recorded",
    "rollout",
]
