"""The MuJoCo model of a simulation, as data for the robot in a web page."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from floatbase.robots import Robot
from floatbase.simulation.build import Extra, build_spec
from floatbase.simulation.ground import Ground

# fields of MuJoCo's model that its XML file rounds to six digits. Meshes are left out: only the
# hulls of the links have them, on which a fallen robot lies
_ROUNDED_FIELDS = ("actuator_", "body_", "dof_", "geom_", "jnt_")


def model_data(
    robot: Robot, ground: Ground, timestep: float, losses: bool, extra: Extra, model: mujoco.MjModel
) -> dict[str, Any]:
    """Return a model as XML, and the fields that the XML does not store exactly."""
    xml = build_spec(robot, ground, timestep, losses, extra).to_xml()
    return {"xml": xml, "overrides": _lost_digits(model, xml)}


def _lost_digits(model: mujoco.MjModel, xml: str) -> dict[str, list[float]]:
    """Return the fields of a model that its XML file does not hold to the last digit."""
    read, lost = mujoco.MjModel.from_xml_string(xml), {}
    for name in dir(model):
        exact: Any = getattr(model, name) if name.startswith(_ROUNDED_FIELDS) else None
        is_real = isinstance(exact, np.ndarray) and exact.dtype.kind == "f"
        if is_real and not np.array_equal(exact, getattr(read, name)):
            lost[name] = exact.ravel().tolist()
    return lost
