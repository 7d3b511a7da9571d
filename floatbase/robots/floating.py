"""Robots with a fixed base that are set free."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from floatbase._validation import as_bool, as_instance, read_only
from floatbase.errors import InputError
from floatbase.robots.feet import DIAGONALS
from floatbase.robots.loading import load_urdf
from floatbase.robots.robot import Foot, Robot

# width and thickness, m, of the plate on which `with_floating_base` places a robot
PLATE_SIZE = (0.4, 0.03)
_FLIGHT_HEIGHT = 1.0  # m: where a robot without a plate floats once its base is free


def with_floating_base(robot: Robot, plate: bool = False) -> Robot:
    """Free the base of a fixed-base robot.

    The links and joints of the URDF stay the same, except for links without mass below the base,
    such as "world".

    Parameters
    ----------
    robot : Robot
        Robot with a fixed base, such as ur5.
    plate : bool, optional
        Whether the robot stands on a massless square plate of size `PLATE_SIZE`. Otherwise it
        touches nothing and floats 1 m above the ground.

    Returns
    -------
    Robot
        The robot with a floating base.

    Raises
    ------
    InputError
        If the base is already floating.
    """
    as_bool("plate", plate)
    if as_instance("robot", robot, Robot, 'fb.load("ur5")').is_floating:
        raise InputError(
            f"The base of {robot.name} is already floating. with_floating_base needs a robot with "
            f"a fixed base, such as ur5."
        )
    floating = load_urdf(robot.urdf, name=robot.name, torque_limits=robot.torque_limits, feet=())
    model = floating.model.copy()
    model.armature = np.concatenate([np.zeros(6), robot.model.armature])  # not in the URDF
    width, thickness = PLATE_SIZE
    corners = np.column_stack([0.5 * width * DIAGONALS, np.full(4, -thickness)])
    return replace(
        floating,
        model=model,
        package_dirs=robot.package_dirs,
        feet=(Foot(floating.base, corners=corners),) if plate else (),
        posture=read_only(
            [0.0, 0.0, thickness if plate else _FLIGHT_HEIGHT, 0.0, 0.0, 0.0, 1.0, *robot.posture]
        ),
    )
