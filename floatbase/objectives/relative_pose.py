"""Task for the pose of one frame of the robot relative to another."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._validation import Array, cross, frozen
from floatbase.errors import InputError
from floatbase.objectives._task import Shapes, Target
from floatbase.objectives.motion_tasks import MotionTask, nearest_rotation
from floatbase.robots import Robot, State

_ZERO6 = (0.0,) * 6
_LAST_ROW = (0.0, 0.0, 0.0, 1.0)  # of a homogeneous matrix
_TOLERANCE = 1e-6  # of the last row, as for rotation matrices


@dataclass(frozen=True, eq=False)
class RelativePoseTask(MotionTask):
    """A task that brings a frame to a pose relative to another frame of the robot.

    The pose (R, p) maps coordinates in `frame` to coordinates in `reference`. All quantities are
    expressed in the axes of `reference`, linear entries first: the error is e = (p - p_desired,
    log(R R_desiredᵀ)), and ė is the difference of ṗ and of the relative angular velocity from their
    targets.

    Parameters
    ----------
    frame : str
        Name of the frame, such as one hand.
    reference : str
        Name of the frame relative to which the pose is measured, such as the other hand.
    pose : array_like, shape (4, 4), or callable
        Target as a homogeneous matrix or a `pinocchio.SE3`, with the position in `reference` [m],
        or a function of the time t [s] that returns `pose` or `(pose, velocity, acceleration)`.
    velocity : array_like, shape (6,), optional
        Target velocity in `reference`: the derivative of the position [m/s], then the angular
        velocity relative to `reference` [rad/s], if `pose` is not a function.
    acceleration : array_like, shape (6,), optional
        Time derivative of `velocity` in `reference` [m/s², rad/s²], if `pose` is not a function.
    kp : float, optional
        Gain on the pose error [1/s²].
    kd : float, optional
        Gain on the velocity error [1/s]. The default, 2 √kp, is critical damping.
    weight : float, optional
        Weight of ½‖residual‖² in the objective [1/(m/s²)² and 1/(rad/s²)²].

    Notes
    -----
    With r = p_frame - p_reference and the angular velocity ω of `reference`, all in world axes, and
    R_r the rotation of `reference`, the acceleration in `reference` is R_rᵀ (r̈ - ω̇ × r -
    ω × (ω × r) - 2 ω × ṙ_rel), where ṙ_rel = ṙ - ω × r. The last two terms, the centrifugal and the
    Coriolis term, are included in the drift. For the relative Jacobian see [Jamisola2015]_.

    Examples
    --------
    Keep the relative position and orientation of a robot's two front feet:

    >>> from floatbase.objectives import RelativePoseTask
    >>> state = fb.load("go2").standing()
    >>> pose = state.frame_pose("FL_foot").actInv(state.frame_pose("FR_foot"))
    >>> RelativePoseTask("FR_foot", "FL_foot", pose).name
    'pose of FR_foot in FL_foot'
    """

    frame: str
    reference: str
    pose: Target
    velocity: npt.ArrayLike = _ZERO6
    acceleration: npt.ArrayLike = _ZERO6
    kp: float = 100.0
    kd: float | None = None
    weight: float = 10.0
    target_shapes: ClassVar[Shapes] = {"pose": (4, 4), "velocity": (6,), "acceleration": (6,)}
    compiled_as = "relative pose"

    def __post_init__(self) -> None:
        """Check that the two frames differ."""
        super().__post_init__()
        if self.reference == self.frame:
            raise InputError(
                f"frame and reference of a RelativePoseTask are both {self.frame!r}, but the pose "
                f"of a frame relative to itself is constant."
            )

    @property
    def name(self) -> str:
        """Name in messages and tables, such as "pose of left_hand in right_hand"."""
        return f"pose of {self.frame} in {self.reference}"

    def _checked(self, target: Array, robot: Robot | None) -> Array:
        if not np.max(np.abs(target[3] - _LAST_ROW)) <= _TOLERANCE:
            raise InputError(
                f"pose of {self.name} is not a homogeneous matrix. Its last row must be 0, 0, 0, 1."
            )
        pose = target.copy()
        pose[:3, :3] = nearest_rotation(self.name, target[:3, :3])
        pose[3] = _LAST_ROW
        return frozen(pose)

    def _displacement(self, start: Array, end: Array, robot: Robot) -> Array:
        turn = pin.log3(end[:3, :3] @ start[:3, :3].T)
        return np.concatenate([end[:3, 3] - start[:3, 3], turn])

    def _motion(self, state: State, x: Array, v: Array) -> tuple[Array, Array, Array, Array]:
        here, there = state.frame_pose(self.frame).copy(), state.frame_pose(self.reference)
        pose = there.actInv(here)
        to_reference, r = there.rotation.T, here.translation - there.translation
        omega = state.frame_velocity(self.reference)[3:]
        J_r, drift_r = state.frame_jacobian(self.reference), state.frame_drift(self.reference)
        J = state.frame_jacobian(self.frame) - J_r
        J[:3] += pin.skew(r) @ J_r[3:]
        drift = state.frame_drift(self.frame) - drift_r
        velocity = state.frame_velocity(self.frame) - state.frame_velocity(self.reference)
        velocity[:3] -= cross(omega, r)
        # angular: the derivative of R_rᵀ (ω_frame - ω) in the axes of the reference
        drift[:3] -= cross(drift_r[3:], r) + cross(omega, cross(omega, r) + 2.0 * velocity[:3])
        drift[3:] -= cross(omega, velocity[3:])
        e = np.concatenate([pose.translation - x[:3, 3], pin.log3(pose.rotation @ x[:3, :3].T)])
        return (
            (to_reference @ J.reshape(2, 3, -1)).reshape(6, -1),
            (drift.reshape(2, 3) @ there.rotation).ravel(),
            e,
            (velocity.reshape(2, 3) @ there.rotation).ravel() - v,
        )
