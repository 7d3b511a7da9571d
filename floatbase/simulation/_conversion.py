"""Conversion of robot states between Pinocchio's convention and MuJoCo's.

The package follows Pinocchio: quaternion x y z w, base velocity in the base frame, joints in
Pinocchio's order. MuJoCo uses quaternion w x y z, the linear base velocity in the world frame, the
angular base velocity in the base frame, and joints in the order of its own file.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
import numpy.typing as npt

from floatbase._validation import Array
from floatbase.robots import Robot, State


class Conversion:
    """Map q and v of a robot to qpos and qvel of its MuJoCo model, and back."""

    def __init__(self, robot: Robot, model: mujoco.MjModel, joints: Sequence[int] | None = None):
        """Find the free joint, and the joints in the order of τ, by default by their names."""
        self._robot, self._sizes = robot, (model.nq, model.nv)
        self._n_base = 6 if robot.is_floating else 0
        if joints is None:
            joints = [model.joint(name).id for name in robot.joint_names]
        mujoco_ids = np.array(joints, dtype=int)
        self._qpos_indices = model.jnt_qposadr[mujoco_ids]
        self._qvel_indices = model.jnt_dofadr[mujoco_ids]
        base = free_joint(model, joints) if self._n_base else 0
        position, velocity = int(model.jnt_qposadr[base]), int(model.jnt_dofadr[base])
        self._quaternion = slice(position + 3, position + 7)
        self._linear_velocity = slice(velocity, velocity + 3)
        joint_ids = [robot.model.getJointId(name) for name in robot.joint_names]
        self._q_indices = np.array(robot.model.idx_qs)[joint_ids]
        # Pinocchio stores the angle of such a joint as (cos, sin)
        self._is_continuous = np.array(robot.model.nqs)[joint_ids] == 2
        self._cos_indices = self._q_indices[self._is_continuous]
        # index in qpos of each entry of q
        self.qpos_of_q = np.zeros(robot.nq, dtype=int)
        if self._n_base:
            self.qpos_of_q[:7] = position + np.array([0, 1, 2, 4, 5, 6, 3])
        self.qpos_of_q[self._q_indices] = self._qpos_indices
        self.qpos_of_q[self._cos_indices + 1] = self._qpos_indices[self._is_continuous]
        self.qvel_of_v = np.append(velocity + np.arange(self._n_base), self._qvel_indices)

    def q(self, qpos: Array) -> Array:
        """Return q, shape (nq,), for MuJoCo's qpos."""
        q: Array = qpos[self.qpos_of_q]
        if self._cos_indices.size:
            q[self._cos_indices] = np.cos(q[self._cos_indices])
            q[self._cos_indices + 1] = np.sin(q[self._cos_indices + 1])
        return q

    def v(self, qpos: Array, qvel: Array) -> Array:
        """Return v, shape (nv,), for MuJoCo's qpos and qvel."""
        v: Array = qvel[self.qvel_of_v]
        if self._n_base:
            R = rotation_matrix(qpos[self._quaternion])
            v[:3] = R.T.dot(qvel[self._linear_velocity])
        return v

    def joint_state(self, qpos: Array, qvel: Array) -> tuple[Array, Array]:
        """Return joint positions [rad or m] and velocities in the order of τ, shape (d,) each.

        Positions of joints without limits may lie beyond π.
        """
        return qpos[self._qpos_indices], qvel[self._qvel_indices]

    def to_mujoco(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Return MuJoCo's qpos and qvel for q and v, with zeros for other joints."""
        qpos, qvel = np.zeros(self._sizes[0]), np.zeros(self._sizes[1])
        qpos[self.qpos_of_q], qvel[self.qvel_of_v] = q, v
        if self._n_base:
            R = rotation_matrix(qpos[self._quaternion])
            qvel[self._linear_velocity] = R @ v[:3]
        qpos[self._qpos_indices[self._is_continuous]] = np.arctan2(
            q[self._cos_indices + 1], q[self._cos_indices]
        )
        return qpos, qvel

    def dynamics(self, data: mujoco.MjData, state: State) -> tuple[Array, Array]:
        """Move MuJoCo's robot to a state, and return its M and h in the package's convention."""
        nv = self._robot.nv
        data.qpos[:], data.qvel[:] = self.to_mujoco(state.q, state.v)
        mujoco.mj_fwdPosition(data.model, data)
        mujoco.mj_fwdVelocity(data.model, data)
        T, T_dot_v = np.zeros((nv, nv)), np.zeros(nv)  # qvel = T v
        T[self.qvel_of_v, np.arange(nv)] = 1.0
        if self._n_base:
            T[:3, :3] = rotation_matrix(data.qpos[3:7])
            T_dot_v[:3] = T[:3, :3] @ np.cross(state.v[3:6], state.v[:3])
        M = np.zeros((nv, nv))
        mujoco.mj_fullM(data.model, data, M)
        return T.T @ M @ T, T.T @ (data.qfrc_bias + M @ T_dot_v)


def free_joint(model: mujoco.MjModel, joints: Sequence[int]) -> int:
    """Return the first joint of the tree that has the joints, or of the model without joints."""
    return int(model.body_jntadr[model.body_rootid[model.jnt_bodyid[joints[0]]]]) if joints else 0


def rotation_matrix(wxyz: npt.ArrayLike) -> Array:
    """Return the rotation matrix, shape (3, 3), of a unit quaternion w x y z."""
    R = np.empty(9)
    mujoco.mju_quat2Mat(R, wxyz)
    return R.reshape(3, 3)
