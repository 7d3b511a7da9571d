"""The settings that determine the plans of a walk, as data for the robot in a web page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from floatbase.behaviours.walk import compiled_targets, plan
from floatbase.behaviours.walk.gait import TIME_TOLERANCE
from floatbase.behaviours.walk.posture import MIN_SIDE_FRACTION

if TYPE_CHECKING:
    from floatbase.behaviours.walk.walk import Walk

# names as in the page's JavaScript
_CONSTANTS = {
    "timeTolerance": TIME_TOLERANCE,
    "nPhases": plan.PLANNED_PHASES,
    "horizon": plan.PLAN_HORIZON,
    "settlingTime": plan.TOUCHDOWN_SETTLING_TIME,
    "shiftTime": plan.WEIGHT_SHIFT_TIME,
    "deadZone": plan.DCM_DEAD_ZONE,
    "pathShift": plan.PATH_SHIFT_THRESHOLD,
    "sideFraction": MIN_SIDE_FRACTION,
}


def gait_data(walk: Walk) -> dict[str, Any]:
    """Return the gait, and the fraction of the desired motion in its first period, for JSON."""
    gait = walk.gait
    return {
        "offsets": dict(gait.offsets),
        "period": gait.period,
        "swing": gait.swing,
        "firstFraction": walk._speeds[0],
    }


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
        "fullLoad": walk._controllers.full_loads,
    }
