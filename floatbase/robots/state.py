"""`State(robot, q, v)`: where a robot is and how it moves; validated, immutable, kinematics
computed once.
"""

from __future__ import annotations

from dataclasses import dataclass
from weakref import ref

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_instance,
    cached_property,
    frozen,
    read_only,
)
from floatbase.robots._checks import check_unit_norms
from floatbase.robots.robot import Robot

WORLD_ALIGNED = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


@dataclass(frozen=True, eq=False, repr=False, init=False)
class State(Value):
    """(2) A configuration q = (q_base, q_jnt) and a velocity v of a robot, and all that follows
    from them alone.

    A State does not change; `state.replace(q=…)` makes a new one. Jacobians, velocities and drifts
    of frames are given in the world-aligned frame at the point requested.

    robot: as from `fb.load`.
    q: shape (nq,): base position [m, world], base quaternion x y z w, joints [rad or m].
    v: shape (nv,): base linear [m/s] and angular [rad/s] velocity **in the base frame**, then joint
        velocities; 0 by default.

    Raises `InputError` for wrong shapes, entries that are not finite, and quaternions (also (cos,
    sin) of joints without limits) that are not of unit length.
    """

    _example = "robot.standing()"
    robot: Robot
    q: Array
    v: Array

    def __init__(self, robot: Robot, q: npt.ArrayLike, v: npt.ArrayLike | None = None):
        object.__setattr__(self, "robot", as_instance("robot", robot, Robot))
        object.__setattr__(self, "q", as_array("q", q, (robot.nq,)))
        object.__setattr__(
            self, "v", as_array("v", np.zeros(robot.nv) if v is None else v, (robot.nv,))
        )
        check_unit_norms(robot.model, "q", self.q, ", or use robot.standing()")

    @classmethod
    def _unchecked(cls, robot: Robot, q: Array, v: Array) -> State:
        """A state of arrays that have been checked, and that nobody else writes to."""
        state = object.__new__(cls)
        vars(state).update(robot=robot, q=frozen(q.view()), v=frozen(v.view()))
        return state

    @property
    def _data(self) -> pin.Data:
        """Pinocchio's results at (q, v): kinematics, then what is asked for, which changes none of
        them. Never handed out: the next state that this thread asks about takes this memory.
        """
        workspace = self.robot._workspace
        if workspace.state() is not self:
            # accelerations at q̈ = 0 are the drifts J̇ v
            pin.forwardKinematics(
                self.robot.model, workspace.data, self.q, self.v, np.zeros(self.robot.nv)
            )
            workspace.state, workspace.has_jacobians = ref(self), False
        return workspace.data

    @cached_property
    def M(self) -> Array:
        """The generalised inertia matrix M(q) of (1), shape (nv, nv), symmetric positive definite,
        rotor inertia included.
        """
        return frozen(pin.crba(self.robot.model, self._data, self.q, pin.Convention.WORLD))

    @cached_property
    def h(self) -> Array:
        """The generalised bias force h(q, q̇) of (1), shape (nv,): Coriolis, centrifugal and
        gravity.
        """
        return frozen(pin.nonLinearEffects(self.robot.model, self._data, self.q, self.v))

    @cached_property
    def _centre_of_mass(self) -> tuple[Array, Array, Array]:
        """Its position, velocity and drift."""
        data = self._data
        com = pin.centerOfMass(self.robot.model, data, pin.KinematicLevel.ACCELERATION, False)
        return frozen(com), frozen(data.vcom[0].copy()), frozen(data.acom[0].copy())

    @property
    def com(self) -> Array:
        """Centre of mass, shape (3,), m, world."""
        return self._centre_of_mass[0]

    @property
    def com_velocity(self) -> Array:
        """Velocity of the centre of mass, shape (3,), m/s, world."""
        return self._centre_of_mass[1]

    @cached_property
    def com_jacobian(self) -> Array:
        """Jacobian of the centre of mass, shape (3, nv): com_velocity = com_jacobian v."""
        J = frozen(pin.jacobianCenterOfMass(self.robot.model, self._data, False))
        return J.reshape(3, self.robot.nv)  # of one joint Pinocchio gives (3,)

    @property
    def com_drift(self) -> Array:
        """J̇ v of the centre of mass, shape (3,), m/s²: its acceleration when q̈ = 0."""
        return self._centre_of_mass[2]

    @cached_property
    def joint_transforms(self) -> Array:
        """World poses of Pinocchio's joints, shape (njoints, 4, 4), index = joint number (0 = the
        world).
        """
        return read_only([placement.homogeneous for placement in self._data.oMi])

    @property
    def _jacobians(self) -> pin.Data:
        """Pinocchio's results with the Jacobians of all joints."""
        data, workspace = self._data, self.robot._workspace
        if not workspace.has_jacobians:
            pin.computeJointJacobians(self.robot.model, data)
            workspace.has_jacobians = True
        return data

    def frame_pose(self, frame: str) -> pin.SE3:
        """Pose T_world_frame of a frame. Raises `UnknownNameError`."""
        return pin.updateFramePlacement(self.robot.model, self._data, self.robot.frame_id(frame))

    def point(self, frame: str, offset: npt.ArrayLike = (0.0, 0.0, 0.0)) -> Array:
        """World position, shape (3,), m, of a point at `offset` (m, in the frame)."""
        return read_only(self.frame_pose(frame).act(as_array("offset", offset, (3,), "m")))

    def frame_jacobian(self, frame: str) -> Array:
        """Jacobian of a frame's origin, shape (6, nv): linear rows, then angular rows,
        world-aligned.
        """
        J = pin.getFrameJacobian(
            self.robot.model, self._jacobians, self.robot.frame_id(frame), WORLD_ALIGNED
        )
        return read_only(J.reshape(6, self.robot.nv))  # of one joint Pinocchio gives (6,)

    def frame_velocity(self, frame: str) -> Array:
        """Linear [m/s] and angular [rad/s] velocity of a frame's origin, shape (6,), world axes."""
        return read_only(
            pin.getFrameVelocity(
                self.robot.model, self._data, self.robot.frame_id(frame), WORLD_ALIGNED
            ).vector
        )

    def frame_drift(self, frame: str) -> Array:
        """J̇ v of the frame named `frame`, shape (6,), world axes: its origin's acceleration when
        q̈ = 0, m/s² and rad/s².
        """
        motion = pin.getFrameClassicalAcceleration(
            self.robot.model, self._data, self.robot.frame_id(frame), WORLD_ALIGNED
        )
        return read_only(motion.vector)

    def integrate(self, dv: npt.ArrayLike) -> Array:
        """The configuration, shape (nq,), at the end of a motion dv.

        dv: shape (nv,), velocity times time: base part, m and rad, in the base frame, then joints.
        """
        return read_only(
            pin.integrate(self.robot.model, self.q, as_array("dv", dv, (self.robot.nv,)))
        )

    def difference(self, q: npt.ArrayLike) -> Array:
        """The dv, shape (nv,), that leads from configuration q to this state's:
        `State(robot, q).integrate(dv)` = self.q.
        """
        return read_only(
            pin.difference(self.robot.model, as_array("q", q, (self.robot.nq,)), self.q)
        )

    def replace(self, q: npt.ArrayLike | None = None, v: npt.ArrayLike | None = None) -> State:
        """A new state with q or v replaced."""
        return State(self.robot, self.q if q is None else q, self.v if v is None else v)

    def __repr__(self) -> str:
        moving = "at rest" if not np.any(self.v) else f"|v|={np.linalg.norm(self.v):.3g}"
        return f"State({self.robot.name}, com={np.round(self.com, 3).tolist()}, {moving})"
