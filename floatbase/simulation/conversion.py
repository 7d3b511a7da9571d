"""Between the two conventions for a state, in one place.

Ours (Pinocchio's): quaternion x y z w, base velocity in the base frame, joints in Pinocchio's order. MuJoCo's:
quaternion w x y z, linear base velocity in the world and angular in the base frame, joints in the URDF's order.
"""

from __future__ import annotations

import mujoco
import numpy as np

from floatbase._arrays import Array
from floatbase.errors import SimulationError
from floatbase.robots import Robot


def body_name(link: str) -> str:
    """Name in MuJoCo of a floating robot's link: its own, but for "world", which is what MuJoCo calls the ground."""
    return "world of the robot" if link == "world" else link


class Conversion:
    """Index tables between a robot and a MuJoCo model of it, and the maps made of them."""

    def __init__(self, robot: Robot, model: mujoco.MjModel):
        self._robot = robot
        self._floating = 6 if robot.is_floating else 0
        ids = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) for name in robot.joint_names]
        missing = [name for name, i in zip(robot.joint_names, ids, strict=True) if i < 0]
        if missing:
            raise SimulationError(f"MuJoCo's model of {robot.name} has no joint {missing[0]!r}.")
        self._qpos = np.array([model.jnt_qposadr[i] for i in ids], dtype=int)
        self._qvel = np.array([model.jnt_dofadr[i] for i in ids], dtype=int)
        joints = [robot.model.getJointId(name) for name in robot.joint_names]
        self._q = np.array([robot.model.idx_qs[j] for j in joints], dtype=int)
        # joints without limits are stored as (cos, sin) by Pinocchio
        self._turning = np.array([robot.model.nqs[j] == 2 for j in joints], dtype=bool)
        self._cos = self._q[self._turning]
        base = [0, 1, 2, 4, 5, 6, 3] if self._floating else []
        self._q_from = np.array(base + [0] * (robot.nq - len(base)), dtype=int)  # where each entry of q stands in qpos
        self._q_from[self._q] = self._qpos
        self._q_from[self._cos + 1] = self._qpos[self._turning]
        self._v_from = np.concatenate([np.arange(self._floating), self._qvel])
        self._inverse = np.zeros(4)

    def q(self, qpos: Array) -> Array:
        """Our q, shape (nq,), of MuJoCo's qpos."""
        q = qpos[self._q_from]
        if self._cos.size:
            q[self._cos] = np.cos(q[self._cos])
            q[self._cos + 1] = np.sin(q[self._cos + 1])
        return q

    def v(self, qpos: Array, qvel: Array) -> Array:
        """Our v, shape (nv,), of MuJoCo's qpos and qvel."""
        v = qvel[self._v_from]
        if self._floating:
            mujoco.mju_negQuat(self._inverse, qpos[3:7])
            mujoco.mju_rotVecQuat(v[:3], qvel[:3], self._inverse)
        return v

    def to_mujoco(self, q: Array, v: Array) -> tuple[Array, Array]:
        """MuJoCo's qpos and qvel of our q and v."""
        qpos, qvel = np.empty(self._robot.d + (7 if self._floating else 0)), np.empty(self._robot.nv)
        if self._floating:
            qpos[:3] = q[:3]
            qpos[3], qpos[4:7] = q[6], q[3:6]
            qvel[:3] = _rotation(qpos[3:7]) @ v[:3]
            qvel[3:6] = v[3:6]
        angles = q[self._q].copy()
        angles[self._turning] = np.arctan2(q[self._q[self._turning] + 1], angles[self._turning])
        qpos[self._qpos] = angles
        qvel[self._qvel] = v[self._floating :]
        return qpos, qvel

    def velocity_map(self, qpos: Array) -> Array:
        """T, shape (nv, nv), with MuJoCo's qvel = T v: M, h and J of the two are compared through it."""
        T = np.zeros((self._robot.nv, self._robot.nv))
        if self._floating:
            T[:3, :3] = _rotation(qpos[3:7])
            T[3:6, 3:6] = np.eye(3)
        T[self._qvel, np.arange(self._floating, self._robot.nv)] = 1.0
        return T


def _rotation(quaternion: Array) -> Array:
    """Rotation matrix of a unit quaternion w x y z."""
    R = np.empty(9)
    mujoco.mju_quat2Mat(R, quaternion)
    return R.reshape(3, 3)
