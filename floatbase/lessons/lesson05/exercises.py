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
    judge_design,
    judge_wrench,
    smallest_by_zeta,
    stub_names,
    torque_mistakes,
    wrench_examples,
)

EXERCISES = (
    Exercise(
        name="05.1",
        statement="The desired wrench of a controller: a function of the actual and the desired "
        "state that returns f̃_c [N] and τ̃_c [N·m], each of shape (3,), world frame.",
        stub="def desired_wrench(now, goal):\n"
        "    force = np.array([0, 0, robot.weight])  # change both\n"
        "    moment = np.zeros(3)\n"
        "    return force, moment",
        solution="from floatbase.lessons.lesson05 import rotation_error\n"
        "from floatbase.objectives import centroidal_inertia\n\n\n"
        "def desired_wrench(now, goal):\n"
        "    weight = np.array([0, 0, robot.weight])\n"
        "    a = -100 * (now.com - goal.com) - 20 * now.com_velocity\n"
        '    omega = now.frame_velocity("base")[3:]\n'
        "    turn = -100 * rotation_error(now, goal) - 20 * omega\n"
        "    return robot.mass * a + weight, centroidal_inertia(now) @ turn",
        judge=judge_wrench,
        namespace=lambda: {"robot": standing_go2_eom().robot},
        examples=wrench_examples,
        explanation="By Newton's law, m a = f_c + m g with g pointing down. The moment is the rate "
        "of the angular momentum, for locked joints and slow rotation. `desired_wrench(state, a, "
        "rate)` of floatbase.objectives computes both.",
    ),
    Exercise(
        name="05.2",
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
        name="05.3",
        statement="A function of the desired total force [N] that returns a cost on λ. At its "
        "minimum, the wrench is that force within 1 N and 0.1 N·m, and at every foot the "
        "tangential force is at most 0.5 times the normal force.",
        stub="def design(force):  # N, world, with the weight\n"
        "    goal = wrench_objective(state, contacts, force, np.zeros(3))\n"
        "    return goal + 1e-3 * force_bias(contacts, 0.1, robot.weight / 4)  # change it",
        solution="from floatbase.objectives import tangential_bias\n\n\n"
        "def design(force):  # N, world, with the weight\n"
        "    goal = wrench_objective(state, contacts, force, np.zeros(3))\n"
        "    direction = force / np.linalg.norm(force)  # of all forces together\n"
        "    inclined = fb.Contacts.points(robot, normals=direction)\n"
        "    return goal + 1e-3 * tangential_bias(inclined)",
        judge=judge_design,
        namespace=stub_names,
        examples=design_examples,
        explanation="(23) prefers forces without friction, and distributes the friction "
        "equally. Where friction is the goal, the direction of the total force is a better "
        "preference. Then the force at each foot has the same direction as the sum, with a "
        "ratio of 60 / 158 in the first case.",
    ),
)
