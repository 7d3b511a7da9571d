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
from floatbase.simulation.perturbed import Perturbation, PerturbedSimulation
from floatbase.simulation.physics import Simulation
from floatbase.simulation.push import Push
from floatbase.simulation.push_recovery import PushRecovery, push_recovery
from floatbase.simulation.record import Rollout
from floatbase.simulation.rollout import Actuators, Controller, rollout
from floatbase.simulation.row_store import read_sweep
from floatbase.simulation.sweep import sweep

__all__ = [
    "ACTIVE_STATUSES",
    "AUTO_PAUSED",
    "PUSH_DISPLAY_TIME",
    "Actuators",
    "Controller",
    "Conversion",
    "Ground",
    "LiveSimulation",
    "Perturbation",
    "PerturbedSimulation",
    "Push",
    "PushRecovery",
    "Rollout",
    "Simulation",
    "push_recovery",
    "read_sweep",
    "rollout",
    "status_message",
    "sweep",
]  # fmt: skip
