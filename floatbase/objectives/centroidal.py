"""The centre of mass steered by forces: momentum, G_f, G_τ, wrenches, force bias, torque redundancy
(20)-(25).
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
    """Momentum of the whole robot, shape (6,), world: linear, kg·m/s, then angular about the centre
    of mass, kg·m²/s.

    Linear m ẋ_c, angular Σ (x_i - x_c) × m_i ẋ_i over all particles: what (20)(21) say that outside
    forces change.
    """
    as_instance("state", state, State)
    model = state.robot.model
    return read_only(
        pin.computeCentroidalMomentum(model, model.createData(), state.q, state.v).vector
    )


def centroidal_momentum_rate(state: State, qdd: npt.ArrayLike) -> Array:
    """Time derivative of `centroidal_momentum` under q̈, shape (nv,), as v of `State`; shape (6,),
    N and N·m, world.

    Newton and Euler: (f_c + m g, τ_c), with the wrench (f_c, τ_c) of (20)(21) that the contact
    forces have about the centre of mass. Torques of the joints are internal and do not show up.
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
    """(20) G_f, shape (3, 3n): f_c = G_f λ, one identity block for each point (four for four feet).
    N, world.
    """
    as_instance("contacts", contacts, Contacts)
    return grasp_matrix(np.zeros((contacts.n_points, 3)), np.zeros(3))[:3]


def net_moment_matrix(state: State, contacts: Contacts) -> Array:
    """(21) G_τ, shape (3, 3n), m: τ_c = G_τ λ = Σ (x_i - x_c) × f_i, the moment about the centre of
    mass x_c. World.

    The order matters: footnote 10 of the course text prints x_c - x_i, which would give the
    opposite moment.
    """
    as_instance("state", state, State)
    as_instance("contacts", contacts, Contacts)
    return grasp_matrix(contacts.positions(state), state.com)[3:]


def com_wrench_map(state: State, contacts: Contacts) -> Affine:
    """(20)(21) λ -> (f_c, τ_c), with blocks "force" (3,), N, and "moment" (3,), N·m, both world,
    about the centre of mass.

    Only contacts whose forces act at points count. Raises `InputError` for others
    (`LinearConstraint`).
    """
    as_instance("state", state, State)
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
    """(22) w_f ½ ‖f̃_c - G_f λ‖² + w_τ ½ ‖τ̃_c - G_τ λ‖² as a cost on λ.

    The course text adds N² and (N·m)² as they come, w_f = w_τ = 1. Where the feet cannot give the
    whole wrench, the weights decide which part is missed; w_τ = 1e6 is the same as counting moments
    in N·mm.

    state: where the robot is.
    contacts: whose forces are λ, shape (k,).
    force: f̃_c, shape (3,), N, world: what the ground should do to the robot; to stand still, its
        weight upwards.
    moment: τ̃_c, shape (3,), N·m, world, about the centre of mass.
    force_weight, moment_weight: w_f and w_τ, ≥ 0.
    """
    named_weights = {"force_weight": force_weight, "moment_weight": moment_weight}
    weights = np.repeat(
        [as_positive(name, value, allow_zero=True) for name, value in named_weights.items()], 3
    )
    desired = np.concatenate(
        [as_array("force", force, (3,), "N"), as_array("moment", moment, (3,), "N·m")]
    )
    residual = com_wrench_map(state, contacts) - desired
    return Quadratic.from_affine(Affine.linear(np.diag(np.sqrt(weights))) @ residual)


def desired_wrench(
    state: State,
    com_acceleration: npt.ArrayLike,
    angular_momentum_rate: npt.ArrayLike = (0.0, 0.0, 0.0),
) -> tuple[Array, Array]:
    """The (f̃_c, τ̃_c) of (22) for a desired motion: f = m (a - g), Newton; τ = L̇, Euler. Shapes
    (3,), N and N·m, world.

    com_acceleration: a, shape (3,), m/s². angular_momentum_rate: L̇ about the centre of mass, shape
        (3,), N·m.
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
    """Inertia of the whole robot about its centre of mass, joints locked, shape (3, 3), kg·m²,
    world.
    """
    as_instance("state", state, State)
    data = state.robot.model.createData()
    pin.ccrba(state.robot.model, data, state.q, state.v)
    return read_only(data.Ig.inertia)


def tangential_bias(contacts: Contacts) -> Quadratic:
    """(23), first part: Σ ½ ‖(I - n nᵀ) f_i‖², the friction that each foot asks for, squared; a
    cost on λ.

    The course text prints the norm without its square; only squared is it quadratic.
    """
    N = _normal_matrix(contacts)
    return Quadratic.from_residual(np.eye(len(N)) - N @ N.T, np.zeros(len(N)))


def normal_bias(contacts: Contacts, a: npt.ArrayLike) -> Quadratic:
    """(23), second part without its α: Σ ½ ‖n nᵀ f_i - a n‖², which draws each normal force towards
    a, N; a cost on λ.

    a: one number for all points or shape (n,).
    """
    N = _normal_matrix(contacts)
    numeric = numeric_copy(a)
    targets = [a] * N.shape[1] if numeric is not None and numeric.ndim == 0 else a
    targets = as_array("the nominal normal force a", targets, (N.shape[1],), "N")
    return Quadratic.from_residual(N @ N.T, N @ targets)


def force_bias(contacts: Contacts, alpha: float, a: npt.ArrayLike) -> Quadratic:
    """(23) Σ h_i(f_i) = Σ ½ ‖tangential part‖² + (α/2) ‖normal part - a‖², as a cost on λ, shape
    (k,). Source: §3.1.1.

    A preference, not a limit: nothing keeps a force in its cone, or from pulling.

    contacts: all with forces at points.
    alpha: α ≥ 0, weight of the normal part beside the tangential one.
    a: the normal force that each contact should carry, N; one number for all points or shape (n,).
    """
    return tangential_bias(contacts) + as_positive("alpha", alpha, allow_zero=True) * normal_bias(
        contacts, a
    )


@dataclass(frozen=True, eq=False)
class TorquesFromForces(Value):
    """(25) The smallest torques that give desired forces, in closed form.

    With fewer torques than forces not every λ is reachable: `torque` then answers for the nearest
    reachable accelerations.

    torque: `Affine` λ -> τ, the pseudo-inverse solution, shape (k,) N to (d,) N·m.
    reachable: the forces that any torques can give, as an `Affine` β̂ -> λ with orthonormal
        columns.
    null_torques: (d, f), torques that change no force: the redundancy.
    """

    torque: Affine
    reachable: Affine
    null_torques: Array

    def distance(self, forces: npt.ArrayLike) -> float:
        """Distance [N] of desired forces (k,) from the reachable ones; 0 when reachable."""
        return float(np.linalg.norm(as_forces(forces, self.reachable.n_out) - self.nearest(forces)))

    def nearest(self, forces: npt.ArrayLike) -> Array:
        """The reachable forces nearest to desired ones, shape (k,), N."""
        forces = as_forces(forces, self.reachable.n_out)
        return self.reachable(self.reachable.A.T @ (forces - self.reachable.b))


def torques_from_forces(eom: EquationsOfMotion) -> TorquesFromForces:
    """(24)(25) min ½ ‖f^τ(β)‖² subject to λ = f^λ(β), for every λ at once.

    f^τ and f^λ are the blocks of (24). Legs of 2, 3 and more joints give d < k, d = k and d > k:
    forces out of reach, one τ for each λ, and a choice among many. Source: [FBR], §3.1.2.
    """
    as_instance("eom", eom, EquationsOfMotion)
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
    """The normal of each point as a column, shape (k, n): the normal parts of λ are Nᵀ λ, and N Nᵀ
    λ as forces.
    """
    _require_point_forces(contacts)
    return (np.eye(contacts.n_points)[:, None] * contacts.normals[:, :, None]).reshape(
        contacts.k, contacts.n_points
    )


def _require_point_forces(contacts: Contacts) -> None:
    as_instance("contacts", contacts, Contacts)
    names = [contact.name for contact in contacts if not isinstance(contact, FrictionContact)]
    if names:
        raise InputError(
            f"{', '.join(names)} has forces that do not act at points; leave it out: "
            f"contacts.without(…)."
        )
