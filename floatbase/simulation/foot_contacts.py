"""Contacts between a robot's feet and the ground, as MuJoCo reports them."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
import numpy.typing as npt

from floatbase._validation import Array
from floatbase.simulation.ground import Ground, box_distance


class FootContacts:
    """Reader of the feet's contacts in a MuJoCo model's data."""

    def __init__(self, model: mujoco.MjModel, ground: Ground, point_names: Sequence[str]):
        self._ground, self._n_planes = ground, len(ground.normals)
        n_planes = self._n_planes
        self.geoms = np.array([model.geom(name).id for name in point_names], dtype=int)
        # in a valley, a ball can touch two planes, and in the corner of a step two boxes
        self.max_contacts = len(self.geoms) * (n_planes + min(len(ground.boxes), 2))
        self._radii = model.geom_size[self.geoms, :1]
        self._are_wheels = (model.geom_type[self.geoms] == mujoco.mjtGeom.mjGEOM_ELLIPSOID)[:, None]
        self._is_foot = np.isin(np.arange(model.ngeom), self.geoms)
        # one frame for each plane, which is a geom; known from its first contact on
        self._contact_frames = np.zeros((n_planes, 3, 3))
        self._planes_without_frame = set(range(n_planes))

    def read(
        self, model: mujoco.MjModel, data: mujoco.MjData, link_collisions: bool
    ) -> tuple[npt.NDArray[np.int32], Array]:
        """Return the n contacts of the feet at this instant."""
        contact = data.contact
        forces = data.efc_force
        n_others = data.ne + data.nf + data.nl
        if n_others:  # the contacts follow connections, dry friction and joints at their limits
            forces = forces[n_others:]
        geoms = contact.geom  # from the plane to a ball or a link; a ball comes before a box
        if forces.size != 3 * len(geoms):
            # a ball that barely touches has no force; a cone other than ours has other sizes
            forces = np.zeros((len(geoms), 6))
            for i, wrench in enumerate(forces):
                mujoco.mj_contactForce(model, data, i, wrench)
            forces = forces[:, :3].ravel()
        if self._planes_without_frame and len(geoms):
            # all balls on a plane share one contact frame, which never changes
            for i, (plane, geom) in enumerate(geoms.tolist()):
                if self._is_foot[geom] and plane < self._n_planes:
                    self._contact_frames[plane] = contact.frame[i].reshape(3, 3)
                    self._planes_without_frame.discard(plane)
        if self._ground.boxes:
            geoms, forces = self._with_boxes(geoms, forces, contact.frame)
        if link_collisions:
            feet = self._is_foot[geoms[:, 1]]
            geoms, forces = geoms[feet], forces.reshape(-1, 3)[feet].ravel()
        return geoms, forces

    def _with_boxes(
        self, geoms: npt.NDArray[np.int32], forces: Array, frames: Array
    ) -> tuple[npt.NDArray[np.int32], Array]:
        """Return contacts in the order ground, foot or link, with world-frame forces on boxes.

        `frames`, shape (n, 9), are MuJoCo's contact frames: the normal, which points from the first
        geom to the second one, and two tangents.
        """
        forces = forces.reshape(-1, 3).copy()
        swapped = self._is_foot[geoms[:, 0]]  # the force on the second geom is on the box
        on_box = swapped | (geoms[:, 0] >= self._n_planes)
        axes = frames.reshape(-1, 3, 3)[on_box]
        forces[on_box] = np.einsum("ij,ijk->ik", forces[on_box], axes)
        forces[swapped] *= -1.0
        return np.where(swapped[:, None], geoms[:, ::-1], geoms), forces.ravel()

    def forces(self, geoms: npt.NDArray[np.int32], contact_frame_forces: Array) -> Array:
        """Return the forces on the contact points at N instants."""
        n = len(geoms)
        planes = geoms[:, :, 0]
        foot_geoms = geoms[:, :, 1]
        forces = np.zeros((n, len(self._is_foot), 3))
        per_contact = contact_frame_forces.reshape(*foot_geoms.shape, 3)
        for plane, frame in enumerate(self._contact_frames):
            # no ball touches a plane twice, so each entry is added to once
            rows, columns = np.nonzero(planes == plane)
            forces[rows, foot_geoms[rows, columns]] += per_contact[rows, columns] @ frame
        rows, columns = np.nonzero(planes >= self._n_planes)
        np.add.at(forces, (rows, foot_geoms[rows, columns]), per_contact[rows, columns])
        return forces[:, self.geoms]

    def positions(self, centres: Array, rotations: Array) -> Array:
        """Return the point of each ball or wheel nearest to the ground, in the world frame.

        `centres`, shape (…, points, 3), and `rotations`, shape (…, points, 9), are those of geoms.
        """
        distances = centres @ self._ground.normals.T - self._ground.offsets
        directions = self._ground.normals[np.argmin(distances, axis=-1)]
        if self._ground.boxes:
            least = distances.min(axis=-1)
            for bounds in self._ground.box_bounds:
                distance, direction = box_distance(centres, bounds)
                nearer = distance < least
                least = np.where(nearer, distance, least)
                directions = np.where(nearer[..., None], direction, directions)
        if self._are_wheels.any():
            axles = rotations[..., 2::3]  # the z axes
            in_wheel = directions - (directions * axles).sum(-1, keepdims=True) * axles
            length = np.linalg.norm(in_wheel, axis=-1, keepdims=True)
            # a wheel that lies flat touches the ground everywhere
            u = np.divide(in_wheel, length, out=np.zeros_like(in_wheel), where=length > 0.0)
            directions = np.where(self._are_wheels, u, directions)
        positions: Array = centres - self._radii * directions
        return positions
