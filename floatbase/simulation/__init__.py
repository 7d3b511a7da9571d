"""Simulation in MuJoCo, built from the same URDF and independent of the controller's code."""

from floatbase.errors import explain_arguments
from floatbase.simulation.damping import joint_damping
from floatbase.simulation.ground import Box, Ground
from floatbase.simulation.live import ACTIVE_STATUSES, LiveSimulation
from floatbase.simulation.mujoco_adapter import MujocoAdapter
from floatbase.simulation.observed import Latency, Observed, Observer, SensorNoise
from floatbase.simulation.physics import FALLEN_COSINE, FALLEN_HEIGHT_FRACTION, Simulation
from floatbase.simulation.push import Push
from floatbase.simulation.push_recovery import PushRecovery, push_recovery
from floatbase.simulation.record import Rollout
from floatbase.simulation.rollout import Actuators, Controller, rollout
from floatbase.simulation.row_store import read_sweep
from floatbase.simulation.sweep import sweep

__all__ = [
    "ACTIVE_STATUSES", "FALLEN_COSINE", "FALLEN_HEIGHT_FRACTION", "Actuators", "Box", "Controller",
    "Ground", "Latency", "LiveSimulation", "MujocoAdapter", "Observed", "Observer", "Push",
    "PushRecovery", "Rollout", "SensorNoise", "Simulation", "joint_damping", "push_recovery",
    "read_sweep", "rollout", "sweep",
]  # fmt: skip

explain_arguments(globals())
