"""Judges of the exercises of lesson 07."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

import floatbase as fb
from floatbase._validation import Array
from floatbase.lessons.judges import (
    Example,
    Verdict,
    array_judge,
    lasting_or_verdict,
)
from floatbase.lessons.lesson03 import standing_go2_eom
from floatbase.lessons.lesson07.helpers import (
    MU,
    PUSH_DURATION,
    PUSH_START,
    leaning_controller,
    run_with_push,
    tuned_controller,
)
from floatbase.lessons.rounding import rounded
from floatbase.qp import ConstraintLabel
from floatbase.simulation import Rollout

INNER = MU * np.cos(np.pi / 4)  # μ' of a pyramid inside the cone
HARD, AFTER = 150.0, 1.0  # of exercise 07.4: N, and s after the end of the push
AWAY, STRAYED, BACK = 53.0, 9.0, 3.0  # mm: limits of exercise 07.4
STEP = 0.005  # increase of μ in exercise 07.3


# 07.1 ---------------------------------------------------------------------------------------------


def rows_on_three_feet() -> int:
    """Count the inequality constraints in the QP of floatbase."""
    state = standing_go2_eom().state
    contacts = fb.Contacts.points(state.robot, mu=MU).without("FL_foot")
    return len(
        fb.WholeBodyController(
            state.robot, contacts, fb.standing_tasks(state), facets=6, joint_limits=None
        )
        .qp(state)
        .G
    )


# 07.2 ---------------------------------------------------------------------------------------------


@array_judge((4, 42))
def judge_rows(G: Array) -> Verdict:
    """Judge the matrix G by G x ≤ 0 on vectors x, whatever the order and length of its rows."""
    if not np.any(G):
        return Verdict(False, "There is no answer yet. Zero rows do not forbid anything.", "zero")
    felt = [i for i in range(42) if np.any(G[:, i])]
    if not set(felt) <= {36, 37, 38}:
        return Verdict(
            False,
            f"These rows depend on {_places(felt)}. RL is the third foot of λ. Which columns of x "
            f"belong to it?",
            "columns",
        )
    if not np.all(np.any(G, axis=1)):
        return Verdict(
            False, "One of the four rows is zero, but a pyramid has four sides.", "zero_row"
        )
    own = G[:, 36:39]
    if _agrees(own, INNER):
        return Verdict(
            True,
            "Four rows of 42 numbers, with three non-zero columns. That is all a solver knows "
            "about a friction cone.",
        )
    if _agrees(-own, INNER):
        return Verdict(
            False,
            "The sign is wrong: these rows are G x ≥ 0. A vertical upward force must satisfy G "
            "x ≤ 0.",
            "sign",
        )
    if _agrees(own, MU):
        around = (
            "This pyramid is outside the cone: at its edges it allows more than μ. Inside, μ' "
            "is μ cos 45°."
        )
        return Verdict(False, around, "around")
    if _agrees(own, MU * np.cos(45)):
        return Verdict(False, "np.cos takes radians, and 45° is π/4.", "radians")
    if _agrees(own, 1 / INNER):
        turned = (
            "This is the pyramid for μ = 1/0.7. Which of the two forces is limited by the other "
            "one?"
        )
        return Verdict(False, turned, "inverse_mu")
    if np.any(own @ [0.0, 0.0, 1.0] > 0):
        return Verdict(
            False,
            "These rows forbid a vertical upward force. Check the signs of the last column.",
            "up_forbidden",
        )
    if np.all(own @ [0.2, 0.0, 1.0] <= 0) and np.all(own @ [2.0, 0.0, 1.0] <= 0):
        return Verdict(False, "These rows allow any forward tangential force.", "leans_freely")
    return Verdict(
        False,
        "These rows do not allow the same forces as the pyramid with its sides towards ±x and ±y.",
        "other_forces",
    )


def _places(columns: list[int]) -> str:
    parts = {
        "q̈": (0, 18),
        "τ": (18, 30),
        "FL": (30, 33),
        "FR": (33, 36),
        "RL": (36, 39),
        "RR": (39, 42),
    }
    return ", ".join(
        name for name, (low, high) in parts.items() if any(low <= i < high for i in columns)
    )


@cache
def _tried() -> Array:
    """Return unit forces all over the sphere, shape (n, 3)."""
    made = np.random.default_rng(7).standard_normal((4000, 3))
    return made / np.linalg.norm(made, axis=1)[:, None]


def _agrees(rows: Array, slope: float) -> bool:
    """Return whether constraints allow exactly the forces with `|f_x|, |f_y| ≤ slope f_z`.

    Forces close to the border do not count: rounding a number to two digits may move it.
    """
    forces = _tried()
    room = slope * forces[:, 2] - np.abs(forces[:, :2]).max(axis=1)
    allowed = np.max(rows @ forces.T, axis=0) <= 0
    # rounding a number to two digits may move the border by 5e-3
    return bool(np.all((allowed == (room > 0)) | (np.abs(room) < 5e-3)))


# 07.3 ---------------------------------------------------------------------------------------------


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


# 07.4 ---------------------------------------------------------------------------------------------


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
        f"x_c moves by {rounded(away.max(), 'mm')} at most, {end} at the end; a foot moves by "
        f"{rounded(strayed, 'mm')}"
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


def _sides(slope: float = INNER, first: int = 36) -> Array:
    """Return the four sides of a pyramid on three columns of x."""
    G = np.zeros((4, 42))
    G[:, first : first + 3] = [[1, 0, -slope], [0, 1, -slope], [-1, 0, -slope], [0, -1, -slope]]
    return G


def pyramid_examples() -> list[Example]:
    """Return examples for exercise 07.2."""
    right = _sides()
    leans_freely, up_forbidden = (
        right[[2, 1, 2, 3]],
        right * np.where(np.arange(42) == 38, [[-1], [1], [1], [1]], 1),
    )
    return [
        (right, ""), (8.0 * right, ""), (right[[3, 1, 0, 2]], ""), (_sides(0.495), ""),
        (_sides(0.5), ""),
        (0.0 * right, "zero"), (_sides(first=39), "columns"), (_sides(first=18), "columns"),
        (_sides(first=30), "columns"),
        (right * [[1], [1], [0], [1]], "zero_row"), (-right, "sign"), (_sides(MU), "around"),
        (_sides(MU * np.cos(45)), "radians"), (_sides(1 / INNER), "inverse_mu"),
        (_sides(0.6), "other_forces"),
        (leans_freely, "leans_freely"), (up_forbidden, "up_forbidden"),
    ]  # fmt: skip


def design_examples() -> list[Example]:
    """Return examples for exercise 07.4."""
    return [
        ((400, 80, 10, 1e-3), ""), ((400, 70, 10, 1e-3), ""), ((500, 90, 30, 1e-3), ""),
        ((200, 40, 10, 1e-3), "too_far"), ((100, 20, 10, 1e-3), "too_far_and_strays"),
        ((25, 10, 10, 1e-3), "stays_away"), ((0, 80, 10, 1e-3), "creeps"),
        ((10, 1, 1, 1e-3), "falls"), ((1e5, 20, 10, 1e-3), "strays"),
        ((100, -20, 10, 1e-3), "negative"),
        ((100, 20, 0, 1e-3), "negative"),
    ]  # fmt: skip
