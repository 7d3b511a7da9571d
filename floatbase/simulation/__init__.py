"""Physics that shares no code with the controller: MuJoCo, built from the same URDF."""

from floatbase.simulation.altered import AlteredSimulation, World
from floatbase.simulation.build import Ground
from floatbase.simulation.conversion import Conversion
from floatbase.simulation.live import GOES_ON, IDLE, SEEN, Live, advice
from floatbase.simulation.physics import Push, Simulation
from floatbase.simulation.push_rose import PushRose, push_rose
from floatbase.simulation.record import Rollout
from floatbase.simulation.rollout import Actuators, Controller, rollout
from floatbase.simulation.sweep import sweep
from floatbase.simulation.table import Table

__all__ = [
    "GOES_ON", "IDLE", "SEEN", "Actuators", "AlteredSimulation", "Controller", "Conversion", "Ground", "Live", "Push",
    "PushRose", "Rollout", "Simulation", "Table", "World", "advice", "push_rose", "rollout", "sweep",
]  # fmt: skip
