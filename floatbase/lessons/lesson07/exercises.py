"""Exercises of lesson 07, Control as a quadratic program."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

import floatbase as fb
from floatbase._validation import Array
from floatbase.lessons.exercises import (
    Example,
    Exercise,
    NumericJudge,
    ShapeJudge,
    Verdict,
    array_or_verdict,
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

INNER = MU * np.cos(np.pi / 4)  # of a pyramid inside the cone
HARD, AFTER = 150.0, 1.0  # N, and s after the push's end: what exercise 07.4 asks for
AWAY, STRAYED, BACK = 53.0, 9.0, 3.0  # mm
STEP = 0.005  # by which μ grows in exercise 07.3


# 07.1 ---------------------------------------------------------------------------------------------


def _rows_on_three_feet() -> int:
    """Counted in the package's own QP."""
    state = standing_go2_eom().state
    contacts = fb.Contacts.points(state.robot, mu=MU).without("FL_foot")
    return len(
        fb.WholeBodyController(state.robot, contacts, fb.standing_tasks(state), facets=6)
        .qp(state)
        .G
    )


# 07.2 ---------------------------------------------------------------------------------------------


def _judge_rows(answer: Any) -> Verdict:
    """Rows G, judged by G x ≤ 0 on vectors x: rows may have any order and any length."""
    G = array_or_verdict(answer, (4, 42))
    if isinstance(G, Verdict):
        return G
    if not np.any(G):
        return Verdict(False, "There is nothing there yet: rows of zeros forbid nothing.", "zero")
    felt = [i for i in range(42) if np.any(G[:, i])]
    if not set(felt) <= {36, 37, 38}:
        return Verdict(
            False,
            f"These rows feel {_places(felt)}. RL is the third foot of λ: which columns of x are "
            f"its own?",
            "columns",
        )
    if not np.all(np.any(G, axis=1)):
        return Verdict(False, "One of the four rows is zero: a pyramid has four sides.", "zero_row")
    own = G[:, 36:39]
    if _agrees(own, INNER):
        return Verdict(
            True,
            "Four rows of 42 numbers, three of them at work: that is all a solver knows of a "
            "friction cone.",
        )
    if _agrees(-own, INNER):
        return Verdict(
            False,
            "The sign: these rows are G x ≥ 0. A force straight up must give G x ≤ 0.",
            "sign",
        )
    if _agrees(own, MU):
        around = (
            "This pyramid lies around the cone: at its edges it believes in more than μ. "
            "Inside, μ' is μ cos 45°."
        )
        return Verdict(False, around, "around")
    if _agrees(own, MU * np.cos(45)):
        return Verdict(False, "np.cos takes radians: 45° is π/4.", "radians")
    if _agrees(own, 1 / INNER):
        turned = (
            "This is the pyramid of a ground with μ = 1/0.7: which of the two forces is at "
            "most how much of the other?"
        )
        return Verdict(False, turned, "inverse_mu")
    if np.any(own @ [0.0, 0.0, 1.0] > 0):
        return Verdict(
            False,
            "A force straight up is forbidden by these rows: look at the signs of the last column.",
            "up_forbidden",
        )
    if np.all(own @ [0.2, 0.0, 1.0] <= 0) and np.all(own @ [2.0, 0.0, 1.0] <= 0):
        return Verdict(
            False, "These rows let the foot lean forwards as far as it likes.", "leans_freely"
        )
    return Verdict(
        False,
        "These rows allow other forces than the pyramid with its sides towards ±x and ±y does.",
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
    """Forces of unit length all over the sphere, (n, 3)."""
    made = np.random.default_rng(7).standard_normal((4000, 3))
    return made / np.linalg.norm(made, axis=1)[:, None]


def _agrees(rows: Array, slope: float) -> bool:
    """Whether rows allow exactly the forces of |f_x| ≤ slope f_z, |f_y| ≤ slope f_z, but for those
    on the border.
    """
    forces = _tried()
    room = slope * forces[:, 2] - np.abs(forces[:, :2]).max(axis=1)
    allowed = np.max(rows @ forces.T, axis=0) <= 0
    return bool(
        np.all((allowed == (room > 0)) | (np.abs(room) < 5e-3))
    )  # a number with two digits may move the border so far


# 07.3 ---------------------------------------------------------------------------------------------


def _change_of_psi() -> float:
    """From two problems solved anew on either side: no price in it."""
    state = standing_go2_eom().state
    below, above = (
        fb.solve(leaning_controller(0.5 + d).qp(state)).objective for d in (-1e-4, 1e-4)
    )
    return (above - below) / 2e-4 * STEP


def _changes() -> dict[str, Callable[[], Any]]:
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


def _judge_design(answer: Any) -> Verdict:
    """Gains and weights, judged on the physics."""
    given = array_or_verdict(answer, (4,))
    if isinstance(given, Verdict):
        return given
    if np.any(given < 0) or given[2] == 0:
        return Verdict(
            False,
            "Gains and weights are not negative, and the centre of mass needs a weight above 0.",
            "negative",
        )
    record = lasting_or_verdict(lambda: _record(tuple(given.tolist())))
    if isinstance(record, Verdict):
        return record
    away = 1e3 * np.linalg.norm((record.com - record.com[0])[:, :2], axis=1)
    strayed = 1e3 * record.slip().max()
    end = rounded(round(away[-1], 1), "mm", floor=0.5)
    told = (
        f"{rounded(away.max(), 'mm')} away, {end} at the end; a foot strays "
        f"{rounded(strayed, 'mm')}"
    )
    if away.max() > AWAY and away[-1] > BACK:
        return Verdict(
            False,
            f"It goes too far and does not come back: {told}. Look at what each gain does to e.",
            "stays_away",
        )
    if away[-1] > BACK:
        return Verdict(
            False,
            f"It creeps home too slowly: {told}. A damper without a spring behind it forgets the "
            f"place.",
            "creeps",
        )
    if away.max() > AWAY and strayed > STRAYED:
        return Verdict(
            False,
            f"It goes too far, and a foot strays: {told}. A spring pulls hardest at the far end, a "
            f"damper earlier.",
            "too_far_and_strays",
        )
    if away.max() > AWAY:
        return Verdict(
            False,
            f"It goes too far: {told}. When is there most to gain, early or late in the push?",
            "too_far",
        )
    if strayed > STRAYED:
        return Verdict(
            False, f"A foot strays: {told}. It pulls home harder than it needs to.", "strays"
        )
    return Verdict(
        True,
        f"On the physics: {told}. Damping brakes while the push still lasts; the spring then only "
        f"brings it home.",
    )


def _sides(slope: float = INNER, first: int = 36) -> Array:
    """Four sides of a pyramid on three columns of x."""
    G = np.zeros((4, 42))
    G[:, first : first + 3] = [[1, 0, -slope], [0, 1, -slope], [-1, 0, -slope], [0, -1, -slope]]
    return G


def _pyramids() -> list[Example]:
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


def _designs() -> list[Example]:
    return [
        ((400, 80, 10, 1e-3), ""), ((400, 70, 10, 1e-3), ""), ((500, 90, 30, 1e-3), ""),
        ((200, 40, 10, 1e-3), "too_far"), ((100, 20, 10, 1e-3), "too_far_and_strays"),
        ((25, 10, 10, 1e-3), "stays_away"), ((0, 80, 10, 1e-3), "creeps"),
        ((10, 1, 1, 1e-3), "falls"), ((1e5, 20, 10, 1e-3), "strays"),
        ((100, -20, 10, 1e-3), "negative"),
        ((100, 20, 0, 1e-3), "negative"),
    ]  # fmt: skip


EXERCISES = (
    Exercise(
        name="07.1",
        statement="go2 on three feet, six facets each, and its twelve motors: how many inequality "
        "rows?",
        stub="rows = 24  # replace this number by what you find",
        solution="rows = 3 * (6 + 1) + 2 * 12",
        judge=NumericJudge(
            is_count=True,
            right=_rows_on_three_feet,
            praise="Six sides and a normal force for each foot that stands, two limits for each "
            "motor.",
            mistakes={
                "motors_alone": lambda: 24,
                "of_the_lesson": lambda: 44,
                "no_normal": lambda: 3 * 6 + 24,
                "one_limit": lambda: 3 * 7 + 12,
                "no_motors": lambda: 3 * 7,
                "four_facets": lambda: 3 * 5 + 24,
                "no_normal_one_limit": lambda: 3 * 6 + 12,
                "four_feet": lambda: 4 * 7 + 24,
                "equalities": lambda: 3 * 7 + 24 + 27,
            },
            hints={
                "motors_alone": "Those are the motors alone. What does each foot that stands add?",
                "of_the_lesson": "That is the lesson's own count: four feet with four facets.",
                "no_normal": "The rows of the normal forces are missing: feet do not pull.",
                "one_limit": "A motor has two limits, one each way.",
                "no_motors": "The motors are missing.",
                "four_facets": "Four facets, or nine motors? Each foot has six facets here, and "
                "all twelve motors count.",
                "no_normal_one_limit": "The normal forces are missing, and a motor has two limits, "
                "one each way.",
                "four_feet": "That is for four feet; one of them is in the air.",
                "equalities": "The rows of (7) are equalities: 18 of motion and 9 for three feet "
                "do not count here.",
            },
        ),
        explanation="A lifted foot takes its 7 rows along, and 3 of the equalities, and 3 of the "
        "variables.",
    ),
    Exercise(
        name="07.2",
        statement="The friction rows of RL alone, G of G x ≤ 0 with x = (q̈, τ, λ), shape (4, 42): "
        "a pyramid inside the cone, "
        "μ = 0.7, its sides towards ±x and ±y.",
        stub="G_RL = np.zeros((4, 42))  # replace: one row for each side of the pyramid",
        solution="inner = 0.7 * np.cos(np.pi / 4)\n"
        "G_RL = np.zeros((4, 42))\n"
        "G_RL[:, 36:39] = [[1, 0, -inner], [0, 1, -inner], [-1, 0, -inner], [0, -1, -inner]]",
        judge=ShapeJudge(
            _judge_rows,
            {
                (4, 12): "12 columns are λ alone; x begins with q̈ and τ.",
                (4, 3): "3 columns are one foot's force; x has 42 numbers.",
                (5, 42): "Five rows: n·f ≥ 0 follows from the other four, as you saw.",
                (42, 4): "This is the transpose: a row of G belongs to one limit.",
            },
        ),
        examples=_pyramids,
        explanation="Each row says d·f - μ' n·f ≤ 0 for one direction d, with zeros for whatever "
        "is not this foot's force.",
    ),
    Exercise(
        name="07.3",
        statement="Predict from the prices in `solution` how ψ changes when μ goes from 0.5 to "
        "0.505.",
        stub='change = 0.0  # replace: from solution.multipliers and solution["forces"]',
        solution='normal = dict(zip(contacts.names, solution["forces"][2::3]))\n'
        "more = 0.005 * np.cos(np.pi / 8)  # of μ'\n"
        "change = -sum(\n"
        "    price * normal[row.owner] * more\n"
        "    for row, price in solution.multipliers.items()\n"
        '    if row.kind == "friction"\n'
        ")",
        judge=NumericJudge(
            right=_change_of_psi,
            praise="Price times room, summed over the active rows: a derivative, read off a "
            "solution that you had anyway.",
            mistakes=_changes(),
            hints={
                "zero": "There is nothing there yet: an active row has a price.",
                "sign": "The sign: more room never raises the least ψ.",
                "no_facets": "The factor of the facets is missing: with 8 of them μ' is μ "
                "cos(π/8).",
                "four_facets": "That is the factor of 4 facets, cos(π/4); here are 8.",
                "all_feet": "Each row gets the room of its own foot, μ' times that foot's normal "
                "force, not that of all feet.",
                "no_normal": "The normal forces are missing: a row d·f ≤ μ' n·f gets as much more "
                "room as n·f says.",
                "leaning": "The room of a row grows with the normal force of its foot, not with "
                "how far it leans.",
                "whole_mu": "So much for Δμ = 1; μ grows by 0.005.",
                "twice_as_much": "So much for Δμ = 0.01; here it is 0.005.",
            },
            tolerance=0.01,
        ),
        examples=lambda: [(round(_change_of_psi(), 3), "")],
        explanation="For small changes ψ falls by the sum of price times room. Torque limits that "
        "are not active cost nothing.",
    ),
    Exercise(
        name="07.4",
        statement="kp, kd and weight of the centre of mass and the weight of the posture, four "
        "numbers: after a push of 150 N "
        "x_c strays at most 53 mm, no foot more than 9 mm, and 1 s after the push x_c is within 3 "
        "mm of its place.",
        stub="design = np.array([100, 20, 10, 1e-3])  # kp, kd, weight; weight of the posture",
        solution="design = np.array([400, 80, 10, 1e-3])",
        judge=_judge_design,
        examples=_designs,
        explanation="Twice the critical damping of a stiff spring: the damper answers the speed, "
        "which is there before any "
        "error is, and a stiff spring brings it home although the damper is slow.",
    ),
)
