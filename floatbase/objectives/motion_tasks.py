"""Motion tasks for the centre of mass, frames and joints."""

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
# R Rᵀ - 1 is smaller for matrices printed with seven digits or stored as float32
_ROTATION_TOLERANCE = 1e-6
_IDENTITY = frozen(np.eye(3))
_ROTATION_ROUNDING = 1e-14  # R Rᵀ - 1 of products of exact rotations: no correction needed


class MotionTask(TargetTask):
    """Base of tasks that track a motion: a = a_ff - kp e - kd ė."""

    block: ClassVar[Block] = "qdd"
    kp: float
    kd: float | None

    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> Affine:
        """Compute the residual J q̈ + J̇ q̇ - a."""
        x, v, a = self._targets(eom, t)
        J, drift, e, e_dot = self._motion(eom.state, x, v)
        assert self.kd is not None  # set by the constructor
        return Affine(J, drift - a + self.kp * e + self.kd * e_dot)

    def _motion(self, state: State, x: Array, v: Array) -> tuple[Array, Array, Array, Array]:
        """Return J, J̇ q̇, e and ė for a target x with velocity v."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class CoMTask(MotionTask):
    """A task that brings the centre of mass to a position.

    Parameters
    ----------
    position : array_like, shape (3,), or callable
        Target in the world frame [m], or a function of the time t [s] that returns `position` or
        `(position, velocity, acceleration)`.
    velocity : array_like, shape (3,), optional
        Target velocity in the world frame [m/s], if `position` is not a function.
    acceleration : array_like, shape (3,), optional
        Target acceleration in the world frame [m/s²], if `position` is not a function.
    kp : float, optional
        Gain on the position error [1/s²].
    kd : float, optional
        Gain on the velocity error [1/s]. The default, 2 √kp, is critical damping.
    weight : float, optional
        Weight of ½‖residual‖² in the objective [1/(m/s²)²].
    name : str, optional
        Name in messages and tables.

    Examples
    --------
    Keep the centre of mass 2 cm above its standing position:

    >>> state = fb.load("go2").standing()
    >>> task = fb.CoMTask(state.com + [0.0, 0.0, 0.02])
    >>> task.kp, task.kd
    (100.0, 20.0)
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
    """A task that brings a frame to an orientation.

    The error is e = log(R R_desiredᵀ), a rotation vector in world axes [rad].

    Parameters
    ----------
    frame : str, optional
        Name of the frame; "base" is the base link.
    rotation : array_like, shape (3, 3), or callable, optional
        Target rotation matrix from the frame to the world, dimensionless, or a function of the time
        t [s] that returns `rotation` or `(rotation, angular_velocity, angular_acceleration)`. The
        default is the identity.
    angular_velocity : array_like, shape (3,), optional
        Target angular velocity in the world frame [rad/s], if `rotation` is not a function.
    angular_acceleration : array_like, shape (3,), optional
        Target angular acceleration in the world frame [rad/s²], if `rotation` is not a function.
    kp : float, optional
        Gain on the orientation error [1/s²].
    kd : float, optional
        Gain on the angular velocity error [1/s]. The default, 2 √kp, is critical damping.
    weight : float, optional
        Weight of ½‖residual‖² in the objective [1/(rad/s²)²].
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
        """Name in messages and tables, such as "orientation of base"."""
        return f"orientation of {self.frame}"

    def _checked(self, target: Array, robot: Robot | None) -> Array:
        return nearest_rotation(self.name, target)

    def _displacement(self, start: Array, end: Array, robot: Robot) -> Array:
        displacement: Array = pin.log3(end @ start.T)
        return displacement

    def _motion(self, state: State, x: Array, v: Array) -> tuple[Array, Array, Array, Array]:
        e = pin.log3(state.frame_pose(self.frame).rotation @ x.T)
        J, drift = state.frame_jacobian(self.frame)[3:], state.frame_drift(self.frame)[3:]
        return J, drift, e, state.frame_velocity(self.frame)[3:] - v


@dataclass(frozen=True, eq=False)
class FrameTask(MotionTask):
    """A task that brings a frame's origin to a position, such as a swing foot or a hand.

    The origin of a ball foot's frame is not its contact point, which `Contacts.positions` gives. If
    the frame lies at the centre of the ball, the contact point is one radius lower. So use
    `state.point(frame)`, or a position one radius above the ground, as the target.

    Parameters
    ----------
    frame : str
        Name of the frame.
    position : array_like, shape (3,), or callable
        Target in the world frame [m], or a function of the time t [s] that returns `position` or
        `(position, velocity, acceleration)`.
    velocity : array_like, shape (3,), optional
        Target velocity in the world frame [m/s], if `position` is not a function.
    acceleration : array_like, shape (3,), optional
        Target acceleration in the world frame [m/s²], if `position` is not a function.
    kp : float, optional
        Gain on the position error [1/s²].
    kd : float, optional
        Gain on the velocity error [1/s]. The default, 2 √kp, is critical damping.
    weight : float, optional
        Weight of ½‖residual‖² in the objective [1/(m/s²)²].
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
        """Name in messages and tables, such as "position of FL_foot"."""
        return f"position of {self.frame}"

    def _motion(self, state: State, x: Array, v: Array) -> tuple[Array, Array, Array, Array]:
        J, drift = state.frame_jacobian(self.frame)[:3], state.frame_drift(self.frame)[:3]
        return J, drift, state.point(self.frame) - x, state.frame_velocity(self.frame)[:3] - v


@dataclass(frozen=True, eq=False)
class PostureTask(MotionTask):
    """A task that brings the joints to the positions of a configuration.

    The default weight is small, so that the posture decides only what other tasks leave open. If
    the posture matters most, as for an arm, increase the weight, for example to 1.

    Parameters
    ----------
    q : array_like, shape (nq,), or callable
        Target configuration [rad, or m for prismatic joints], or a function of the time t [s] that
        returns `q` or `(q, velocity, acceleration)`. The base part is ignored. The pair (cos, sin)
        of a joint without limits must have length 1.
    velocity : array_like, shape (d,), optional
        Target joint velocities [rad/s, m/s], if `q` is not a function; zero by default.
    acceleration : array_like, shape (d,), optional
        Target joint accelerations [rad/s², m/s²], if `q` is not a function; zero by default.
    kp : float, optional
        Gain on the position error [1/s²].
    kd : float, optional
        Gain on the velocity error [1/s]. The default, 2 √kp, is critical damping.
    weight : float, optional
        Weight of ½‖residual‖² in the objective [1/(rad/s²)²].
    name : str, optional
        Name in messages and tables.
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
        if robot is not None:  # the base's quaternion is ignored
            first_joint = 2 if robot.is_floating else 1
            check_unit_norms(robot.model, f"q of {self.name}", target, first_joint=first_joint)
        return target

    def _displacement(self, start: Array, end: Array, robot: Robot) -> Array:
        displacement: Array = pin.difference(robot.model, start, end)[robot.nv - robot.d :]
        return displacement

    def _motion(self, state: State, x: Array, v: Array) -> tuple[Array, Array, Array, Array]:
        d = state.robot.d
        joints = slice(state.robot.nv - d, None)
        return state.robot.S.T, np.zeros(d), state.difference(x)[joints], state.v[joints] - v


def standing_tasks(state: State) -> tuple[Task, ...]:
    """Make the tasks that keep a robot at a state: centre of mass, base orientation and posture.

    To move the robot, replace the target of the centre of mass. The posture task yields, because
    its small weight decides only what the other tasks leave open.

    Parameters
    ----------
    state : State
        State to keep, such as `robot.standing()`.

    Returns
    -------
    tuple of Task
        A `CoMTask`, an `OrientationTask` of the base and a `PostureTask`.

    Examples
    --------
    >>> state = fb.load("go2").standing()
    >>> [task.name for task in fb.standing_tasks(state)]
    ['centre of mass', 'orientation of base', 'posture']
    """
    as_instance("state", state, State)
    return (
        CoMTask(state.com),
        OrientationTask("base", state.frame_pose("base").rotation),
        PostureTask(state.q),
    )


def nearest_rotation(name: str, R: Array) -> Array:
    """Return the rotation matrix nearest to a matrix with rounding errors.

    Printed digits and float32 numbers have such errors.
    """
    R = as_array(f"rotation of {name}", R, (3, 3))
    error = np.max(np.abs(R @ R.T - _IDENTITY))
    if not error <= _ROTATION_TOLERANCE or cross(R[0], R[1]) @ R[2] < 0:
        raise InputError(
            f"rotation of {name} is not a rotation matrix. Its columns must be orthonormal and its "
            f"determinant must be +1."
        )
    if error < _ROTATION_ROUNDING:
        return R
    U, _, Vt = np.linalg.svd(R)
    return read_only(U @ Vt)
