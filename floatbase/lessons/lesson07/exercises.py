"""Exercises of lesson 07, Control as a quadratic program."""

from __future__ import annotations

from functools import cache

import numpy as np

import floatbase as fb
from floatbase._validation import Array
from floatbase.lessons.exercises import Exercise
from floatbase.lessons.judges import (
    NEAR_MISS,
    Example,
    Mistake,
    NumericJudge,
    Verdict,
    array_judge,
    first_fault,
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
    fault = first_fault([
        ("zero", not len(used), "There is no answer yet. A zero row does not limit anything."),
        ("columns", used.tolist() != [KNEE], "This row depends on column "
         f"{', '.join(map(str, used))} of x. Only the acceleration of the left front knee matters. "
         "The order is base, then hip, thigh and calf of FL."),
        ("sign", row[KNEE] < 0, "The sign is wrong: this is a lower bound of the acceleration."),
    ])  # fmt: skip
    if fault:
        return fault
    limit = bound / row[KNEE]

    def allows(acceleration: float) -> bool:
        return bool(abs(limit - acceleration) <= NEAR_MISS * acceleration)

    return first_fault([
        ("no_velocity", allows(2 * ROOM / PERIOD**2), "Without q̈ the knee still moves by Δt v."),
        ("velocity_sign", allows(2 * (ROOM + PERIOD * SPEED) / PERIOD**2),
         "The knee moves towards the limit, so its velocity leaves less room, not more."),
        ("no_half", allows(BOUND / 2), "The factor ½ of ½ Δt² q̈ is missing."),
        ("other_limit", not allows(BOUND), "This row allows other accelerations. Solve the formula "
         "at its limit for q̈."),
    ]) or Verdict(
        True, f"The knee may accelerate by at most {rounded(limit)} rad/s² in this step."
    )  # fmt: skip


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


def change_mistakes() -> list[Mistake]:
    """Return the mistakes of exercise 07.2."""
    eom = standing_go2_eom()
    solution = fb.solve(leaning_controller(0.5).qp(eom.state))
    f = solution["forces"].reshape(4, 3)
    normal, tangential = f[:, 2], np.hypot(f[:, 0], f[:, 1])
    rows = [
        (eom.contacts.names.index(row.owner), price)
        for row, price in solution.multipliers.items()
        if isinstance(row, ConstraintLabel) and row.kind == "friction"
    ]

    def change(relaxation: Array) -> float:
        """Return the change of ψ if each foot's constraints are relaxed."""
        return float(-sum(price * relaxation[foot] for foot, price in rows))

    facet = np.cos(np.pi / 8)
    return [
        ("zero", 0.0, "There is no answer yet. An active constraint has a multiplier."),
        ("sign", -change(STEP * facet * normal), "The sign is wrong. Relaxing a constraint never "
         "increases the minimum of ψ."),
        ("no_facets", change(STEP * normal), "The factor of the facets is missing. With 8 facets, "
         "μ' is μ cos(π/8)."),
        ("four_facets", change(STEP * np.cos(np.pi / 4) * normal), "That is the factor of 4 "
         "facets, cos(π/4). Here there are 8."),
        ("all_feet", change(STEP * facet * np.full(4, normal.sum())), "Each constraint is relaxed "
         "by the change of μ' times the normal force of its own foot, not of all feet."),
        ("no_normal", change(STEP * facet * np.ones(4)), "The normal forces are missing. A "
         "constraint d·f ≤ μ' n·f is relaxed in proportion to n·f."),
        ("leaning", change(STEP * facet * tangential), "The relaxation of a constraint is "
         "proportional to the normal force of its foot, not to the tangential force."),
        ("whole_mu", change(facet * normal), "That is the change for Δμ = 1, but μ increases by "
         "0.005."),
        ("twice_as_much", change(2 * STEP * facet * normal), "That is the change for Δμ = 0.01, "
         "but here it is 0.005."),
    ]  # fmt: skip


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
        text = (
            "Gains and weights must not be negative, and the centre of mass needs a weight above 0."
        )
        return Verdict(False, text, "negative")
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
    return first_fault([
        ("stays_away", away.max() > AWAY and away[-1] > BACK, "The robot goes too far and stays "
         f"there: {text}. How does each gain affect e?"),
        ("creeps", away[-1] > BACK, f"The robot returns too slowly: {text}. A damper without a "
         "spring does not know the place."),
        ("too_far_and_strays", away.max() > AWAY and strayed > STRAYED, "The robot goes too far, "
         f"and so does a foot: {text}. A spring pulls hardest at the far end, a damper earlier."),
        ("too_far", away.max() > AWAY, f"The robot goes too far: {text}. When does braking help "
         "most, early or late in the push?"),
        ("strays", strayed > STRAYED, f"A foot moves too far: {text}. The robot pulls back harder "
         "than necessary."),
    ]) or Verdict(
        True,
        f"In simulation: {text}. The damping brakes while the push still acts. Then the spring "
        "only has to bring the robot back.",
    )  # fmt: skip


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


EXERCISES = (
    Exercise(
        name="07.1",
        stub="limit = np.zeros(43)  # replace: the 42 numbers of the row, then the bound",
        solution="limit = np.zeros(43)\n"
        "limit[6 + knee] = dt**2 / 2\n"
        "limit[42] = limits.upper[knee] - q_joints[knee] - dt * v_joints[knee]",
        judge=judge_joint_limit,
        examples=joint_limit_examples,
        explanation="Position and velocity are known, so they are part of the bound. Only the "
        "acceleration is a variable of the QP.",
    ),
    Exercise(
        name="07.2",
        stub='dpsi = 0.0  # replace: from leaning.multipliers and leaning["forces"]',
        solution='normal = dict(zip(contacts.names, leaning["forces"][2::3]))\n'
        "more = 0.005 * np.cos(np.pi / 8)  # of μ'\n"
        "dpsi = -sum(\n"
        "    price * normal[row.owner] * more\n"
        "    for row, price in leaning.multipliers.items()\n"
        '    if row.kind == "friction"\n'
        ")",
        judge=NumericJudge(
            right=change_of_psi,
            praise="This is the multiplier times the relaxation, summed over the active "
            "constraints: a derivative, read from a solution that you had anyway.",
            mistakes=change_mistakes,
            tolerance=0.01,
        ),
        examples=lambda: [(round(change_of_psi(), 3), "")],
        explanation="For small changes, ψ falls by the sum of multiplier times relaxation. "
        "Inactive torque limits have no effect.",
    ),
    Exercise(
        name="07.3",
        stub="design = np.array([100, 20, 10, 1e-3])  # kp, kd, weight; weight of the posture",
        solution="design = np.array([400, 80, 10, 1e-3])",
        judge=judge_design,
        examples=design_examples,
        explanation="The solution is a stiff spring with twice the critical damping. The damper "
        "reacts to the velocity, which is there before any position error. A stiff spring "
        "brings the robot home although the damper is slow.",
    ),
)
