"""What a web page needs to know of a walk: its controllers, and what its plans depend on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from floatbase._validation import Array
from floatbase.behaviours.walk import compiled_targets, plan
from floatbase.behaviours.walk.gait import TIME_TOLERANCE
from floatbase.behaviours.walk.gait_limits import speed_fractions
from floatbase.behaviours.walk.posture import MIN_SIDE_FRACTION
from floatbase.behaviours.walk.walk import Walk
from floatbase.control import WholeBodyController

# names as in the page's JavaScript
_CONSTANTS = {
    "timeTolerance": TIME_TOLERANCE,
    "nPhases": plan._PLANNED_PHASES,
    "horizon": plan._PLAN_HORIZON,
    "settlingTime": plan._TOUCHDOWN_SETTLING_TIME,
    "shiftTime": plan._ZMP_SHIFT_TIME,
    "deadZone": plan.DCM_DEAD_ZONE,
    "pathShift": plan._PATH_SHIFT_THRESHOLD,
    "sideFraction": MIN_SIDE_FRACTION,
}
SHIFT_TIME = plan._ZMP_SHIFT_TIME  # s that the weight needs before the first lift-off


def controllers(walk: Walk) -> Mapping[tuple[str, ...], WholeBodyController]:
    """Return the controllers of all stances of a walk."""
    return walk._controllers._controllers


def plan_data(walk: Walk) -> dict[str, Any]:
    """Return what the plans of a walk on point feet depend on, for JSON."""
    posture, options = walk._posture, walk.options
    return {
        "constants": _CONSTANTS,
        # where the numbers of a plan are in the arrays of `compiled_targets`
        "layout": {name: value for name, value in vars(compiled_targets).items() if name.isupper()},
        "feet": {foot: nominal.tolist() for foot, nominal in posture.nominal_feet.items()},
        "comHeight": float(posture.state.com[2]),
        "groundHeight": posture.ground_height,
        "baseRotation": posture.rotation("base").ravel().tolist(),
        "reach": options.reach,
        "clearance": options.clearance,
        "acceleration": options.acceleration.tolist(),
        "ramp": options.ramp,
        "fullLoad": {foot: load for foot, (_, load) in walk._controllers._full_loads.items()},
    }


def possible_fractions(walk: Walk, motion: Array) -> tuple[float, float]:
    """Return the fractions of a desired motion that the feet can follow: first period, later.

    motion: (3,), velocity [m/s] and yaw rate [rad/s].
    """
    options = walk.options
    return speed_fractions(
        walk.gait, walk._posture, options.reach, np.asarray(motion), options.acceleration[0]
    )
