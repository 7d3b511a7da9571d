"""Exercises of lesson 10, A horizon."""

from __future__ import annotations

from typing import Any

import numpy as np

from floatbase._validation import Array
from floatbase.lessons.exercises import Exercise
from floatbase.lessons.judges import (
    Example,
    Mistake,
    NumericJudge,
    Verdict,
    function_or_verdict,
    stopped,
)
from floatbase.lessons.lesson10.helpers import INTERVAL, pendulum_rate, plan_with

STEP, REACH = 0.2, 0.05  # m, of exercise 10.2, and from the middle of the pendulum's foot
_STATE, _MIDDLES = np.array([-0.01, 0.02]), np.array([0.05] * 9 + [0.25] * 9)  # of exercise 10.1


# 10.1 ---------------------------------------------------------------------------------------------


def _plan(**parts: Any) -> Array:
    """Return the plan of exercise 10.1, with parts of the problem replaced."""
    return plan_with(_STATE, _MIDDLES, **parts)


def _plan_mistakes() -> list[Mistake]:
    n, growth = len(_MIDDLES), np.exp(pendulum_rate() * INTERVAL)
    alone = growth**n * (_STATE[0] + _STATE[1] / pendulum_rate())  # ξ at the end with p = 0
    late = (1.0 - growth) * growth ** np.arange(n, 0.0, -1.0)
    return [
        ("near_zero", _plan(near=np.zeros(n)), "Each p must be near the middle of its own foot, "
         "not near zero."),
        ("middles_only", _MIDDLES, "These are the middles of the feet. Where is ξ at the end?"),
        ("not_carried", _plan(weights=np.full(n, 1.0 - growth)), "An early p moves the body in "
         "all later intervals: A multiplies its effect in each of them."),
        ("too_early", _plan(weights=late), "A multiplies the effect of an earlier p. Add B for "
         "the p of an interval after this."),
        ("first_foot", _plan(goal=_MIDDLES[0]), "At the end, ξ must be above the last foot of the "
         "horizon, not the first."),
        ("no_state", _plan(alone=0.0), "The state x is missing. Where does it go if p is zero?"),
        ("one_side", _plan(alone=0.0, goal=(_MIDDLES[-1] - alone) / 100.0), "The weight 100 "
         "multiplies both sides of its row, so the goal as well."),
        ("clipped", np.clip(_plan(), _MIDDLES - REACH, _MIDDLES + REACH), "Do not limit p here: "
         "run_pendulum does."),
        ("light", _plan(end_weight=1.0), "ξ is too far from the last foot. Its row in the "
         "least-squares problem has the weight 100."),
    ]  # fmt: skip


_PLAN_JUDGE = NumericJudge(
    right=_plan,
    praise="This is model predictive control: all p are planned, and only the first is used.",
    mistakes=_plan_mistakes,
    tolerance=0.01,
)


def _judge_plan(answer: Any) -> Verdict:
    """Judge a function that plans the positions of a horizon."""
    program = function_or_verdict(answer)
    if isinstance(program, Verdict):
        return program
    try:
        return _PLAN_JUDGE(program(_STATE.copy(), _MIDDLES.tolist()))
    except Exception as error:  # whatever a learner's function raises
        return stopped(error)


def _plan_examples() -> list[Example]:
    told = [(lambda x, middles, p=plan: p, hint) for plan, hint in _PLAN_JUDGE.examples()]
    return [*told, (lambda: 0.0, "stops")]


# 10.2 ---------------------------------------------------------------------------------------------


def _intervals(distance: float) -> int:
    """Return how many intervals ξ needs from 0 to a distance with p at the heel, and one more."""
    return 1 + int(np.ceil(np.log(1.0 + distance / REACH) / (pendulum_rate() * INTERVAL)))


def _horizon_mistakes() -> list[Mistake]:
    n = _intervals(STEP - REACH)
    return [
        ("zero", 0, "There is no answer yet. How far must ξ be ahead at the step?"),
        ("last_begins", n - 1, "The horizon must contain one interval *after* the step."),
        ("not_smallest", n + 1, "It survives, but there is a smaller number."),
        ("milliseconds", round(1e3 * np.log(STEP / REACH) / pendulum_rate()),
         "That is a time in ms. How many intervals of 20 ms?"),
        ("middle", _intervals(STEP), "ξ need not be above the middle of the new foot. p reaches "
         "5 cm to each side."),
        ("feet_overlap", _intervals(STEP - 2 * REACH), "That is the distance between the two feet. "
         "Where is ξ before the body begins?"),
        ("linear", round(_intervals(0.3 - REACH) * STEP / 0.3), "ξ does not grow in proportion to "
         "the time."),
        ("old_step", _intervals(0.3 - REACH), "That is for a step of 30 cm."),
    ]  # fmt: skip


PLAN_STUB = '''def horizon(x, middles):
    """The p of all intervals, m, for the state x = (c, ċ) and the feet under them."""
    return np.array(middles)  # replace: p that also bring ξ above the last foot'''

PLAN = '''def horizon(x, middles):
    """The p of all intervals, m, for the state x = (c, ċ) and the feet under them."""
    n, xi = len(middles), np.array([1, 1 / omega])
    X = np.zeros((2, n))  # how the state depends on the p's
    for k in range(n):
        X, x = A @ X, A @ x
        X[:, k] += B
    rows = np.vstack([np.eye(n), 100 * xi @ X])
    goals = [*middles, 100 * (middles[-1] - xi @ x)]
    return np.linalg.lstsq(rows, goals, rcond=None)[0]'''


def _pendulum() -> dict[str, Any]:
    """Return the names of the lesson's cells that the solutions use."""
    omega = pendulum_rate()
    c, s = np.cosh(omega * INTERVAL), np.sinh(omega * INTERVAL)
    A = np.array([[c, s / omega], [omega * s, c]])
    return {"omega": omega, "A": A, "B": np.array([1 - c, -omega * s])}


EXERCISES = (
    Exercise(
        name="10.1",
        stub=PLAN_STUB,
        solution=PLAN,
        judge=_judge_plan,
        examples=_plan_examples,
        explanation="Each interval multiplies the effect of all earlier p by A and adds B for its "
        "own p. The rows of the least-squares problem are the p and, with a large weight, ξ.",
        namespace=_pendulum,
    ),
    Exercise(
        name="10.2",
        stub="smallest = 0  # replace: number of intervals",
        solution="smallest = 1\n"
        "while 0.05 * np.exp(omega * 0.02 * (smallest - 1)) < 0.2:\n"
        "    smallest += 1",
        judge=NumericJudge(
            right=lambda: _intervals(STEP - REACH),
            praise="ξ grows exponentially, so a step of two thirds needs more than two thirds of "
            "the time.",
            mistakes=_horizon_mistakes,
            is_count=True,
        ),
        explanation="ξ must grow from 0 to 15 cm: e^{ωt} = 4, so t = 249 ms, which is 13 "
        "intervals. The step itself is in the 14th.",
        namespace=_pendulum,
    ),
)
