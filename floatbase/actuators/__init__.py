"""Hydraulic actuators between the torque that a controller desires and the one that a joint gets (App. B of the document)."""

from floatbase.actuators.hydraulics import Cylinders, Hydraulics, Pose, Power
from floatbase.actuators.lags import Delay, FirstOrderLag
from floatbase.actuators.loop import VACUUM, HydraulicActuators, OilState

__all__ = [
    "VACUUM",
    "Cylinders",
    "Delay",
    "FirstOrderLag",
    "HydraulicActuators",
    "Hydraulics",
    "OilState",
    "Pose",
    "Power",
]
