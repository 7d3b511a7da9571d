"""Exercises of lesson 03, The space of possible motions."""

from __future__ import annotations

from typing import Any

import numpy as np

import floatbase as fb
from floatbase._validation import Array
from floatbase.dynamics import (
    EquationsOfMotion,
    internal_forces,
    torque_force_matrix,
    torque_force_space,
)
from floatbase.lessons.exercises import (
    Example,
    Exercise,
    NumericJudge,
    ShapeJudge,
    Verdict,
    array_or_verdict,
)
from floatbase.lessons.lesson03.helpers import rising_solo8_eom, standing_go2_eom, tilted_squeeze
from floatbase.linear_algebra import RANK_TOLERANCE, rank

# part of the largest number by which two solutions may differ: rounding leaves 1e-12, the mistakes
# 1e-2
TOLERANCE = 1e-5


def _diagonal_stance_eom() -> EquationsOfMotion:
    """(7) of go2 standing on two feet."""
    standing = standing_go2_eom()
    return fb.equations_of_motion(standing.state, standing.contacts.only("FL_foot", "RR_foot"))


def _squeeze_torques() -> Array:
    """By the inverse of ζ, not by the transpose of J."""
    eom, squeeze = tilted_squeeze()
    return np.linalg.solve(fb.forces_from_torques(eom).A, squeeze)


def _turned(forces: Array, R: Array) -> Array:
    return (forces.reshape(-1, 3) @ R.T).ravel()


def _wrong_squeezes() -> dict[str, Any]:
    def torques(change: Any = lambda eom, f: f, after: Any = lambda eom, tau: tau) -> Any:
        def value() -> Array:
            eom, squeeze = tilted_squeeze()
            return after(eom, -eom.J[:, 6:].T @ change(eom, squeeze))

        return value

    return {
        "sign": torques(after=lambda eom, tau: -tau),
        "transpose": lambda: -tilted_squeeze()[0].J[:, 6:] @ tilted_squeeze()[1],
        "into_base": torques(lambda eom, f: _turned(f, eom.state.frame_pose("base").rotation.T)),
        "out_of_base": torques(lambda eom, f: _turned(f, eom.state.frame_pose("base").rotation)),
        "standing": lambda: -standing_go2_eom().J[:, 6:].T @ tilted_squeeze()[1],
        "h_too": torques(after=lambda eom, tau: tau + eom.h[6:]),
    }


def _standing_forces() -> Array:
    """The smallest forces, shape (12,), N, world, that carry the standing robot."""
    eom = standing_go2_eom()
    return np.asarray(np.linalg.lstsq(eom.J[:, :6].T, eom.h[:6], rcond=RANK_TOLERANCE)[0])


def _judge_unloading(answer: Any) -> Verdict:
    """Any forces will do that balance the standing robot and give FL its 20 N."""
    forces = array_or_verdict(answer, (12,))
    if isinstance(forces, Verdict):
        return forces
    eom = standing_go2_eom()
    before = _standing_forces()
    if np.allclose(forces, before, atol=1e-3):
        return Verdict(
            False,
            f"Nothing has changed yet: the front left foot still carries {forces[2]:.0f} N.",
            "unchanged",
        )
    off = eom.h[:6] - eom.J[:, :6].T @ forces
    if abs(off[:3]).max() > 0.05:
        return Verdict(
            False,
            "The forces no longer add up to the weight: what one foot loses, the others must take.",
            "weight",
        )
    if abs(off[3:]).max() > 0.01:
        return Verdict(
            False,
            "The sum is right, but the moments are not: the body would turn. Add internal forces "
            "only.",
            "moments",
        )
    if abs(forces[2] - 20.0) > 0.05:
        more = " That is more than before: mind the sign." if forces[2] > before[2] + 0.05 else ""
        return Verdict(
            False,
            f"The robot stays at rest, but the front left foot carries {forces[2]:.1f} N, not "
            f"20.{more}",
            "not_20",
        )
    if forces[2::3].min() < 0.0:
        return Verdict(
            False, "It balances, but some foot would have to pull on the ground.", "pulls"
        )
    return Verdict(
        True, "The wobbling table: FL gives up 23 N, RR as well, and the other diagonal takes them."
    )


def _wrong_pairs() -> dict[tuple[str, str], Array]:
    """Name of a hint, hint -> the shortest pair (τ, λ) that this mistake leads to, shape (20,)."""
    eom = rising_solo8_eom()
    C, right_side = torque_force_matrix(eom)
    J, M, h, S, b = eom.J, eom.M, eom.h, eom.S, eom.b
    shortest = np.linalg.pinv(C, rcond=RANK_TOLERANCE)
    not_inverted = np.linalg.pinv(np.hstack([J @ M @ S, J @ M @ J.T]), rcond=RANK_TOLERANCE)
    b_missing = (
        "b is missing on the right of (10): solo8 moves, and its feet stay only with J q̈ "
        "= b, not 0."
    )
    M_not_inverted = (
        "M is not inverted: a force is divided by the inertia, so J M⁻¹ it is, not J M."
    )
    return {
        ("b_missing", b_missing): shortest @ (right_side - b),
        ("h_missing", "h is missing on the right of (10): this robot has no weight."): shortest @ b,
        (
            "sign_of_h",
            "The sign of h: in (8) and (10) it comes to the right as + J M⁻¹ h.",
        ): shortest @ (2.0 * b - right_side),
        (
            "sign_of_b",
            "The sign of b: it stands on the right of (10) as in (7), with a plus.",
        ): shortest @ (right_side - 2.0 * b),
        ("M_not_inverted", M_not_inverted): not_inverted @ (b + J @ M @ h),
    }


def _nearly_equal(x: Array, y: Array) -> bool:
    return bool(np.max(np.abs(x - y)) <= TOLERANCE * np.max(np.abs(y)))


def _fault_of_pair(pair: Array) -> Verdict | None:
    """What is wrong with a shortest pair (τ, λ) of (11); None where nothing is."""
    eom = rising_solo8_eom()
    C, right_side = torque_force_matrix(eom)
    if _nearly_equal(pair, torque_force_space(eom).b):
        return None
    if not pair.any():
        return Verdict(
            False, "The first column is still zero, and zero does not solve (10).", "zero"
        )
    if _nearly_equal(C @ pair, right_side):
        return Verdict(
            False,
            "The first column solves (10), but it is longer than need be: some of the null space "
            "is in it. "
            "Was something divided by a singular value that is only rounding?",
            "longer",
        )
    fitting = (
        Verdict(False, text, hint)
        for (hint, text), wrong in _wrong_pairs().items()
        if _nearly_equal(pair, wrong)
    )
    unknown = Verdict(
        False,
        "The first column does not solve (10). It is v, shape (20,): first τ, then λ.",
        "no_solution",
    )
    return next(fitting, unknown)


def _fault_of_directions(V: Array) -> Verdict | None:
    """What is wrong with columns that should be V⊥ of (11); None where nothing is."""
    C = torque_force_matrix(rising_solo8_eom())[0]
    orthonormal = np.allclose(V.T @ V, np.eye(V.shape[1]), atol=TOLERANCE)
    if np.max(np.abs(C @ V), initial=0.0) > TOLERANCE * np.max(np.abs(C)):
        if orthonormal:
            return Verdict(
                False,
                "v is right. The other columns are orthonormal, but C takes some of them not to "
                "zero. The SVD gives Vᵀ: "
                "its rows are the directions, those of the null space come last.",
                "not_null_space",
            )
        return Verdict(
            False, "v is right, but C takes some of the other columns not to zero.", "not_to_zero"
        )
    if not orthonormal:
        return Verdict(
            False,
            "v is right, and the columns lie in the null space, but they are not orthonormal.",
            "not_orthonormal",
        )
    missing = C.shape[1] - rank(C) - V.shape[1]
    if missing == C.shape[0] - rank(C):
        return Verdict(
            False,
            "v is right. But these are too few directions: one is taken away for each row of C, "
            "and not every row says "
            "something new. How many singular values are not zero?",
            "full_rank",
        )
    if missing:
        return Verdict(
            False,
            f"v is right, and so are these directions, but not all are there: {missing} missing.",
            "too_few",
        )
    return None


def _judge_all_pairs(answer: Any) -> Verdict:
    """The shortest pair must be right; behind it any orthonormal columns will do that span the null
    space.
    """
    try:
        shape = np.shape(answer)
    except ValueError:  # rows of different lengths
        shape = ()
    given = array_or_verdict(answer, shape)
    if isinstance(given, Verdict):
        return given
    if given.ndim != 2 or shape[0] != 20 or not shape[1]:
        if given.ndim == 2 and shape[1] == 20:
            return Verdict(False, "These are rows; pairs (τ, λ) are columns here.", "transpose")
        if shape[:1] == (34,):
            return Verdict(
                False, "34 rows: that is (13) with q̈; in (11) are τ and λ alone.", "with_qdd"
            )
        form = (
            "One matrix is asked for, of 20 rows: 8 torques and 12 forces. v is its first "
            "column, then comes V⊥."
        )
        return Verdict(False, form, "no_matrix")
    right = Verdict(
        True, "Ten directions for eight motors, and nobody typed a 10: the singular values said so."
    )
    return _fault_of_pair(given[:, 0]) or _fault_of_directions(given[:, 1:]) or right


def _unloadings() -> list[Example]:
    wobble = np.array(
        [0, 0, 1, 0, 0, -1, 0, 0, -1, 0, 0, 1.0]
    )  # forces without a sum and without a moment
    forces, squeezes = _standing_forces(), internal_forces(standing_go2_eom())
    less = 20.0 - forces[2]
    short, moved = np.eye(12)[[2, 11]] * less
    return [
        (forces + less * wobble, ""), (forces + less * wobble + 5.0 * squeezes @ squeezes[1], ""),
        (forces, "unchanged"),
        (forces + short, "weight"), (forces + short - moved, "moments"),
        (forces - less * wobble, "not_20"),
        (forces + (less + 10.0) * wobble, "not_20"),
    ]  # fmt: skip


def _pairs() -> list[Example]:
    C, right_side = torque_force_matrix(rising_solo8_eom())
    (U, s, Vt), r = np.linalg.svd(C), rank(C)
    v, V = Vt[:r].T @ (U[:, :r].T @ right_side / s[:r]), Vt[r:].T
    turned = V @ np.linalg.qr(np.random.default_rng(0).standard_normal((10, 10)))[0]

    def first(pair: Array, directions: Array = V) -> Array:
        return np.column_stack([pair, directions])

    return [
        *((first(wrong), hint) for (hint, _), wrong in _wrong_pairs().items()),
        (first(v), ""), (first(v, turned), ""), (first(v + 0.1 * V[:, 0]), "longer"),
        (first(v, Vt[12:].T), "full_rank"),
        (first(v, Vt[:, 10:]), "not_null_space"), (first(v, Vt[:10].T), "not_null_space"),
        (first(v, np.column_stack([V, V[:, 0] + Vt[0]])), "not_to_zero"),
        (first(v, 2.0 * V), "not_orthonormal"),
        (first(v, V[:, :-1]), "too_few"), (first(v)[:, ::-1], "no_solution"),
        (np.zeros((20, 9)), "zero"),
        (first(v).T, "transpose"), (np.zeros((34, 11)), "with_qdd"), (v, "no_matrix"),
        (3.0, "no_matrix"),
    ]  # fmt: skip


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
            right=lambda: rank(fb.accelerations_from_torques(_diagonal_stance_eom()).A),
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
                right=_squeeze_torques,
                praise="Internal forces are answered joint by joint, in any posture, at any "
                "velocity, without M and without h.",
                mistakes={"zero": lambda: np.zeros(12)} | _wrong_squeezes(),
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
                (12, 1): "This is a matrix with one column; the answer is a vector of shape (12,).",
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
        judge=_judge_unloading,
        namespace=lambda: {"forces": _standing_forces()},
        examples=_unloadings,
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
        judge=_judge_all_pairs,
        examples=_pairs,
        explanation="C has 12 rows and rank 10: two of its singular values are zero but for "
        "rounding. They belong to no "
        "direction of V∥, must not be divided by, and leave 20 - 10 directions to V⊥.",
    ),
)
