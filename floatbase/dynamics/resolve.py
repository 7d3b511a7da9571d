"""Which directions of motion the contacts of (7) resolve: the one place that decides the rank of A and J."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from floatbase._arrays import Array, Value, of_kind, read_only
from floatbase.dynamics.equations import EquationsOfMotion
from floatbase.errors import InputError
from floatbase.linear_algebra import RANK_TOLERANCE

MOTION_TOLERANCE = 1e-4  # part of A's largest singular value below which a motion counts as not held: angles err by 1e-4 rad
MOTION_NOISE = 100.0  # 1/s: rows of (5) may disagree by this for each m/s that contacts move: 1 m/s² for 1 cm/s of slip
_FIT_TOLERANCE = 1e-6  # part of J that may lie beside A's rows: rounding leaves 1e-14, contacts that do not fit leave all


@dataclass(frozen=True, eq=False)
class ContactSpace(Value):
    """The contacts of (7) along the directions that they resolve: r independent motions and the forces that hold them.

    The rank r is decided here, once, for everything that follows (`contact_space`).

    rows, b: (r, nv), orthonormal, and (r,): rows q̈ = b stands for A q̈ = b, in the least-squares sense where the rows of A are
        inconsistent.
    lift: (k, r), the smallest λ that gives q̈ a part along the rows: rows M⁻¹ Jᵀ lift = 1.
    free: (k, k - r), orthonormal, forces that the resolved motions do not feel; null(Jᵀ), but for directions that A resolves
        badly.
    """

    rows: Array
    b: Array
    lift: Array
    free: Array

    @property
    def r(self) -> int:
        """rank J, as far as the contacts resolve it."""
        return int(self.rows.shape[0])


def contact_space(eom: EquationsOfMotion) -> ContactSpace:
    """The resolved part of the contacts of (7), by singular values of A (tolerance `MOTION_TOLERANCE`).

    Where J loses rank (solo8 on four feet), nearby states have a singular value σ that measured angles and velocities cannot
    tell from 0, and ζ would multiply their noise in b by 1/σ². Such a direction is left out: no row holds it, no force is
    spent on it. Newton's law still holds exactly. A q̈ - b is off by at most σ |q̈| beside the part of b that A cannot meet.
    Raises `InputError` when forces and rows of a contact do not fit each other.
    """
    U, s, rows = _resolved(eom)
    P, w, Qt = np.linalg.svd(rows @ np.linalg.solve(eom.M, eom.J.T))
    reached = int(np.sum(w > RANK_TOLERANCE * w.max(initial=0.0)))
    if reached < w.size:
        raise InputError(f"the contacts hold {w.size} directions of motion, but forces reach {reached}: A and J do not fit.")
    beside = eom.J - eom.J @ np.linalg.pinv(eom.A, rcond=RANK_TOLERANCE) @ eom.A
    if np.max(np.abs(beside), initial=0.0) > _FIT_TOLERANCE * np.max(np.abs(eom.J), initial=0.0):
        raise InputError("forces act along motions that the contacts do not hold: A and J do not fit.")
    return ContactSpace(
        rows=read_only(rows),
        b=read_only((U.T @ eom.b) / s),
        lift=read_only((Qt[: w.size].T / w) @ P.T),
        free=read_only(Qt[w.size :].T),
    )


def resolved_motion(eom: EquationsOfMotion) -> tuple[Array, Array]:
    """A, shape (m, nv), and b, shape (m,), m/s², of (5) without the directions that A resolves badly (see `contact_space`)."""
    U, s, Vt = _resolved(eom)
    return read_only(U * s @ Vt), read_only(U @ (U.T @ eom.b))


def _resolved(eom: EquationsOfMotion) -> tuple[Array, Array, Array]:
    """U, s, Vt of A's singular value decomposition, without the directions that A resolves badly."""
    of_kind("eom", eom, EquationsOfMotion)
    U, s, Vt = np.linalg.svd(eom.A, full_matrices=False)
    r = int(np.sum(s > MOTION_TOLERANCE * s.max(initial=0.0)))
    return U[:, :r], s[:r], Vt[:r]
