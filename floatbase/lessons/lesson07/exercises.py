"""Exercises of lesson 07, Control as a quadratic program."""

from __future__ import annotations

from floatbase.lessons.exercises import Exercise
from floatbase.lessons.judges import NumericJudge
from floatbase.lessons.lesson07.verdicts import (
    change_mistakes,
    change_of_psi,
    design_examples,
    joint_limit_examples,
    judge_design,
    judge_joint_limit,
)

EXERCISES = (
    Exercise(
        name="07.1",
        statement="The position limit of the left front knee after one control step, as one row of "
        "G x ≤ h with x = (q̈, τ, λ): the 42 numbers of the row, then its bound.",
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
        statement="Predict from the multipliers (prices) in `leaning` how ψ changes when μ "
        "increases from 0.5 to 0.505.",
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
            mistakes=change_mistakes(),
            hints={
                "zero": "There is no answer yet. An active constraint has a multiplier.",
                "sign": "The sign is wrong. Relaxing a constraint never increases the minimum "
                "of ψ.",
                "no_facets": "The factor of the facets is missing. With 8 facets, μ' is μ "
                "cos(π/8).",
                "four_facets": "That is the factor of 4 facets, cos(π/4). Here there are 8.",
                "all_feet": "Each constraint is relaxed by the change of μ' times the normal "
                "force of its own foot, not of all feet.",
                "no_normal": "The normal forces are missing. A constraint d·f ≤ μ' n·f is "
                "relaxed in proportion to n·f.",
                "leaning": "The relaxation of a constraint is proportional to the normal force "
                "of its foot, not to the tangential force.",
                "whole_mu": "That is the change for Δμ = 1, but μ increases by 0.005.",
                "twice_as_much": "That is the change for Δμ = 0.01, but here it is 0.005.",
            },
            tolerance=0.01,
        ),
        examples=lambda: [(round(change_of_psi(), 3), "")],
        explanation="For small changes, ψ falls by the sum of multiplier times relaxation. "
        "Inactive torque limits have no effect.",
    ),
    Exercise(
        name="07.3",
        statement="Four numbers: kp, kd and weight of the centre of mass, and the weight of the "
        "posture. After a push of 150 N, x_c must move by at most 53 mm and no foot by more "
        "than 9 mm. 1 s after the push, x_c must be within 3 mm of its place.",
        stub="design = np.array([100, 20, 10, 1e-3])  # kp, kd, weight; weight of the posture",
        solution="design = np.array([400, 80, 10, 1e-3])",
        judge=judge_design,
        examples=design_examples,
        explanation="The solution is a stiff spring with twice the critical damping. The damper "
        "reacts to the velocity, which is there before any position error. A stiff spring "
        "brings the robot home although the damper is slow.",
    ),
)
