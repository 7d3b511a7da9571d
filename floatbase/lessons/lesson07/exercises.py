"""Exercises of lesson 07, Control as a quadratic program."""

from __future__ import annotations

import numpy as np

import floatbase as fb
from floatbase._validation import Array
from floatbase.lessons.exercises import Exercise
from floatbase.lessons.judges import (
    NEAR_MISS,
    BugHunt,
    Example,
    Mistake,
    NumericJudge,
    Verdict,
    array_judge,
    first_fault,
)
from floatbase.lessons.lesson03 import standing_go2_eom
from floatbase.lessons.lesson07.helpers import leaning_controller
from floatbase.lessons.rounding import rounded
from floatbase.qp import ConstraintLabel

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
        stub='fault = ["", ""]  # the line, and: frame, sign, transpose, missing term',
        solution='fault = ["3", "transpose"]',
        judge=BugHunt(
            lines=("3",),
            kind="transpose",
            praise="J takes joint velocities to foot velocities. Forces go back through Jᵀ. In a "
            "robot with as many motors as force components, the wrong matrix has the right shape.",
            refuted={
                "sign": "With a wrong sign, each entry would be the negative of the one by virtual "
                "work. The same numbers are there, in other places.",
                "frame": "In another frame, the numbers would be combinations of the right ones. "
                "Here the numbers themselves are right.",
                "missing term": "Without forces the torques are right, so h is there. And all "
                "numbers of virtual work are there.",
            },
            elsewhere="Without forces the torques are right. Which line has the forces?",
        ),
        explanation="The torques that balance contact forces are -Jᵀλ, with the joint columns of "
        "J. With three motors in each leg this block is square, and no error tells you.",
    ),
)
