"""Exercises of lesson 03, The space of possible motions."""

from __future__ import annotations

from floatbase.lessons.exercises import Exercise, OwnNumber
from floatbase.lessons.judges import NumericJudge, ShapeJudge
from floatbase.lessons.lesson03.verdicts import (
    judge_all_pairs,
    pair_examples,
    standing_forces,
    unloading_examples,
    unloading_judge,
    zeta_columns,
    zeta_mistakes,
)

EXERCISES = (
    Exercise(
        name="03.1",
        statement="Derive λ = z + Z τ for the tilted, moving robot from (7): one matrix of 12 "
        "rows, first z, then the 12 columns of Z.",
        stub="z_and_Z = np.zeros((12, 13))  # replace: z, then the 12 columns of Z",
        solution="J_Minv = tilted.J @ np.linalg.inv(tilted.M)\n"
        "G = J_Minv @ tilted.J.T\n"
        "z = np.linalg.solve(G, tilted.b + J_Minv @ tilted.h)\n"
        "Z = -np.linalg.solve(G, J_Minv @ tilted.S)\n"
        "z_and_Z = np.column_stack([z, Z])",
        judge=ShapeJudge(
            NumericJudge(
                right=zeta_columns,
                praise="ζ is affine: Z holds the response to the motors, and z holds weight and "
                "motion.",
                mistakes=zeta_mistakes(),
                hints={
                    "b_missing": "b is missing in z. The robot moves, and its feet stay in place "
                    "only with J q̈ = b, not 0.",
                    "b_sign": "The sign of b is wrong. J q̈ equals b in (7).",
                    "h_missing": "h is missing in z, so this robot has no weight.",
                    "h_sign": "The sign of h is wrong. (7) says q̈ = M⁻¹ (S τ + Jᵀ λ - h). What "
                    "remains on the other side when you solve for λ?",
                    "constant_missing": "z is zero. With τ = 0, does the ground exert no force?",
                    "S_missing": "Z is zero, but the motors do change the contact forces.",
                    "Z_sign": "The sign of Z is wrong. In J q̈ = b, Jᵀ λ and S τ are on the same "
                    "side. If one grows, the other must shrink.",
                    "all_signs": "All signs are wrong. Is this the force on the robot?",
                    "constant_last": "The constant z must be the first column.",
                    "standing": "This is ζ of the standing robot. `tilted` has another posture and "
                    "moves.",
                    "zero": "All entries are zero.",
                },
            ),
            {
                (12,): "12 numbers are one λ. The answer must hold for every τ: z and Z.",
                (12, 12): "This has the shape of Z alone. Put z in front of it as a column.",
                (12, 19): "Z has 12 columns, one for each motor. 18 columns act on the generalized "
                "forces. Which matrix maps τ to them?",
                (13, 12): "These are rows. z and the columns of Z must be columns here.",
            },
        ),
        explanation="Insert q̈ = M⁻¹ (S τ + Jᵀ λ - h) into J q̈ = b and collect λ on one side: "
        "J M⁻¹ Jᵀ λ = b + J M⁻¹ h - J M⁻¹ S τ.",
    ),
    Exercise(
        name="03.2",
        statement="Redistribute the forces of the standing robot so that FL carries 20 N and "
        "the robot does not move.",
        stub="new_forces = forces.copy()  # replace: shape (12,), N",
        solution="squeezes = internal_forces(eom)  # (12, 6)\n"
        "row = squeezes[2]  # what each of them does to the vertical force of FL\n"
        "new_forces = forces + squeezes @ row * (20 - forces[2]) / (row @ row)",
        judge=unloading_judge(),
        namespace=lambda: {"forces": standing_forces()},
        examples=unloading_examples,
        explanation="Every λ = λ₀ + N x keeps the robot still. x is the shortest vector with "
        "row x = 20 - λ₀[2].",
        own=OwnNumber("FL carries {} N.", (16.0, 18.0, 22.0, 24.0, 26.0, 28.0), unloading_judge),
    ),
    Exercise(
        name="03.3",
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
