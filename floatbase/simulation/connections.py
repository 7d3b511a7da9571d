"""Contacts and constraints of a controller that a simulation can have besides the robot's feet."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin

from floatbase._validation import Array
from floatbase.dynamics import Contacts, FlatFootContact, PointContact, RollingWheel
from floatbase.dynamics._compiled import connected_frames
from floatbase.robots import State


def parts_of(feet: Contacts, contacts: Contacts) -> Contacts:
    """Return what a simulation can have of the contacts, besides the feet."""
    touching = PointContact, FlatFootContact, RollingWheel
    others = [each for each in contacts if each.name not in feet.names]
    return Contacts([each for each in others if type(each) in touching or connected_frames(each)])


class Connections:
    """The welds in a MuJoCo model that connect frames as fixed frames and rigid connections do."""

    def __init__(self, model: mujoco.MjModel, contacts: Contacts):
        self.contacts = Contacts([each for each in contacts if connected_frames(each)])
        self._welds = [model.equality(name).id for name in self.contacts.names]

    def fix(self, model: mujoco.MjModel, data: mujoco.MjData, state: State) -> None:
        """Fix the connected frames in the poses of a state; `data` is in this state."""
        for weld, contact in zip(self._welds, self.contacts, strict=True):
            pair, pose = (model.eq_obj1id[weld], model.eq_obj2id[weld]), model.eq_data[weld]
            contact.constraint(state)  # raises an error if both frames belong to one link
            point = state.point(connected_frames(contact)[0])
            # the point in the second body and in the first one, then the second's orientation in
            # the first
            first, second = (pin.SE3(data.xmat[i].reshape(3, 3), data.xpos[i]) for i in pair)
            pose[3:6], pose[:3] = first.actInv(point), second.actInv(point)
            mujoco.mju_mat2Quat(pose[6:10], (first.rotation.T @ second.rotation).ravel())

    def forces(self, model: mujoco.MjModel, data: mujoco.MjData) -> Array:
        """Return force [N] and moment [N·m] on each first frame in world axes, shape (6 n,)."""
        welds, forces = data.efc_id[: data.ne], data.efc_force[: data.ne]
        wrenches = np.zeros((len(self._welds), 6))
        for weld, wrench in zip(self._welds, wrenches, strict=True):
            rows = forces[welds == weld]
            if rows.size:  # a weld of two bodies that cannot move has none
                # MuJoCo measures rotations by the vector part of a quaternion, half of the angle
                axes = data.xmat[model.eq_obj2id[weld]].reshape(3, 3)
                wrench[:3], wrench[3:] = rows[:3], 0.5 * axes @ rows[3:]
        return wrenches.ravel()
