"""Comparison of a robot's MuJoCo model with its Pinocchio model."""

from __future__ import annotations

import mujoco
import numpy as np

from floatbase.errors import SimulationError
from floatbase.robots import Robot
from floatbase.simulation._conversion import Conversion

_N_STATES = 2
# relative to the largest entry; rounding leaves 1e-12, and a difference that matters is larger
_TOLERANCE = 1e-8


def check_agreement(robot: Robot, model: mujoco.MjModel) -> None:
    """Raise `SimulationError` unless MuJoCo and Pinocchio have the same mass, gravity, M and h."""
    data, conversion = mujoco.MjData(model), Conversion(robot, model)
    moving_mass = sum(inertia.mass for inertia in robot.model.inertias[1:])
    pairs = {
        "mass": (model.body_mass.sum(), moving_mass),
        "gravity": (model.opt.gravity, robot.model.gravity.linear),
    }
    for seed in range(_N_STATES):
        state = robot.random_state(seed)
        M, h = conversion.dynamics(data, state)
        different = [
            name
            for name, (theirs, ours) in {**pairs, "M": (M, state.M), "h": (h, state.h)}.items()
            if not np.abs(theirs - ours).max() <= _TOLERANCE * np.abs(ours).max()
        ]
        if different:
            raise SimulationError(
                f"MuJoCo's model of {robot.name} differs from Pinocchio's in "
                f"{', '.join(different)}. The controller would use another model than the "
                f"simulation. Load the robot again if its model was changed after loading."
            )
