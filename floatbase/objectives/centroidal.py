"""Centroidal dynamics: momentum, net force and moment, force bias and torques for given forces.

Section 3.1 of the course text, eqs. (20) to (25).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_forces,
    as_instance,
    as_positive,
    numeric_copy,
    read_only,
)
from floatbase.affine import Affine, Quadratic
from floatbase.dynamics import (
    Contacts,
    EquationsOfMotion,
    FrictionContact,
    grasp_matrix,
    resolved_constraint,
    torque_force_space,
)
from floatbase.errors import InputError
from floatbase.linear_algebra import RANK_TOLERANCE, null_space, rank
from floatbase.robots import State


def centroidal_momentum(state: State) -> Array:
    """Compute the linear and angular momentum of the whole robot about its centre of mass.

    The linear momentum is m ẋ_c. The angular momentum is Σ (x_i - x_c) × m_i ẋ_i over all
    particles. Only external forces change them.

    Parameters
    ----------
    state : State
        State of the robot.

    Returns
    -------
    ndarray, shape (6,)
        Linear [kg·m/s] and angular momentum [kg·m²/s] in the world frame.

    Notes
    -----
    Centroidal momentum is described in [Orin2013]_.
    """
    as_instance("state", state, State)
    model = state.robot.model
    return read_only(
        pin.computeCentroidalMomentum(model, model.createData(), state.q, state.v).vector
    )


def centroidal_momentum_rate(state: State, qdd: npt.ArrayLike) -> Array:
    """Compute the time derivative of the centroidal momentum for an acceleration q̈.

    By the laws of Newton and Euler, this rate equals (f_c + m g, τ_c). Here (f_c, τ_c) is the
    wrench of the contact forces about the centre of mass. Joint torques are internal and have no
    effect.

    Parameters
    ----------
    state : State
        State of the robot.
    qdd : array_like, shape (nv,)
        Acceleration q̈ [m/s², rad/s²]: the base in its own frame, then the joints.

    Returns
    -------
    ndarray, shape (6,)
        Rates of linear [N] and angular momentum [N·m] in the world frame.
    """
    as_instance("state", state, State)
    model = state.robot.model
    qdd = as_array("qdd", qdd, (state.robot.nv,))
    return read_only(
        pin.computeCentroidalMomentumTimeVariation(
            model, model.createData(), state.q, state.v, qdd
        ).vector
    )


def net_force_matrix(contacts: Contacts) -> Array:
    """Compute the matrix G_f of the net contact force f_c = G_f λ.

    G_f has one identity block for each contact point, four for four point feet.

    Parameters
    ----------
    contacts : Contacts
        Contacts whose forces are λ.

    Returns
    -------
    ndarray, shape (3, 3n)
        G_f, dimensionless, for forces in world axes.

    Notes
    -----
    [FBR]_, eq. (20).
    """
    as_instance("contacts", contacts, Contacts)
    return grasp_matrix(np.zeros((contacts.n_points, 3)), np.zeros(3))[:3]


def net_moment_matrix(state: State, contacts: Contacts) -> Array:
    """Compute the matrix G_τ of the net contact moment τ_c = G_τ λ about the centre of mass.

    The moment is τ_c = Σ (x_i - x_c) × f_i, where x_c is the centre of mass.

    Parameters
    ----------
    state : State
        State of the robot.
    contacts : Contacts
        Contacts whose forces are λ.

    Returns
    -------
    ndarray, shape (3, 3n)
        G_τ in world axes [m].

    Notes
    -----
    [FBR]_, eq. (21). Footnote 10 of the course text prints x_c - x_i, which would give the opposite
    moment.
    """
    as_instance("state", state, State)
    as_instance("contacts", contacts, Contacts)
    return grasp_matrix(contacts.positions(state), state.com)[3:]


def com_wrench_map(state: State, contacts: Contacts) -> Affine:
    """Compute the map from contact forces to their wrench about the centre of mass.

    Parameters
    ----------
    state : State
        State of the robot.
    contacts : Contacts
        Contacts whose forces are λ.

    Returns
    -------
    Affine
        Map from λ, shape (k,) [N], to (f_c, τ_c), with blocks "force", shape (3,) [N], and
        "moment", shape (3,) [N·m], both in world axes.

    Raises
    ------
    InputError
        If a contact has forces that do not act at points, such as a `LinearConstraint`.

    Notes
    -----
    [FBR]_, eqs. (20), (21).
    """
    _require_point_forces(contacts)
    return Affine.stack(
        force=Affine.linear(net_force_matrix(contacts)),
        moment=Affine.linear(net_moment_matrix(state, contacts)),
    )


def wrench_objective(
    state: State,
    contacts: Contacts,
    force: npt.ArrayLike,
    moment: npt.ArrayLike,
    *,
    force_weight: float = 1.0,
    moment_weight: float = 1.0,
) -> Quadratic:
    """Make a cost on contact forces for the error of their wrench about the centre of mass.

    The cost is w_f ½ ‖f̃_c - G_f λ‖² + w_τ ½ ‖τ̃_c - G_τ λ‖². The course text adds N² and (N·m)²
    with w_f = w_τ = 1. If the feet cannot produce the whole wrench, the weights decide which part
    has the error. The weight w_τ = 1e6 is the same as measuring moments in N·mm.

    Parameters
    ----------
    state : State
        State of the robot.
    contacts : Contacts
        Contacts whose forces are λ.
    force : array_like, shape (3,)
        Desired force f̃_c of the ground on the robot, in the world frame [N]. For standing still,
        the force is the robot's weight, upwards.
    moment : array_like, shape (3,)
        Desired moment τ̃_c about the centre of mass, in the world frame [N·m].
    force_weight : float, optional
        Weight w_f ≥ 0 [1/N²].
    moment_weight : float, optional
        Weight w_τ ≥ 0 [1/(N·m)²].

    Returns
    -------
    Quadratic
        Cost on λ, shape (k,).

    Notes
    -----
    [FBR]_, eq. (22).
    """
    named_weights = {"force_weight": force_weight, "moment_weight": moment_weight}
    weights = np.repeat(
        [as_positive(name, value, allow_zero=True) for name, value in named_weights.items()], 3
    )
    desired = np.concatenate(
        [as_array("force", force, (3,), "N"), as_array("moment", moment, (3,), "N·m")]
    )
    scale = np.diag(np.sqrt(weights))
    return Quadratic.from_residual(scale @ com_wrench_map(state, contacts).A, scale @ desired)


def desired_wrench(
    state: State,
    com_acceleration: npt.ArrayLike,
    angular_momentum_rate: npt.ArrayLike = (0.0, 0.0, 0.0),
) -> tuple[Array, Array]:
    """Compute the contact wrench about the centre of mass that a desired motion requires.

    The force is m (a - g) by Newton's law, and the moment is L̇ by Euler's law.

    Parameters
    ----------
    state : State
        State of the robot.
    com_acceleration : array_like, shape (3,)
        Acceleration a of the centre of mass, in the world frame [m/s²].
    angular_momentum_rate : array_like, shape (3,), optional
        Rate L̇ of the angular momentum about the centre of mass, in the world frame [N·m].

    Returns
    -------
    force : ndarray, shape (3,)
        Desired force f̃_c of eq. (22), in the world frame [N].
    moment : ndarray, shape (3,)
        Desired moment τ̃_c of eq. (22), in the world frame [N·m].
    """
    as_instance("state", state, State)
    specific_force = (
        as_array("com_acceleration", com_acceleration, (3,), "m/s²")
        - state.robot.model.gravity.linear
    )
    return read_only(state.robot.mass * specific_force), as_array(
        "angular_momentum_rate", angular_momentum_rate, (3,)
    )


def centroidal_inertia(state: State) -> Array:
    """Compute the inertia of the whole robot about its centre of mass, with locked joints.

    Parameters
    ----------
    state : State
        State of the robot.

    Returns
    -------
    ndarray, shape (3, 3)
        Rotational inertia in world axes [kg·m²].
    """
    as_instance("state", state, State)
    data = state.robot.model.createData()
    pin.ccrba(state.robot.model, data, state.q, state.v)
    return read_only(data.Ig.inertia)


def tangential_bias(contacts: Contacts) -> Quadratic:
    """Make a cost on the tangential parts of the contact forces, Σ ½ ‖(I - n nᵀ) f_i‖².

    Parameters
    ----------
    contacts : Contacts
        Contacts, all with forces at points.

    Returns
    -------
    Quadratic
        Cost on λ, shape (k,) [N²].

    Notes
    -----
    [FBR]_, eq. (23). This cost is the first part of that equation. The course text prints the norm
    without the square, but only its square is quadratic.
    """
    N = _normal_matrix(contacts)
    return Quadratic.from_residual(np.eye(len(N)) - N @ N.T, np.zeros(len(N)))


def normal_bias(contacts: Contacts, a: npt.ArrayLike) -> Quadratic:
    """Make a cost that draws each normal force towards a, Σ ½ ‖n nᵀ f_i - a n‖².

    Parameters
    ----------
    contacts : Contacts
        Contacts, all with forces at points.
    a : float or array_like, shape (n,)
        Desired normal force [N]: one number for all points, or one for each.

    Returns
    -------
    Quadratic
        Cost on λ, shape (k,) [N²].

    Notes
    -----
    [FBR]_, eq. (23). This cost is the second part of that equation, without the factor α.
    """
    N = _normal_matrix(contacts)
    numeric = numeric_copy(a)
    targets = [a] * N.shape[1] if numeric is not None and numeric.ndim == 0 else a
    targets = as_array("the desired normal force a", targets, (N.shape[1],), "N")
    return Quadratic.from_residual(N @ N.T, N @ targets)


def force_bias(contacts: Contacts, alpha: float, a: npt.ArrayLike) -> Quadratic:
    """Make the cost Σ ½ ‖tangential part‖² + (α/2) ‖normal part - a‖² on contact forces.

    The cost is a preference, not a limit: it keeps no force inside its friction cone, and it allows
    forces that pull.

    Parameters
    ----------
    contacts : Contacts
        Contacts, all with forces at points.
    alpha : float
        Weight α ≥ 0 of the normal part relative to the tangential part, dimensionless.
    a : float or array_like, shape (n,)
        Desired normal force [N]: one number for all points, or one for each.

    Returns
    -------
    Quadratic
        Cost on λ, shape (k,) [N²].

    Notes
    -----
    [FBR]_, eq. (23).
    """
    return tangential_bias(contacts) + as_positive("alpha", alpha, allow_zero=True) * normal_bias(
        contacts, a
    )


@dataclass(frozen=True, eq=False)
class TorquesFromForces(Value):
    """The smallest torques that produce desired contact forces, in closed form.

    With fewer torques than forces, not every λ is reachable. For an unreachable λ, `torque` gives
    the torques of the nearest reachable accelerations.

    Parameters
    ----------
    torque : Affine
        Pseudo-inverse solution, from λ, shape (k,) [N], to τ, shape (d,) [N·m].
    reachable : Affine
        All forces that torques can produce, as a map from coordinates β̂ to λ [N] with orthonormal
        columns.
    null_torques : ndarray, shape (d, f)
        Orthonormal columns that span the torques without effect on any contact force, the
        redundancy.

    Notes
    -----
    [FBR]_, eq. (25).
    """

    torque: Affine
    reachable: Affine
    null_torques: Array

    def distance(self, forces: npt.ArrayLike) -> float:
        """Compute the distance of desired forces from the reachable ones.

        Parameters
        ----------
        forces : array_like, shape (k,) or (k / 3, 3)
            Desired contact forces in world axes [N].

        Returns
        -------
        float
            Distance [N], 0 for reachable forces.
        """
        return float(np.linalg.norm(as_forces(forces, self.reachable.n_out) - self.nearest(forces)))

    def nearest(self, forces: npt.ArrayLike) -> Array:
        """Compute the reachable forces nearest to desired ones.

        Parameters
        ----------
        forces : array_like, shape (k,) or (k / 3, 3)
            Desired contact forces in world axes [N].

        Returns
        -------
        ndarray, shape (k,)
            Nearest reachable forces in world axes [N].
        """
        forces = as_forces(forces, self.reachable.n_out)
        return self.reachable(self.reachable.A.T @ (forces - self.reachable.b))


def torques_from_forces(eom: EquationsOfMotion) -> TorquesFromForces:
    """Compute the smallest torques for every λ at once, min ½ ‖f^τ(β)‖² subject to λ = f^λ(β).

    f^τ and f^λ are the blocks of eq. (24). Legs with two joints (d < k) cannot reach every λ. Legs
    with three joints (d = k) have one τ for each λ. Legs with more joints (d > k) have many.

    Parameters
    ----------
    eom : EquationsOfMotion
        Equations of motion at one state.

    Returns
    -------
    TorquesFromForces
        The map from forces to torques, the reachable forces and the redundant torques.

    Notes
    -----
    [FBR]_, eqs. (24), (25).
    """
    A, b = resolved_constraint(eom)
    C_tau, C_forces = A @ np.linalg.solve(eom.M, eom.S), A @ np.linalg.solve(eom.M, eom.J.T)
    inverse, a = np.linalg.pinv(C_tau, rcond=RANK_TOLERANCE), b + A @ np.linalg.solve(eom.M, eom.h)
    forces = torque_force_space(eom)["forces"]
    U = np.linalg.svd(forces.A, full_matrices=False)[0]
    return TorquesFromForces(
        torque=Affine(-inverse @ C_forces, inverse @ a),
        reachable=Affine(U[:, : rank(forces.A, absolute=True)], forces.b),
        null_torques=null_space(C_tau),
    )


def _normal_matrix(contacts: Contacts) -> Array:
    """Return N with the normal of each point as a column, shape (k, n).

    Nᵀ λ holds the normal components of the forces, and N Nᵀ λ the normal parts as vectors.
    """
    _require_point_forces(contacts)
    return (np.eye(contacts.n_points)[:, None] * contacts.normals[:, :, None]).reshape(
        contacts.k, contacts.n_points
    )


def _require_point_forces(contacts: Contacts) -> None:
    """Check that the forces of all contacts act at points."""
    as_instance("contacts", contacts, Contacts)
    names = [contact.name for contact in contacts if not isinstance(contact, FrictionContact)]
    if names:
        raise InputError(
            f"The forces of {', '.join(names)} do not act at points, which is required here. Leave "
            f"such constraints out with contacts.without(…)."
        )
