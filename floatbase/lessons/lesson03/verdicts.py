"""Judges of the exercises of lesson 03."""

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
from floatbase.lessons.judges import Example, Verdict, array_judge, array_or_verdict
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


def zeta_mistakes() -> dict[str, Any]:
    """Return, for each hint, a function that computes the answer of this mistake."""

    def columns(b: float = 1.0, h: float = 1.0, tau: float = -1.0) -> Array:
        eom = tilted_go2_eom()
        J_Minv = eom.J @ np.linalg.inv(eom.M)
        constant = b * eom.b + h * J_Minv @ eom.h
        both = np.column_stack([constant, tau * J_Minv @ eom.S])
        return np.asarray(np.linalg.solve(J_Minv @ eom.J.T, both))

    return {
        "b_missing": lambda: columns(b=0.0),
        "b_sign": lambda: columns(b=-1.0),
        "h_missing": lambda: columns(h=0.0),
        "h_sign": lambda: columns(h=-1.0),
        "constant_missing": lambda: columns(b=0.0, h=0.0),
        "S_missing": lambda: columns(tau=0.0),
        "Z_sign": lambda: columns(tau=1.0),
        "all_signs": lambda: -columns(),
        "constant_last": lambda: np.roll(columns(), -1, axis=1),
        "standing": lambda: zeta_columns(standing_go2_eom()),
        "zero": lambda: np.zeros((12, 13)),
    }


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
    if np.allclose(forces, before, atol=1e-3):
        return Verdict(
            False,
            f"Nothing has changed yet. The front left foot still carries {forces[2]:.0f} N.",
            "unchanged",
        )
    off = eom.h[:6] - eom.J[:, :6].T @ forces
    if abs(off[:3]).max() > 0.05:
        return Verdict(
            False,
            "The forces no longer add up to the weight. When one foot carries less, the others "
            "must carry more.",
            "weight",
        )
    if abs(off[3:]).max() > 0.01:
        return Verdict(
            False,
            "The sum is right, but the moments are not: the body would turn. Add only internal "
            "forces.",
            "moments",
        )
    if abs(forces[2] - load) > 0.05:
        more = " That is more than before. Check the sign." if forces[2] > before[2] + 0.05 else ""
        return Verdict(
            False,
            f"The robot stays at rest, but the front left foot carries {forces[2]:.1f} N, not "
            f"{load:g}.{more}",
            "not_20",
        )
    if forces[2::3].min() < 0.0:
        return Verdict(
            False, "The forces are balanced, but a foot would have to pull on the ground.", "pulls"
        )
    return Verdict(
        True,
        f"This is the wobbling table: FL and RR each carry {before[2] - load:.0f} N less, and the "
        f"other diagonal carries it.",
    )


def _wrong_pairs() -> dict[tuple[str, str], Array]:
    """Return (name, text) of each hint and the shortest pair of this mistake, shape (20,)."""
    eom = rising_solo8_eom()
    C, right_side = torque_force_matrix(eom)
    J, M, h, S, b = eom.J, eom.M, eom.h, eom.S, eom.b
    shortest = np.linalg.pinv(C, rcond=RANK_TOLERANCE)
    not_inverted = np.linalg.pinv(np.hstack([J @ M @ S, J @ M @ J.T]), rcond=RANK_TOLERANCE)
    b_missing = (
        "b is missing on the right-hand side of (10). solo8 moves, and its feet stay in place only "
        "with J q̈ = b, not 0."
    )
    M_not_inverted = (
        "M is not inverted. A force is divided by the inertia, so it must be J M⁻¹, not J M."
    )
    return {
        ("b_missing", b_missing): shortest @ (right_side - b),
        (
            "h_missing",
            "h is missing on the right-hand side of (10), so this robot has no weight.",
        ): shortest @ b,
        (
            "sign_of_h",
            "The sign of h is wrong. In (8) and (10) it appears on the right-hand side as + J "
            "M⁻¹ h.",
        ): shortest @ (2.0 * b - right_side),
        (
            "sign_of_b",
            "The sign of b is wrong. It is on the right-hand side of (10) with a plus, as in (7).",
        ): shortest @ (right_side - 2.0 * b),
        ("M_not_inverted", M_not_inverted): not_inverted @ (b + J @ M @ h),
    }


def _nearly_equal(x: Array, y: Array) -> bool:
    return bool(np.max(np.abs(x - y)) <= TOLERANCE * np.max(np.abs(y)))


def _fault_of_pair(pair: Array) -> Verdict | None:
    """Return what is wrong with the shortest pair (τ, λ) of (11), or None."""
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
            "The first column solves (10), but it is longer than necessary: it has a component "
            "in the null space. Did you divide by a singular value that is only rounding?",
            "longer",
        )
    fitting = (
        Verdict(False, text, hint)
        for (hint, text), wrong in _wrong_pairs().items()
        if _nearly_equal(pair, wrong)
    )
    unknown = Verdict(
        False,
        "The first column does not solve (10). It must be v, shape (20,): first τ, then λ.",
        "no_solution",
    )
    return next(fitting, unknown)


def _fault_of_directions(V: Array) -> Verdict | None:
    """Return what is wrong with columns that should be V⊥ of (11), or None."""
    C = torque_force_matrix(rising_solo8_eom())[0]
    orthonormal = np.allclose(V.T @ V, np.eye(V.shape[1]), atol=TOLERANCE)
    if np.max(np.abs(C @ V), initial=0.0) > TOLERANCE * np.max(np.abs(C)):
        if orthonormal:
            return Verdict(
                False,
                "v is right. The other columns are orthonormal, but C does not map all of them "
                "to zero. The SVD returns Vᵀ: its rows are the directions, and those of the "
                "null space come last.",
                "not_null_space",
            )
        return Verdict(
            False, "v is right, but C does not map all of the other columns to zero.", "not_to_zero"
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
            "v is right, but there are too few directions. You have removed one for each row of "
            "C, but some rows are redundant. How many singular values are not zero?",
            "full_rank",
        )
    if missing:
        return Verdict(
            False,
            f"v is right, and so are these directions, but {missing} of them are missing.",
            "too_few",
        )
    return None


def judge_all_pairs(answer: Any) -> Verdict:
    """Judge the matrix of exercise 03.3."""
    try:
        shape = np.shape(answer)
    except ValueError:  # rows of different lengths
        shape = ()
    given = array_or_verdict(answer, shape)
    if isinstance(given, Verdict):
        return given
    if given.ndim != 2 or shape[0] != 20 or not shape[1]:
        if given.ndim == 2 and shape[1] == 20:
            return Verdict(False, "These are rows. Pairs (τ, λ) must be columns here.", "transpose")
        if shape[:1] == (34,):
            return Verdict(
                False,
                "34 rows are for (13), which includes q̈. (11) contains only τ and λ.",
                "with_qdd",
            )
        form = (
            "The answer must be one matrix with 20 rows: 8 torques and 12 forces. Its first "
            "column is v, followed by V⊥."
        )
        return Verdict(False, form, "no_matrix")
    right = Verdict(
        True, "Ten directions for eight motors. You never typed a 10: the singular values gave it."
    )
    return _fault_of_pair(given[:, 0]) or _fault_of_directions(given[:, 1:]) or right


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
