"""Which accelerations, torques and forces go together: ζ, η, C, B, their spaces and dimensions
(8)-(14), (16), (17).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_forces,
    as_instance,
    cached_property,
    read_only,
)
from floatbase.affine import Affine
from floatbase.dynamics.constraint_rank import contact_space
from floatbase.dynamics.equations import EquationsOfMotion
from floatbase.linear_algebra import null_space, rank


def delassus_matrix(eom: EquationsOfMotion) -> Array:
    """(8) A M⁻¹ Jᵀ, shape (m, k): how the contacts' accelerations answer to their forces.

    For points J M⁻¹ Jᵀ, known as the Delassus matrix; its inverse, where there is one, is the
    inertia that contacts feel.
    """
    as_instance("eom", eom, EquationsOfMotion)
    return read_only(eom.A @ np.linalg.solve(eom.M, eom.J.T))


def forces_from_torques(eom: EquationsOfMotion) -> Affine:
    """(9) ζ: τ -> λ, from (8) A M⁻¹ Jᵀ λ = b + A M⁻¹ (h - S τ).

    Maps shape (d,), N·m, to (k,), N, world. λ is unique where J has full row rank k; elsewhere
    (solo8 on four feet, corners of a flat foot) this is the smallest λ, as the pseudo-inverse has
    it. Directions of motion that the contacts resolve worse than `CONSTRAINT_RANK_TOLERANCE` count
    as not held, see `contact_space`. Source: [FBR], §2.2.1.
    """
    space = contact_space(eom)
    # what forces must add to q̈ along the resolved rows: b - A M⁻¹ (S τ - h)
    required_acceleration = Affine(
        -space.A @ np.linalg.solve(eom.M, eom.S), space.b + space.A @ np.linalg.solve(eom.M, eom.h)
    )
    return Affine.linear(space.force_map) @ required_acceleration


def accelerations_from_torques(eom: EquationsOfMotion) -> Affine:
    """(14) η: τ -> q̈ = M⁻¹ (S τ + Jᵀ ζ(τ) - h), shape (d,) to (nv,). Right whether or not λ is
    unique. Source: §3.
    """
    as_instance("eom", eom, EquationsOfMotion)
    return _acceleration_map(eom, Affine.identity(eom.d), forces_from_torques(eom))


def torque_force_matrix(eom: EquationsOfMotion) -> tuple[Array, Array]:
    """(10) C, shape (m, d + k), and its right-hand side b + A M⁻¹ h, shape (m,): C (τ, λ) = b + A
    M⁻¹ h.
    """
    as_instance("eom", eom, EquationsOfMotion)
    C = np.hstack([eom.A @ np.linalg.solve(eom.M, eom.S), delassus_matrix(eom)])
    return read_only(C), read_only(eom.b + eom.A @ np.linalg.solve(eom.M, eom.h))


def torque_force_space(eom: EquationsOfMotion) -> Affine:
    """(11)(24) All (τ, λ) that go together: β -> C† a + V⊥ β, a = b + A M⁻¹ h, with blocks "tau"
    and "forces".
    """
    as_instance("eom", eom, EquationsOfMotion)
    return _orthonormalised(_torque_force_map(eom))


def motion_matrix(eom: EquationsOfMotion) -> tuple[Array, Array]:
    """(12) B, shape (nv + m, nv + d + k), and (-h, b), with B (q̈, τ, λ) = (-h, b)."""
    as_instance("eom", eom, EquationsOfMotion)
    B = np.block([[eom.M, -eom.S, -eom.J.T], [eom.A, np.zeros((len(eom.A), eom.d + eom.k))]])
    return read_only(B), read_only(np.concatenate([-eom.h, eom.b]))


@dataclass(frozen=True, eq=False)
class FeasibleSpace(Value):
    """(13)(16)(17) All (q̈, τ, λ) that satisfy (7), as the map β -> v + V⊥ β with orthonormal V⊥.

    eom: the equations (7). map: `Affine` with blocks "qdd", "tau", "forces". Source: [FBR], §2.2.2.
    """

    _example = "fb.feasible_space(eom)"
    eom: EquationsOfMotion
    map: Affine

    @property
    def dimension(self) -> int:
        """Length of β: d + k - rank J; d where J has full rank."""
        return self.map.n_in

    @cached_property
    def qdd(self) -> Affine:
        """(17) β -> q̈, (dimension,) to (nv,), m/s² and rad/s²: base in the base frame, then
        joints.
        """
        return self.map["qdd"]

    @cached_property
    def tau(self) -> Affine:
        """(17) β -> τ, (dimension,) to (d,), N·m."""
        return self.map["tau"]

    @cached_property
    def forces(self) -> Affine:
        """(17) β -> λ, (dimension,) to (k,), N, world, ordered as the contacts' points."""
        return self.map["forces"]

    def coordinates(self, qdd: npt.ArrayLike, tau: npt.ArrayLike, forces: npt.ArrayLike) -> Array:
        """The β of a feasible (q̈, τ, λ), or of the feasible point nearest to one that is not;
        shape (dimension,).
        """
        eom = self.eom
        parts = [
            as_array("qdd", qdd, (eom.nv,)),
            as_array("tau", tau, (eom.d,)),
            as_forces(forces, eom.k),
        ]
        return self.map.A.T @ (np.concatenate(parts) - self.map.b)

    def __call__(self, beta: npt.ArrayLike) -> tuple[Array, Array, Array]:
        """(q̈, τ, λ) at β, shape (dimension,)."""
        beta = as_array("beta", beta, (self.dimension,))
        return self.qdd(beta), self.tau(beta), self.forces(beta)


def feasible_space(eom: EquationsOfMotion) -> FeasibleSpace:
    """(13) The space of all motions that the robot and its contacts allow at this state: v + V⊥ β.

    The columns of V⊥ span the null space of B and v is its pseudo-inverse solution. They are found
    from the resolved part of the contacts (`contact_space`): the same space as by the SVD of B, and
    one of bounded numbers where J nearly loses rank.
    """
    as_instance("eom", eom, EquationsOfMotion)
    torque_force = _torque_force_map(eom)
    qdd = _acceleration_map(eom, torque_force["tau"], torque_force["forces"])
    return FeasibleSpace(
        eom,
        _orthonormalised(
            Affine.stack(qdd=qdd, tau=torque_force["tau"], forces=torque_force["forces"])
        ),
    )


def internal_forces(eom: EquationsOfMotion) -> Array:
    """Forces between the contacts that move nothing once torques balance them: orthonormal columns
    of null(J_bᵀ), (k, n).

    J_b holds the base columns of J. Such a λ is balanced by τ = -J_jᵀ λ, where J_j holds the joint
    columns. n = k - rank J_b: 6 for four point feet. With a fixed base every λ is internal. Where J
    has full rank torques can bring all of them about without moving anything: ζ answers -J_jᵀ λ
    with λ. Where J loses rank (solo8 on four feet) the k - r directions of null(Jᵀ) are among them;
    no torques can bring those about, which leaves rank J - rank J_b to torques.
    """
    as_instance("eom", eom, EquationsOfMotion)
    return null_space(eom.J[:, : eom.nv - eom.d].T)


def undetermined_forces(eom: EquationsOfMotion) -> Array:
    """Forces that change nothing at all, orthonormal columns of null(Jᵀ), shape (k, k - rank J):
    why λ may not be unique.
    """
    return contact_space(eom).null_forces


@dataclass(frozen=True)
class Dimensions:
    """Sizes, ranks and dimensions of (7) at one state, by singular values.

    nv, d, k: lengths of q̈, τ, λ.
    rank_J, rank_J_base: ranks of J and of its base columns J_b.
    null_B, null_C: dimensions of the null spaces of (12) and (10), both d + k - rank J.
    internal: dimension of null(J_bᵀ), of which torques choose internal - undetermined.
    undetermined: dimension of null(Jᵀ).
    rank_V_qdd: how many of the directions of β move the robot at all: d - rank J + rank J_b.
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

    `contact_space` decides the rank of J. B and C are counted by their own singular values, with
    the resolved rows and their forces in place of A and J; the dimension of null(Jᵀ) is added.
    """
    as_instance("eom", eom, EquationsOfMotion)
    space = contact_space(eom)
    reactions = np.linalg.qr(eom.J.T @ space.force_map)[0]
    B = np.block([[eom.M, -eom.S, -reactions], [space.A, np.zeros((space.r, eom.d + space.r))]])
    C = space.A @ np.linalg.solve(eom.M, np.hstack([eom.S, reactions]))
    internal, undetermined = internal_forces(eom).shape[1], eom.k - space.r
    return Dimensions(
        nv=eom.nv,
        d=eom.d,
        k=eom.k,
        rank_J=space.r,
        rank_J_base=eom.k - internal,
        null_B=B.shape[1] - rank(B) + undetermined,
        null_C=C.shape[1] - rank(C) + undetermined,
        internal=internal,
        undetermined=undetermined,
        rank_V_qdd=rank(null_space(B)[: eom.nv], absolute=True),
    )


def _torque_force_map(eom: EquationsOfMotion) -> Affine:
    """(τ, z) -> (τ, λ): the smallest λ for τ, and any of the undetermined ones with it."""
    minimum_norm, null_forces = forces_from_torques(eom), undetermined_forces(eom)
    tau = Affine.linear(np.eye(eom.d, eom.d + null_forces.shape[1]))
    return Affine.stack(
        tau=tau, forces=Affine(np.hstack([minimum_norm.A, null_forces]), minimum_norm.b)
    )


def _acceleration_map(eom: EquationsOfMotion, tau: Affine, forces: Affine) -> Affine:
    """(4) q̈ = M⁻¹ (S τ + Jᵀ λ - h) of τ and λ that depend on something."""
    A = np.linalg.solve(eom.M, eom.S @ tau.A + eom.J.T @ forces.A)
    return Affine(A, np.linalg.solve(eom.M, eom.S @ tau.b + eom.J.T @ forces.b - eom.h))


def _orthonormalised(f: Affine) -> Affine:
    """The values of f as v + V⊥ β: V⊥ orthonormal, v the smallest of them."""
    V = np.linalg.qr(f.A)[0]
    return Affine(V, f.b - V @ (V.T @ f.b), f.blocks)
