"""Lesson C: problems in the plane, Beale's problem, and controllers with the learner's solver."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

import floatbase as fb
from floatbase._geometry import rotation_z
from floatbase._validation import Array, as_array
from floatbase.lessons import lesson07
from floatbase.lessons.exercises import all_exercises
from floatbase.qp import ActiveSetRun, active_set
from floatbase.simulation import Controller, Rollout

_NONE = np.zeros((0, 2)), np.zeros(0)


def table_top(minimum: npt.ArrayLike = (0.5, -1.0), curvature: npt.ArrayLike = (1.0, 1.0)) -> fb.QP:
    """Return the table of the course text: a bowl above a level table, in the plane (along, up).

    The QP minimizes ½ Σ curvature (x - minimum)² subject to up ≥ 0. If the minimum is above the
    table, the constraint "table" is inactive and could be left out. If it is below, the constraint
    is active and could be an equality constraint.

    Parameters
    ----------
    minimum : array_like, shape (2,), optional
        Lowest point of the bowl [m].
    curvature : array_like, shape (2,), optional
        Curvature along both axes.

    Returns
    -------
    QP
        The problem.
    """
    centre = as_array("minimum", minimum, (2,), "m")
    H = np.diag(as_array("curvature", curvature, (2,)))
    G, h = np.array([[0.0, -1.0]]), np.zeros(1)  # -up ≤ 0
    return fb.QP(H, -H @ centre, np.zeros((0, 2)), np.zeros(0), G, h, inequality_names=("table",))


def corner_table(
    minimum: npt.ArrayLike = (-1.5, -1.5), curvature: npt.ArrayLike = (1.0, 0.5)
) -> fb.QP:
    """Return the table of the course text with three walls, in the plane (along, up).

    The constraints are table up ≥ 0, ramp along - 3 up ≤ 2, roof 2 along + 3 up ≤ 2, and wall along
    ≥ -3.

    Parameters
    ----------
    minimum : array_like, shape (2,), optional
        Lowest point of the bowl.
    curvature : array_like, shape (2,), optional
        Curvature along both axes.

    Returns
    -------
    QP
        The problem.
    """
    H = np.diag(as_array("curvature", curvature, (2,)))
    G = np.array([[0.0, -1.0], [1.0, -3.0], [2.0, 3.0], [-1.0, 0.0]])
    h = np.array([0.0, 2.0, 2.0, 3.0])
    return fb.QP(
        H,
        -H @ as_array("minimum", minimum, (2,)),
        *_NONE,
        G,
        h,
        inequality_names=("table", "ramp", "roof", "wall"),
    )


def hexagon_table() -> fb.QP:
    """Return a hexagonal table, seen from above, with a long slanting bowl.

    Each edge is at a distance of 2 from the middle. The bowl is lowest at (1, 3.9).
    """
    angles = np.pi / 3 * np.arange(6) + np.pi / 6
    axes = rotation_z(np.deg2rad(15.0))[:2, :2]
    H = axes @ np.diag([1.0, 8.0]) @ axes.T
    names = tuple(f"edge {i}" for i in range(6))
    G = np.column_stack([np.cos(angles), np.sin(angles)])
    return fb.QP(H, -H @ [1.0, 3.9], *_NONE, G, np.full(6, 2.0), inequality_names=names)


def beale_problem(curvature: float = 0.1) -> fb.QP:
    """Return Beale's problem with a little curvature: 4 variables and 7 inequality constraints.

    On this problem, careless pivoting rules cycle for ever. Six of the constraints meet at the
    origin, where the solver starts. Source: E. M. L. Beale, Cycling in the dual simplex algorithm,
    Naval Research Logistics Quarterly 2 (1955).

    Parameters
    ----------
    curvature : float, optional
        Curvature of the objective in all directions.

    Returns
    -------
    QP
        The problem.
    """
    rows = [[0.25, -60.0, -0.04, 9.0], [0.5, -90.0, -0.02, 3.0], [0.0, 0.0, 1.0, 0.0], *-np.eye(4)]
    g = np.array([-0.75, 150.0, -0.02, 6.0])
    return fb.QP(
        curvature * np.eye(4),
        g,
        np.zeros((0, 4)),
        np.zeros(0),
        np.array(rows),
        np.array([0, 0, 1.0, 0, 0, 0, 0]),
    )


class LimitedActiveSet:
    """Solver for `SolverController`: `active_set`, stopped after a number of iterations.

    Parameters
    ----------
    max_rounds : int
        Largest number of iterations per control step.
    warm : bool
        Whether to start with the working set at the end of the last control step.

    Attributes
    ----------
    runs : list of ActiveSetRun
        The runs of all control steps.
    """

    def __init__(self, max_rounds: int, warm: bool):
        self.max_rounds, self.warm = max_rounds, warm
        self.runs: list[ActiveSetRun] = []

    def __call__(self, qp: fb.QP) -> Array:
        """Return x of one control step, shape (n,)."""
        working: Sequence[str] = self.runs[-1].working_set if self.warm and self.runs else ()
        self.runs.append(active_set(qp, working_set=working, max_iterations=self.max_rounds))
        return self.runs[-1].solution.x


def standing_controller() -> fb.WholeBodyController:
    """Return the standing controller of go2 from lesson 07.

    Its QP has 42 variables, 30 equality and 44 inequality constraints.
    """
    return lesson07.make_controller()


def run_with_push(
    controller: Controller, newtons: float, duration: float = 0.6, towards: float = 90.0
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
    towards : float, optional
        Direction of the push [°]: 0 is forwards, 90 to the left.

    Returns
    -------
    Rollout
        The record.
    """
    direction = fb.Push.horizontal(1.0, towards).force
    return lesson07.run_with_push(controller, newtons, duration, direction)


@cache
def braking_qp() -> fb.QP:
    """Return the QP of exercise C.4: 50 ms into a push of 120 N forwards and to the left."""
    controller = standing_controller()
    return controller.qp(run_with_push(controller, 120.0, 0.101, 45.0).state(100))


def answer_or_default(name: str, answer: Any, otherwise: Any) -> Any:
    """Return the answer to an exercise if it is right, or else a default, and print which one."""
    if all_exercises()[name].judge(answer).right:
        print(f"{name}: the lesson continues with your answer.")
        return answer
    print(f"{name}: not right yet; the lesson continues with the solution of floatbase.")
    return otherwise


def longest_step(
    x: Array, p: Array, G: Array, h: Array, W: Sequence[int]
) -> tuple[float, int | None]:
    """Return the longest feasible step from x along p, and the constraint that blocks it."""
    slack, speed = np.round(h - G @ x, 9), G @ p
    length, blocking = 1.0, None
    for i in range(len(h)):
        if i not in W and speed[i] > 1e-6 and slack[i] < length * speed[i]:
            length, blocking = float(slack[i] / speed[i]), i
    return length, blocking


def row_to_drop(W: Sequence[int], prices: Array) -> int | None:
    """Return the constraint in W with the most negative multiplier, or None if none is negative."""
    if len(W) == 0 or min(prices) > -1e-9:
        return None
    return int(W[int(np.argmin(prices))])
