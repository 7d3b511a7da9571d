"""Lesson 04: a minimum-cost controller, its measured acceleration, and β in other units."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

import floatbase as fb
from floatbase._validation import Array
from floatbase.dynamics import EquationsOfMotion, FeasibleSpace
from floatbase.lessons.controllers import TorqueCommand
from floatbase.robots import Robot
from floatbase.simulation import Rollout

DESIRED_ACCELERATION = np.array([0.0, 0.5, 0.0])  # m/s², world: to the left
SETTLING_TIME = 0.02  # s in which the engine's soft contact settles


class MinimumCostController:
    """Controller that minimizes a cost on the torques in every control step."""

    def __init__(
        self, robot: Robot, contacts: fb.Contacts, cost: Callable[[EquationsOfMotion], fb.Quadratic]
    ):
        self.robot, self.contacts, self.cost = robot, contacts, cost

    def __call__(self, q: Array, v: Array, t: float) -> TorqueCommand:
        """Return the torques for configuration q and velocity v."""
        eom = fb.equations_of_motion(fb.State(self.robot, q, v), self.contacts)
        return TorqueCommand(self.cost(eom).minimizer())


def measured_acceleration(record: Rollout) -> Array:
    """Return the mean acceleration of the centre of mass in a record.

    Parameters
    ----------
    record : Rollout
        The record.

    Returns
    -------
    ndarray, shape (3,)
        Acceleration, from the velocities after the contacts have settled, in the world frame
        [m/s²].
    """
    first = int(np.searchsorted(record.time, SETTLING_TIME))
    change = record.final.com_velocity - record.state(first).com_velocity
    return change / (record.time[-1] - record.time[first])


def rescaled_space(space: FeasibleSpace, W: npt.ArrayLike) -> FeasibleSpace:
    """Return the same space of motions with another β, whose unit of length is set by a matrix.

    v and V⊥ of (13) become those of a space in which vectors have the length ‖W (q̈, τ, λ)‖.

    Parameters
    ----------
    space : FeasibleSpace
        The space of possible motions.
    W : array_like, shape (nv + d + k, nv + d + k)
        The matrix, which must be invertible.

    Returns
    -------
    FeasibleSpace
        The space. Its maps still give q̈, τ and λ in SI units.
    """
    W = np.asarray(W, dtype=np.float64)
    V, v = np.linalg.qr(W @ space.map.A)[0], W @ space.map.b
    v = v - V @ (V.T @ v)
    return FeasibleSpace(
        space.eom, fb.Affine(np.linalg.solve(W, V), np.linalg.solve(W, v), space.map.blocks)
    )
