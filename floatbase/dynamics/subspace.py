"""Which accelerations, torques and forces go together: ζ, η, C, B, their spaces and dimensions (8)-(14), (16), (17)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from floatbase._arrays import Array, checked, read_only
from floatbase.affine import Affine
from floatbase.dynamics.equations import EquationsOfMotion
from floatbase.errors import InputError

RANK_TOLERANCE = 1e-9  # singular values below this part of the largest count as zero


def rank(A: npt.ArrayLike, absolute: bool = False) -> int:
    """Number of singular values of A above `RANK_TOLERANCE` times the largest.

    absolute: above `RANK_TOLERANCE` itself, for parts of orthonormal columns, which may be rounding altogether.
    """
    s = np.linalg.svd(np.asarray(A, dtype=np.float64), compute_uv=False)
    largest = 1.0 if absolute else float(s.max(initial=0.0))
    return int(np.sum(s > RANK_TOLERANCE * largest))


def null_space(A: npt.ArrayLike, absolute: bool = False) -> Array:
    """Orthonormal columns that span {x : A x = 0}, shape (n, n - rank); absolute as for `rank`."""
    A = np.asarray(A, dtype=np.float64)
    if A.size == 0:
        return np.eye(A.shape[1])
    return read_only(np.linalg.svd(A)[2][rank(A, absolute) :].T)


@dataclass(frozen=True, eq=False)
class ContactSpace:
    """The contacts of (7) without their repetitions: r = rank J independent motions and forces.

    Where J loses rank, or nearly does, rows repeat each other up to rounding. The rank is decided here, once, and all that
    follows is written in orthonormal coordinates, so that nothing divides by rounding.
    rows: (r, nv), orthonormal, and b: (r,), with rows q̈ = b for A q̈ = b, in the least-squares sense where rows contradict
    each other. push: (nv, r), orthonormal: Jᵀ λ = push y. lift: (k, r): the smallest λ of a y. free: (k, k - r): null(Jᵀ).
    """

    rows: Array
    b: Array
    push: Array
    lift: Array
    free: Array

    @property
    def r(self) -> int:
        """rank J."""
        return int(self.rows.shape[0])


def contact_space(eom: EquationsOfMotion) -> ContactSpace:
    """The independent part of the contacts of (7), by singular values (tolerance `RANK_TOLERANCE`)."""
    r = rank(eom.A)
    if rank(eom.J) != r:
        raise InputError(f"forces reach {rank(eom.J)} directions of motion, but the contacts keep {r}: A and J do not fit.")
    U, s, Vt = np.linalg.svd(eom.A, full_matrices=False)
    U_J, s_J, Vt_J = np.linalg.svd(eom.J, full_matrices=True)
    return ContactSpace(
        rows=read_only(Vt[:r]),
        b=read_only((U[:, :r].T @ eom.b) / s[:r]),
        push=read_only(Vt_J[:r].T),
        lift=read_only(U_J[:, :r] / s_J[:r]),
        free=read_only(U_J[:, r:]),
    )


def contact_inertia_inverse(eom: EquationsOfMotion) -> Array:
    """(8) A M⁻¹ Jᵀ, shape (m, k): how the contacts' accelerations answer to their forces; J M⁻¹ Jᵀ for points."""
    return read_only(eom.A @ _inverse_inertia(eom, eom.J.T))


def forces_from_torques(eom: EquationsOfMotion) -> Affine:
    """(9) ζ: τ -> λ, from (8) A M⁻¹ Jᵀ λ = b + A M⁻¹ (h - S τ).

    Maps shape (d,), N·m, to (k,), N, world. λ is unique where `forces_are_unique`; elsewhere (solo8 on four feet, corners of
    a flat foot) this is the smallest λ, as the pseudo-inverse has it. Source: the document, §2.2.1.
    """
    space = contact_space(eom)
    y = _independent_forces(eom, space)
    return Affine(space.lift @ y.A, space.lift @ y.b)


def forces_are_unique(eom: EquationsOfMotion) -> bool:
    """Whether torques determine the contact forces, so that (9) needs no choice: J has full row rank k."""
    return contact_space(eom).r == eom.k


def accelerations_from_torques(eom: EquationsOfMotion) -> Affine:
    """(14) η: τ -> q̈ = M⁻¹ (S τ + Jᵀ ζ(τ) - h), shape (d,) to (nv,). Right whether or not λ is unique.

    Source: the document, §3.
    """
    space = contact_space(eom)
    y = _independent_forces(eom, space)
    A = _inverse_inertia(eom, eom.S + space.push @ y.A)
    return Affine(A, _inverse_inertia(eom, space.push @ y.b - eom.h))


def torque_force_matrix(eom: EquationsOfMotion) -> tuple[Array, Array]:
    """(10) C, shape (m, d + k), and its right-hand side b + A M⁻¹ h, shape (m,): C (τ, λ) = b + A M⁻¹ h."""
    C = np.hstack([eom.A @ _inverse_inertia(eom, eom.S), contact_inertia_inverse(eom)])
    return read_only(C), read_only(eom.b + eom.A @ _inverse_inertia(eom, eom.h))


def torque_force_space(eom: EquationsOfMotion) -> Affine:
    """(11)(24) All (τ, λ) that go together: β -> C† a + V⊥ β, a = b + A M⁻¹ h, with blocks "tau" and "forces"."""
    space = contact_space(eom)
    y = _independent_forces(eom, space)
    return _with_forces(Affine.stack(tau=Affine.identity(eom.d), y=y), space, {"tau": slice(0, eom.d)})


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
    """(13) The space of all motions that the robot and its contacts allow at this state: v + V⊥ β.

    The columns of V⊥ span the null space of B and v is its pseudo-inverse solution. They are found from the independent part
    of the contacts, which gives the same space as the SVD of B and keeps its digits where J nearly loses rank.
    """
    space = contact_space(eom)
    y = _independent_forces(eom, space)
    qdd = Affine(_inverse_inertia(eom, eom.S + space.push @ y.A), _inverse_inertia(eom, space.push @ y.b - eom.h))
    motions = Affine.stack(qdd=qdd, tau=Affine.identity(eom.d), y=y)
    blocks = {"qdd": slice(0, eom.nv), "tau": slice(eom.nv, eom.nv + eom.d)}
    return FeasibleSpace(eom, _with_forces(motions, space, blocks))


def internal_forces(eom: EquationsOfMotion) -> Array:
    """Forces that torques can squeeze in without moving anything: orthonormal columns of null(J_bᵀ), shape (k, n).

    J_b holds the base columns of J. Such a λ is balanced by τ = -J_jᵀ λ, where J_j holds the joint columns.
    n = k - rank J_b: 6 for four point feet. With a fixed base every λ is internal.
    """
    return null_space(_base_columns(eom).T)


def undetermined_forces(eom: EquationsOfMotion) -> Array:
    """Forces that change nothing at all, orthonormal columns of null(Jᵀ), shape (k, k - rank J): why λ may not be unique."""
    return contact_space(eom).free


@dataclass(frozen=True)
class Dimensions:
    """Sizes, ranks and dimensions of (7) at one state, by singular values.

    d, k, nv: lengths of τ, λ, q̈. rank_J, rank_J_base: of J and of its base columns. null_B, null_C: dimensions of the null
    spaces of (12) and (10), both d + k - rank J. internal: of null(J_bᵀ). undetermined: of null(Jᵀ). rank_V_qdd: how many of
    the directions of β move the robot at all: d - rank J + rank J_b.
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
    """Counts every dimension of §2.2 at this state.

    The rank of J is decided once (`contact_space`). B and C are then counted, each by its own singular values, with the
    independent rows and forces in place of A and J, whose r numbers say the same; null(Jᵀ) comes on top.
    """
    space = contact_space(eom)
    B = np.block([[eom.M, -eom.S, -space.push], [space.rows, np.zeros((space.r, eom.d + space.r))]])
    C = space.rows @ _inverse_inertia(eom, np.hstack([eom.S, space.push]))
    free = eom.k - space.r
    return Dimensions(
        nv=eom.nv,
        d=eom.d,
        k=eom.k,
        rank_J=space.r,
        rank_J_base=rank(_base_columns(eom)),
        null_B=B.shape[1] - rank(B) + free,
        null_C=C.shape[1] - rank(C) + free,
        internal=internal_forces(eom).shape[1],
        undetermined=space.free.shape[1],
        rank_V_qdd=rank(null_space(B)[: eom.nv], absolute=True),
    )


def _independent_forces(eom: EquationsOfMotion, space: ContactSpace) -> Affine:
    """τ -> y, the forces of (9) in the r independent coordinates in which J M⁻¹ Jᵀ is always invertible."""
    inertia = space.rows @ _inverse_inertia(eom, space.push)
    right = Affine(-space.rows @ _inverse_inertia(eom, eom.S), space.b + space.rows @ _inverse_inertia(eom, eom.h))
    return Affine(np.linalg.solve(inertia, right.A), np.linalg.solve(inertia, right.b))


def _with_forces(motions: Affine, space: ContactSpace, blocks: dict[str, slice]) -> Affine:
    """All points of `motions`, whose last block is y, with every λ that belongs to y: as v + V⊥ β, v ⊥ V⊥ orthonormal."""
    rest = motions.n_out - space.r
    k, free = space.free.shape
    lift = np.block([[np.eye(rest), np.zeros((rest, space.r))], [np.zeros((k, rest)), space.lift]])
    directions = np.hstack([lift @ motions.A, np.vstack([np.zeros((rest, free)), space.free])])
    V = np.linalg.qr(directions)[0]
    point = lift @ motions.b
    return Affine(V, point - V @ (V.T @ point), {**blocks, "forces": slice(rest, rest + k)})


def _base_columns(eom: EquationsOfMotion) -> Array:
    """J_b: the columns of J that belong to the base, shape (k, 6) or (k, 0)."""
    return eom.J[:, : eom.nv - eom.d]


def _inverse_inertia(eom: EquationsOfMotion, right: Array) -> Array:
    """M⁻¹ right."""
    return np.linalg.solve(eom.M, right)
