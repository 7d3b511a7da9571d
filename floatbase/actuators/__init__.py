"""Hydraulic actuators between a torque that is asked for and one that comes (App. B of the document)."""

from floatbase.actuators.hydraulics import VACUUM, Cylinders, HydraulicActuators, Hydraulics, OilState, Pose, Power

__all__ = [
    "VACUUM",
    "Cylinders",
    "HydraulicActuators",
    "Hydraulics",
    "OilState",
    "Pose",
    "Power",
]
