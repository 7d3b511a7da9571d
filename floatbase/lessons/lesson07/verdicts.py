"""Judges of the exercises of lesson 07."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

import floatbase as fb
from floatbase._validation import Array
from floatbase.lessons.judges import (
    NEAR_MISS,
    Example,
    Verdict,
    array_judge,
    lasting_or_verdict,
)
from floatbase.lessons.lesson03 import standing_go2_eom
from floatbase.lessons.lesson07.helpers import (
    PUSH_DURATION,
    PUSH_START,
    leaning_controller,
    run_with_push,
    tuned_controller,
)
from floatbase.lessons.rounding import rounded
from floatbase.qp import ConstraintLabel
from floatbase.simulation import Rollout

HARD, AFTER = 150.0, 1.0  # of exercise 07.3: N, and s after the end of the push
AWAY, STRAYED, BACK = 53.0, 9.0, 3.0  # mm: limits of exercise 07.3
STEP = 0.005  # increase of μ in exercise 07.2


# 07.1 ---------------------------------------------------------------------------------------------

KNEE = 6 + 2  # column of the left front knee: after the base, hip and thigh
ROOM, SPEED, PERIOD = 0.1, 20.0, 0.004  # rad to the upper limit, rad/s, s
BOUND = 2 * (ROOM - PERIOD * SPEED) / PERIOD**2  # rad/s²


@array_judge((43,))
def judge_joint_limit(given: Array) -> Verdict:
    """Judge a row and its bound by the accelerations that they allow, whatever their scale."""
    row, bound = given[:-1], given[-1]
    used = np.flatnonzero(row)
    if not len(used):
        return Verdict(False, "There is no answer yet. A zero row does not limit anything.", "zero")
    if used.tolist() != [KNEE]:
        return Verdict(
            False,
            f"This row depends on column {', '.join(map(str, used))} of x. Only the acceleration "
            f"of the left front knee matters. The order is base, then hip, thigh and calf of FL.",
            "columns",
        )
    if row[KNEE] < 0:
        return Verdict(
            False, "The sign is wrong: this is a lower bound of the acceleration.", "sign"
        )
    limit = bound / row[KNEE]
    mistakes = {
        "no_velocity": (2 * ROOM / PERIOD**2, "Without q̈ the knee still moves by Δt v."),
        "velocity_sign": (
            2 * (ROOM + PERIOD * SPEED) / PERIOD**2,
            "The knee moves towards the limit, so its velocity leaves less room, not more.",
        ),
        "no_half": (BOUND / 2, "The factor ½ of ½ Δt² q̈ is missing."),
    }
    if abs(limit - BOUND) <= NEAR_MISS * BOUND:
        return Verdict(
            True, f"The knee may accelerate by at most {rounded(limit)} rad/s² in this step."
        )
    for name, (wrong, text) in mistakes.items():
        if abs(limit - wrong) <= NEAR_MISS * wrong:
            return Verdict(False, text, name)
    return Verdict(
        False,
        "This row allows other accelerations. Solve the formula at its limit for q̈.",
        "other_limit",
    )


def joint_limit_examples() -> list[Example]:
    """Return examples for exercise 07.1."""

    def row(limit: float, column: int = KNEE, scale: float = PERIOD**2 / 2) -> Array:
        given = np.zeros(43)
        given[column], given[-1] = scale, scale * limit
        return given

    return [
        (row(BOUND), ""), (row(BOUND, scale=1.0), ""),
        (np.zeros(43), "zero"),
        (row(BOUND, column=2), "columns"), (row(BOUND, column=20), "columns"),
        (row(BOUND, scale=-1.0), "sign"), (row(2 * ROOM / PERIOD**2), "no_velocity"),
        (row(2 * (ROOM + PERIOD * SPEED) / PERIOD**2), "velocity_sign"),
        (row(BOUND / 2), "no_half"), (row(0.0), "other_limit"),
    ]  # fmt: skip


# 07.2 ---------------------------------------------------------------------------------------------


def change_of_psi() -> float:
    """Compute the change from two problems, solved on either side, without any multiplier."""
    state = standing_go2_eom().state
    below, above = (
        fb.solve(leaning_controller(0.5 + d).qp(state)).objective for d in (-1e-4, 1e-4)
    )
    return (above - below) / 2e-4 * STEP


def change_mistakes() -> dict[str, Callable[[], Any]]:
    """Return, for each hint, a function that computes the change of this mistake."""

    def change(
        cos: float = np.pi / 8, part: str = "own", grows: float = STEP, sign: float = -1.0
    ) -> Callable[[], float]:
        def value() -> float:
            solution = fb.solve(leaning_controller(0.5).qp(standing_go2_eom().state))
            f = solution["forces"].reshape(4, 3)
            of = {
                "own": f[:, 2],
                "all": np.full(4, f[:, 2].sum()),
                "1": np.ones(4),
                "tangent": np.hypot(f[:, 0], f[:, 1]),
            }
            names = standing_go2_eom().contacts.names
            rows = [
                (row, price)
                for row, price in solution.multipliers.items()
                if isinstance(row, ConstraintLabel)
            ]
            room = {
                row: of[part][names.index(row.owner)] * np.cos(cos) * grows
                for row, _ in rows
                if row.kind == "friction"
            }
            return float(sign * sum(price * room.get(row, 0.0) for row, price in rows))

        return value

    return {
        "zero": lambda: 0.0,
        "sign": change(sign=1.0),
        "no_facets": change(cos=0.0),
        "four_facets": change(cos=np.pi / 4),
        "all_feet": change(part="all"),
        "no_normal": change(part="1"),
        "leaning": change(part="tangent"),
        "whole_mu": change(grows=1.0),
        "twice_as_much": change(grows=2 * STEP),
    }


# 07.3 ---------------------------------------------------------------------------------------------


@cache
def _record(design: tuple[float, ...]) -> Rollout:
    return run_with_push(
        tuned_controller(*design), HARD, round(PUSH_START + PUSH_DURATION + AFTER, 3)
    )


@array_judge((4,))
def judge_design(given: Array) -> Verdict:
    """Judge gains and weights in simulation."""
    if np.any(given < 0) or given[2] == 0:
        return Verdict(
            False,
            "Gains and weights must not be negative, and the centre of mass needs a weight "
            "above 0.",
            "negative",
        )
    record = lasting_or_verdict(lambda: _record(tuple(given.tolist())))
    if isinstance(record, Verdict):
        return record
    away = 1e3 * np.linalg.norm((record.com - record.com[0])[:, :2], axis=1)
    strayed = 1e3 * record.slip().max()
    end = rounded(round(away[-1], 1), "mm", floor=0.5)
    text = (
        f"x_c moves by {away.max():.1f} mm at most, {end} at the end; a foot moves by "
        f"{strayed:.1f} mm"
    )
    if away.max() > AWAY and away[-1] > BACK:
        return Verdict(
            False,
            f"The robot goes too far and stays there: {text}. How does each gain affect e?",
            "stays_away",
        )
    if away[-1] > BACK:
        return Verdict(
            False,
            f"The robot returns too slowly: {text}. A damper without a spring does not know the "
            f"place.",
            "creeps",
        )
    if away.max() > AWAY and strayed > STRAYED:
        return Verdict(
            False,
            f"The robot goes too far, and so does a foot: {text}. A spring pulls hardest at the "
            f"far end, a damper earlier.",
            "too_far_and_strays",
        )
    if away.max() > AWAY:
        return Verdict(
            False,
            f"The robot goes too far: {text}. When does braking help most, early or late in the "
            f"push?",
            "too_far",
        )
    if strayed > STRAYED:
        return Verdict(
            False,
            f"A foot moves too far: {text}. The robot pulls back harder than necessary.",
            "strays",
        )
    return Verdict(
        True,
        f"In simulation: {text}. The damping brakes while the push still acts. Then the spring "
        f"only has to bring the robot back.",
    )


def design_examples() -> list[Example]:
    """Return examples for exercise 07.3."""
    return [
        ((400, 80, 10, 1e-3), ""), ((400, 70, 10, 1e-3), ""), ((500, 90, 30, 1e-3), ""),
        ((200, 40, 10, 1e-3), "too_far"), ((100, 20, 10, 1e-3), "too_far_and_strays"),
        ((25, 10, 10, 1e-3), "stays_away"), ((0, 80, 10, 1e-3), "creeps"),
        ((10, 1, 1, 1e-3), "falls"), ((1e5, 20, 10, 1e-3), "strays"),
        ((100, -20, 10, 1e-3), "negative"),
        ((100, 20, 0, 1e-3), "negative"),
    ]  # fmt: skip
