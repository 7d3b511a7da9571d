"""Lesson 01: the smallest robot, joint paths, a simulation without gravity, and base rotation."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

import floatbase as fb
from floatbase._geometry import minimum_jerk
from floatbase._validation import Array, read_only
from floatbase.robots import Robot
from floatbase.simulation import Rollout

# the URDF of the smallest robot: a box of 5 kg that slides up and down a rail, 2 m high
LIFT_URDF = """
<robot name="lift">
  <link name="rail"/>
  <link name="box">
    <inertial>
      <mass value="5"/> <inertia ixx="0.05" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <joint name="slide" type="prismatic">
    <parent link="rail"/> <child link="box"/> <axis xyz="0 0 1"/>
    <limit lower="0" upper="2" effort="200" velocity="1"/>
  </joint>
</robot>
"""


def joint_turn(joint: int, angle: float, duration: float) -> Callable[[float], Array]:
    """Return a path that turns one of six joints; it starts and ends at rest."""
    return lambda t: angle * minimum_jerk(t / duration)[0] * np.eye(6)[joint]


def joint_circle(first: int, second: int, size: float, duration: float) -> Callable[[float], Array]:
    """Return a path on which two of six joints go once around a circle, from rest to rest."""

    def path(t: float) -> Array:
        angle = 2.0 * np.pi * minimum_jerk(t / duration)[0]
        return size * (np.sin(angle) * np.eye(6)[first] + (1.0 - np.cos(angle)) * np.eye(6)[second])

    return path


def weightless_simulation(robot: Robot) -> fb.Simulation:
    """Return a simulation of a robot without gravity."""
    sim = fb.Simulation(robot)
    sim.model.opt.gravity[:] = 0.0
    return sim


def base_rotation(record: Rollout) -> Array:
    """Return how far the base turned in a record."""
    first, last = (record.state(i).frame_pose("base_link").rotation for i in (0, -1))
    return read_only(np.degrees(pin.log3(last @ first.T)))
