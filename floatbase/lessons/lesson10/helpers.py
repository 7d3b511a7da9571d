"""Lesson 10: a pendulum with a horizon, controllers to push, and measures of a record."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

import floatbase as fb
from floatbase._validation import Array
from floatbase.behaviours import MPC, Gait, Walk
from floatbase.lessons.lesson08.helpers import MU
from floatbase.simulation import Rollout

PUSH_RECOVERY_WATCH_TIME = 4.0  # s: a robot that steps may fall late
INTERVAL = 0.02  # s, of the pendulum
END_WEIGHT = 100.0  # of ξ at the end, beside the positions p


@cache
def pendulum_rate() -> float:
    """Return ω of the pendulum as high as the centre of mass of go2 [1/s]."""
    robot = fb.load("go2")
    return float(np.sqrt(robot.gravity / robot.standing().com[2]))


def plan_pendulum(x: npt.ArrayLike, middles: npt.ArrayLike) -> Array:
    """Compute the positions p of a horizon of the lesson's pendulum.

    Parameters
    ----------
    x : array_like, shape (2,)
        Position and velocity of the centre of mass [m, m/s].
    middles : array_like, shape (n,)
        Middle of the foot in each interval of 20 ms [m].

    Returns
    -------
    ndarray, shape (n,)
        Positions that minimize the distances from the middles and, with a large weight, the
        distance of the capture point ξ from the last middle at the end [m].

    Notes
    -----
    The capture point at the end is a weighted sum of the positions: ξ grows by e^{ωΔt} in each
    interval. The minimum is on the line through the middles in the direction of these weights.
    """
    return plan_with(x, middles)


def plan_with(x: npt.ArrayLike, middles: npt.ArrayLike, **parts: Any) -> Array:
    """Compute the positions of `plan_pendulum`, with parts of the problem replaced."""
    (c, velocity), feet = np.asarray(x, dtype=np.float64), np.asarray(middles, dtype=np.float64)
    n, growth = len(feet), np.exp(pendulum_rate() * INTERVAL)
    problem = {
        "weights": (1.0 - growth) * growth ** np.arange(n - 1.0, -1.0, -1.0),  # of p in ξ
        "alone": growth**n * (c + velocity / pendulum_rate()),  # ξ at the end with p = 0
        "near": feet, "goal": feet[-1], "end_weight": END_WEIGHT,
    } | parts  # fmt: skip
    weights, near, square = problem["weights"], problem["near"], problem["end_weight"] ** 2
    miss = problem["goal"] - problem["alone"] - weights @ near
    return np.asarray(near + square * miss / (1.0 + square * weights @ weights) * weights)


def make_controller(n: int = 10) -> MPC:
    """Return the controller of the lesson's push-recovery map: go2 trotting in place, by `MPC`."""
    robot = fb.load("go2")
    return MPC(robot, fb.Contacts.points(robot, mu=MU), Gait.trot(robot, start=0.0), n=n)


def make_short_controller() -> MPC:
    """Return the controller of the second map: the same `MPC` with one interval."""
    return make_controller(n=1)


def make_walking_controller() -> Walk:
    """Return the controller of the third map: the same trot, by `Walk`."""
    robot = fb.load("go2")
    return Walk(robot, fb.Contacts.points(robot, mu=MU), Gait.trot(robot, start=0.0))


def angular_momentum(record: Rollout, i: int) -> Array:
    """Return the angular momentum about the centre of mass in a row of a record, shape (3,).

    Parameters
    ----------
    record : Rollout
        The record.
    i : int
        Index of the row.

    Returns
    -------
    ndarray, shape (3,)
        Angular momentum in the world frame [kg·m²/s].
    """
    model = record.robot.model
    h = pin.computeCentroidalMomentum(model, model.createData(), record.q[i], record.v[i])
    return np.array(h.angular)


def mean_load(record: Rollout, begin: float, end: float, standing: bool) -> float:
    """Return the mean vertical force of the ground, as a multiple of the weight.

    Parameters
    ----------
    record : Rollout
        The record.
    begin, end : float
        Part of the record [s].
    standing : bool
        Whether only rows with a contact count, or all.

    Returns
    -------
    float
        Mean vertical force divided by the weight [-].
    """
    rows = (record.time >= begin - 1e-9) & (record.time < end - 1e-9)
    if standing:
        rows &= np.array([len(record.contacts_at(i)) > 0 for i in range(len(record))])
    return float(record.measured[rows, 2::3].sum(axis=1).mean() / record.robot.weight)
