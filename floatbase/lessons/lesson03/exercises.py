"""Exercises of lesson 03, The space of possible motions."""

from __future__ import annotations

import numpy as np

import floatbase as fb
from floatbase.lessons.exercises import Exercise
from floatbase.lessons.judges import NumericJudge, ShapeJudge
from floatbase.lessons.lesson03.verdicts import (
    diagonal_stance_eom,
    judge_all_pairs,
    judge_unloading,
    pair_examples,
    squeeze_mistakes,
    squeeze_torques,
    standing_forces,
    unloading_examples,
)
from floatbase.linear_algebra import rank

EXERCISES = (
    Exercise(
        name="03.1",
        statement="go2 stands on FL and RR alone. Of the 12 directions of β, how many move the "
        "robot?",
        stub="moving = 12  # replace this number by what you find",
        solution='two_feet = fb.equations_of_motion(state, contacts.only("FL_foot", "RR_foot"))\n'
        "moving = dimensions(two_feet).rank_V_qdd",
        judge=NumericJudge(
            is_count=True,
            right=lambda: rank(fb.accelerations_from_torques(diagonal_stance_eom()).A),
            praise="Two feet have one internal force, along the line between them. Every other "
            "direction moves something.",
            mistakes={
                "all": lambda: 12,
                "unmoving": lambda: 1,
                "components": lambda: 6,
                "three_feet": lambda: 9,
                "base_alone": lambda: 5,
                "more_internal": lambda: 10,
            },
            hints={
                "all": "That is all of them. One action between two feet does not move anything.",
                "unmoving": "That is the number of directions that do not move the robot.",
                "components": "That is k, the number of force components. The answer is the "
                "number of directions of β.",
                "three_feet": "That is the number for three feet.",
                "base_alone": "That is the number of motions of the base that two feet can "
                "stop. The legs move, too.",
                "more_internal": "You have counted more than one internal force. Which pairs of "
                "forces at two feet have no moment?",
            },
        ),
        explanation="d - r + rank J_b = 12 - 6 + 5. Point feet cannot stop the base from "
        "turning about the line through both feet, so J_b has rank 5. The remaining 6 - 5 = 1 "
        "direction is an internal force.",
    ),
    Exercise(
        name="03.2",
        statement="Which torques make the ground add exactly `squeeze` to the contact forces of "
        "the tilted robot?",
        stub="torques = np.zeros(12)  # replace: N·m, from tilted.J and squeeze",
        solution="torques = -tilted.J[:, 6:].T @ squeeze",
        judge=ShapeJudge(
            NumericJudge(
                right=squeeze_torques,
                praise="Internal forces are balanced joint by joint, in any posture, at any "
                "velocity, without M and without h.",
                mistakes={"zero": lambda: np.zeros(12)} | squeeze_mistakes(),
                hints={
                    "sign": "The sign is wrong: these torques squeeze in the opposite "
                    "direction. Torques and forces must cancel in the joint rows of (7).",
                    "transpose": "This uses J instead of its transpose. J maps joint velocities "
                    "to foot velocities, and Jᵀ maps forces to torques.",
                    "into_base": "The frame is wrong. J and the forces are both in world axes "
                    "here, so no rotation of the base is needed.",
                    "out_of_base": "The frame is wrong. The forces are in world axes already, "
                    "and the rotation of the base takes them out of these axes.",
                    "standing": "This is the J of the standing robot. `tilted` has another "
                    "posture, so J differs.",
                    "h_too": "This includes h, which would also carry the robot. The answer is "
                    "only what the squeeze adds.",
                    "zero": "All torques are zero, so the forces do not change.",
                },
            ),
            {
                (18,): "18 numbers are generalized forces of base and joints. Motors act only on "
                "the joints: see S.",
                (6,): "6 numbers are the base columns of J. The base has no motors.",
            },
        ),
        explanation="In (7) only τ and λ may change: 0 = S τ + Jᵀ λ. The base rows say that λ "
        "is internal, and the joint rows give τ.",
    ),
    Exercise(
        name="03.3",
        statement="Redistribute the forces of the standing robot so that FL carries 20 N and "
        "the robot does not move.",
        stub="new_forces = forces.copy()  # replace: shape (12,), N",
        solution="squeezes = internal_forces(eom)  # (12, 6)\n"
        "row = squeezes[2]  # what each of them does to the vertical force of FL\n"
        "new_forces = forces + squeezes @ row * (20 - forces[2]) / (row @ row)",
        judge=judge_unloading,
        namespace=lambda: {"forces": standing_forces()},
        examples=unloading_examples,
        explanation="Every λ = λ₀ + N x keeps the robot still. x is the shortest vector with "
        "row x = 20 - λ₀[2].",
    ),
    Exercise(
        name="03.4",
        statement="Build (11) for a moving solo8: one matrix with 20 rows, first v, then the "
        "columns of V⊥.",
        stub="all_pairs = np.zeros((20, 9))  # replace: v, then V⊥ (8 torques, then 12 forces)",
        solution="J_Minv = rising.J @ np.linalg.inv(rising.M)\n"
        "C = np.hstack([J_Minv @ rising.S, J_Minv @ rising.J.T])\n"
        "U, s, Vt = np.linalg.svd(C)\n"
        "r = rank(C)\n"
        "v = Vt[:r].T @ (U[:, :r].T @ (rising.b + J_Minv @ rising.h) / s[:r])\n"
        "all_pairs = np.column_stack([v, Vt[r:].T])",
        judge=judge_all_pairs,
        examples=pair_examples,
        explanation="C has 12 rows and rank 10, so two of its singular values are zero except "
        "for rounding. They do not belong to a direction of V∥, and you must not divide by "
        "them. So 20 - 10 directions remain for V⊥.",
    ),
)
