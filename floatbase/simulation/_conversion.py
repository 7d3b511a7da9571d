"""Conversion of robot states between Pinocchio's convention and MuJoCo's.

The package follows Pinocchio: quaternion x y z w, base velocity in the base frame, joints in
Pinocchio's order. MuJoCo uses quaternion w x y z, the linear base velocity in the world frame, the
angular base velocity in the base frame, and joints in the URDF's order.
"""

from __future__ import annotations

import mujoco
import numpy as np
import numpy.typing as npt

from floatbase._validation import Array
from floatbase.robots import Robot, State


class Conversion:
    """Map q and v of a robot to qpos and qvel of its MuJoCo model, and back."""

    def __init__(self, robot: Robot, model: mujoco.MjModel):
        self._robot = robot
        self._n_base = 6 if robot.is_floating else 0
        mujoco_ids = [model.joint(name).id for name in robot.joint_names]
        self._qpos_indices = model.jnt_qposadr[mujoco_ids]
        self._qvel_indices = model.jnt_dofadr[mujoco_ids]
        joint_ids = [robot.model.getJointId(name) for name in robot.joint_names]
        self._q_indices = np.array(robot.model.idx_qs)[joint_ids]
        # Pinocchio stores the angle of such a joint as (cos, sin)
        self._is_continuous = np.array(robot.model.nqs)[joint_ids] == 2
        self._cos_indices = self._q_indices[self._is_continuous]
        base = [0, 1, 2, 4, 5, 6, 3] if self._n_base else []
        # index in qpos of each entry of q
        self.qpos_of_q = np.array(base + [0] * (robot.nq - len(base)), dtype=int)
        self.qpos_of_q[self._q_indices] = self._qpos_indices
        self.qpos_of_q[self._cos_indices + 1] = self._qpos_indices[self._is_continuous]
        self.qvel_of_v = np.concatenate([np.arange(self._n_base), self._qvel_indices])

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
            v[:3] = rotation_matrix(qpos[3:7]).T.dot(qvel[:3])
        return v

    def joint_state(self, qpos: Array, qvel: Array) -> tuple[Array, Array]:
        """Return joint positions [rad or m] and velocities in the order of τ, shape (d,) each.

        Positions of joints without limits may lie beyond π.
        """
        return qpos[self._qpos_indices], qvel[self._qvel_indices]

    def to_mujoco(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Return MuJoCo's qpos and qvel for q and v."""
        qpos, qvel = np.empty(self._robot.d + (7 if self._n_base else 0)), np.empty(self._robot.nv)
        if self._n_base:
            qpos[:7] = q[[0, 1, 2, 6, 3, 4, 5]]
            qvel[:3], qvel[3:6] = rotation_matrix(qpos[3:7]) @ v[:3], v[3:6]
        qpos[self._qpos_indices], qvel[self._qvel_indices] = q[self._q_indices], v[self._n_base :]
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


def rotation_matrix(wxyz: npt.ArrayLike) -> Array:
    """Return the rotation matrix, shape (3, 3), of a unit quaternion w x y z."""
    R = np.empty(9)
    mujoco.mju_quat2Mat(R, wxyz)
    return R.reshape(3, 3)
