"""Feasible accelerations, torques and contact forces: the maps ζ and η, and the spaces of C and B.

Section 2.2 of the course text, and eqs. (14), (16) and (17) of section 3.
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
    """Compute A M⁻¹ Jᵀ, the change of the contact accelerations per unit of contact force.

    For point contacts it is J M⁻¹ Jᵀ, known as the Delassus matrix. Its inverse, if it exists, is
    the apparent inertia at the contacts.

    Parameters
    ----------
    eom : EquationsOfMotion
        Equations of motion at one state.

    Returns
    -------
    ndarray, shape (m, k)
        A M⁻¹ Jᵀ [m/s² per N, and accordingly for other rows].

    Notes
    -----
    [FBR]_, eq. (8).
    """
    as_instance("eom", eom, EquationsOfMotion)
    return read_only(eom.A @ np.linalg.solve(eom.M, eom.J.T))


def forces_from_torques(eom: EquationsOfMotion) -> Affine:
    """Compute the affine map ζ from joint torques τ to contact forces λ.

    The map solves A M⁻¹ Jᵀ λ = b + A M⁻¹ (h - S τ). λ is unique if J has full row rank k. Otherwise
    (solo8 on four feet, or the corners of a flat foot) the map gives the λ of smallest norm, as the
    pseudo-inverse does. Directions of motion that the contacts resolve worse than
    `CONSTRAINT_RANK_TOLERANCE` count as unconstrained; see `contact_space`.

    Parameters
    ----------
    eom : EquationsOfMotion
        Equations of motion at one state.

    Returns
    -------
    Affine
        ζ, from τ, shape (d,) [N·m], to λ, shape (k,), in world axes [N].

    Notes
    -----
    [FBR]_, eq. (9). Eq. (8) is the linear system that ζ solves.

    Examples
    --------
    >>> robot = fb.load("go2")
    >>> eom = fb.equations_of_motion(robot.standing(), fb.Contacts.points(robot))
    >>> zeta = forces_from_torques(eom)
    >>> forces = zeta(np.zeros(robot.d))
    >>> forces.shape
    (12,)
    """
    space = contact_space(eom)
    # the acceleration that forces must add along the resolved rows: b - A M⁻¹ (S τ - h)
    required_acceleration = Affine(
        -space.A @ np.linalg.solve(eom.M, eom.S), space.b + space.A @ np.linalg.solve(eom.M, eom.h)
    )
    return Affine.linear(space.force_map) @ required_acceleration


def accelerations_from_torques(eom: EquationsOfMotion) -> Affine:
    """Compute the affine map η from joint torques τ to the acceleration q̈.

    η(τ) = M⁻¹ (S τ + Jᵀ ζ(τ) - h), with ζ of `forces_from_torques`. q̈ is unique even where λ is
    not.

    Parameters
    ----------
    eom : EquationsOfMotion
        Equations of motion at one state.

    Returns
    -------
    Affine
        η, from τ, shape (d,) [N·m], to q̈, shape (nv,) [m/s², rad/s²]: the base in its own frame,
        then the joints.

    Notes
    -----
    [FBR]_, eq. (14).
    """
    as_instance("eom", eom, EquationsOfMotion)
    return _acceleration_map(eom, Affine.identity(eom.d), forces_from_torques(eom))


def torque_force_matrix(eom: EquationsOfMotion) -> tuple[Array, Array]:
    """Compute the matrix C and the right-hand side of C (τ, λ) = b + A M⁻¹ h.

    Parameters
    ----------
    eom : EquationsOfMotion
        Equations of motion at one state.

    Returns
    -------
    C : ndarray, shape (m, d + k)
        C = [A M⁻¹ S, A M⁻¹ Jᵀ].
    a : ndarray, shape (m,)
        Right-hand side b + A M⁻¹ h [m/s², or rad/s² for angular rows].

    Notes
    -----
    [FBR]_, eq. (10).
    """
    as_instance("eom", eom, EquationsOfMotion)
    C = np.hstack([eom.A @ np.linalg.solve(eom.M, eom.S), delassus_matrix(eom)])
    return read_only(C), read_only(eom.b + eom.A @ np.linalg.solve(eom.M, eom.h))


def torque_force_space(eom: EquationsOfMotion) -> Affine:
    """Compute the space of all pairs (τ, λ) that satisfy the equations of motion.

    The pairs are C† a + V⊥ β with a = b + A M⁻¹ h and orthonormal V⊥, for every β.

    Parameters
    ----------
    eom : EquationsOfMotion
        Equations of motion at one state.

    Returns
    -------
    Affine
        Map from β to (τ, λ), with blocks "tau", shape (d,) [N·m], and "forces", shape (k,), in
        world axes [N].

    Notes
    -----
    [FBR]_, eqs. (11), (24).
    """
    return _orthonormalized(_torque_force_map(eom))


def motion_matrix(eom: EquationsOfMotion) -> tuple[Array, Array]:
    """Compute the matrix B and the right-hand side of B (q̈, τ, λ) = (-h, b).

    Parameters
    ----------
    eom : EquationsOfMotion
        Equations of motion at one state.

    Returns
    -------
    B : ndarray, shape (nv + m, nv + d + k)
        B = [[M, -S, -Jᵀ], [A, 0, 0]].
    right_hand_side : ndarray, shape (nv + m,)
        -h [N, N·m], followed by b [m/s², or rad/s² for angular rows].

    Notes
    -----
    [FBR]_, eq. (12).
    """
    as_instance("eom", eom, EquationsOfMotion)
    B = np.block([[eom.M, -eom.S, -eom.J.T], [eom.A, np.zeros((len(eom.A), eom.d + eom.k))]])
    return read_only(B), read_only(np.concatenate([-eom.h, eom.b]))


@dataclass(frozen=True, eq=False)
class FeasibleSpace(Value):
    """The space of all (q̈, τ, λ) that satisfy the equations of motion, as the map β -> v + V⊥ β.

    The columns of V⊥ are orthonormal, and v is the point of smallest norm. Calling the object with
    β gives the tuple (q̈, τ, λ).

    Parameters
    ----------
    eom : EquationsOfMotion
        Equations of motion at one state.
    map : Affine
        Map from β to the stacked (q̈, τ, λ), with blocks "qdd", "tau" and "forces".

    Notes
    -----
    [FBR]_, eqs. (13), (16), (17).
    """

    _example = "fb.feasible_space(eom)"
    eom: EquationsOfMotion
    map: Affine

    @property
    def dimension(self) -> int:
        """Length of β, which is d + k - rank J, and d if J has full row rank."""
        return self.map.n_in

    @cached_property
    def qdd(self) -> Affine:
        """Map from β, shape (dimension,), to q̈, shape (nv,) [m/s², rad/s²].

        The base part of q̈ is in the base frame; the joints follow.

        Notes
        -----
        [FBR]_, eq. (17).
        """
        return self.map["qdd"]

    @cached_property
    def tau(self) -> Affine:
        """Map from β, shape (dimension,), to τ, shape (d,) [N·m].

        Notes
        -----
        [FBR]_, eq. (17).
        """
        return self.map["tau"]

    @cached_property
    def forces(self) -> Affine:
        """Map from β, shape (dimension,), to λ, shape (k,), in world axes [N].

        The forces are in the order of the contact points.

        Notes
        -----
        [FBR]_, eq. (17).
        """
        return self.map["forces"]

    def coordinates(self, qdd: npt.ArrayLike, tau: npt.ArrayLike, forces: npt.ArrayLike) -> Array:
        """Compute the coordinates β of a feasible (q̈, τ, λ).

        For an infeasible (q̈, τ, λ), the result belongs to the nearest feasible point.

        Parameters
        ----------
        qdd : array_like, shape (nv,)
            Acceleration q̈ [m/s², rad/s²]: the base in its own frame, then the joints.
        tau : array_like, shape (d,)
            Joint torques τ [N·m, or N for prismatic joints].
        forces : array_like, shape (k,) or (k / 3, 3)
            Contact forces λ in world axes [N].

        Returns
        -------
        ndarray, shape (dimension,)
            Coordinates β.
        """
        eom = self.eom
        parts = [
            as_array("qdd", qdd, (eom.nv,)),
            as_array("tau", tau, (eom.d,)),
            as_forces(forces, eom.k),
        ]
        return self.map.A.T @ (np.concatenate(parts) - self.map.b)

    def __call__(self, beta: npt.ArrayLike) -> tuple[Array, Array, Array]:
        """Return (q̈, τ, λ) at β, shape (dimension,)."""
        beta = as_array("beta", beta, (self.dimension,))
        return self.qdd(beta), self.tau(beta), self.forces(beta)


def feasible_space(eom: EquationsOfMotion) -> FeasibleSpace:
    """Compute the space v + V⊥ β of all (q̈, τ, λ) that the robot and its contacts allow.

    The columns of V⊥ span the null space of B, and v is the pseudo-inverse solution. Both are
    computed from the resolved part of the contacts; see `contact_space`. The result is the same
    space as from the SVD of B, but its numbers stay bounded where J nearly loses rank.

    Parameters
    ----------
    eom : EquationsOfMotion
        Equations of motion at one state.

    Returns
    -------
    FeasibleSpace
        The space with coordinates β.

    Notes
    -----
    [FBR]_, eq. (13).

    Examples
    --------
    >>> robot = fb.load("go2")
    >>> eom = fb.equations_of_motion(robot.standing(), fb.Contacts.points(robot))
    >>> feasible_space(eom).dimension
    12
    """
    torque_force = _torque_force_map(eom)
    qdd = _acceleration_map(eom, torque_force["tau"], torque_force["forces"])
    return FeasibleSpace(
        eom,
        _orthonormalized(
            Affine.stack(qdd=qdd, tau=torque_force["tau"], forces=torque_force["forces"])
        ),
    )


def internal_forces(eom: EquationsOfMotion) -> Array:
    """Compute the internal forces, which move nothing once joint torques balance them.

    The internal forces are the null space of J_bᵀ, where J_b holds the base columns of J. The
    torques τ = -J_jᵀ λ balance such a λ, where J_j holds the joint columns of J. With a fixed base,
    every λ is internal.

    Parameters
    ----------
    eom : EquationsOfMotion
        Equations of motion at one state.

    Returns
    -------
    ndarray, shape (k, n)
        Orthonormal columns that span the internal forces, with n = k - rank J_b. For four point
        feet n = 6.

    Notes
    -----
    If J has full row rank, torques can produce all internal forces without moving anything: the
    change -J_jᵀ λ of the torques changes ζ(τ) by λ. If J loses rank (solo8 on four feet), the k -
    rank J directions of null(Jᵀ) are among the internal forces. No torques can produce these
    forces, which leaves rank J - rank J_b directions to the torques.
    """
    as_instance("eom", eom, EquationsOfMotion)
    return null_space(eom.J[:, : eom.nv - eom.d].T)


def undetermined_forces(eom: EquationsOfMotion) -> Array:
    """Compute the contact forces without any effect, null(Jᵀ), which make λ non-unique.

    Parameters
    ----------
    eom : EquationsOfMotion
        Equations of motion at one state.

    Returns
    -------
    ndarray, shape (k, k - rank J)
        Orthonormal columns that span these forces.
    """
    return contact_space(eom).null_forces


@dataclass(frozen=True)
class Dimensions:
    """Sizes, ranks and dimensions of the equations of motion at one state."""

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
    """Compute every size, rank and dimension of the equations of motion from singular values.

    `contact_space` decides the rank of J. The null spaces of B and C come from their own singular
    values. In B and C, the resolved rows and their forces replace A and J, so the dimension of
    null(Jᵀ) is added.

    Parameters
    ----------
    eom : EquationsOfMotion
        Equations of motion at one state.

    Returns
    -------
    Dimensions
        The numbers at this state, as in section 2.2 of the course text.
    """
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
    """Compute the map (τ, z) -> (τ, λ): the smallest λ for τ plus undetermined forces."""
    minimum_norm, null_forces = forces_from_torques(eom), undetermined_forces(eom)
    tau = Affine.linear(np.eye(eom.d, eom.d + null_forces.shape[1]))
    return Affine.stack(
        tau=tau, forces=Affine(np.hstack([minimum_norm.A, null_forces]), minimum_norm.b)
    )


def _acceleration_map(eom: EquationsOfMotion, tau: Affine, forces: Affine) -> Affine:
    """Compute q̈ = M⁻¹ (S τ + Jᵀ λ - h) for τ and λ that are maps of the same variable."""
    A = np.linalg.solve(eom.M, eom.S @ tau.A + eom.J.T @ forces.A)
    return Affine(A, np.linalg.solve(eom.M, eom.S @ tau.b + eom.J.T @ forces.b - eom.h))


def _orthonormalized(f: Affine) -> Affine:
    """Write the values of f as v + V⊥ β with orthonormal V⊥ and the smallest v."""
    V = np.linalg.qr(f.A)[0]
    return Affine(V, f.b - V @ (V.T @ f.b), f.blocks)
