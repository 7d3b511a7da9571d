"""Lesson 10: controllers to push, and loads and angular momentum of a record."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import floatbase as fb
from floatbase._validation import Array
from floatbase.behaviours import MPC, Gait, Walk
from floatbase.lessons.lesson08.helpers import MU
from floatbase.simulation import Rollout

PUSH_RECOVERY_WATCH_TIME = 4.0  # s: a robot that steps may fall late


def make_controller() -> MPC:
    """Return the controller of the lesson's push-recovery map: go2 trotting in place, by `MPC`."""
    robot = fb.load("go2")
    return MPC(robot, fb.Contacts.points(robot, mu=MU), Gait.trot(robot, start=0.0))


def make_walking_controller() -> Walk:
    """Return the controller of the second map: the same trot, by `Walk`."""
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
