"""Physics that shares no code with the controller: MuJoCo, built from the same URDF."""

from floatbase.simulation.build import Ground
from floatbase.simulation.conversion import Conversion
from floatbase.simulation.live import (
    ACTIVE_STATUSES,
    AUTO_PAUSED,
    PUSH_DISPLAY_TIME,
    LiveSimulation,
    status_message,
)
from floatbase.simulation.physics import Push, Simulation
from floatbase.simulation.push_recovery import PushRecovery, push_recovery
from floatbase.simulation.record import Rollout
from floatbase.simulation.rollout import Actuators, Controller, rollout
from floatbase.simulation.sweep import sweep
from floatbase.simulation.table import Table

__all__ = [
    "ACTIVE_STATUSES",
    "AUTO_PAUSED",
    "PUSH_DISPLAY_TIME",
    "Actuators",
    "Controller",
    "Conversion",
    "Ground",
    "LiveSimulation",
    "Push",
    "PushRecovery",
    "Rollout",
    "Simulation",
    "Table",
    "push_recovery",
    "rollout",
    "status_message",
    "sweep",
]  # fmt: skip
