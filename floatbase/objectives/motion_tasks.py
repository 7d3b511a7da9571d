"""Motion tasks: the centre of mass, a frame's orientation and position, the joints."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._validation import Array, as_array, as_instance, cross, frozen, read_only
from floatbase.affine import Affine
from floatbase.dynamics import Block, EquationsOfMotion
from floatbase.errors import InputError
from floatbase.objectives._task import Shapes, Target, TargetTask, Task
from floatbase.robots import Robot, State
from floatbase.robots._checks import check_unit_norms

_ZERO3 = (0.0, 0.0, 0.0)
_POINT: Shapes = {"position": (3,), "velocity": (3,), "acceleration": (3,)}
# R Rᵀ - 1 of matrices printed with seven digits or stored as float32 is below
_ROTATION_TOLERANCE = 1e-6
_IDENTITY = frozen(np.eye(3))
_ROTATION_ROUNDING = 1e-14  # R Rᵀ - 1 of products of exact rotations: nothing to mend


class MotionTask(TargetTask):
    """Base of tasks that track a motion: a = a_ff - kp e - kd ė."""

    block: ClassVar[Block] = "qdd"
    kp: float
    kd: float | None

    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> Affine:
        """J q̈ + J̇ q̇ - a, m/s² or rad/s², world-aligned for a point or a frame."""
        x, v, a = self._targets(eom, t)
        J, drift, e, e_dot = self._motion(eom.state, x, v)
        assert self.kd is not None  # set when the task was made
        return Affine(J, drift - a + self.kp * e + self.kd * e_dot)

    def _motion(self, state: State, x: Array, v: Array) -> tuple[Array, Array, Array, Array]:
        """J, J̇ q̇, e and ė for a target x with velocity v."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class CoMTask(MotionTask):
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
    target_shapes: ClassVar[Shapes] = _POINT
    compiled_as = "com"

    def _motion(self, state: State, x: Array, v: Array) -> tuple[Array, Array, Array, Array]:
        return state.com_jacobian, state.com_drift, state.com - x, state.com_velocity - v


@dataclass(frozen=True, eq=False)
class OrientationTask(MotionTask):
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
    target_shapes: ClassVar[Shapes] = {
        "rotation": (3, 3),
        "angular_velocity": (3,),
        "angular_acceleration": (3,),
    }
    compiled_as = "orientation"

    @property
    def name(self) -> str:
        """orientation of the frame."""
        return f"orientation of {self.frame}"

    def _checked(self, target: Array, robot: Robot | None) -> Array:
        return nearest_rotation(self.name, target)

    def _motion(self, state: State, x: Array, v: Array) -> tuple[Array, Array, Array, Array]:
        e = pin.log3(state.frame_pose(self.frame).rotation @ x.T)
        J, drift = state.frame_jacobian(self.frame)[3:], state.frame_drift(self.frame)[3:]
        return J, drift, e, state.frame_velocity(self.frame)[3:] - v


@dataclass(frozen=True, eq=False)
class FrameTask(MotionTask):
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
    target_shapes: ClassVar[Shapes] = _POINT
    compiled_as = "frame"

    @property
    def name(self) -> str:
        """position of the frame."""
        return f"position of {self.frame}"

    def _motion(self, state: State, x: Array, v: Array) -> tuple[Array, Array, Array, Array]:
        J, drift = state.frame_jacobian(self.frame)[:3], state.frame_drift(self.frame)[:3]
        return J, drift, state.point(self.frame) - x, state.frame_velocity(self.frame)[:3] - v


@dataclass(frozen=True, eq=False)
class PostureTask(MotionTask):
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
    target_shapes: ClassVar[Shapes] = {"q": ("nq",), "velocity": ("d",), "acceleration": ("d",)}
    compiled_as = "posture"

    def _checked(self, target: Array, robot: Robot | None) -> Array:
        if robot is not None:  # the base's quaternion does not count
            first_joint = 2 if robot.is_floating else 1
            check_unit_norms(robot.model, f"q of {self.name}", target, first_joint=first_joint)
        return target

    def _motion(self, state: State, x: Array, v: Array) -> tuple[Array, Array, Array, Array]:
        d = state.robot.d
        joints = slice(state.robot.nv - d, None)
        return state.robot.S.T, np.zeros(d), state.difference(x)[joints], state.v[joints] - v


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
