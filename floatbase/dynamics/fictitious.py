"""Gravity, centrifugal and Coriolis forces, and fictitious forces in a rotating frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._validation import Array, Value, as_array, as_callable, as_instance, read_only
from floatbase.errors import InputError, unknown_name
from floatbase.robots import State

VectorOrFunction: TypeAlias = npt.ArrayLike | Callable[[float], npt.ArrayLike]
# rad per step of the integrated rotation: the error is 1e-10 rad after a full turn
_MAX_ROTATION_STEP = 0.01
_MAX_STEPS = 100_000  # steps between two times: 160 turns, which take some seconds to compute


@dataclass(frozen=True, eq=False)
class BiasForces(Value):
    """The bias forces h, split into gravity, centrifugal and Coriolis forces.

    The split between centrifugal and Coriolis forces depends on the coordinates, and so does their
    size; see `bias_forces`.
    """

    gravity: Array
    centrifugal: Array
    coriolis: Array

    @property
    def fictitious(self) -> Array:
        """Sum C v of centrifugal and Coriolis forces, shape (nv,) [N, N·m]."""
        return read_only(self.centrifugal + self.coriolis)

    @property
    def total(self) -> Array:
        """Sum h(q, v) of all three, shape (nv,), for the same axes as the parts [N, N·m]."""
        return read_only(self.gravity + self.centrifugal + self.coriolis)


def bias_forces(state: State, axes: Literal["base", "world"] = "base") -> BiasForces:
    """Split h(q, v) into gravity, centrifugal and Coriolis forces.

    The velocity-dependent part is Σ_ij Γ_ij v_i v_j. A motion of one coordinate alone gives Γ_ii.

    Parameters
    ----------
    state : State
        State of the robot.
    axes : {"base", "world"}, optional
        Axes of the velocity, acceleration, force and moment of the base. The axes of the base, as
        in v, rotate, and so h includes the Coriolis force m ω × v_lin. With a fixed base, the
        result is the same for both.

    Returns
    -------
    BiasForces
        The three parts of h, each of shape (nv,) [N, N·m].

    Raises
    ------
    UnknownNameError
        If `axes` is neither "base" nor "world".

    Notes
    -----
    [FBR]_, App. A.
    """
    as_instance("state", state, State)
    if not isinstance(axes, str) or axes not in ("base", "world"):
        raise unknown_name("axes", axes, ("base", "world"))
    model = state.robot.model
    data = model.createData()
    T = _world_to_base_axes(state) if axes == "world" else np.eye(model.nv)
    g = np.array(pin.computeGeneralizedGravity(model, data, state.q))

    def velocity_forces(v: Array) -> Array:
        """Compute Σ_ij Γ_ij u_i u_j for u with v = T u: q̈ = T u̇ + Ṫ u, and Tᵀ maps forces."""
        axes_rotation = (
            state.M[:, :3] @ np.cross(v[:3], v[3:6])
            if axes == "world" and state.robot.is_floating
            else 0.0
        )
        return np.asarray(T.T @ (pin.nonLinearEffects(model, data, state.q, v) - g + axes_rotation))

    u = T.T @ state.v  # T is orthogonal
    centrifugal = np.column_stack([velocity_forces(unit) for unit in T.T]) @ u**2
    return BiasForces(
        read_only(T.T @ g),
        read_only(centrifugal),
        read_only(velocity_forces(state.v) - centrifugal),
    )


def _world_to_base_axes(state: State) -> Array:
    """Compute the orthogonal T with v = T u, where u has the velocity of the base in world axes."""
    T = np.eye(state.robot.nv)
    if state.robot.is_floating:
        T[:3, :3] = T[3:6, 3:6] = state.frame_pose("base").rotation.T
    return T


def coriolis_matrix(state: State) -> Array:
    """Compute the Coriolis matrix C(q, v).

    C v is the sum of centrifugal and Coriolis forces, and Ṁ - 2 C is skew-symmetric. Many matrices
    have the first property; the one returned here, from Pinocchio, has both.

    Parameters
    ----------
    state : State
        State of the robot.

    Returns
    -------
    ndarray, shape (nv, nv)
        Coriolis matrix; C v is in [N, N·m].

    Notes
    -----
    [FBR]_, App. A. Pinocchio computes the matrix [Carpentier2019]_.
    """
    as_instance("state", state, State)
    model = state.robot.model
    return read_only(pin.computeCoriolisMatrix(model, model.createData(), state.q, state.v))


@dataclass(frozen=True, eq=False)
class RotatingFrameView(Value):
    """The motion of a free particle in a rotating frame, with one row for each time.

    The three accelerations together explain the curved path of the particle in the frame.
    """

    time: Array
    rotation: Array
    position: Array
    velocity: Array
    centrifugal: Array
    coriolis: Array
    euler: Array

    @property
    def acceleration(self) -> Array:
        """Acceleration p̈ in the rotating frame, all of it fictitious, shape (n, 3) [m/s²]."""
        return read_only(self.centrifugal + self.coriolis + self.euler)


def view_from_rotating_frame(
    time: npt.ArrayLike,
    omega: VectorOrFunction,
    position: npt.ArrayLike,
    velocity: npt.ArrayLike = (0.0, 0.0, 0.0),
    omega_rate: VectorOrFunction | None = None,
) -> RotatingFrameView:
    """Describe the straight path of a free particle in a rotating frame.

    No force acts on the particle. The axes of the frame are those of the world at `time[0]`, and
    its origin stays at the origin of the world.

    Parameters
    ----------
    time : array_like, shape (n,)
        Increasing times [s].
    omega : array_like, shape (3,), or callable
        Angular velocity of the frame, in world axes [rad/s]: a constant, or a function of the time
        [s] that returns shape (3,).
    position : array_like, shape (3,)
        Position of the particle at `time[0]`, in the world frame [m].
    velocity : array_like, shape (3,), optional
        Velocity of the particle, in the world frame [m/s].
    omega_rate : array_like, shape (3,), or callable, optional
        Time derivative of `omega`, in world axes [rad/s²]. The default is zero for a constant
        `omega`; the derivative is required if `omega` is a function.

    Returns
    -------
    RotatingFrameView
        Position, velocity and fictitious accelerations in the rotating frame at each time.

    Raises
    ------
    InputError
        If the times do not increase, or if the frame turns more than about 160 times between two of
        them, or if `omega` is a function and `omega_rate` is missing.

    Notes
    -----
    [FBR]_, App. A.
    """
    time = as_array("time", time, (None,), "s")
    if time.size < 1 or np.any(np.diff(time) <= 0.0):
        raise InputError(
            "time must contain at least one value, and its values must increase strictly."
        )
    if callable(omega) and omega_rate is None:
        raise InputError(
            "omega is a function of time, so its derivative is needed as well. Pass "
            "omega_rate=lambda t: … [rad/s²]."
        )
    omega_at = _as_function("omega", omega)
    omega_rate_at = _as_function("omega_rate", np.zeros(3) if omega_rate is None else omega_rate)
    R = _rotations(time, omega_at)
    start = as_array("position", position, (3,), "m")
    v = as_array("velocity", velocity, (3,), "m/s")
    world = [[start + (t - time[0]) * v, v, omega_at(t), omega_rate_at(t)] for t in time]
    p, v_rotated, w, w_rate = np.einsum("nji,nkj->kni", R, world)  # Rᵀ x: in the axes of the frame
    p_rate = v_rotated - np.cross(w, p)
    return RotatingFrameView(
        time=time,
        rotation=read_only(R),
        position=read_only(p),
        velocity=read_only(p_rate),
        centrifugal=read_only(-np.cross(w, np.cross(w, p))),
        coriolis=read_only(-2.0 * np.cross(w, p_rate)),
        euler=read_only(-np.cross(w_rate, p)),
    )


def _as_function(name: str, value: VectorOrFunction) -> Callable[[float], Array]:
    """Return the value as a checked function of time."""
    if callable(value):
        as_callable(name, value, f"{name}(t)")
        return lambda t: as_array(f"{name} at {t:g} s", value(t), (3,))
    constant = as_array(name, value, (3,))
    return lambda t: constant


def _rotations(time: Array, omega: Callable[[float], Array]) -> Array:
    """Integrate Ṙ = [ω] R from R = 1 at time[0] with a Magnus method of fourth order.

    The method evaluates ω at two Gauss points per step. Source: Iserles et al., Lie-group methods,
    Acta Numerica, 2000.
    """
    R = np.empty((time.size, 3, 3))
    R[0] = np.eye(3)
    for i, (begin, end) in enumerate(pairwise(time)):
        max_speed = max(float(np.linalg.norm(omega(t))) for t in np.linspace(begin, end, 3))
        steps = int(np.ceil(max_speed * (end - begin) / _MAX_ROTATION_STEP)) + 1
        if steps > _MAX_STEPS:
            raise InputError(
                f"From {begin:g} s to {end:g} s the frame turns by {steps * _MAX_ROTATION_STEP:g} "
                f"rad, but at most {_MAX_STEPS * _MAX_ROTATION_STEP:g} rad are allowed between two "
                f"times. Use a shorter time or add times in between."
            )
        dt = (end - begin) / steps
        R[i + 1] = R[i]
        for t in begin + dt * np.arange(steps):
            first, second = (
                omega(float(t + (0.5 + side * np.sqrt(3.0) / 6.0) * dt)) for side in (-1.0, 1.0)
            )
            commutator = np.sqrt(3.0) / 12.0 * dt**2 * np.cross(second, first)
            R[i + 1] = pin.exp3(0.5 * dt * (first + second) + commutator) @ R[i + 1]
    return R
