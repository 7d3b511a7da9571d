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
                praise="One block for each foot. The base rows of J give the same matrix.",
                mistakes=moment_mistakes(),
                hints={
                    "zero": "There is no answer yet. A foot beside the centre of mass has a "
                    "lever arm.",
                    "sign": "This is the opposite moment. The lever arm points from x_c to the "
                    "foot, and r × x, r × y, r × z are columns, not rows.",
                    "about_base": "These are moments about the base's origin, but x_c is "
                    "another point.",
                    "about_origin": "These are moments about the world's origin. Subtract x_c.",
                    "millimetres": "The unit is wrong: this is in N·mm. Lengths are in m.",
                    "reversed": "The blocks are right, but in the opposite order. λ begins with "
                    "the first row of `x_feet`.",
                    "order": "The blocks are right, but in the wrong order. λ has the feet in "
                    "the order of `x_feet`.",
                },
            ),
            {
                (3, 12): "Twelve columns are for four feet. FL is in the air.",
                (9, 3): "The blocks must be side by side, not below each other: use `np.hstack`.",
                (
                    3,
                    3,
                ): "The blocks must be side by side. Their sum would mean one common force for "
                "all feet.",
                (3,): "That is a moment. G_τ is the matrix that maps λ to the moment.",
            },
        ),
        explanation="In (21) the columns of a block are r × x, r × y and r × z with r = x_i - x_c.",
    ),
    Exercise(
        name="05.2",
        statement="f̃_c, shape (3,), N, world, for go2 to accelerate by 0.5 m/s² forwards and 1 "
        "m/s² upwards.",
        stub="f_wish = np.array([0, 0, robot.weight])  # replace",
        solution="f_wish = robot.mass * np.array([0.5, 0, 1.0]) + np.array([0, 0, robot.weight])",
        judge=NumericJudge(
            right=force_by_momentum,
            praise="m a plus m g: gravity is the only external force that is not in λ.",
            mistakes=force_mistakes(),
            hints={
                "weight_alone": "That holds the robot still. Add the force that accelerates it.",
                "no_gravity": "Gravity is missing. The ground must carry the weight, too.",
                "gravity_sign": "The sign of gravity is wrong. Gravity pulls down, so the "
                "ground must push up harder.",
                "weight_twice": "The weight is counted twice.",
                "no_mass": "The mass is missing: these are m/s², not N.",
                "no_mass_on_a": "The mass is missing in one of the two terms.",
                "g_without_mass": "9.81 is an acceleration. Multiply it by the mass to get a "
                "force.",
                "weight_times_a": "This is weight times acceleration. The weight already is m g.",
            },
        ),
        namespace=lambda: {"robot": standing_go2_eom().robot},
        explanation="By Newton's law, m a = f_c + m g with g pointing down. "
        "`desired_wrench(state, a)` of floatbase.objectives computes f_c.",
    ),
    Exercise(
        name="05.3",
        statement="The smallest torques, shape (18,), N·m, that give anymal_kinova's feet the "
        "contact forces `pressed`.",
        stub="tau_pressed = np.zeros(18)  # replace: from C_tau, C_forces, a and pressed",
        solution="tau_pressed = np.linalg.pinv(C_tau) @ (a - C_forces @ pressed)",
        judge=ShapeJudge(
            NumericJudge(
                right=smallest_by_zeta,
                praise="(25) in one line: λ determines τ through the pseudo-inverse of C_τ alone.",
                mistakes=torque_mistakes(),
                hints={
                    "zero": "There is no answer yet. Without torques the feet carry hardly "
                    "anything.",
                    "whole_C": "The pseudo-inverse of the whole C gives the shortest (τ, λ). "
                    "But λ is not free: it must be `pressed`.",
                    "a_forgotten": "a is missing, and it contains gravity.",
                    "forces_forgotten": "λ is missing. Move C_λ λ to the right-hand side, then "
                    "solve for τ.",
                    "forces_sign": "The sign of C_λ λ is wrong. It changes when the term moves "
                    "to the right-hand side.",
                    "a_sign": "The sign of a is wrong.",
                    "transpose": "A transpose is not an inverse. Use the pseudo-inverse of C_τ.",
                    "all_still": "These torques hold all joints still, including the arm. "
                    "Smaller torques give the same forces.",
                    "no_squeeze": "These torques hold the robot still, but without the internal "
                    "force.",
                    "standing": "These torques are for the forces of standing still. `pressed` "
                    "has 20 N more between the front feet.",
                },
            ),
            {
                (12,): "12 numbers are forces. anymal_kinova has 18 motors.",
                (30,): "30 numbers are (τ, λ), but λ is given.",
                (24,): "24 numbers are accelerations, or torques with six zeros for the base.",
            },
        ),
        namespace=lambda: {"pressed": squeezed_standing_forces()},
        explanation="(10) is C_τ τ + C_λ λ = a. For a given λ this is a linear system for τ, "
        "with more unknowns than equations. The pseudo-inverse gives its shortest solution. β "
        "is not needed.",
    ),
    Exercise(
        name="05.4",
        statement="A cost on λ for a force of 60 N forwards in addition to the weight, within 1 "
        "N and 0.1 N·m. At every foot the tangential force must be at most 0.5 times the normal "
        "force.",
        stub="design = cost60 + 1e-3 * force_bias(contacts, 0.1, robot.weight / 4)  # change it",
        solution="whole = np.array([60, 0, robot.weight])  # where all forces together point\n"
        "leaning = fb.Contacts.points(robot, normals=whole / np.linalg.norm(whole))\n"
        "design = cost60 + 1e-3 * tangential_bias(leaning)",
        judge=judge_design,
        namespace=stub_names,
        examples=design_examples,
        explanation="(23) prefers forces without friction, and distributes the friction "
        "equally. Where friction is the goal, the direction of the total force is a better "
        "preference. Then the force at each foot has the same direction as the sum, with a "
        "ratio of 60 / 158.",
    ),
)
