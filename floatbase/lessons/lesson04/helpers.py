"""Lesson 04, One cost, many spaces: a controller of least cost, what it reaches, and β in other
units.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import numpy.typing as npt

import floatbase as fb
from floatbase._validation import Array
from floatbase.dynamics import EquationsOfMotion, FeasibleSpace
from floatbase.lessons.controllers import TorqueCommand
from floatbase.lessons.lesson03 import tilted_squeeze
from floatbase.robots import Robot
from floatbase.simulation import Rollout

DESIRED_ACCELERATION = np.array([0.0, 0.5, 0.0])  # m/s², world: to the left
SETTLING_TIME = 0.02  # s in which the engine's soft contact settles


class MinimumCostController:
    """A controller: in every tick the torques of least cost. contacts: its stance. cost: eom ->
    `Quadratic` on τ.
    """

    def __init__(
        self, robot: Robot, contacts: fb.Contacts, cost: Callable[[EquationsOfMotion], fb.Quadratic]
    ):
        self.robot, self.contacts, self.cost = robot, contacts, cost

    def __call__(self, q: Array, v: Array, t: float) -> TorqueCommand:
        """The torques for configuration q and velocity v."""
        eom = fb.equations_of_motion(fb.State(self.robot, q, v), self.contacts)
        return TorqueCommand(self.cost(eom).minimiser())


def measured_acceleration(record: Rollout) -> Array:
    """Mean acceleration of the centre of mass, shape (3,), m/s², from its velocities in a record of
    the physics.
    """
    first = int(np.searchsorted(record.time, SETTLING_TIME))
    change = record.final.com_velocity - record.state(first).com_velocity
    return change / (record.time[-1] - record.time[first])


def rescaled_space(space: FeasibleSpace, W: npt.ArrayLike) -> FeasibleSpace:
    """The same space of motions with another β: v and V⊥ of (13) as they are where a length is ‖W
    (q̈, τ, λ)‖.

    W: shape (nv + d + k, nv + d + k), invertible. The maps give q̈, τ and λ in SI units as before.
    """
    W = np.asarray(W, dtype=np.float64)
    V, v = np.linalg.qr(W @ space.map.A)[0], W @ space.map.b
    v = v - V @ (V.T @ v)
    return FeasibleSpace(
        space.eom, fb.Affine(np.linalg.solve(W, V), np.linalg.solve(W, v), space.map.blocks)
    )


@cache
def tilted_go2_eom() -> EquationsOfMotion:
    """(7) of go2 on four feet, tilted and moving."""
    return tilted_squeeze()[0]
