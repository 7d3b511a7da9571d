"""Judges of lesson C for functions of a learner's solver."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from floatbase.lessons.judges import Verdict, first_fault, function_or_verdict, stopped

_CLOSE = 1e-6  # tolerance of lengths, which are between 0 and 1


# C.2 ----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _StepCase:
    """Step in the plane with a known answer, and the comment on a function that misses it."""

    hint: str  # its name
    text: str
    p: tuple[float, float]
    G: Sequence[Sequence[float]]
    h: Sequence[float]
    W: Sequence[int]
    answer: tuple[float, int | None]


_STEP_CASES = (
    _StepCase(
        "free", "Nothing blocks here: return 1, the full step, and None.",
        (1, 0), [[1, 0], [0, 1]], [2, 2], [], (1.0, None),
    ),
    _StepCase(
        "halfway", "A constraint blocks halfway. Where it holds with equality, slack = length · "
        "speed.",
        (2, 0), [[0, 1], [1, 0]], [5, 1], [], (0.5, 1),
    ),
    _StepCase(
        "away", "A constraint that the step moves away from (speed < 0) never blocks.",
        (1, 1), [[-1, 0], [0, -1]], [0.5, 0.25], [], (1.0, None),
    ),
    _StepCase(
        "along", "A constraint that the step is parallel to (speed 0) never blocks, and you "
        "must not divide by its speed.",
        (1, 0), [[0, 1], [0, -1]], [0, 0], [], (1.0, None),
    ),
    _StepCase(
        "nearest", "Two constraints block. The step must end at the first one.",
        (4, 0), [[1, 0], [2, 0], [1, 0]], [3, 2, 2.5], [], (0.25, 1),
    ),
    _StepCase(
        "soonest",
        "Here two constraints block at different speeds. The slack alone does not decide, but "
        "how soon it is used up.",
        (2, 2), [[1, 0], [3, 3]], [1, 3], [], (0.25, 1),
    ),
    _StepCase(
        "held", "A constraint in W holds with equality already, and rounding must not let it "
        "block.",
        (1, 0), [[1, 1e-8], [1, 0]], [0, 0.5], [0], (0.5, 1),
    ),
    _StepCase(
        "touches",
        "The point touches a constraint that is not in W, and the step would violate it. Then "
        "the step has length 0, and this constraint blocks.",
        (1, 0), [[0, 1], [1, 0]], [1, 0], [], (0.0, 1),
    ),
    _StepCase(
        "beyond", "The constraint is beyond the end of the step, so the length is 1 and nothing "
        "blocks.",
        (1, 0), [[1, 0]], [1.5], [], (1.0, None),
    ),
    _StepCase(
        "slack_rounding",
        "Slacks of 1e-13 and 0 are the same except for rounding. Use np.round(slack, 9), and of "
        "equal constraints the first.",
        (1, 0), [[1, 0], [1, 0]], [1e-13, 0], [], (0.0, 0),
    ),
    _StepCase(
        "speed_rounding",
        "A speed of 1e-7 is zero except for rounding, so this constraint does not block. Use "
        "1e-6 as the limit.",
        (1, 0), [[1e-7, 1]], [0], [], (1.0, None),
    ),
)  # fmt: skip


def judge_step(answer: Any) -> Verdict:
    """Judge a function that returns the longest step of exercise C.2, on test cases."""

    def one(way: _StepCase) -> Verdict | None:
        for origin in (np.zeros(2), np.array([0.3, -0.2])):
            # the same step elsewhere: the slack is h - G x
            G = np.array(way.G, dtype=np.float64)
            h = np.array(way.h, dtype=np.float64) + G @ origin
            given = answer(origin, np.array(way.p, dtype=np.float64), G, h, list(way.W))
            if not isinstance(given, tuple) or len(given) != 2:
                text = "Return two things: the length, and the index of the constraint or None."
                return Verdict(False, text, "not_two")
            length, row = given
            if not isinstance(length, int | float | np.number) or not np.isfinite(length):
                text = (
                    f"The length is {length!r}, but it must be a number from 0 to 1. Did you "
                    "divide by a speed of zero?"
                )
                return Verdict(False, text, "no_length")
            right, blocks = way.answer
            wrong = abs(length - right) > _CLOSE or row != blocks
            fault = first_fault([
                ("negative", length < 0, f"A length is negative ({length:.2g}). {way.text}"),
                ("no_row", row is not None and not isinstance(row, int | np.integer),
                 f"The constraint is {row!r}, but it must be an index in G or None."),
                ("held", wrong and row is not None and row in way.W,
                 f"Constraint {row} is in W and must not block. {way.text}"),
                ("elsewhere", wrong and origin.any(),
                 f"Is the slack h - G x, or h alone? {way.text}"),
                (way.hint, wrong, way.text),
            ])  # fmt: skip
            if fault:
                return fault
        return None

    return _tried(
        answer,
        [partial(one, way) for way in _STEP_CASES],
        "The step goes as far as all constraints allow, and no further.",
    )


def _tried(answer: Any, cases: Sequence[Callable[[], Verdict | None]], praise: str) -> Verdict:
    """Run test cases of a learner's function; the first verdict decides."""
    program = function_or_verdict(answer)
    if isinstance(program, Verdict):
        return program
    for case in cases:
        try:
            with np.errstate(all="ignore"):
                said = case()
        except Exception as error:  # whatever a learner's function raises
            said = stopped(error)
        if said:
            return said
    return Verdict(True, praise)


# C.3 ----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Drop:
    """Working set with its multipliers, and the comment on a function that drops another row."""

    hint: str  # its name
    text: str
    W: list[int]
    prices: list[float]
    answer: int | None


_DROP_CASES = (
    _Drop("pulls", "One constraint pulls (its multiplier is negative) and must be dropped.",
          [5, 3, 8], [2.0, -0.5, 1.0], 3),
    _Drop("pushes", "No multiplier is negative here: every constraint pushes, and none must be "
          "dropped.", [4, 2], [1.0, 0.5], None),
    _Drop("empty", "W may be empty. Then there is nothing to drop.", [], [], None),
    _Drop("most_negative", "Two constraints pull. Drop the one with the most negative multiplier.",
          [5, 3, 8], [-0.5, 1.0, -2.0], 8),
    _Drop("negative_alone", "Only a negative multiplier counts, however large another one is.",
          [1, 6], [9.0, -0.1], 6),
    _Drop("rounding", "-1e-14 is zero except for rounding, so this constraint is not dropped. Use "
          "-1e-9 as the limit.", [1, 6], [3.0, -1e-14], None),
)  # fmt: skip


def judge_drop(answer: Any) -> Verdict:
    """Judge a function that returns the constraint to drop of exercise C.3, on test cases."""

    def one(drop: _Drop) -> Verdict | None:
        given = answer(list(drop.W), np.array(drop.prices))
        return first_fault([
            ("no_number", given is not None and not isinstance(given, int | np.integer),
             f"The answer is {given!r}, but it must be an index in G or None."),
            ("place", given is not None and given not in drop.W, "Return the entry of W, which is "
             "an index in G, not its position in W."),
            (drop.hint, given != drop.answer, drop.text),
        ])  # fmt: skip

    cases = [partial(one, drop) for drop in _DROP_CASES]
    return _tried(
        answer,
        cases,
        "A constraint may push, but never pull. That is the whole test for an optimum.",
    )
