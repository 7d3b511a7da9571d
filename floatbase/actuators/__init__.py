"""Hydraulic actuators between the torque that a controller desires and the one that a joint gets
(App. B of the course text).
"""

from floatbase.actuators.hydraulic_actuators import HydraulicActuators, HydraulicState
from floatbase.actuators.hydraulics import (
    VACUUM,
    CylinderGeometry,
    Cylinders,
    Hydraulics,
    PowerBalance,
)
from floatbase.actuators.lags import Delay, FirstOrderLag

__all__ = [
    "VACUUM",
    "CylinderGeometry",
    "Cylinders",
    "Delay",
    "FirstOrderLag",
    "HydraulicActuators",
    "HydraulicState",
    "Hydraulics",
    "PowerBalance",
]
