"""States of robots: checked, immutable, with kinematics that are computed once."""

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
    """A configuration q = (q_base, q_jnt) and a velocity v of a robot, with all derived quantities.

    A state is immutable; `state.replace(q=…)` returns a new one. Jacobians, velocities and drifts
    of frames are expressed in world axes at the origin of the frame.

    Parameters
    ----------
    robot : Robot
        Robot, as returned by `fb.load`.
    q : array_like, shape (nq,)
        Base position [m, world frame], base quaternion x y z w, joints [rad or m].
    v : array_like, shape (nv,), optional
        Base linear [m/s] and angular [rad/s] velocity **in the base frame**, then joint velocities
        [rad/s or m/s]; 0 by default.

    Raises
    ------
    InputError
        If a shape is wrong, an entry is not finite, or a quaternion, or a (cos, sin) pair of a
        joint without limits, is not of unit length.

    Notes
    -----
    [FBR]_, eq. (2).

    Examples
    --------
    >>> state = fb.load("go2").standing()
    >>> state.replace(v=np.zeros(18)).com.shape
    (3,)
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
    def unchecked(cls, robot: Robot, q: Array, v: Array) -> State:
        """Make a state without checks, for loops that have checked the arrays.

        Parameters
        ----------
        robot : Robot
            The robot.
        q : ndarray, shape (nq,)
            Configuration, float64 and finite, with unit quaternions and (cos, sin) pairs of unit
            length; nothing may write to it later.
        v : ndarray, shape (nv,)
            Velocity, float64 and finite; nothing may write to it later.

        Returns
        -------
        State
            The state.
        """
        state = object.__new__(cls)
        vars(state).update(robot=robot, q=frozen(q.view()), v=frozen(v.view()))
        return state

    @property
    def _data(self) -> pin.Data:
        """Pinocchio's results at (q, v).

        The results hold the kinematics; others may be added without changing these. Never return
        them to the user, since the next state that this thread uses overwrites them.
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
        """Generalized inertia matrix M(q) of eq. (1), shape (nv, nv), positive definite.

        M is symmetric and includes the rotor inertias.
        """
        return frozen(pin.crba(self.robot.model, self._data, self.q, pin.Convention.WORLD))

    @cached_property
    def h(self) -> Array:
        """Generalized bias force h(q, q̇) of eq. (1), shape (nv,).

        h contains the Coriolis, centrifugal and gravity terms.
        """
        return frozen(pin.nonLinearEffects(self.robot.model, self._data, self.q, self.v))

    @cached_property
    def _centre_of_mass(self) -> tuple[Array, Array, Array]:
        """Position, velocity and drift of the centre of mass."""
        data = self._data
        com = pin.centerOfMass(self.robot.model, data, pin.KinematicLevel.ACCELERATION, False)
        return frozen(com), frozen(data.vcom[0].copy()), frozen(data.acom[0].copy())

    @property
    def com(self) -> Array:
        """Position of the centre of mass, shape (3,), world frame [m]."""
        return self._centre_of_mass[0]

    @property
    def com_velocity(self) -> Array:
        """Velocity of the centre of mass, shape (3,), world frame [m/s]."""
        return self._centre_of_mass[1]

    @cached_property
    def com_jacobian(self) -> Array:
        """Jacobian of the centre of mass, shape (3, nv), world frame.

        The Jacobian satisfies com_velocity = com_jacobian v.
        """
        J = frozen(pin.jacobianCenterOfMass(self.robot.model, self._data, False))
        return J.reshape(3, self.robot.nv)  # for one joint Pinocchio returns shape (3,)

    @property
    def com_drift(self) -> Array:
        """Drift J̇ v of the centre of mass, shape (3,), world frame [m/s²].

        The drift is the acceleration of the centre of mass if q̈ = 0.
        """
        return self._centre_of_mass[2]

    @cached_property
    def _centroidal(self) -> tuple[Array, Array]:
        """Return the matrix and the drift of the centroidal momentum."""
        model, data = self.robot.model, self._data
        # Pinocchio gives (6,) for one joint
        rate_matrix = pin.dccrba(model, data, self.q, self.v).reshape(6, model.nv)
        return read_only(data.Ag.reshape(6, model.nv)), frozen(rate_matrix @ self.v)

    @property
    def centroidal_matrix(self) -> Array:
        """Matrix A_g of the centroidal momentum A_g v, shape (6, nv), world axes.

        The first three rows are the linear momentum [kg·m/s], and the last three the angular
        momentum about the centre of mass [kg·m²/s].

        Notes
        -----
        The matrix is defined in [Orin2013]_.
        """
        return self._centroidal[0]

    @property
    def centroidal_drift(self) -> Array:
        """Part of the centroidal momentum's rate without q̈, Ȧ_g v, shape (6,), [N] and [N·m]."""
        return self._centroidal[1]

    @cached_property
    def joint_transforms(self) -> Array:
        """World poses of Pinocchio's joints, shape (njoints, 4, 4); joint 0 is the world."""
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
        """Return the pose of a frame in the world frame.

        Parameters
        ----------
        frame : str
            Name of the frame.

        Returns
        -------
        pinocchio.SE3
            The pose T_world_frame.

        Raises
        ------
        UnknownNameError
            If the robot has no such frame.
        """
        return pin.updateFramePlacement(self.robot.model, self._data, self.robot.frame_id(frame))

    def point(self, frame: str, offset: npt.ArrayLike = (0.0, 0.0, 0.0)) -> Array:
        """Return the position of a point that is attached to a frame.

        Parameters
        ----------
        frame : str
            Name of the frame.
        offset : array_like, shape (3,), optional
            Position of the point in the frame [m].

        Returns
        -------
        ndarray, shape (3,)
            Position in the world frame [m].

        Raises
        ------
        UnknownNameError
            If the robot has no such frame.
        """
        return read_only(self.frame_pose(frame).act(as_array("offset", offset, (3,), "m")))

    def frame_jacobian(self, frame: str) -> Array:
        """Return the Jacobian of a frame's origin.

        Parameters
        ----------
        frame : str
            Name of the frame.

        Returns
        -------
        ndarray, shape (6, nv)
            Linear rows, then angular rows, in world axes.

        Raises
        ------
        UnknownNameError
            If the robot has no such frame.
        """
        J = pin.getFrameJacobian(
            self.robot.model, self._jacobians, self.robot.frame_id(frame), WORLD_ALIGNED
        )
        return frozen(J).reshape(6, self.robot.nv)  # for one joint Pinocchio returns shape (6,)

    def frame_velocity(self, frame: str) -> Array:
        """Return the velocity of a frame's origin.

        Parameters
        ----------
        frame : str
            Name of the frame.

        Returns
        -------
        ndarray, shape (6,)
            Linear [m/s], then angular [rad/s] velocity, in world axes.

        Raises
        ------
        UnknownNameError
            If the robot has no such frame.
        """
        motion = pin.getFrameVelocity(
            self.robot.model, self._data, self.robot.frame_id(frame), WORLD_ALIGNED
        )
        return frozen(motion.vector.copy())

    def frame_drift(self, frame: str) -> Array:
        """Return the drift J̇ v of a frame, which is the acceleration of its origin if q̈ = 0.

        Parameters
        ----------
        frame : str
            Name of the frame.

        Returns
        -------
        ndarray, shape (6,)
            Linear [m/s²], then angular [rad/s²] acceleration, in world axes.

        Raises
        ------
        UnknownNameError
            If the robot has no such frame.
        """
        motion = pin.getFrameClassicalAcceleration(
            self.robot.model, self._data, self.robot.frame_id(frame), WORLD_ALIGNED
        )
        return frozen(motion.vector.copy())

    def integrate(self, dv: npt.ArrayLike) -> Array:
        """Return the configuration after a displacement.

        Parameters
        ----------
        dv : array_like, shape (nv,)
            Displacement, which is velocity times time: base part in the base frame [m and rad],
            then joints [rad or m].

        Returns
        -------
        ndarray, shape (nq,)
            The new configuration.
        """
        return read_only(
            pin.integrate(self.robot.model, self.q, as_array("dv", dv, (self.robot.nv,)))
        )

    def difference(self, q: npt.ArrayLike) -> Array:
        """Return the displacement dv from a configuration to the configuration of this state.

        Parameters
        ----------
        q : array_like, shape (nq,)
            Configuration at which the displacement starts.

        Returns
        -------
        ndarray, shape (nv,)
            The dv with `State(robot, q).integrate(dv)` = self.q.
        """
        return read_only(
            pin.difference(self.robot.model, as_array("q", q, (self.robot.nq,)), self.q)
        )

    def replace(self, q: npt.ArrayLike | None = None, v: npt.ArrayLike | None = None) -> State:
        """Return a new state with q or v replaced.

        Parameters
        ----------
        q : array_like, shape (nq,), optional
            New configuration; by default unchanged.
        v : array_like, shape (nv,), optional
            New velocity; by default unchanged.

        Returns
        -------
        State
            The new state.
        """
        return State(self.robot, self.q if q is None else q, self.v if v is None else v)

    def __repr__(self) -> str:
        moving = "at rest" if not np.any(self.v) else f"|v|={np.linalg.norm(self.v):.3g}"
        return f"State({self.robot.name}, com={np.round(self.com, 3).tolist()}, {moving})"
