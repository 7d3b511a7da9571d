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
        statement="go2 stands on three feet, with six facets each, and has twelve motors. How "
        "many inequality constraints are there?",
        stub="rows = 24  # replace this number by what you find",
        solution="rows = 3 * (6 + 1) + 2 * 12",
        judge=NumericJudge(
            is_count=True,
            right=rows_on_three_feet,
            praise="Six facets and a normal force for each foot on the ground, and two limits "
            "for each motor.",
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
                "motors_alone": "Those are only the motors. What does each foot on the ground add?",
                "of_the_lesson": "That is the number in the lesson, for four feet with four "
                "facets.",
                "no_normal": "The constraints on the normal forces are missing: feet cannot pull.",
                "one_limit": "A motor has two limits, one in each direction.",
                "no_motors": "The motors are missing.",
                "four_facets": "Did you use four facets, or nine motors? Each foot has six "
                "facets here, and all twelve motors count.",
                "no_normal_one_limit": "The normal forces are missing, and a motor has two "
                "limits, one in each direction.",
                "four_feet": "That is for four feet. One of them is in the air.",
                "equalities": "The rows of (7) are equality constraints: 18 for the motion and "
                "9 for three feet. They do not count here.",
            },
        ),
        explanation="A lifted foot removes its 7 inequality constraints, 3 equality constraints "
        "and 3 variables.",
    ),
    Exercise(
        name="07.2",
        statement="The friction constraints of RL alone: G of G x ≤ 0 with x = (q̈, τ, λ), "
        "shape (4, 42), for a pyramid inside the cone with μ = 0.7 and its sides towards ±x and "
        "±y.",
        stub="G_RL = np.zeros((4, 42))  # replace: one row for each side of the pyramid",
        solution="inner = 0.7 * np.cos(np.pi / 4)\n"
        "G_RL = np.zeros((4, 42))\n"
        "G_RL[:, 36:39] = [[1, 0, -inner], [0, 1, -inner], [-1, 0, -inner], [0, -1, -inner]]",
        judge=ShapeJudge(
            judge_rows,
            {
                (4, 12): "12 columns are for λ alone. x begins with q̈ and τ.",
                (4, 3): "3 columns are for the force of one foot. x has 42 numbers.",
                (5, 42): "There are five rows. n·f ≥ 0 follows from the other four, as you saw.",
                (42, 4): "This is the transpose. Each row of G is one constraint.",
            },
        ),
        examples=pyramid_examples,
        explanation="Each row says d·f - μ' n·f ≤ 0 for one direction d, with zeros for "
        "everything except the force of this foot.",
    ),
    Exercise(
        name="07.3",
        statement="Predict from the multipliers (prices) in `solution` how ψ changes when μ "
        "increases from 0.5 to 0.505.",
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
        name="07.4",
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
