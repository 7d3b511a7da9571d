"""`HorizonQP`: the contact forces of a whole horizon as one quadratic program (convex MPC).

The robot is a single rigid body with its mass m and its inertia I₀ in the standing posture. Legs
have no inertia of their own. The state is x = (Θ, p, ω, ṗ): roll, pitch and yaw, centre of mass,
angular velocity and velocity, in the world frame. With the yaw ψ, small roll and pitch, and the
vectors r_i from the centre of mass to the contacts, the motion is

    (M1)  Θ̇ = R_z(ψ)ᵀ ω
    (M2)  I ω̇ = Σ r_i × λ_i,  I = R_z(ψ) I₀ R_z(ψ)ᵀ
    (M3)  m p̈ = Σ λ_i + m g

ψ and r_i are taken from a reference motion, so (M1)-(M3) are linear in x and the forces λ. In an
interval of length Δt, the forces are constant. Then ω and ṗ are linear in time, Θ and p quadratic,
and the next state is exactly

    (M4)  x_{k+1} = A_k x_k + B_k λ_k + b

Eliminating the states leaves one affine map from all forces u to all states of the horizon,

    (M5)  X = S u + s

and the forces follow from a quadratic program with friction pyramids:

    (M6)  min  ½ Σ_k ‖x_k - x_k,ref‖²_Q + ½ R ‖u‖²
    (M7)  |λ_x| ≤ μ λ_z,  |λ_y| ≤ μ λ_z,  0 ≤ λ_z ≤ max_load m g

A foot in the air has no force in u. If all feet are in the air, the horizon only predicts the
flight, and forces before it and after it decide how the robot takes off and lands.

[DiCarlo2018]_, with the exact discretization (M4) and the states eliminated (M5).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from floatbase._geometry import rotation_z
from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_positive,
    checked,
    read_only,
    short_repr,
)
from floatbase.errors import InputError, SolverError
from floatbase.qp import QP

# of (Θ, p, ω, ṗ): heights and attitudes matter, and horizontal velocity more than position
STATE_WEIGHTS = (25.0, 25.0, 10.0, 2.0, 2.0, 50.0, 0.3, 0.3, 0.3, 0.5, 0.5, 0.3)
# entries of the state
THETA, COM, OMEGA, VELOCITY = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12)
_PYRAMID = np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0], [0, 0, -1.0], [0, 0, 1]])
_NO_BOUND = -1e30  # DAQP treats this as no bound
_MAX_ITERATIONS = 400  # some 4 ms; 600 wild states of quadrupeds needed at most 250
_NO_INERTIA = "inertia must be symmetric and positive definite [kg·m²]."


@dataclass(frozen=True, eq=False)
class HorizonMotion(Value):
    """Forces and predicted states of a horizon.

    Parameters
    ----------
    forces : ndarray, shape (n, m, 3)
        Contact forces in each of the n intervals, in the world frame [N]; zero for a foot in the
        air.
    states : ndarray, shape (n, 12)
        State (Θ, p, ω, ṗ) at the end of each interval [rad, m, rad/s, m/s].
    """

    forces: Array = field(metadata=checked(as_array, (None, None, 3), "N"))
    states: Array = field(metadata=checked(as_array, (None, 12)))


@dataclass(frozen=True, eq=False)
class HorizonQP(Value):
    """Contact forces of a single rigid body over a horizon, as a quadratic program.

    Parameters
    ----------
    mass : float
        Mass [kg].
    inertia : array_like, shape (3, 3)
        Rotational inertia about the centre of mass at zero yaw, in the world frame [kg·m²].
    dt : float, optional
        Length of an interval [s].
    mu : float, optional
        Friction coefficient of the pyramids [-].
    max_load : float, optional
        Largest normal force of a foot, as a multiple of the weight [-].
    gravity : float, optional
        Gravitational acceleration [m/s²].
    state_weights : array_like, shape (12,), optional
        Diagonal of Q, the weights of (Θ, p, ω, ṗ) [1/rad², 1/m², ...].
    force_weight : float, optional
        Weight of the squared forces, in units of the weight; R is force_weight / (m g)² [-].

    Notes
    -----
    Convex model predictive control after [DiCarlo2018]_. The module's documentation has the
    equations.

    Examples
    --------
    A body of 10 kg on two feet, which should rise at 0.1 m/s:

    >>> import numpy as np
    >>> from floatbase.behaviours import HorizonQP
    >>> horizon = HorizonQP(mass=10.0, inertia=0.1 * np.eye(3), mu=0.5)
    >>> x = np.zeros(12)
    >>> reference = np.tile([0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0.1], (10, 1))
    >>> feet = np.tile([[0.0, 0.2, -0.3], [0.0, -0.2, -0.3]], (10, 1, 1))
    >>> motion = horizon.solve(x, reference, feet, np.ones((10, 2), bool))
    >>> bool(motion.forces[0, :, 2].sum() > 10.0 * 9.81)
    True
    """

    mass: float = field(metadata=checked(as_positive, "kg"))
    inertia: Array = field(metadata=checked(as_array, (3, 3), "kg·m²"))
    dt: float = field(default=0.03, metadata=checked(as_positive, "s", maximum=1.0))
    mu: float = field(default=0.6, metadata=checked(as_positive, ""))
    max_load: float = field(default=2.0, metadata=checked(as_positive, ""))
    gravity: float = field(default=9.81, metadata=checked(as_positive, "m/s²"))
    state_weights: Array = field(
        default_factory=lambda: np.array(STATE_WEIGHTS), metadata=checked(as_array, (12,))
    )
    force_weight: float = field(default=0.02, metadata=checked(as_positive, ""))

    def __post_init__(self) -> None:
        super().__post_init__()
        if np.any(self.state_weights < 0.0):
            raise InputError("state_weights must not be negative.")
        inertia = self.inertia
        if not np.allclose(inertia, inertia.T) or np.linalg.eigvalsh(inertia)[0] <= 0.0:
            raise InputError(_NO_INERTIA)

    def solve(
        self,
        state: npt.ArrayLike,
        reference: npt.ArrayLike,
        feet: npt.ArrayLike,
        stance: npt.ArrayLike,
    ) -> HorizonMotion:
        """Compute the forces of the horizon.

        Parameters
        ----------
        state : array_like, shape (12,)
            Present state (Θ, p, ω, ṗ) in the world frame [rad, m, rad/s, m/s].
        reference : array_like, shape (n, 12)
            Desired state at the end of each interval.
        feet : array_like, shape (n, m, 3)
            Vector from the centre of mass to each contact in each interval, world frame [m].
        stance : array_like, shape (n, m)
            Whether each foot stands in each interval.

        Returns
        -------
        HorizonMotion
            Forces and predicted states.
        """
        S, s, stands, error = self._prediction(state, reference, feet, stance)
        u = np.zeros(S.shape[1])
        if len(u):
            import daqp

            H, g, G, h = self._matrices(S, error)
            senses = np.zeros(len(h), dtype=np.int32)
            no_bounds = np.full(len(h), _NO_BOUND)
            u, _, exit_flag, _ = daqp.solve(
                H, g, G, h, no_bounds, senses, iter_limit=_MAX_ITERATIONS
            )
            if exit_flag != 1:
                raise SolverError(
                    f"DAQP did not solve a horizon of {len(stands)} intervals (exit flag "
                    f"{exit_flag}). The weights may be too far apart."
                )
        forces = np.zeros((*stands.shape, 3))
        forces[stands] = u.reshape(-1, 3)
        return HorizonMotion(read_only(forces), read_only((S @ u + s).reshape(-1, 12)))

    def qp(
        self,
        state: npt.ArrayLike,
        reference: npt.ArrayLike,
        feet: npt.ArrayLike,
        stance: npt.ArrayLike,
    ) -> QP:
        """Return the quadratic program (M6), (M7) that `solve` solves; arguments as there."""
        S, _, _, error = self._prediction(state, reference, feet, stance)
        H, g, G, h = self._matrices(S, error)
        return QP(H, g, np.zeros((0, len(g))), np.zeros(0), G, h)

    def _matrices(self, S: Array, error: Array) -> tuple[Array, Array, Array, Array]:
        """Return H, g, G and h of (M6), (M7), where `error` is s minus the reference."""
        QS, n_forces = np.tile(self.state_weights, len(S) // 12)[:, None] * S, S.shape[1] // 3
        weight = self.mass * self.gravity
        H = S.T @ QS + self.force_weight / weight**2 * np.eye(S.shape[1])  # (M6)
        faces = _PYRAMID - np.outer([1, 1, 1, 1, 0, 0], [0, 0, self.mu])  # (M7)
        h = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, self.max_load * weight], n_forces)
        return H, error @ QS, np.kron(np.eye(n_forces), faces), h

    def _prediction(
        self,
        state: npt.ArrayLike,
        reference: npt.ArrayLike,
        feet: npt.ArrayLike,
        stance: npt.ArrayLike,
    ) -> tuple[Array, Array, npt.NDArray[np.bool_], Array]:
        """Return S and s of (M5), the stance, and s minus the reference."""
        x, reference = as_array("state", state, (12,)), as_array("reference", reference, (None, 12))
        n, dt, m = len(reference), self.dt, self.mass
        if n == 0:
            raise InputError("reference must have at least one row, one for each interval.")
        feet = as_array("feet", feet, (n, None, 3), "m")
        stands = _as_stance(stance, feet.shape[:2])
        S, s = np.zeros((n, 12, 3 * int(stands.sum()))), np.zeros((n, 12))
        X, column = np.zeros(S.shape[1:]), 0
        fall = np.zeros(12)
        fall[COM], fall[VELOCITY] = [0, 0, -self.gravity * dt**2 / 2], [0, 0, -self.gravity * dt]
        inverse = np.linalg.inv(self.inertia)
        unit = np.eye(3)
        A = np.eye(12)
        A[COM, VELOCITY] = dt * unit
        for k in range(n):
            Rz = rotation_z(reference[k, 2])
            A[THETA, OMEGA] = dt * Rz.T  # (M1)
            X, x = A @ X, A @ x + fall
            for r in feet[k, stands[k]]:
                turn = Rz @ inverse @ Rz.T @ _cross_matrix(r)  # ω̇ of a unit force, (M2)
                force = slice(column, column + 3)
                X[OMEGA, force], X[VELOCITY, force] = dt * turn, dt / m * unit  # (M3)
                X[THETA, force], X[COM, force] = dt**2 / 2 * Rz.T @ turn, dt**2 / 2 / m * unit
                column += 3
            S[k], s[k] = X, x
        return S.reshape(12 * n, -1), s.ravel(), stands, (s - reference).ravel()


def _as_stance(stance: Any, shape: tuple[int, ...]) -> npt.NDArray[np.bool_]:
    """Return which feet stand in each interval, (n, m), checked."""
    try:
        stands = np.asarray(stance)
    except ValueError:  # rows of different lengths
        stands = np.empty(0)
    if stands.dtype != bool or stands.shape != shape:
        raise InputError(
            f"stance must be an array of bool of shape {shape}, like feet, not "
            f"{short_repr(stance)}."
        )
    return stands


def _cross_matrix(r: Array) -> Array:
    """Return the matrix of r ×."""
    return np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])
