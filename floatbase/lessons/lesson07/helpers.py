"""Lesson 07: pushes in simulation, and controllers with some constraints added or removed."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from statistics import median
from typing import Any

import numpy as np
from scipy.linalg import block_diag

import floatbase as fb
from floatbase._validation import Array
from floatbase.control import AnalyticController
from floatbase.lessons.controllers import SolverController
from floatbase.lessons.lesson03 import standing_go2_eom
from floatbase.simulation import Controller, Rollout

PUSH_START, PUSH_DURATION = 0.05, 0.1  # s: start and duration of a push
MU = 0.7
LEFT = np.array([0.0, 1.0, 0.0])


class WithoutInequalities(SolverController):
    """Controller without some kinds of inequality constraints, which are removed from every QP.

    Parameters
    ----------
    controller : WholeBodyController
        The controller.
    *kinds : str
        Kinds of constraints, such as "friction" or "normal force", as for `QP.without`.
    """

    def __init__(self, controller: fb.WholeBodyController, *kinds: str):
        super().__init__(controller, lambda qp: fb.solve(qp.without(*kinds)).x)


class WithConstraints(SolverController):
    """Controller with the costs of one controller and the constraints of another.

    The controller minimizes the ψ of lesson 05 subject to (27).

    Parameters
    ----------
    costs : AnalyticController
        Controller of objectives alone, which provides the costs.
    constraints : WholeBodyController
        Controller that provides the equality and inequality constraints.
    """

    def __init__(self, costs: AnalyticController, constraints: fb.WholeBodyController):
        super().__init__(constraints, lambda qp: fb.solve(qp).x)
        self.costs = costs

    def qp(self, state: fb.State, t: float = 0.0) -> fb.QP:
        """Return the QP of one control step."""
        qp = self.controller.qp(state, t, slacks=False)
        costs = self.costs.objective(fb.equations_of_motion(state, self.costs.contacts))
        H, g = block_diag(*(cost.H for cost in costs)), np.concatenate([cost.g for cost in costs])
        return replace(qp, H=H, g=g)


def run_with_push(
    controller: Controller, newtons: float, duration: float = 0.6, towards: Array = LEFT
) -> Rollout:
    """Simulate go2 with a push at the base from 0.05 to 0.15 s.

    Parameters
    ----------
    controller : callable
        Controller of go2.
    newtons : float
        Force of the push [N].
    duration : float, optional
        Duration of the record [s].
    towards : ndarray, shape (3,), optional
        Unit vector in the direction of the push, in the world frame; by default to the left.

    Returns
    -------
    Rollout
        The record.
    """
    push = fb.Push(newtons * towards, start=PUSH_START, duration=PUSH_DURATION)
    return fb.rollout(fb.Simulation(standing_go2_eom().robot), controller, duration, [push])


def make_controller() -> fb.WholeBodyController:
    """Return the controller of the push-recovery map: motion, forces and torques in one QP."""
    state = standing_go2_eom().state
    return fb.WholeBodyController(
        state.robot,
        fb.Contacts.points(state.robot, mu=MU),
        fb.standing_tasks(state),
        joint_limits=None,
    )


def median_time_ms(function: Callable[[], Any], repeats: int = 20) -> float:
    """Measure the time that a function takes.

    Parameters
    ----------
    function : callable
        Function without arguments.
    repeats : int, optional
        Number of calls, after a first one that does not count.

    Returns
    -------
    float
        Median of the times [ms].
    """
    function()
    took = []
    for _ in range(repeats):
        before = time.perf_counter()
        function()
        took.append(time.perf_counter() - before)
    return 1e3 * median(took)


@cache
def leaning_controller(mu: float) -> fb.WholeBodyController:
    """Return the controller of exercise 07.2, which asks for more force than friction allows.

    Parameters
    ----------
    mu : float
        Friction coefficient [-]; the polyhedra have 8 facets.

    Returns
    -------
    WholeBodyController
        The controller.
    """
    state = standing_go2_eom().state
    wish = fb.CoMTask(state.com, acceleration=[6.0, 0.0, 0.0])
    contacts = fb.Contacts.points(state.robot, mu=mu)
    return fb.WholeBodyController(
        state.robot, contacts, [wish, *fb.standing_tasks(state)[1:]], facets=8, joint_limits=None
    )
