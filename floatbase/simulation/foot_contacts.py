"""Contacts between a robot's feet and the ground, as MuJoCo reports them."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
import numpy.typing as npt

from floatbase._validation import Array
from floatbase.simulation.build import Ground


class FootContacts:
    """Reader of the feet's contacts in a MuJoCo model's data.

    Parameters
    ----------
    model : mujoco.MjModel
        MuJoCo's model of the robot on the ground.
    ground : Ground
        The ground.
    point_names : sequence of str
        Names of the feet's contact points.

    Attributes
    ----------
    geoms : ndarray, shape (points,)
        MuJoCo's ids of the feet's balls.
    max_contacts : int
        Largest number of simultaneous contacts of the feet.
    """

    def __init__(self, model: mujoco.MjModel, ground: Ground, point_names: Sequence[str]):
        self._ground, n_planes = ground, len(ground.normals)
        self.geoms = np.array([model.geom(name).id for name in point_names], dtype=int)
        self.max_contacts = len(self.geoms) * n_planes  # in a valley, a ball can touch two planes
        self._radii = model.geom_size[self.geoms, :1]
        self._is_foot = np.isin(np.arange(model.ngeom), self.geoms)
        # one frame for each plane, which is a geom; known from its first contact on
        self._contact_frames = np.zeros((n_planes, 3, 3))
        self._planes_without_frame = set(range(n_planes))

    def read(
        self, model: mujoco.MjModel, data: mujoco.MjData, link_collisions: bool
    ) -> tuple[npt.NDArray[np.int32], Array]:
        """Return the n contacts of the feet at this instant.

        Parameters
        ----------
        model : mujoco.MjModel
            MuJoCo's model.
        data : mujoco.MjData
            MuJoCo's data of the model.
        link_collisions : bool
            Whether links may touch the ground, too; contacts of links are left out.

        Returns
        -------
        geoms : ndarray, shape (n, 2)
            MuJoCo's ids of plane and ball.
        forces : ndarray, shape (3 n,)
            Contact forces in the contact frames, normal component first [N].
        """
        contact, forces, n_limits = data.contact, data.efc_force, data.nl
        if n_limits:  # the contacts follow the joints that are at their limits
            forces = forces[n_limits:]
        geoms = contact.geom  # from the plane to a ball or a link
        if forces.size != 3 * len(geoms):
            # a ball that barely touches has no force; a cone other than ours has other sizes
            forces = np.zeros((len(geoms), 6))
            for i, wrench in enumerate(forces):
                mujoco.mj_contactForce(model, data, i, wrench)
            forces = forces[:, :3].ravel()
        if self._planes_without_frame and len(geoms):
            # all balls on a plane share one contact frame, which never changes
            for i, (plane, geom) in enumerate(geoms.tolist()):
                if self._is_foot[geom]:
                    self._contact_frames[plane] = contact.frame[i].reshape(3, 3)
                    self._planes_without_frame.discard(plane)
        if link_collisions:
            feet = self._is_foot[geoms[:, 1]]
            geoms, forces = geoms[feet], forces.reshape(-1, 3)[feet].ravel()
        return geoms, forces

    def forces(self, geoms: npt.NDArray[np.int32], contact_frame_forces: Array) -> Array:
        """Return the forces on the contact points at N instants.

        Parameters
        ----------
        geoms : ndarray, shape (N, n, 2)
            Ids of plane and ball, as from `read`; geom 0 stands for no contact.
        contact_frame_forces : ndarray, shape (N, 3 n)
            Forces in the contact frames, as from `read` [N].

        Returns
        -------
        ndarray, shape (N, points, 3)
            Forces in the world frame [N].
        """
        n, planes, foot_geoms = len(geoms), geoms[:, :, 0], geoms[:, :, 1]
        forces = np.zeros((n, len(self._is_foot), 3))
        per_contact = contact_frame_forces.reshape(*foot_geoms.shape, 3)
        for plane, frame in enumerate(self._contact_frames):
            # no ball touches a plane twice, so each entry is added to once
            rows, columns = np.nonzero(planes == plane)
            forces[rows, foot_geoms[rows, columns]] += per_contact[rows, columns] @ frame
        return forces[:, self.geoms]

    def positions(self, centres: Array) -> Array:
        """Return the point of each ball nearest to the ground, in the world frame.

        Parameters
        ----------
        centres : ndarray, shape (..., points, 3)
            Centres of the balls in the world frame [m].

        Returns
        -------
        ndarray, shape (..., points, 3)
            Nearest points in the world frame [m].
        """
        nearest = np.argmin(self._ground.clearances(centres), axis=-1)
        positions: Array = centres - self._radii * self._ground.normals[nearest]
        return positions
