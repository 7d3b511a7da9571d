"""Lesson C, How a QP solver thinks: problems in the plane, Beale's corner, and a controller whose
solver is the learner's.
"""

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
    """The course text's table: min ½ Σ curvature (x - minimum)² in the plane x = (along, up),
    subject to up ≥ 0.

    With the minimum above the table the row "table" is inactive and might not be there; with the
    minimum below it the row is active and might be an equality.
    """
    centre = as_array("minimum", minimum, (2,), "m")
    H = np.diag(as_array("curvature", curvature, (2,)))
    G, h = np.array([[0.0, -1.0]]), np.zeros(1)  # -up ≤ 0
    return fb.QP(H, -H @ centre, np.zeros((0, 2)), np.zeros(0), G, h, inequality_names=("table",))


def corner_table(
    minimum: npt.ArrayLike = (-1.5, -1.5), curvature: npt.ArrayLike = (1.0, 0.5)
) -> fb.QP:
    """The course text's table with three walls: a bowl with its lowest point at `minimum`, in the
    plane (along, up).

    Rows: table up ≥ 0, ramp along - 3 up ≤ 2, roof 2 along + 3 up ≤ 2, wall along ≥ -3.
    """
    H = np.diag(as_array("curvature", curvature, (2,)))
    G, h = (
        np.array([[0.0, -1.0], [1.0, -3.0], [2.0, 3.0], [-1.0, 0.0]]),
        np.array([0.0, 2.0, 2.0, 3.0]),
    )
    return fb.QP(
        H,
        -H @ as_array("minimum", minimum, (2,)),
        *_NONE,
        G,
        h,
        inequality_names=("table", "ramp", "roof", "wall"),
    )


def hexagon_table() -> fb.QP:
    """A table with six edges seen from above, 2 from its middle, and a long, slanting bowl that is
    lowest at (1, 3.9).
    """
    angles = np.pi / 3 * np.arange(6) + np.pi / 6
    axes = rotation_z(np.deg2rad(15.0))[:2, :2]
    H = axes @ np.diag([1.0, 8.0]) @ axes.T
    names = tuple(f"edge {i}" for i in range(6))
    G = np.column_stack([np.cos(angles), np.sin(angles)])
    return fb.QP(H, -H @ [1.0, 3.9], *_NONE, G, np.full(6, 2.0), inequality_names=names)


def beale_problem(curvature: float = 0.1) -> fb.QP:
    """Beale's problem, on which careless rules go round for ever, with a little curvature: 4
    variables, 7 rows.

    Six of the rows meet in the point 0, where it begins. Source: E. M. L. Beale, Cycling in the
    dual simplex algorithm, Naval Research Logistics Quarterly 2 (1955).
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
    """A solver for `SolverController`: the package's `active_set`, stopped after so many rounds,
    from nothing or from the tick before.

    max_rounds: rounds in a tick. warm: whether it begins with the rows on which the tick before
        ended. runs: of all ticks.
    """

    def __init__(self, max_rounds: int, warm: bool):
        self.max_rounds, self.warm = max_rounds, warm
        self.runs: list[ActiveSetRun] = []

    def __call__(self, qp: fb.QP) -> Array:
        """x of one tick, shape (n,)."""
        working: Sequence[str] = self.runs[-1].working_set if self.warm and self.runs else ()
        self.runs.append(active_set(qp, working_set=working, max_iterations=self.max_rounds))
        return self.runs[-1].solution.x


def standing_controller() -> fb.WholeBodyController:
    """go2 that stands, as in lesson 07: 42 variables, 30 equalities, 44 inequalities."""
    return lesson07.make_controller()


def run_with_push(
    controller: Controller, newtons: float, duration: float = 0.6, towards: float = 90.0
) -> Rollout:
    """The record of go2 on the physics, pushed at the base from 0.05 to 0.15 s.

    newtons: how hard. duration: s, of the record. towards: degrees, 0 forwards, 90 to its left.
    """
    angle = np.deg2rad(towards)
    direction = np.array([np.cos(angle), np.sin(angle), 0.0])
    return lesson07.run_with_push(controller, newtons, duration, direction)


@cache
def braking_qp() -> fb.QP:
    """The QP of exercise C.4: 50 ms into a push of 120 N forwards and to the left."""
    controller = standing_controller()
    return controller.qp(run_with_push(controller, 120.0, 0.101, 45.0).state(100))


def central_path(qp: fb.QP, start: npt.ArrayLike, softness: npt.ArrayLike) -> list[Array]:
    """Where the marble lies when every row repels it, ψ - t Σ log(h - G x), for each softness t:
    Newton's method, damped.

    start: (n,), inside all rows. softness: (k,), from soft to hard, each begun where the last
        ended. This is the central path
    of interior-point methods. Source: Boyd and Vandenberghe, Convex Optimization, ch. 11.2.
    """
    x, points = as_array("start", start, (qp.n,)), []
    for t in as_array("softness", softness, (None,)):
        for _ in range(60):
            slack = qp.h - qp.G @ x
            slope = qp.H @ x + qp.g + t * qp.G.T @ (1.0 / slack)
            step = -np.linalg.solve(qp.H + t * (qp.G.T / slack**2) @ qp.G, slope)
            length = min(1.0, 0.9 / max(float(np.max(qp.G @ step / slack)), 0.1))  # stays inside
            x = x + length * step
            if np.max(np.abs(step)) < 1e-12:
                break
        points.append(x)
    return points


def answer_or_default(name: str, answer: Any, otherwise: Any) -> Any:
    """The answer to an exercise if it is right; `otherwise` if it is not, and a line that says so.
    Counts no try.
    """
    if all_exercises()[name].judge(answer).right:
        print(f"{name}: the lesson goes on with yours.")
        return answer
    print(f"{name}: not yet right; the lesson goes on with the package's.")
    return otherwise


def longest_step(
    x: Array, p: Array, G: Array, h: Array, W: Sequence[int]
) -> tuple[float, int | None]:
    """The solution of exercise C.2: how far from x along p, at most 1, all rows hold, and the first
    row in the way, or None.
    """
    slack, speed = np.round(h - G @ x, 9), G @ p
    length, blocking = 1.0, None
    for i in range(len(h)):
        if i not in W and speed[i] > 1e-6 and slack[i] < length * speed[i]:
            length, blocking = float(slack[i] / speed[i]), i
    return length, blocking


def row_to_drop(W: Sequence[int], prices: Array) -> int | None:
    """The solution of exercise C.3: the row of W with the most negative price, or None."""
    if len(W) == 0 or min(prices) > -1e-9:
        return None
    return int(W[int(np.argmin(prices))])
