"""Which directions of motion the contacts of (7) resolve: the one place that decides the rank of A
and J.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from floatbase._validation import Array, Value, as_instance, read_only
from floatbase.dynamics.equations import EquationsOfMotion
from floatbase.errors import InputError
from floatbase.linear_algebra import RANK_TOLERANCE

# part of A's largest singular value below which a motion is not held: angles err by 1e-4 rad
CONSTRAINT_RANK_TOLERANCE = 1e-4
# 1/s: rows of (5) may disagree by this for each m/s that contacts move: 1 m/s² for 1 cm/s of slip
CONSTRAINT_NOISE = 100.0
# part of J that may lie beside A's rows: rounding leaves 1e-14, contacts that do not fit leave all
_FIT_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class ContactSpace(Value):
    """The contacts of (7) along the directions that they resolve: r independent motions and the
    forces that hold them.

    The rank r is decided here, once, for everything that follows (`contact_space`).

    A, b: (r, nv), orthonormal, and (r,): this A q̈ = b stands for that of (7), in the least-squares
        sense where the rows of its A are inconsistent.
    force_map: (k, r), the smallest λ that gives q̈ a part along the rows of A: A M⁻¹ Jᵀ force_map =
        1.
    null_forces: (k, k - r), orthonormal, forces that the resolved motions do not feel; null(Jᵀ),
        but for directions that A resolves badly.
    """

    A: Array
    b: Array
    force_map: Array
    null_forces: Array

    @property
    def r(self) -> int:
        """rank J, as far as the contacts resolve it."""
        return int(self.A.shape[0])


def contact_space(eom: EquationsOfMotion) -> ContactSpace:
    """The resolved part of the contacts of (7), by singular values of A (tolerance
    `CONSTRAINT_RANK_TOLERANCE`).

    Where J loses rank (solo8 on four feet), nearby states have a singular value σ that measured
    angles and velocities cannot tell from 0, and ζ would multiply their noise in b by 1/σ². Such a
    direction is left out: no row holds it, no force is spent on it. Newton's law still holds
    exactly. A q̈ - b is off by at most σ |q̈| beside the part of b that A cannot meet. Raises
    `InputError` when forces and rows of a contact do not fit each other.
    """
    U, s, A = _resolved(eom)
    U_A, w, Vt_A = np.linalg.svd(A @ np.linalg.solve(eom.M, eom.J.T))
    force_rank = int(np.sum(w > RANK_TOLERANCE * w.max(initial=0.0)))
    if force_rank < w.size:
        raise InputError(
            f"the contacts hold {w.size} directions of motion, but forces reach {force_rank}: A "
            f"and J do not fit."
        )
    outside = eom.J - eom.J @ np.linalg.pinv(eom.A, rcond=RANK_TOLERANCE) @ eom.A
    if np.max(np.abs(outside), initial=0.0) > _FIT_TOLERANCE * np.max(np.abs(eom.J), initial=0.0):
        raise InputError(
            "forces act along motions that the contacts do not hold: A and J do not fit."
        )
    return ContactSpace(
        A=read_only(A),
        b=read_only((U.T @ eom.b) / s),
        force_map=read_only((Vt_A[: w.size].T / w) @ U_A.T),
        null_forces=read_only(Vt_A[w.size :].T),
    )


def resolved_constraint(eom: EquationsOfMotion) -> tuple[Array, Array]:
    """A, shape (m, nv), and b, shape (m,), m/s², of (5) without the directions that A resolves
    badly (see `contact_space`).
    """
    U, s, Vt = _resolved(eom)
    return read_only(U * s @ Vt), read_only(U @ (U.T @ eom.b))


def _resolved(eom: EquationsOfMotion) -> tuple[Array, Array, Array]:
    """U, s, Vt of A's singular value decomposition, without directions that A resolves badly."""
    as_instance("eom", eom, EquationsOfMotion)
    U, s, Vt = np.linalg.svd(eom.A, full_matrices=False)
    r = int(np.sum(s > CONSTRAINT_RANK_TOLERANCE * s.max(initial=0.0)))
    return U[:, :r], s[:r], Vt[:r]
