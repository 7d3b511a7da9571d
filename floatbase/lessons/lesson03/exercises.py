"""Exercises of lesson 03, The space of possible motions."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from floatbase._validation import Array
from floatbase.dynamics import (
    EquationsOfMotion,
    internal_forces,
    torque_force_matrix,
    torque_force_space,
)
from floatbase.lessons.exercises import Exercise, OwnNumber
from floatbase.lessons.judges import (
    Example,
    Mistake,
    NumericJudge,
    ShapeJudge,
    Verdict,
    array_judge,
    array_or_verdict,
    first_fault,
)
from floatbase.lessons.lesson03.helpers import rising_solo8_eom, standing_go2_eom, tilted_go2_eom
from floatbase.linear_algebra import RANK_TOLERANCE, rank

# relative tolerance between two solutions: rounding errors are 1e-12, mistakes 1e-2
TOLERANCE = 1e-5


def zeta_columns(eom: EquationsOfMotion | None = None) -> Array:
    """Return the constant and the matrix of ζ side by side, shape (12, 13)."""
    eom = eom or tilted_go2_eom()
    nv, k = eom.nv, eom.k
    kkt = np.block([[eom.M, -eom.J.T], [eom.J, np.zeros((k, k))]])
    constant = np.concatenate([-eom.h, eom.b])[:, None]
    torques = np.vstack([eom.S, np.zeros((k, eom.d))])
    return np.linalg.solve(kkt, np.hstack([constant, torques]))[nv:]


def zeta_mistakes() -> list[Mistake]:
    """Return the mistakes of exercise 03.1."""

    def columns(b: float = 1.0, h: float = 1.0, tau: float = -1.0) -> Array:
        eom = tilted_go2_eom()
        J_Minv = eom.J @ np.linalg.inv(eom.M)
        constant = b * eom.b + h * J_Minv @ eom.h
        both = np.column_stack([constant, tau * J_Minv @ eom.S])
        return np.asarray(np.linalg.solve(J_Minv @ eom.J.T, both))

    return [
        ("b_missing", columns(b=0.0), "b is missing from z. The robot moves, and its feet stay in "
         "place only with J q̈ = b, not 0."),
        ("b_sign", columns(b=-1.0), "The sign of b is wrong. J q̈ equals b in (7)."),
        ("h_missing", columns(h=0.0), "h is missing from z, so this robot has no weight."),
        ("h_sign", columns(h=-1.0), "The sign of h is wrong. (7) says q̈ = M⁻¹ (S τ + Jᵀ λ - h). "
         "What remains on the other side when you solve for λ?"),
        ("constant_missing", columns(b=0.0, h=0.0), "z is zero. With τ = 0, does the ground exert "
         "no force?"),
        ("S_missing", columns(tau=0.0), "Z is zero, but the motors do change the contact forces."),
        ("Z_sign", columns(tau=1.0), "The sign of Z is wrong. In J q̈ = b, Jᵀ λ and S τ are on the "
         "same side. If one grows, the other must shrink."),
        ("all_signs", -columns(), "All signs are wrong. Is this the force on the robot?"),
        ("constant_last", np.roll(columns(), -1, axis=1), "The constant z must be the first "
         "column."),
        ("standing", zeta_columns(standing_go2_eom()), "This is ζ of the standing robot. `tilted` "
         "has another posture and moves."),
        ("zero", np.zeros((12, 13)), "All entries are zero."),
    ]  # fmt: skip


def standing_forces() -> Array:
    """Return the smallest forces that carry the standing robot, shape (12,), world frame [N]."""
    eom = standing_go2_eom()
    return np.asarray(np.linalg.lstsq(eom.J[:, :6].T, eom.h[:6], rcond=RANK_TOLERANCE)[0])


def unloading_judge(load: float = 20.0) -> Callable[[Any], Verdict]:
    """Return the judge of forces that balance the standing robot with a load [N] at FL."""
    return array_judge((12,))(partial(_judge_unloading, load))


def _judge_unloading(load: float, forces: Array) -> Verdict:
    """Judge forces that balance the standing robot with a load [N] at FL."""
    eom = standing_go2_eom()
    before = standing_forces()
    off = eom.h[:6] - eom.J[:, :6].T @ forces
    more = " That is more than before. Check the sign." if forces[2] > before[2] + 0.05 else ""
    return first_fault([
        ("unchanged", np.allclose(forces, before, atol=1e-3), "Nothing has changed yet. The front "
         f"left foot still carries {forces[2]:.0f} N."),
        ("weight", abs(off[:3]).max() > 0.05, "The forces no longer add up to the weight. When one "
         "foot carries less, the others must carry more."),
        ("moments", abs(off[3:]).max() > 0.01, "The sum is right, but the moments are not: the "
         "body would turn. Add only internal forces."),
        ("not_20", abs(forces[2] - load) > 0.05, "The robot stays at rest, but the front left foot "
         f"carries {forces[2]:.1f} N, not {load:g}.{more}"),
        ("pulls", forces[2::3].min() < 0.0, "The forces are balanced, but a foot would have to "
         "pull on the ground."),
    ]) or Verdict(
        True,
        f"This is the wobbling table: FL and RR each carry {before[2] - load:.0f} N less, and the "
        "other diagonal carries it.",
    )  # fmt: skip


def _wrong_pairs() -> list[Mistake]:
    """Return the mistakes of exercise 03.3 in the shortest pair, shape (20,)."""
    eom = rising_solo8_eom()
    C, right_side = torque_force_matrix(eom)
    J, M, h, S, b = eom.J, eom.M, eom.h, eom.S, eom.b
    shortest = np.linalg.pinv(C, rcond=RANK_TOLERANCE)
    not_inverted = np.linalg.pinv(np.hstack([J @ M @ S, J @ M @ J.T]), rcond=RANK_TOLERANCE)
    return [
        ("b_missing", shortest @ (right_side - b), "b is missing from the right-hand side of (10). "
         "solo8 moves, and its feet stay in place only with J q̈ = b, not 0."),
        ("h_missing", shortest @ b, "h is missing from the right-hand side of (10), so this robot "
         "has no weight."),
        ("sign_of_h", shortest @ (2.0 * b - right_side), "The sign of h is wrong. In (8) and (10) "
         "it appears on the right-hand side as + J M⁻¹ h."),
        ("sign_of_b", shortest @ (right_side - 2.0 * b), "The sign of b is wrong. It is on the "
         "right-hand side of (10) with a plus, as in (7)."),
        ("M_not_inverted", not_inverted @ (b + J @ M @ h), "M is not inverted. A force is divided "
         "by the inertia, so it must be J M⁻¹, not J M."),
    ]  # fmt: skip


def _nearly_equal(x: Array, y: Array) -> bool:
    return bool(np.max(np.abs(x - y)) <= TOLERANCE * np.max(np.abs(y)))


def _fault_of_pair(pair: Array) -> Verdict | None:
    """Return what is wrong with the shortest pair (τ, λ) of (11), or None."""
    eom = rising_solo8_eom()
    C, right_side = torque_force_matrix(eom)
    if _nearly_equal(pair, torque_force_space(eom).b):
        return None
    return first_fault([
        ("zero", not pair.any(), "The first column is still zero, and zero does not solve (10)."),
        ("longer", _nearly_equal(C @ pair, right_side), "The first column solves (10), but it is "
         "longer than necessary: it has a component in the null space. Did you divide by a "
         "singular value that is only rounding?"),
        *((hint, _nearly_equal(pair, wrong), text) for hint, wrong, text in _wrong_pairs()),
        ("no_solution", True, "The first column does not solve (10). It must be v, shape (20,): "
         "first τ, then λ."),
    ])  # fmt: skip


def _fault_of_directions(V: Array) -> Verdict | None:
    """Return what is wrong with columns that should be V⊥ of (11), or None."""
    C = torque_force_matrix(rising_solo8_eom())[0]
    orthonormal = np.allclose(V.T @ V, np.eye(V.shape[1]), atol=TOLERANCE)
    not_null = np.max(np.abs(C @ V), initial=0.0) > TOLERANCE * np.max(np.abs(C))
    missing = C.shape[1] - rank(C) - V.shape[1]
    return first_fault([
        ("not_null_space", not_null and orthonormal, "v is right. The other columns are "
         "orthonormal, but C does not map all of them to zero. The SVD returns Vᵀ: its rows are "
         "the directions, and those of the null space come last."),
        ("not_to_zero", not_null, "v is right, but C does not map all of the other columns to "
         "zero."),
        ("not_orthonormal", not orthonormal, "v is right, and the columns lie in the null space, "
         "but they are not orthonormal."),
        ("full_rank", missing == C.shape[0] - rank(C), "v is right, but there are too few "
         "directions. You have removed one for each row of C, but some rows are redundant. How "
         "many singular values are non-zero?"),
        ("too_few", missing != 0, f"v is right, and so are these directions, but {missing} of them "
         "are missing."),
    ])  # fmt: skip


def judge_all_pairs(answer: Any) -> Verdict:
    """Judge the matrix of exercise 03.3."""
    try:
        shape = np.shape(answer)
    except ValueError:  # rows of different lengths
        shape = ()
    given = array_or_verdict(answer, shape)
    if isinstance(given, Verdict):
        return given
    is_matrix = given.ndim == 2
    right = Verdict(
        True, "Ten directions for eight motors: two of the twelve singular values of C are zero."
    )
    if is_matrix and shape[0] == 20 and shape[1]:
        return _fault_of_pair(given[:, 0]) or _fault_of_directions(given[:, 1:]) or right
    return first_fault([
        ("transpose", is_matrix and shape[1] == 20, "These are rows. Pairs (τ, λ) must be columns "
         "here."),
        ("with_qdd", shape[:1] == (34,), "34 rows are for (13), which includes q̈. (11) contains "
         "only τ and λ."),
    ]) or Verdict(
        False,
        "The answer must be one matrix with 20 rows: 8 torques and 12 forces. Its first column is "
        "v, followed by V⊥.",
        "no_matrix",
    )  # fmt: skip


def unloading_examples() -> list[Example]:
    """Return examples for exercise 03.2."""
    # forces whose sum and moment are zero
    wobble = np.array([0, 0, 1, 0, 0, -1, 0, 0, -1, 0, 0, 1.0])
    forces, squeezes = standing_forces(), internal_forces(standing_go2_eom())
    less = 20.0 - forces[2]
    short, moved = np.eye(12)[[2, 11]] * less
    return [
        (forces + less * wobble, ""), (forces + less * wobble + 5.0 * squeezes @ squeezes[1], ""),
        (forces, "unchanged"),
        (forces + short, "weight"), (forces + short - moved, "moments"),
        (forces - less * wobble, "not_20"),
        (forces + (less + 10.0) * wobble, "not_20"),
    ]  # fmt: skip


def pair_examples() -> list[Example]:
    """Return examples for exercise 03.3."""
    C, right_side = torque_force_matrix(rising_solo8_eom())
    (U, s, Vt), r = np.linalg.svd(C), rank(C)
    v, V = Vt[:r].T @ (U[:, :r].T @ right_side / s[:r]), Vt[r:].T
    turned = V @ np.linalg.qr(np.random.default_rng(0).standard_normal((10, 10)))[0]

    def first(pair: Array, directions: Array = V) -> Array:
        return np.column_stack([pair, directions])

    return [
        *((first(wrong), hint) for hint, wrong, _ in _wrong_pairs()),
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
                mistakes=zeta_mistakes,
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
        stub="new_forces = forces.copy()  # replace: shape (12,), N",
        solution="squeezes = internal_forces(eom)  # (12, 6)\n"
        "row = squeezes[2]  # what each of them does to the vertical force of FL\n"
        "new_forces = forces + squeezes @ row * (20 - forces[2]) / (row @ row)",
        judge=unloading_judge(),
        namespace=lambda: {"forces": standing_forces()},
        examples=unloading_examples,
        explanation="Every λ = λ₀ + N x keeps the robot still. x is the shortest vector with "
        "row x = 20 - λ₀[2].",
        own=OwnNumber(
            "the force on FL", "N", 20.0, (16.0, 18.0, 22.0, 24.0, 26.0, 28.0), unloading_judge
        ),
    ),
    Exercise(
        name="03.3",
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
