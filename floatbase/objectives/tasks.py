"""Tasks: what a controller should bring about, each a weighted affine residual, actual - desired,
    in q̈, τ or λ.

A motion task asks for the acceleration a = a_ff - kp e - kd ė, where e and ė are the errors of
position and velocity. Its residual is J q̈ + J̇ q̇ - a, its cost (weight / 2) ‖residual‖², a term
of ψ in (26).

A target is a value, or a function of the time t in s that gives one. That of a motion task gives
the position alone, and the target's velocity and acceleration count as zero, or all three together:
`lambda t: (position, velocity, acceleration)`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, ClassVar, Protocol, TypeAlias, runtime_checkable

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_callable,
    as_forces,
    as_instance,
    as_number,
    as_positive,
    as_string,
    cross,
    frozen,
    numeric_copy,
    read_only,
)
from floatbase.affine import Affine
from floatbase.dynamics import Block, EquationsOfMotion
from floatbase.errors import InputError
from floatbase.robots import Robot, State, check_unit_norms

Target: TypeAlias = (
    npt.ArrayLike
    | Callable[[float], npt.ArrayLike | tuple[npt.ArrayLike, npt.ArrayLike, npt.ArrayLike]]
)
_ZERO3 = (0.0, 0.0, 0.0)
_TRIPLE_HINT = "all three together, as in lambda t: (position, velocity, acceleration)"
# R Rᵀ - 1 of matrices printed with seven digits or stored as float32 is below
_ROTATION_TOLERANCE = 1e-6
_IDENTITY = frozen(np.eye(3))
_ROTATION_ROUNDING = 1e-14  # R Rᵀ - 1 of products of exact rotations: nothing to mend


@runtime_checkable
class Task(Protocol):
    """A weighted residual on one block of x = (q̈, τ, λ).

    name: in messages and tables. weight: of ½‖residual‖² in the objective.

    A user-defined object of this form is a task too, on the compiled tick as on the reference
    backend: this one keeps the height of the centre of mass, as far as its acceleration may be 100
        (h - z) - 20 ż, m/s².

        class Height:
            name, weight, block = "height", 10.0, "qdd"

            def __init__(self, height):
                self.height = height

            def residual(self, eom, t=0.0):
                s = eom.state
                desired = 100.0 * (self.height - s.com[2:]) - 20.0 * s.com_velocity[2:]
                return fb.Affine(s.com_jacobian[2:], s.com_drift[2:] - desired)
    """

    block: ClassVar[Block]

    @property
    def name(self) -> str: ...
    @property
    def weight(self) -> float: ...
    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> Affine:
        """The residual as an `Affine` of the task's block at time t."""


def _check_arguments(eom: EquationsOfMotion, t: float) -> None:
    """Check what a residual is asked for."""
    as_instance("eom", eom, EquationsOfMotion)
    as_number("t", t, "s")


def target_shapes(task: Task, robot: Robot, k: int) -> dict[str, tuple[int, ...]]:
    """Shape of each target of a task of the package by its attribute, with k forces; the first may
    be a function of time.
    """
    if isinstance(task, OrientationTask):
        return {"rotation": (3, 3), "angular_velocity": (3,), "angular_acceleration": (3,)}
    if isinstance(task, CoMTask | FrameTask):
        return {"position": (3,), "velocity": (3,), "acceleration": (3,)}
    if isinstance(task, PostureTask):
        return {"q": (robot.nq,), "velocity": (robot.d,), "acceleration": (robot.d,)}
    return {"target": (k if isinstance(task, ForceTask) else robot.d,)}


def targets_at(task: Task, robot: Robot, k: int, t: float) -> list[Array]:
    """The targets of a task of the package at time t in s, in the order of `target_shapes`.

    Raises `InputError` for a function's value that has another shape, or is no rotation or
    configuration.
    """
    shapes = target_shapes(task, robot, k)
    values = [getattr(task, name) for name in shapes]
    time_varying = callable(values[0])
    if time_varying:
        values = _split_target(task.name, values[0](t), *shapes.values())
    else:
        values = [
            _zeros(shape) if value is None else value
            for value, shape in zip(values, shapes.values(), strict=True)
        ]
    targets = [
        _as_target(f"{name} of {task.name}", value, shapes[name])
        for name, value in zip(shapes, values, strict=True)
    ]
    if isinstance(task, OrientationTask) and time_varying:
        targets[0] = nearest_rotation(task.name, targets[0])
    if isinstance(task, PostureTask):
        check_unit_norms(
            robot.model, f"q of {task.name}", targets[0], first_joint=2 if robot.is_floating else 1
        )
    return targets


def _split_target(
    name: str, value: Any, shape: tuple[int, ...], *derivative_shapes: tuple[int, ...]
) -> list[Any]:
    """What a function of time gave, with zeros for velocity and acceleration unless it gave all
    three.
    """
    is_sequence = (
        derivative_shapes
        and (isinstance(value, Sequence) or (isinstance(value, np.ndarray) and value.ndim))
        and len(value) > 1
    )
    first = numeric_copy(value[0]) if is_sequence else None
    if first is None or first.ndim != len(shape):
        return [value, *map(_zeros, derivative_shapes)]
    if len(value) == 3:
        return list(value)
    raise InputError(
        f"the function of {name} gave {len(value)} targets; it must give one, or {_TRIPLE_HINT}."
    )


def _as_target(name: str, target: Any, shape: tuple[int, ...]) -> Array:
    """A target. One that does not move was checked when its task was made, but for a robot's own
    shape.
    """
    if type(target) is np.ndarray and target.shape == shape and not target.flags.writeable:
        return target
    return as_array(name, target, shape)


@lru_cache(maxsize=64)
def _zeros(shape: tuple[int, ...]) -> Array:
    return frozen(np.zeros(shape))


def _set_validated_fields(task: Task, **shapes: tuple[int | None, ...]) -> None:
    """Check gains and weight, and copy the targets that do not move; kd is critically damped, 2
    √kp, by default.

    shapes: of each target as far as the task knows it, the one that may be a function of time
        first.
    """
    as_string("name of a task", task.name)
    if isinstance(task, OrientationTask | FrameTask):
        as_string("frame of a task", task.frame)
    fields: dict[str, object] = {
        "weight": as_positive(f"weight of {task.name}", task.weight, allow_zero=True)
    }
    if isinstance(task, CoMTask | OrientationTask | FrameTask | PostureTask):
        kp = fields["kp"] = as_positive(f"kp of {task.name}", task.kp, "1/s²", allow_zero=True)
        kd = 2.0 * kp**0.5 if task.kd is None else task.kd
        fields["kd"] = as_positive(f"kd of {task.name}", kd, "1/s", allow_zero=True)
    first, time_varying = next(iter(shapes)), False
    for name, shape in shapes.items():
        target, label = getattr(task, name), f"{name} of {task.name}"
        if name == first and callable(target) and not isinstance(target, type):
            time_varying, _ = True, as_callable(label, target, f"{name}(t)")
        elif name != first and callable(target):
            raise InputError(
                f"{label} cannot be a function: let {first} be one, and give {_TRIPLE_HINT}."
            )
        elif (
            target is not None or getattr(type(task), name, ...) is not None
        ):  # None counts where it is the default
            array = (
                as_forces(target, None, label)
                if task.block == "forces"
                else as_array(label, target, shape)
            )
            fields[name] = nearest_rotation(task.name, array) if name == "rotation" else array
            if time_varying and np.any(array):
                raise InputError(
                    f"{label} must be left out, for {first} is a function: let it give "
                    f"{_TRIPLE_HINT}."
                )
    for name, value in fields.items():
        object.__setattr__(task, name, value)


@dataclass(frozen=True, eq=False)
class CoMTask(Value):
    """Bring the centre of mass to a position; residual in q̈, m/s².

    position: shape (3,), m, world; or a function of t that gives it, or (position, velocity,
        acceleration).
    velocity, acceleration: shape (3,), m/s and m/s², world, of a target that is no function.
    kp, kd: gains, 1/s² and 1/s; kd is critically damped by default.
    weight: of ½‖residual‖² in the objective.
    name: in messages and tables.
    """

    position: Target
    velocity: npt.ArrayLike = _ZERO3
    acceleration: npt.ArrayLike = _ZERO3
    kp: float = 100.0
    kd: float | None = None
    weight: float = 10.0
    name: str = "centre of mass"
    block: ClassVar[Block] = "qdd"

    def __post_init__(self) -> None:
        _set_validated_fields(self, position=(3,), velocity=(3,), acceleration=(3,))

    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> Affine:
        """J_com q̈ + J̇_com q̇ - a, shape (3,), m/s²."""
        _check_arguments(eom, t)
        state, (x, v, a) = eom.state, targets_at(self, eom.robot, eom.k, t)
        return _motion_residual(
            self, state.com_jacobian, state.com_drift, a, state.com - x, state.com_velocity - v
        )


@dataclass(frozen=True, eq=False)
class OrientationTask(Value):
    """Bring a frame to an orientation; residual in q̈, rad/s². The error is e = log(R R_desiredᵀ),
    rad, world-aligned.

    frame: its name; "base" is the base link.
    rotation: R_world_frame, shape (3, 3); or a function of t that gives it, or (R, angular
        velocity, angular acceleration).
    angular_velocity, angular_acceleration: shape (3,), rad/s and rad/s², world, of a target that is
        no function.
    kp, kd, weight: as for `CoMTask`.
    """

    frame: str = "base"
    rotation: Target = field(default_factory=lambda: np.eye(3))
    angular_velocity: npt.ArrayLike = _ZERO3
    angular_acceleration: npt.ArrayLike = _ZERO3
    kp: float = 100.0
    kd: float | None = None
    weight: float = 10.0
    block: ClassVar[Block] = "qdd"

    def __post_init__(self) -> None:
        _set_validated_fields(
            self, rotation=(3, 3), angular_velocity=(3,), angular_acceleration=(3,)
        )

    @property
    def name(self) -> str:
        """orientation of the frame."""
        return f"orientation of {self.frame}"

    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> Affine:
        """J_ω q̈ + J̇_ω q̇ - α, shape (3,), rad/s², world-aligned."""
        _check_arguments(eom, t)
        state, (R, omega, alpha) = eom.state, targets_at(self, eom.robot, eom.k, t)
        e = pin.log3(state.frame_pose(self.frame).rotation @ R.T)
        J, drift = state.frame_jacobian(self.frame)[3:], state.frame_drift(self.frame)[3:]
        return _motion_residual(
            self, J, drift, alpha, e, state.frame_velocity(self.frame)[3:] - omega
        )


@dataclass(frozen=True, eq=False)
class FrameTask(Value):
    """Bring a frame's origin to a position; residual in q̈, m/s². A foot that swings, a hand.

    The origin of a ball foot's frame is not where it touches: `Contacts.positions` has the sole,
    one radius lower where the frame sits in the ball's centre. So aim at `state.point(frame)`, or
    at a position one radius above the ground.

    frame: its name.
    position: shape (3,), m, world; or a function of t that gives it, or (position, velocity,
        acceleration).
    velocity, acceleration: shape (3,), m/s and m/s², world, of a target that is no function.
    kp, kd, weight: as for `CoMTask`.
    """

    frame: str
    position: Target
    velocity: npt.ArrayLike = _ZERO3
    acceleration: npt.ArrayLike = _ZERO3
    kp: float = 400.0
    kd: float | None = None
    weight: float = 10.0
    block: ClassVar[Block] = "qdd"

    def __post_init__(self) -> None:
        _set_validated_fields(self, position=(3,), velocity=(3,), acceleration=(3,))

    @property
    def name(self) -> str:
        """position of the frame."""
        return f"position of {self.frame}"

    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> Affine:
        """J q̈ + J̇ q̇ - a, shape (3,), m/s², world-aligned."""
        _check_arguments(eom, t)
        state, (x, v, a) = eom.state, targets_at(self, eom.robot, eom.k, t)
        J, drift = state.frame_jacobian(self.frame)[:3], state.frame_drift(self.frame)[:3]
        return _motion_residual(
            self, J, drift, a, state.point(self.frame) - x, state.frame_velocity(self.frame)[:3] - v
        )


@dataclass(frozen=True, eq=False)
class PostureTask(Value):
    """Bring the joints to those of a configuration; residual in q̈, rad/s².

    q: shape (nq,); its base part does not count, and (cos, sin) of joints without limits must be of
        length 1. Or a function of t that gives it, or (q, velocity, acceleration).
    velocity, acceleration: shape (d,), of the joints, of a target that is no function; 0 by
        default.
    kp, kd, weight, name: as for `CoMTask`. The weight is small, so that posture settles only what
        other tasks leave open; where posture is what matters most, as for an arm, give it more,
        such as 1.
    """

    q: Target
    velocity: npt.ArrayLike | None = None
    acceleration: npt.ArrayLike | None = None
    kp: float = 100.0
    kd: float | None = None
    weight: float = 1e-3
    name: str = "posture"
    block: ClassVar[Block] = "qdd"

    def __post_init__(self) -> None:
        _set_validated_fields(self, q=(None,), velocity=(None,), acceleration=(None,))

    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> Affine:
        """q̈_joints - a, shape (d,), rad/s²."""
        _check_arguments(eom, t)
        state, (q, v, a) = eom.state, targets_at(self, eom.robot, eom.k, t)
        joints = slice(eom.nv - eom.d, None)
        return _motion_residual(
            self, eom.S.T, np.zeros(eom.d), a, state.difference(q)[joints], state.v[joints] - v
        )


@dataclass(frozen=True, eq=False)
class ForceTask(Value):
    """Keep contact forces near a target, shape (k,), N, world, zero by default; residual in λ, N.

    With a small weight it chooses among forces of equal wrench: the force regularisation.
    """

    target: Target | None = None
    weight: float = 1e-5
    name: str = "force regularisation"
    block: ClassVar[Block] = "forces"

    def __post_init__(self) -> None:
        _set_validated_fields(self, target=(None,))

    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> Affine:
        """λ - target, shape (k,), N."""
        _check_arguments(eom, t)
        return Affine.identity(eom.k) - targets_at(self, eom.robot, eom.k, t)[0]


@dataclass(frozen=True, eq=False)
class TorqueTask(Value):
    """Keep joint torques near a target, shape (d,), N·m, zero by default; residual in τ, N·m."""

    target: Target | None = None
    weight: float = 1e-5
    name: str = "torque regularisation"
    block: ClassVar[Block] = "tau"

    def __post_init__(self) -> None:
        _set_validated_fields(self, target=(None,))

    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> Affine:
        """τ - target, shape (d,), N·m."""
        _check_arguments(eom, t)
        return Affine.identity(eom.d) - targets_at(self, eom.robot, eom.k, t)[0]


def standing_tasks(state: State) -> tuple[Task, ...]:
    """The tasks that keep a robot where `state` has it: centre of mass, base orientation, posture.

    To go elsewhere, replace the centre of mass's target: posture gives way, and settles only what
    the others leave open.
    """
    as_instance("state", state, State)
    return (
        CoMTask(state.com),
        OrientationTask("base", state.frame_pose("base").rotation),
        PostureTask(state.q),
    )


def _motion_residual(
    task: CoMTask | OrientationTask | FrameTask | PostureTask,
    J: Array,
    drift: Array,
    feedforward: Array,
    e: Array,
    e_dot: Array,
) -> Affine:
    """J q̈ + J̇ q̇ - (a_ff - kp e - kd ė)."""
    assert task.kd is not None  # set when the task was made
    return Affine(J, drift - feedforward + task.kp * e + task.kd * e_dot)


def nearest_rotation(name: str, R: Array) -> Array:
    """The rotation nearest to R (3, 3), which may be off by the rounding of printed digits or of
    float32.

    Raises `InputError` where R Rᵀ is off by more than 1e-6 of the identity, or R mirrors.
    """
    R = as_array(f"rotation of {name}", R, (3, 3))
    error = np.max(np.abs(R @ R.T - _IDENTITY))
    if not error <= _ROTATION_TOLERANCE or cross(R[0], R[1]) @ R[2] < 0:
        raise InputError(
            f"rotation of {name} is not a rotation matrix: its columns must be orthonormal, "
            f"determinant +1."
        )
    if error < _ROTATION_ROUNDING:
        return R
    U, _, Vt = np.linalg.svd(R)
    return read_only(U @ Vt)
