"""Actuator models between the torque a controller requests and the torque a joint gets.

[FBR]_, App. B.
"""

from floatbase.actuators.hydraulic_actuators import HydraulicActuators, HydraulicState
from floatbase.actuators.hydraulics import (
    VACUUM,
    CylinderGeometry,
    Cylinders,
    Hydraulics,
    PowerBalance,
)
from floatbase.actuators.joint_servo import JointServo, JointTargets
from floatbase.actuators.lags import Delay, FirstOrderLag
from floatbase.errors import explain_arguments

__all__ = [
    "VACUUM", "CylinderGeometry", "Cylinders", "Delay", "FirstOrderLag", "HydraulicActuators",
    "HydraulicState", "Hydraulics", "JointServo", "JointTargets", "PowerBalance",
]  # fmt: skip

explain_arguments(globals())
