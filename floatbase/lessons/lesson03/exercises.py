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
            praise="Two feet have one internal force, along the line between them; every other "
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
                "all": "That is all of them. One thing can be done between two feet that moves "
                "nothing.",
                "unmoving": "That is how many do not move it.",
                "components": "That is the number of force components k; the answer is the number "
                "of directions of β.",
                "three_feet": "That is for three feet.",
                "base_alone": "That is how many motions of the base two feet can stop; the legs "
                "move, too.",
                "more_internal": "You have counted more than one internal force. Which pushes of "
                "two feet turn nothing?",
            },
        ),
        explanation="d - r + rank J_b = 12 - 6 + 5: about the line through both feet no point foot "
        "can stop the base from "
        "turning, so J_b has rank 5, and 6 - 5 = 1 direction only squeezes.",
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
                praise="Internal forces are answered joint by joint, in any posture, at any "
                "velocity, without M and without h.",
                mistakes={"zero": lambda: np.zeros(12)} | squeeze_mistakes(),
                hints={
                    "sign": "The sign: these torques squeeze the other way. Torques and forces "
                    "must cancel in the joint rows "
                    "of (7).",
                    "transpose": "J instead of its transpose: J turns velocities of joints into "
                    "velocities of feet, Jᵀ forces "
                    "into torques.",
                    "into_base": "The frame: J and the forces are both in world axes here; no "
                    "rotation of the base is needed.",
                    "out_of_base": "The frame: the forces are given in world axes already; the "
                    "base's rotation takes them out "
                    "of it.",
                    "standing": "This is the J of the standing robot; `tilted` has another "
                    "posture, so another J.",
                    "h_too": "h is in it: that would hold the robot up as well. The answer is only "
                    "what the squeeze adds.",
                    "zero": "These are no torques at all, so the forces stay as they are.",
                },
            ),
            {
                (
                    18,
                ): "18 numbers: these are generalised forces of base and joints. Motors reach the "
                "joints alone: see S.",
                (6,): "6 numbers: those are the base columns of J. The base has no motors.",
            },
        ),
        explanation="In (7) nothing may change but τ and λ: 0 = S τ + Jᵀ λ. The base rows say that "
        "λ is internal; the joint "
        "rows give τ.",
    ),
    Exercise(
        name="03.3",
        statement="Redistribute the forces of the standing robot so that FL carries 20 N and the "
        "robot does not move.",
        stub="new_forces = forces.copy()  # replace: shape (12,), N",
        solution="squeezes = internal_forces(eom)  # (12, 6)\n"
        "row = squeezes[2]  # what each of them does to the vertical force of FL\n"
        "new_forces = forces + squeezes @ row * (20 - forces[2]) / (row @ row)",
        judge=judge_unloading,
        namespace=lambda: {"forces": standing_forces()},
        examples=unloading_examples,
        explanation="Every λ = λ₀ + N x keeps the robot still; x is the shortest vector with row x "
        "= 20 - λ₀[2].",
    ),
    Exercise(
        name="03.4",
        statement="Build (11) for a moving solo8: one matrix of 20 rows, first v, then the columns "
        "of V⊥.",
        stub="all_pairs = np.zeros((20, 9))  # replace: v, then V⊥ (8 torques, then 12 forces)",
        solution="J_Minv = rising.J @ np.linalg.inv(rising.M)\n"
        "C = np.hstack([J_Minv @ rising.S, J_Minv @ rising.J.T])\n"
        "U, s, Vt = np.linalg.svd(C)\n"
        "r = rank(C)\n"
        "v = Vt[:r].T @ (U[:, :r].T @ (rising.b + J_Minv @ rising.h) / s[:r])\n"
        "all_pairs = np.column_stack([v, Vt[r:].T])",
        judge=judge_all_pairs,
        examples=pair_examples,
        explanation="C has 12 rows and rank 10: two of its singular values are zero but for "
        "rounding. They belong to no "
        "direction of V∥, must not be divided by, and leave 20 - 10 directions to V⊥.",
    ),
)
