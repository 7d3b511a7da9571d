"""Comparison of a robot's MuJoCo model with its Pinocchio model."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin

from floatbase.errors import SimulationError
from floatbase.robots import Robot, State
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
            links = _different_links(data, state)
            where = f", at the links {', '.join(links)}" if links else ""
            raise SimulationError(
                f"MuJoCo's model of {robot.name} differs from Pinocchio's in "
                f"{', '.join(different)}{where}. The controller would use another model than the "
                f"simulation. Load the robot again if its model was changed after loading."
            )


def _different_links(data: mujoco.MjData, state: State) -> list[str]:
    """Return the links whose inertia or position differs between MuJoCo and Pinocchio."""
    robot, model = state.robot, data.model
    pin_data = robot.model.createData()
    pin.forwardKinematics(robot.model, pin_data, np.array(state.q))
    links = []
    for i, name in list(enumerate(robot.model.names))[1:]:
        is_base = robot.is_floating and i == 1  # MuJoCo's first joint
        body = int(model.jnt_bodyid[0] if is_base else model.joint(name).bodyid[0])
        axes = data.ximat[body].reshape(3, 3)
        tensor = axes @ np.diag(model.body_inertia[body]) @ axes.T
        theirs = pin.Inertia(float(model.body_mass[body]), data.xipos[body], tensor).matrix()
        ours = pin_data.oMi[i].act(robot.model.inertias[i]).matrix()
        if np.abs(theirs - ours).max() > _TOLERANCE * np.abs(ours).max():
            links.append(model.body(body).name)
    return links
