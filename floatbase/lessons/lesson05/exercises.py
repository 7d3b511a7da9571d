"""Exercises of lesson 05, Steering the centre of mass."""

from __future__ import annotations

from floatbase.lessons.exercises import Exercise
from floatbase.lessons.judges import NumericJudge, ShapeJudge
from floatbase.lessons.lesson03 import standing_go2_eom
from floatbase.lessons.lesson05.helpers import (
    squeezed_standing_forces,
)
from floatbase.lessons.lesson05.verdicts import (
    design_examples,
    force_by_momentum,
    force_mistakes,
    judge_design,
    moment_mistakes,
    moments_by_jacobian,
    smallest_by_zeta,
    stub_names,
    torque_mistakes,
)

EXERCISES = (
    Exercise(
        name="05.1",
        statement="G_τ of (21) for three feet, shape (3, 9), from `x_feet` (3, 3) and `x_com` "
        "(3,), m, world.",
        stub="G_three = np.zeros((3, 9))  # replace: from x_feet and x_com",
        solution="x_feet = three_feet_eom().contacts.positions(three_feet_eom().state)\n"
        "x_com = three_feet_eom().state.com\n"
        "levers = x_feet - x_com\n"
        "G_three = np.hstack([np.cross(lever, np.eye(3)).T for lever in levers])",
        judge=ShapeJudge(
            NumericJudge(
                right=moments_by_jacobian,
                praise="One block for each foot; the base's rows of J say the same.",
                mistakes=moment_mistakes(),
                hints={
                    "zero": "There is nothing there yet: a foot beside the centre of mass has a "
                    "lever.",
                    "sign": "The opposite moment: the lever goes from x_c to the foot, and r × y, "
                    "r × x are columns, not rows.",
                    "about_base": "These are moments about the base's origin; x_c is another "
                    "point.",
                    "about_origin": "These are moments about the world's origin: subtract x_c.",
                    "millimetres": "The unit: this is in N·mm; lengths are in m.",
                    "reversed": "The right blocks in the opposite order: λ begins with the first "
                    "row of `x_feet`.",
                    "order": "The right blocks in a wrong order: λ has the feet as `x_feet` has "
                    "them.",
                },
            ),
            {
                (3, 12): "Twelve columns are for four feet; FL is in the air.",
                (9, 3): "The blocks stand side by side, not below each other: `np.hstack`.",
                (
                    3,
                    3,
                ): "The blocks stand side by side; added up, they would need one force for all "
                "feet.",
                (3,): "That is a moment. G_τ is the matrix that makes it from λ.",
            },
        ),
        explanation="(21): the columns of a block are r × x, r × y and r × z with r = x_i - x_c.",
    ),
    Exercise(
        name="05.2",
        statement="f̃_c, shape (3,), N, world: go2 shall accelerate by 0.5 m/s² forwards and 1 "
        "m/s² upwards.",
        stub="f_wish = np.array([0, 0, robot.weight])  # replace",
        solution="f_wish = robot.mass * np.array([0.5, 0, 1.0]) + np.array([0, 0, robot.weight])",
        judge=NumericJudge(
            right=force_by_momentum,
            praise="m a, and m g on top: gravity is the one outside force that is not in λ.",
            mistakes=force_mistakes(),
            hints={
                "weight_alone": "That holds it still. What accelerates it comes on top.",
                "no_gravity": "Gravity is forgotten: the ground must carry the weight, too.",
                "gravity_sign": "The sign of gravity: it pulls down, so the ground must push up by "
                "more.",
                "weight_twice": "The weight counts twice.",
                "no_mass": "The mass is forgotten: these are m/s², not N.",
                "no_mass_on_a": "The mass is forgotten in one of the two parts.",
                "g_without_mass": "9.81 is an acceleration; times the mass it is a force.",
                "weight_times_a": "Weight times acceleration: the weight is m g already.",
            },
        ),
        namespace=lambda: {"robot": standing_go2_eom().robot},
        explanation="Newton: m a = f_c + m g with g pointing down. `desired_wrench(state, a)` of "
        "floatbase.objectives does it.",
    ),
    Exercise(
        name="05.3",
        statement="The smallest torques, shape (18,), N·m, with which anymal_kinova's feet get the "
        "forces `pressed`.",
        stub="tau_pressed = np.zeros(18)  # replace: from C_tau, C_forces, a and pressed",
        solution="tau_pressed = np.linalg.pinv(C_tau) @ (a - C_forces @ pressed)",
        judge=ShapeJudge(
            NumericJudge(
                right=smallest_by_zeta,
                praise="(25) in one line: what λ leaves to τ, by the pseudo-inverse of C_τ alone.",
                mistakes=torque_mistakes(),
                hints={
                    "zero": "There is nothing there yet: without torques the feet carry hardly "
                    "anything.",
                    "whole_C": "The pseudo-inverse of the whole C gives the shortest (τ, λ). λ is "
                    "not to be chosen: it is "
                    "`pressed`.",
                    "a_forgotten": "a is forgotten: gravity is in it.",
                    "forces_forgotten": "λ is forgotten: move C_λ λ to the right side, then solve "
                    "for τ.",
                    "forces_sign": "The sign of C_λ λ: it changes when it moves to the right side.",
                    "a_sign": "The sign of a.",
                    "transpose": "A transpose is no inverse: use the pseudo-inverse of C_τ.",
                    "all_still": "These hold all joints still, the arm too. The same forces can be "
                    "had for less.",
                    "no_squeeze": "These hold the robot still without the squeeze.",
                    "standing": "These are for the forces of standing still; `pressed` has 20 N "
                    "more between the front feet.",
                },
            ),
            {
                (12,): "12 numbers: those are forces. anymal_kinova has 18 motors.",
                (30,): "30 numbers: that is (τ, λ); λ is given.",
                (
                    24,
                ): "24 numbers: those are accelerations, or torques with six zeros for the base.",
            },
        ),
        namespace=lambda: {"pressed": squeezed_standing_forces()},
        explanation="(10) reads C_τ τ + C_λ λ = a. For a given λ that is a linear system for τ, "
        "with more unknowns than rows; "
        "the pseudo-inverse gives its shortest solution. No β is needed.",
    ),
    Exercise(
        name="05.4",
        statement="A cost on λ: 60 N forwards beside the weight, within 1 N and 0.1 N·m, and no "
        "foot leans by more than 0.5.",
        stub="design = cost60 + 1e-3 * force_bias(contacts, 0.1, robot.weight / 4)  # change it",
        solution="whole = np.array([60, 0, robot.weight])  # where all forces together point\n"
        "leaning = fb.Contacts.points(robot, normals=whole / np.linalg.norm(whole))\n"
        "design = cost60 + 1e-3 * tangential_bias(leaning)",
        judge=judge_design,
        namespace=stub_names,
        examples=design_examples,
        explanation="(23) calls a force without friction the best, and shares the friction "
        "equally. Where friction is the "
        "wish, a better preference is the direction of the whole: then each foot leans as the sum "
        "does, by 60 / 158.",
    ),
)
