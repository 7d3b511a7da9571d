"""Contacts and constraints of a controller that a simulation can have besides the robot's feet."""

from __future__ import annotations

import mujoco
import numpy as np

from floatbase._validation import Array
from floatbase.dynamics import Contacts, FlatFootContact, PointContact, RollingWheel
from floatbase.dynamics._compiled import connected_frames
from floatbase.robots import State


def parts_of(feet: Contacts, contacts: Contacts) -> Contacts:
    """Return what a simulation can have of the contacts, besides the feet."""
    touching = PointContact, FlatFootContact, RollingWheel
    return Contacts(
        [
            each
            for each in contacts
            if each.name not in feet.names and (type(each) in touching or connected_frames(each))
        ]
    )


class Connections:
    """The welds in a MuJoCo model that connect frames as fixed frames and rigid connections do."""

    def __init__(self, model: mujoco.MjModel, contacts: Contacts):
        self.contacts = Contacts([each for each in contacts if connected_frames(each)])
        self._welds = [model.equality(name).id for name in self.contacts.names]

    def fix(self, model: mujoco.MjModel, data: mujoco.MjData, state: State) -> None:
        """Let the connections keep the poses of a state, which `data` is in."""
        for weld, contact in zip(self._welds, self.contacts, strict=True):
            pair, pose = (model.eq_obj1id[weld], model.eq_obj2id[weld]), model.eq_data[weld]
            contact.constraint(state)  # raises an error if both frames belong to one link
            point = state.point(connected_frames(contact)[0])
            # the point in the second body and in the first one, then the second's orientation in
            # the first
            for body, entries in zip(pair, (slice(3, 6), slice(0, 3)), strict=True):
                axes = data.xmat[body].reshape(3, 3)
                pose[entries] = axes.T @ (point - data.xpos[body])
            inverse = np.empty(4)
            mujoco.mju_negQuat(inverse, data.xquat[pair[0]])
            mujoco.mju_mulQuat(pose[6:10], inverse, data.xquat[pair[1]])

    def forces(self, model: mujoco.MjModel, data: mujoco.MjData) -> Array:
        """Return force [N] and moment [N·m] on each first frame in world axes, shape (6 n,)."""
        welds, forces = data.efc_id[: data.ne], data.efc_force[: data.ne]
        wrenches = np.array([forces[welds == weld] for weld in self._welds]).reshape(-1, 6)
        for weld, wrench in zip(self._welds, wrenches, strict=True):
            # MuJoCo measures turns by the vector of a quaternion, half of the angle
            axes = data.xmat[model.eq_obj2id[weld]].reshape(3, 3)
            wrench[3:] = 0.5 * axes @ wrench[3:]
        return wrenches.ravel()
