"""Directions of motion that the contacts resolve.

This module alone decides the rank of A and J in eq. (7).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from floatbase._validation import Array, Value, as_instance, frozen, read_only
from floatbase.dynamics.equations import EquationsOfMotion
from floatbase.errors import InputError
from floatbase.linear_algebra import RANK_TOLERANCE

# fraction of A's largest singular value below which a direction is not constrained: joint angles
# have errors of 1e-4 rad
CONSTRAINT_RANK_TOLERANCE = 1e-4
# 1/s: allowed inconsistency of the rows of eq. (5) per m/s of contact velocity: 1 m/s² for 1 cm/s
# of slip
CONSTRAINT_NOISE = 100.0
# fraction of J that may lie outside the row space of A: rounding leaves 1e-14, an inconsistent
# contact leaves all of it
_FIT_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class ContactSpace(Value):
    """The contacts along the r independent directions of motion that they resolve.

    `contact_space` decides the rank r once, for all other functions.
    """

    A: Array
    b: Array
    force_map: Array
    null_forces: Array

    @property
    def r(self) -> int:
        """Rank of J, counting only the resolved directions."""
        return int(self.A.shape[0])


def contact_space(eom: EquationsOfMotion) -> ContactSpace:
    """Compute the resolved part of the contacts from the singular values of A.

    Directions whose singular value is at most `CONSTRAINT_RANK_TOLERANCE` times the largest are
    left out.

    Parameters
    ----------
    eom : EquationsOfMotion
        Equations of motion at one state.

    Returns
    -------
    ContactSpace
        The independent rows, the forces that enforce them, and the forces without effect.

    Raises
    ------
    InputError
        If the rows A and the Jacobian J of a contact are inconsistent.

    Notes
    -----
    J loses rank for solo8 on four feet, for example. Near such a state, A has a small singular
    value σ. Measured angles and velocities are not exact enough to tell σ from 0, and the map ζ
    would multiply their noise in b by 1/σ². Such a direction is left out: no row constrains it, and
    no force acts along it. Newton's law still holds exactly. The norm of A q̈ - b is at most σ ‖q̈‖,
    in addition to the part of b that A cannot meet.
    """
    U, s, A = _resolved(eom)
    U_A, w, Vt_A = np.linalg.svd(A @ np.linalg.solve(eom.M, eom.J.T))
    force_rank = int(np.sum(w > RANK_TOLERANCE * w.max(initial=0.0)))
    if force_rank < w.size:
        raise InputError(
            f"A and J of the contacts are inconsistent: rank(A) is {w.size}, but rank(A M⁻¹ Jᵀ) is "
            f"{force_rank}. Every constrained direction needs a force that can act along it."
        )
    outside = eom.J - eom.J @ np.linalg.pinv(eom.A, rcond=RANK_TOLERANCE) @ eom.A
    if np.max(np.abs(outside), initial=0.0) > _FIT_TOLERANCE * np.max(np.abs(eom.J), initial=0.0):
        raise InputError(
            "A and J of the contacts are inconsistent: some forces act along directions that A "
            "does not constrain. The rows of J must lie in the row space of A."
        )
    return ContactSpace(
        A=read_only(A),
        b=read_only((U.T @ eom.b) / s),
        force_map=read_only((Vt_A[: w.size].T / w) @ U_A.T),
        null_forces=read_only(Vt_A[w.size :].T),
    )


def resolved_constraint(eom: EquationsOfMotion) -> tuple[Array, Array]:
    """Compute A and b without the directions that A resolves poorly.

    `contact_space` explains which directions are left out.

    Parameters
    ----------
    eom : EquationsOfMotion
        Equations of motion at one state.

    Returns
    -------
    A : ndarray, shape (m, nv)
        Matrix of eq. (5), of reduced rank if a direction was left out.
    b : ndarray, shape (m,)
        Right-hand side [m/s², or rad/s² for angular rows].
    """
    U, s, Vt = _resolved(eom)
    return frozen(U * s @ Vt), frozen(U @ (U.T @ eom.b))


def _resolved(eom: EquationsOfMotion) -> tuple[Array, Array, Array]:
    """Compute the singular value decomposition of A without the poorly resolved directions."""
    as_instance("eom", eom, EquationsOfMotion)
    U, s, Vt = np.linalg.svd(eom.A, full_matrices=False)
    r = int(np.count_nonzero(s > CONSTRAINT_RANK_TOLERANCE * s.max(initial=0.0)))
    return U[:, :r], s[:r], Vt[:r]
