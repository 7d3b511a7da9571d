"""Lesson 07, Control as a quadratic program: pushes on the physics, and controllers whose rows were
added or taken away.
"""

from __future__ import annotations

import time
from collections.abc import Callable
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

PUSH_START, PUSH_DURATION = 0.05, 0.1  # s: when a push begins, and how long it lasts
MU = 0.7
LEFT = np.array([0.0, 1.0, 0.0])


class WithoutInequalities(SolverController):
    """A controller from which the inequality rows of some kinds were taken away: its QP without
    them, at every tick.

    controller: the controller. kinds: "friction", "normal force" and others, as of `QP.without`.
    """

    def __init__(self, controller: fb.WholeBodyController, *kinds: str):
        super().__init__(controller, lambda qp: fb.solve(qp.without(*kinds)).x)


class WithConstraints(SolverController):
    """The costs of one controller with the rows of another: ψ of lesson 05, least where (27) holds.

    costs: of objectives alone. constraints: gives the equalities and inequalities.
    """

    def __init__(self, costs: AnalyticController, constraints: fb.WholeBodyController):
        super().__init__(constraints, lambda qp: fb.solve(qp).x)
        self.costs = costs

    def qp(self, state: fb.State, t: float = 0.0) -> fb.QP:
        """The QP of one tick."""
        qp = super().qp(state, t)
        costs = self.costs.objective(fb.equations_of_motion(state, self.costs.contacts))
        H, g = block_diag(*(cost.H for cost in costs)), np.concatenate([cost.g for cost in costs])
        return fb.QP(
            H, g, qp.A, qp.b, qp.G, qp.h, qp.equality_names, qp.inequality_names, qp.blocks
        )


def run_with_push(
    controller: Controller, newtons: float, duration: float = 0.6, towards: Array = LEFT
) -> Rollout:
    """The record of go2 on the physics, pushed at the base from 0.05 to 0.15 s.

    newtons: how hard. duration: s, of the record. towards: (3,), unit vector.
    """
    push = fb.Push(newtons * towards, start=PUSH_START, duration=PUSH_DURATION)
    return fb.rollout(fb.Simulation(standing_go2_eom().robot), controller, duration, [push])


def make_controller() -> fb.WholeBodyController:
    """Motion, forces and torques in one QP: the controller whose push rose ends the lesson."""
    state = standing_go2_eom().state
    return fb.WholeBodyController(
        state.robot, fb.Contacts.points(state.robot, mu=MU), fb.standing_tasks(state)
    )


def median_time_ms(function: Callable[[], Any], repeats: int = 20) -> float:
    """How long a function takes, ms: the median of some calls, after one that does not count."""
    function()
    took = []
    for _ in range(repeats):
        before = time.perf_counter()
        function()
        took.append(time.perf_counter() - before)
    return 1e3 * median(took)


@cache
def leaning_controller(mu: float) -> fb.WholeBodyController:
    """The controller of exercise 07.3, for a coefficient of friction: 8 facets, and more wish than
    friction gives.
    """
    state = standing_go2_eom().state
    wish = fb.CoMTask(state.com, acceleration=[6.0, 0.0, 0.0])
    contacts = fb.Contacts.points(state.robot, mu=mu)
    return fb.WholeBodyController(
        state.robot, contacts, [wish, *fb.standing_tasks(state)[1:]], facets=8
    )


def tuned_controller(kp: float, kd: float, weight: float, posture: float) -> fb.WholeBodyController:
    """The controller of exercise 07.4: gains and weight of the centre of mass, and the weight of
    the posture.
    """
    state = standing_go2_eom().state
    com = fb.CoMTask(state.com, kp=kp, kd=kd, weight=weight)
    tasks = [com, fb.standing_tasks(state)[1], fb.PostureTask(state.q, weight=posture)]
    return fb.WholeBodyController(state.robot, fb.Contacts.points(state.robot, mu=MU), tasks)
