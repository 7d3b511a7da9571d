"""h taken apart: gravity, centrifugal and Coriolis forces, and what a turning frame makes of
straight paths (App. A).
"""

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
# rad between two points of the grid on which the turning is added up: 1e-10 rad off after a turn
_MAX_ROTATION_STEP = 0.01
_MAX_STEPS = 100_000  # between two times: 160 turns, and some seconds of computing


@dataclass(frozen=True, eq=False)
class BiasForces(Value):
    """h = gravity g(q) + centrifugal (terms in v_i²) + coriolis (terms in v_i v_j, i ≠ j), each
    (nv,), N and N·m as h.

    Which is which, and how large, depends on the coordinates: see `bias_forces`. Source: [FBR],
    Appendix A.
    """

    gravity: Array
    centrifugal: Array
    coriolis: Array

    @property
    def fictitious(self) -> Array:
        """The part due to motion along coordinates that curve or turn, shape (nv,): C v."""
        return read_only(self.centrifugal + self.coriolis)

    @property
    def total(self) -> Array:
        """h(q, v), shape (nv,), for the axes that the parts are for."""
        return read_only(self.gravity + self.centrifugal + self.coriolis)


def bias_forces(state: State, axes: Literal["base", "world"] = "base") -> BiasForces:
    """App. A: h(q, v) taken apart. The velocity part is Σ_ij Γ_ij v_i v_j; moving one coordinate
    alone gives Γ_ii.

    axes: of the base's velocity, acceleration, force and moment: its own, as in v, which turn and
        so have m ω × v_lin as a Coriolis force; or the world's. A robot without a floating base has
        the same parts in both.

    Raises `InputError` for other axes.
    """
    as_instance("state", state, State)
    if not isinstance(axes, str) or axes not in ("base", "world"):
        raise unknown_name("axes", axes, ("base", "world"))
    model = state.robot.model
    data = model.createData()
    T = _world_to_base_axes(state) if axes == "world" else np.eye(model.nv)
    g = np.array(pin.computeGeneralizedGravity(model, data, state.q))

    def moving(v: Array) -> Array:
        """Σ_ij Γ_ij u_i u_j for the coordinates u with v = T u: q̈ = T u̇ + Ṫ u, and forces turn
        with Tᵀ.
        """
        turning = (
            state.M[:, :3] @ np.cross(v[:3], v[3:6])
            if axes == "world" and state.robot.is_floating
            else 0.0
        )
        return np.asarray(T.T @ (pin.nonLinearEffects(model, data, state.q, v) - g + turning))

    u = T.T @ state.v  # T is orthogonal
    centrifugal = np.column_stack([moving(unit) for unit in T.T]) @ u**2
    return BiasForces(
        read_only(T.T @ g), read_only(centrifugal), read_only(moving(state.v) - centrifugal)
    )


def _world_to_base_axes(state: State) -> Array:
    """T with v = T u, shape (nv, nv), orthogonal: u has the base's velocity in world axes."""
    T = np.eye(state.robot.nv)
    if state.robot.is_floating:
        T[:3, :3] = T[3:6, 3:6] = state.frame_pose("base").rotation.T
    return T


def coriolis_matrix(state: State) -> Array:
    """App. A: C(q, v), shape (nv, nv), with C v = centrifugal + Coriolis forces and Ṁ - 2 C
    skew-symmetric.

    Many matrices satisfy the first; this one, Pinocchio's, satisfies both.
    """
    as_instance("state", state, State)
    model = state.robot.model
    return read_only(pin.computeCoriolisMatrix(model, model.createData(), state.q, state.v))


@dataclass(frozen=True, eq=False)
class RotatingFrameView(Value):
    """A free particle as one who rides on a turning frame sees it; a row for each time.

    All but `rotation` is in the turning frame's coordinates, shape (n, 3). Source: [FBR], Appendix
    A.

    time: (n,) s.
    rotation: (n, 3, 3), R_world_frame.
    position, velocity: of the particle, m and m/s.
    centrifugal, coriolis, euler: -ω × (ω × p), -2 ω × ṗ and -ω̇ × p, m/s²: the accelerations that
        explain the curved path.
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
        """The particle's acceleration as the frame sees it, shape (n, 3), m/s²: p̈ is all
        fictitious.
        """
        return read_only(self.centrifugal + self.coriolis + self.euler)


def view_from_rotating_frame(
    time: npt.ArrayLike,
    omega: VectorOrFunction,
    position: npt.ArrayLike,
    velocity: npt.ArrayLike = (0.0, 0.0, 0.0),
    omega_rate: VectorOrFunction | None = None,
) -> RotatingFrameView:
    """App. A: a particle that no force acts on, moving straight in the world, seen from a frame
    that turns.

    time: (n,) s, rising; the frame's axes are the world's at time[0], its origin stays at the
        world's.
    omega: (3,) rad/s, world, angular velocity of the frame: a constant, or a function of the time
        in s.
    position: (3,) m, world, of the particle at time[0].
    velocity: (3,) m/s, world, of the particle.
    omega_rate: (3,) rad/s², world, derivative of omega; zero for a constant, and needed for a
        function.

    Raises `InputError` for times that do not rise, wrong shapes and an ω(t) without its rate.
    """
    time = as_array("time", time, (None,), "s")
    if time.size < 1 or np.any(np.diff(time) <= 0.0):
        raise InputError(
            "time must hold at least one instant, and each must come after the one before."
        )
    if callable(omega) and omega_rate is None:
        raise InputError(
            "omega is a function of time; give its derivative too, omega_rate=lambda t: …, rad/s²."
        )
    omega_at, omega_rate_at = (
        _as_function("omega", omega),
        _as_function("omega_rate", np.zeros(3) if omega_rate is None else omega_rate),
    )
    R, start, v = (
        _rotations(time, omega_at),
        as_array("position", position, (3,), "m"),
        as_array("velocity", velocity, (3,), "m/s"),
    )
    world = [[start + (t - time[0]) * v, v, omega_at(t), omega_rate_at(t)] for t in time]
    p, v_rotated, w, w_rate = np.einsum("nji,nkj->kni", R, world)  # Rᵀ x: in the frame's axes
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
    """The value as a checked function of time."""
    if callable(value):
        as_callable(name, value, f"{name}(t)")
        return lambda t: as_array(f"{name} at {t:g} s", value(t), (3,))
    constant = as_array(name, value, (3,))
    return lambda t: constant


def _rotations(time: Array, omega: Callable[[float], Array]) -> Array:
    """R(t) with Ṙ = [ω] R and R = 1 at time[0], shape (n, 3, 3), in small turns by ω at two Gauss
    points (Magnus series).

    Of fourth order. Source: Iserles et al., Lie-group methods, Acta Numerica, 2000.
    """
    R = np.empty((time.size, 3, 3))
    R[0] = np.eye(3)
    for i, (begin, end) in enumerate(pairwise(time)):
        max_speed = max(float(np.linalg.norm(omega(t))) for t in np.linspace(begin, end, 3))
        steps = int(np.ceil(max_speed * (end - begin) / _MAX_ROTATION_STEP)) + 1
        if steps > _MAX_STEPS:
            raise InputError(
                f"from {begin:g} s to {end:g} s the frame turns by {steps * _MAX_ROTATION_STEP:g} "
                f"rad; use a shorter time."
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
