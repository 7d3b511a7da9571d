"""Exercises of lesson 07, Control as a quadratic program."""

from __future__ import annotations

from floatbase.lessons.exercises import Exercise
from floatbase.lessons.judges import NumericJudge, ShapeJudge
from floatbase.lessons.lesson07.verdicts import (
    change_mistakes,
    change_of_psi,
    design_examples,
    judge_design,
    judge_rows,
    pyramid_examples,
    rows_on_three_feet,
)

EXERCISES = (
    Exercise(
        name="07.1",
        statement="go2 on three feet, six facets each, and its twelve motors: how many inequality "
        "rows?",
        stub="rows = 24  # replace this number by what you find",
        solution="rows = 3 * (6 + 1) + 2 * 12",
        judge=NumericJudge(
            is_count=True,
            right=rows_on_three_feet,
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
            judge_rows,
            {
                (4, 12): "12 columns are λ alone; x begins with q̈ and τ.",
                (4, 3): "3 columns are one foot's force; x has 42 numbers.",
                (5, 42): "Five rows: n·f ≥ 0 follows from the other four, as you saw.",
                (42, 4): "This is the transpose: a row of G belongs to one limit.",
            },
        ),
        examples=pyramid_examples,
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
            right=change_of_psi,
            praise="Price times room, summed over the active rows: a derivative, read off a "
            "solution that you had anyway.",
            mistakes=change_mistakes(),
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
        examples=lambda: [(round(change_of_psi(), 3), "")],
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
        judge=judge_design,
        examples=design_examples,
        explanation="Twice the critical damping of a stiff spring: the damper answers the speed, "
        "which is there before any "
        "error is, and a stiff spring brings it home although the damper is slow.",
    ),
)
