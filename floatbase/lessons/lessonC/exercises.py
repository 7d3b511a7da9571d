"""Exercises of lesson C, How a QP solver thinks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

import floatbase as fb
from floatbase.lessons.exercises import Exercise
from floatbase.lessons.judges import Example, Mistake, NumericJudge, Verdict, first_fault
from floatbase.lessons.lessonC.helpers import braking_qp
from floatbase.lessons.lessonC.verdicts import judge_drop, judge_step
from floatbase.qp import QP, active_set

_NONE = np.zeros((0, 2)), np.zeros(0)


# C.1 ----------------------------------------------------------------------------------------------


def slanted_table() -> QP:
    """Return the bowl and the slanted table of exercise C.1."""
    H = np.diag([1.0, 4.0])
    slant = np.array([[0.5, -1.0]])
    return QP(H, -H @ [2.0, -2.0], *_NONE, slant, np.zeros(1), inequality_names=("slant",))


def _price() -> float:
    """Compute the multiplier as the rate at which relaxing the constraint changes the minimum."""
    qp = slanted_table()
    h = 1e-4
    low, high = (
        fb.solve(QP(qp.H, qp.g, qp.A, qp.b, qp.G, np.array([d]))).objective for d in (-h, h)
    )
    return (low - high) / (2 * h)


def _price_of(curvature: Sequence[float]) -> float:
    """Return the multiplier of C.1 for another bowl, from its equations."""
    G, H = np.array([0.5, -1.0]), np.diag(curvature)
    low = np.array([2.0, -2.0])
    return float(G @ low / (G @ np.linalg.solve(H, G)))


def _price_mistakes() -> list[Mistake]:
    right, (along, height) = _price(), fb.solve(slanted_table()).x
    return [
        ("sign", -right, "The sign is wrong. With H x + g + Gᵀ μ = 0, the multiplier of a table "
         "that pushes is positive."),
        ("length", right * np.sqrt(1.25), "That is the magnitude of the gradient. A multiplier "
         "belongs to the constraint as it is written, and this one has a normal of length √1.25."),
        ("level", 8.0, "That is the multiplier of a level table. Here along and up both "
         "contribute."),
        ("no_curvature", _price_of([1.0, 1.0]), "The curvature of 4 is missing."),
        ("no_half", 2.0 * right, "The objective has a ½ before each square."),
        ("along", along, "That is the position of the marble along the table."),
        ("height", height, "That is the height of the marble."),
        ("distance", 3.0, "That is the violation of the constraint at the lowest point of the "
         "bowl."),
    ]  # fmt: skip


# C.4 ----------------------------------------------------------------------------------------------


def _judge_guess(answer: Any) -> Verdict:
    """Judge a guess of the active constraints."""
    if answer is None or answer is Ellipsis:
        return Verdict(False, "There is no answer yet. List the names of constraints.", "no_answer")
    if not isinstance(answer, list | tuple) or not all(isinstance(name, str) for name in answer):
        text = "The answer must be a list of names from qp.inequality_names."
        return Verdict(False, text, "no_names")
    qp = braking_qp()
    names = list(dict.fromkeys(answer))
    unknown = [name for name in names if name not in qp.inequality_names]
    if unknown:
        text = f"There is no constraint {unknown[0]!r}. qp.inequality_names lists all of them."
        return Verdict(False, text, "no_such_row")
    if not names:
        text = (
            "With an empty list, the plan pulls on the ground. Which feet does the push lift off?"
        )
        return Verdict(False, text, "no_row")
    rows = [qp.inequality_names.index(name) for name in names]
    small, Z = qp.reduced, qp.reduced.G[rows]
    if np.linalg.matrix_rank(Z / np.linalg.norm(Z, axis=1)[:, None], 1e-9) < len(rows):
        text = (
            "These constraints depend on one another. The force of a foot has three components, so "
            "at most three of its constraints can be in the list."
        )
        return Verdict(False, text, "dependent")
    k = len(rows)
    found = np.linalg.solve(
        np.block([[small.H, Z.T], [Z, np.zeros((k, k))]]), np.concatenate([-small.g, small.h[rows]])
    )
    over, prices = small.G @ found[: small.n] - small.h, found[small.n :]
    broken = [str(qp.inequality_names[i]) for i in np.flatnonzero(over > 1e-6)]
    pulls = [name for name, price in zip(names, prices, strict=True) if price < -1e-9]
    faults = [f"{_count(broken)} violated, {_example_of(broken)}"] if broken else []
    faults += [f"{_count(pulls)} pulling, {_example_of(pulls)}"] if pulls else []
    only_motors = not any("foot" in name for name in names)
    return first_fault([
        ("motors", bool(faults) and only_motors, "The motors are far from their limits here. What "
         "does a push do to the feet?"),
        ("corrections", bool(faults), f"With your list, {', and '.join(faults)}. Correct the guess "
         "as the solver would, and check again."),
    ]) or Verdict(
        True,
        "One system of equations, and nothing to correct. A solver that starts here needs only one "
        "iteration.",
    )  # fmt: skip


def _count(names: Sequence[str]) -> str:
    """Return the number of constraints, with the verb."""
    return "1 constraint is" if len(names) == 1 else f"{len(names)} constraints are"


def _example_of(names: Sequence[str]) -> str:
    """Return the first of some names, and whether there are more."""
    return f"such as {names[0]}" if len(names) > 1 else f"namely {names[0]}"


def rounds_from_guess(guess: Sequence[str]) -> int:
    """Return how many iterations `active_set` takes for exercise C.4 from a guess."""
    return active_set(braking_qp(), working_set=tuple(guess)).solution.iterations


LONGEST_STEP_STUB = '''def longest_step(x, p, G, h, W):
    """How far from x along p, at most 1, all constraints hold, and which one blocks."""
    return 1.0, None  # replace: from slack and speed of each constraint'''

LONGEST_STEP = '''def longest_step(x, p, G, h, W):
    """How far from x along p, at most 1, all constraints hold, and which one blocks."""
    slack, speed = np.round(h - G @ x, 9), G @ p
    length, blocking = 1.0, None
    for i in range(len(h)):
        if i not in W and speed[i] > 1e-6 and slack[i] < length * speed[i]:
            length, blocking = slack[i] / speed[i], i
    return length, blocking'''

ROW_TO_DROP_STUB = '''def row_to_drop(W, prices):
    """The constraint of W that pulls hardest, or None."""
    return None  # replace; W and prices have one entry for each row in W'''

ROW_TO_DROP = '''def row_to_drop(W, prices):
    """The constraint of W that pulls hardest, or None."""
    if len(W) == 0 or min(prices) > -1e-9:
        return None
    return W[int(np.argmin(prices))]'''


def _longest_step_examples() -> list[Example]:
    def step(
        slack: Callable[..., Any] = lambda x, G, h: np.round(h - G @ x, 9),
        counts: Callable[..., Any] = lambda room, speed: speed > 1e-6,
        length: Callable[..., Any] = lambda room, speed: room / speed,
        best: Callable[..., Any] = min,
        most: float = 1.0,
        beyond: float = 1.0,
        held: bool = True,
    ) -> Callable[..., Any]:
        """Return a `longest_step` that does one thing differently."""

        def made(x: Any, p: Any, G: Any, h: Any, W: Any) -> Any:
            rows = [
                (room, speed, i)
                for i, (room, speed) in enumerate(zip(slack(x, G, h), G @ p, strict=True))
            ]
            near = [
                (length(*row[:2]), row[2])
                for row in rows
                if not (held and row[2] in W) and counts(*row[:2])
            ]
            found, row = best(near, default=(most, None))
            return (found, row) if found < beyond else (most, None)

        return made

    right = step()

    def by_room(x: Any, p: Any, G: Any, h: Any, W: Any) -> Any:
        near = [(h[i] - G[i] @ x, i) for i in range(len(h)) if i not in W and G[i] @ p > 1e-9]
        room, row = min(near, default=(1.0, None))
        found = room / (G[row] @ p) if row is not None else 1.0
        return (found, row) if found < 1.0 else (1.0, None)

    return [
        (right, ""), (step(most=np.inf), "no_length"), (step(most=2.0), "free"),
        (lambda x, p, G, h, W: (1.0, None), "halfway"),
        (step(counts=lambda room, speed: speed != 0), "negative"),
        (step(slack=lambda x, G, h: G @ x - h), "negative"),
        (step(slack=lambda x, G, h: h), "elsewhere"),
        (step(counts=lambda room, speed: speed > 1e-9), "speed_rounding"),
        (step(counts=lambda room, speed: abs(speed) > 1e-6,
              length=lambda room, speed: room / abs(speed)), "away"),
        (step(counts=lambda room, speed: speed >= 0,
              length=lambda room, speed: room / max(speed, 1e-3)), "along"),
        (step(best=max), "nearest"), (by_room, "soonest"),
        (step(counts=lambda room, speed: speed > 1e-9, held=False), "held"),
        (step(counts=lambda room, speed: speed > 1e-6 and room > 0), "touches"),
        (step(beyond=1.6), "beyond"),
        (step(slack=lambda x, G, h: h - G @ x), "slack_rounding"),
        (lambda x, p, G, h, W: right(x, p, G, h, W)[0], "not_two"),
        (lambda x, p, G, h, W: (right(x, p, G, h, W)[0], "row"), "no_row"),
        (lambda x, p: 1.0, "stops"), (0.5, "no_function"),
    ]  # fmt: skip


def _drops() -> list[Example]:
    def drop(take: Callable[..., Any], limit: float = -1e-9) -> Callable[..., Any]:
        return lambda W, prices: take(W, prices) if len(W) and min(prices) < limit else None

    def hardest(W: Any, prices: Any) -> Any:
        return W[int(np.argmin(prices))]

    return [
        (drop(hardest), ""), (lambda W, prices: None, "pulls"),
        (drop(lambda W, prices: int(np.argmin(prices))), "place"),
        (drop(lambda W, prices: W[int(np.argmax(np.abs(prices)))]), "pulls"),
        (drop(hardest, 0.0), "rounding"),
        (drop(lambda W, prices: next(r for r, p in zip(W, prices, strict=True) if p < 0)),
         "most_negative"),
        (lambda W, prices: hardest(W, prices) if len(W) else None, "pushes"),
        (drop(hardest, -0.2), "negative_alone"),
        (lambda W, prices: drop(hardest)(W, prices) if len(W) else 3, "place"),
        (lambda W, prices: hardest(W, prices) if min(prices) < -1e-9 else None, "stops"),
        (drop(lambda W, prices: float(hardest(W, prices))), "no_number"), ([3], "no_function"),
    ]  # fmt: skip


def _guesses() -> list[Example]:
    active = list(fb.solve(braking_qp()).active)
    motor = next(name for name in braking_qp().inequality_names if "upper" in name)
    return [
        (active, ""), (tuple(reversed(active)), ""), ([], "no_row"), (active[:-1], "corrections"),
        (["RR facet 2"], "no_such_row"), ([*active, "FL_foot facet 0"], "corrections"),
        ([motor], "motors"),
        ("RR_foot facet 2", "no_names"), ([f"RR_foot facet {i}" for i in range(4)], "dependent"),
    ]  # fmt: skip


EXERCISES = (
    Exercise(
        name="C.1",
        stub="price = 8.0  # of a level table; replace this number",
        solution="W = [[0.5, -1]]\n"
        "KKT = np.block([[np.diag([1, 4]), np.transpose(W)], [np.array(W), np.zeros((1, 1))]])\n"
        "price = np.linalg.solve(KKT, [2, -8, 0])[2]",
        judge=NumericJudge(
            right=_price,
            praise="Three equations: two say that the constraint force balances the gradient, "
            "and one says that the marble lies on the table.",
            mistakes=_price_mistakes,
        ),
        explanation="On the constraint up = 0.5 along, ψ = ½(a - 2)² + 2(0.5 a + 2)² with a = "
        "along. This is smallest at a = -1, so the marble lies at (-1, -0.5). The gradient "
        "there is (-3, 6), and 6 times the row (0.5, -1) balances it.",
    ),
    Exercise(
        name="C.2",
        stub=LONGEST_STEP_STUB,
        solution=LONGEST_STEP,
        judge=judge_step,
        examples=_longest_step_examples,
        explanation="Constraint i allows a step of length slack / speed, if the step approaches "
        "it at all. The smallest of these lengths decides, or 1 if none is smaller.",
    ),
    Exercise(
        name="C.3",
        stub=ROW_TO_DROP_STUB,
        solution=ROW_TO_DROP,
        judge=judge_drop,
        examples=_drops,
        explanation="A negative multiplier means that ψ would decrease without this constraint. "
        "The most negative one promises the most.",
    ),
    Exercise(
        name="C.4",
        stub='guess = ["RR_foot normal force"]  # more names, or others',
        solution="guess = [\n"
        '    "FR_foot facet 2", "FR_foot facet 3", "RL_foot facet 2",\n'
        '    "RR_foot facet 2", "RR_foot facet 3", "RR_foot normal force",\n'
        "]",
        judge=_judge_guess,
        examples=_guesses,
        explanation="To brake, the contact forces must point backwards and to the right: facets "
        "2 and 3. The push relieves the rear right foot, which carries nothing, so all three "
        "components of its force are fixed. FL, on which go2 leans, is free.",
    ),
)
