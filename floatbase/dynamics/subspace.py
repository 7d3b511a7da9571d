"""Which accelerations, torques and forces go together: ζ, η, C, B, their spaces and dimensions (8)-(14), (16), (17)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
import scipy.linalg

from floatbase._arrays import Array, checked, read_only
from floatbase.affine import Affine
from floatbase.dynamics.equations import EquationsOfMotion

RANK_TOLERANCE = 1e-9  # singular values below this part of the largest count as zero


def rank(A: npt.ArrayLike, tolerance: float = RANK_TOLERANCE) -> int:
    """Number of singular values of A above `tolerance` times the largest."""
    s = np.linalg.svd(np.asarray(A, dtype=np.float64), compute_uv=False)
    return int(np.sum(s > tolerance * s[0])) if s.size and s[0] > 0 else 0


def null_space(A: npt.ArrayLike, tolerance: float = RANK_TOLERANCE) -> Array:
    """Orthonormal columns that span {x : A x = 0}, shape (n, n - rank)."""
    A = np.asarray(A, dtype=np.float64)
    if A.shape[0] == 0 or A.shape[1] == 0:
        return np.eye(A.shape[1])
    return read_only(np.linalg.svd(A)[2][rank(A, tolerance) :].T)


def solution_space(A: Array, b: Array, tolerance: float = RANK_TOLERANCE) -> Affine:
    """(11)(13) All x with A x = b, as β -> A† b + V⊥ β with orthonormal V⊥.

    Where b is not in the range of A the least-squares solutions are meant.
    """
    V = null_space(A, tolerance)
    return Affine(V, np.linalg.lstsq(A, b, rcond=tolerance)[0] if A.size else np.zeros(A.shape[1]))


def contact_inertia_inverse(eom: EquationsOfMotion) -> Array:
    """A M⁻¹ Jᵀ of (8), shape (m, k): how the contacts' accelerations answer to their forces; J M⁻¹ Jᵀ for points."""
    return eom.A @ _inverse_inertia(eom, eom.J.T)


def forces_from_torques(eom: EquationsOfMotion) -> Affine:
    """(9) ζ: τ -> λ, from (8) A M⁻¹ Jᵀ λ = b + A M⁻¹ (h - S τ).

    Maps shape (d,), N·m, to (k,), N, world. λ is unique where `forces_are_unique`; elsewhere (solo8 on four feet,
    straight knees, corners of a flat foot) the pseudo-inverse picks the smallest λ. Source: the document, §2.2.1.
    """
    inverse = np.linalg.pinv(contact_inertia_inverse(eom), rcond=RANK_TOLERANCE)
    h, S = _inverse_inertia(eom, eom.h), _inverse_inertia(eom, eom.S)
    return Affine(-inverse @ eom.A @ S, inverse @ (eom.b + eom.A @ h))


def forces_are_unique(eom: EquationsOfMotion) -> bool:
    """Whether torques determine the contact forces, so that (9) needs no choice: J has full row rank k."""
    return rank(eom.J) == eom.k


def accelerations_from_torques(eom: EquationsOfMotion) -> Affine:
    """(14) η: τ -> q̈ = M⁻¹ (S τ + Jᵀ ζ(τ) - h), shape (d,) to (nv,). Right whether or not λ is unique.

    Source: the document, §3.
    """
    zeta = forces_from_torques(eom)
    A = _inverse_inertia(eom, eom.S + eom.J.T @ zeta.A)
    return Affine(A, _inverse_inertia(eom, eom.J.T @ zeta.b - eom.h))


def torque_force_matrix(eom: EquationsOfMotion) -> tuple[Array, Array]:
    """(10) C, shape (m, d + k), and its right-hand side b + A M⁻¹ h, shape (m,): C (τ, λ) = b + A M⁻¹ h."""
    C = np.hstack([eom.A @ _inverse_inertia(eom, eom.S), contact_inertia_inverse(eom)])
    return read_only(C), read_only(eom.b + eom.A @ _inverse_inertia(eom, eom.h))


def torque_force_space(eom: EquationsOfMotion) -> Affine:
    """(11)(24) All (τ, λ) that go together: β -> C† a + V⊥ β, a = b + A M⁻¹ h, with blocks "tau" and "forces"."""
    space = solution_space(*torque_force_matrix(eom))
    return Affine(space.A, space.b, {"tau": slice(0, eom.d), "forces": slice(eom.d, eom.d + eom.k)})


def motion_matrix(eom: EquationsOfMotion) -> tuple[Array, Array]:
    """(12) B, shape (nv + m, nv + d + k), and its right-hand side (-h, b): B (q̈, τ, λ) = (-h, b)."""
    B = np.block([[eom.M, -eom.S, -eom.J.T], [eom.A, np.zeros((len(eom.A), eom.d + eom.k))]])
    return read_only(B), read_only(np.concatenate([-eom.h, eom.b]))


@dataclass(frozen=True, eq=False)
class FeasibleSpace:
    """(13)(16)(17) All (q̈, τ, λ) that satisfy (7), as the map β -> v + V⊥ β with orthonormal V⊥.

    map: `Affine` with blocks "qdd", "tau", "forces". Source: the document, §2.2.2.
    """

    eom: EquationsOfMotion
    map: Affine

    @property
    def dimension(self) -> int:
        """Length of β: d + k - rank J; d where J has full rank."""
        return self.map.n_in

    @cached_property
    def qdd(self) -> Affine:
        """(17) β -> q̈."""
        return self.map["qdd"]

    @cached_property
    def tau(self) -> Affine:
        """(17) β -> τ."""
        return self.map["tau"]

    @cached_property
    def forces(self) -> Affine:
        """(17) β -> λ."""
        return self.map["forces"]

    def coordinates(self, qdd: npt.ArrayLike, tau: npt.ArrayLike, forces: npt.ArrayLike) -> Array:
        """The β of a feasible (q̈, τ, λ), or of the feasible point nearest to one that is not; shape (dimension,)."""
        point = np.concatenate([np.ravel(qdd), np.ravel(tau), np.ravel(forces)])
        return self.map.A.T @ (checked("the point", point, (self.map.n_out,)) - self.map.b)

    def __call__(self, beta: npt.ArrayLike) -> tuple[Array, Array, Array]:
        """(q̈, τ, λ) at β, shape (dimension,)."""
        beta = checked("beta", beta, (self.dimension,))
        return self.qdd(beta), self.tau(beta), self.forces(beta)


def feasible_space(eom: EquationsOfMotion) -> FeasibleSpace:
    """(13) The space of all motions that the robot and its contacts allow at this state."""
    space = solution_space(*motion_matrix(eom))
    nv, d, k = eom.nv, eom.d, eom.k
    blocks = {"qdd": slice(0, nv), "tau": slice(nv, nv + d), "forces": slice(nv + d, nv + d + k)}
    return FeasibleSpace(eom, Affine(space.A, space.b, blocks))


def internal_forces(eom: EquationsOfMotion) -> Array:
    """Forces that torques can squeeze in without moving anything: orthonormal columns of null(J_bᵀ), shape (k, n).

    J_b holds the base columns of J. Such a λ is balanced by τ = -J_jᵀ λ, where J_j holds the joint columns. n = k -
    rank J_b: 6 for four point feet. With a fixed base every λ is internal.
    """
    return null_space(_base_columns(eom).T) if eom.k else np.zeros((0, 0))


def undetermined_forces(eom: EquationsOfMotion) -> Array:
    """Forces that change nothing at all, orthonormal columns of null(Jᵀ), shape (k, k - rank J): why λ may not be unique."""
    return null_space(eom.J.T) if eom.k else np.zeros((0, 0))


@dataclass(frozen=True)
class Dimensions:
    """Sizes, ranks and dimensions of (7) at one state, by singular values.

    d, k, nv: lengths of τ, λ, q̈. rank_J, rank_J_base: of J and of its base columns. null_B, null_C: dimensions of the
    null spaces of (12) and (10), both d + k - rank J. internal: of null(J_bᵀ). undetermined: of null(Jᵀ). rank_V_qdd:
    how many of the directions of β move the robot at all: d - rank J + rank J_b.
    """

    nv: int
    d: int
    k: int
    rank_J: int
    rank_J_base: int
    null_B: int
    null_C: int
    internal: int
    undetermined: int
    rank_V_qdd: int


def dimensions(eom: EquationsOfMotion) -> Dimensions:
    """Counts every dimension of §2.2 at this state, each from its own singular values (tolerance `RANK_TOLERANCE`)."""
    B, C = motion_matrix(eom)[0], torque_force_matrix(eom)[0]
    return Dimensions(
        nv=eom.nv,
        d=eom.d,
        k=eom.k,
        rank_J=rank(eom.J),
        rank_J_base=rank(_base_columns(eom)),
        null_B=B.shape[1] - rank(B),
        null_C=C.shape[1] - rank(C),
        internal=internal_forces(eom).shape[1],
        undetermined=undetermined_forces(eom).shape[1],
        rank_V_qdd=rank(feasible_space(eom).qdd.A),
    )


def _base_columns(eom: EquationsOfMotion) -> Array:
    """J_b: the columns of J that belong to the base, shape (k, 6) or (k, 0)."""
    return eom.J[:, : eom.nv - eom.d]


def _inverse_inertia(eom: EquationsOfMotion, right: Array) -> Array:
    """M⁻¹ right, by Cholesky."""
    return np.asarray(scipy.linalg.cho_solve(scipy.linalg.cho_factor(eom.M), right))
