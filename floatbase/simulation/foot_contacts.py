"""The contacts between a robot's feet and the ground, as MuJoCo has them."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
import numpy.typing as npt

from floatbase._validation import Array
from floatbase.simulation.build import Ground


class FootContacts:
    """Reads the contacts of feet from a MuJoCo model's data.

    geoms: (points,) MuJoCo's numbers of the feet's balls.
    max_contacts: the most contacts that feet have at a time.
    """

    def __init__(self, model: mujoco.MjModel, ground: Ground, point_names: Sequence[str]):
        self._ground, n_planes = ground, len(ground.normals)
        self.geoms = np.array([model.geom(name).id for name in point_names], dtype=int)
        self.max_contacts = len(self.geoms) * n_planes  # in a valley a ball touches two planes
        self._radii = model.geom_size[self.geoms, :1]
        self._is_foot = np.isin(np.arange(model.ngeom), self.geoms)
        # of each plane, which is a geom; known from its first contact on
        self._contact_frames = np.zeros((n_planes, 3, 3))
        self._planes_without_frame = set(range(n_planes))

    def read(
        self, model: mujoco.MjModel, data: mujoco.MjData, link_collisions: bool
    ) -> tuple[npt.NDArray[np.int32], Array]:
        """The n contacts of feet now: numbers of plane and ball, shape (n, 2), and forces in the
        contact frames, normal first, shape (3 n,), N.

        link_collisions: whether there may be contacts of links, too, which are left out.
        """
        contact, forces, n_limits = data.contact, data.efc_force, data.nl
        if n_limits:  # behind the joints at their limits come the contacts
            forces = forces[n_limits:]
        geoms = contact.geom  # from the plane to a ball or a link
        if forces.size != 3 * len(geoms):
            # a ball that only just touches has no force, another cone than ours has others
            forces = np.zeros((len(geoms), 6))
            for i, wrench in enumerate(forces):
                mujoco.mj_contactForce(model, data, i, wrench)
            forces = forces[:, :3].ravel()
        if self._planes_without_frame and len(geoms):
            # all balls on a plane have one contact frame at all times
            for i, (plane, geom) in enumerate(geoms.tolist()):
                if self._is_foot[geom]:
                    self._contact_frames[plane] = contact.frame[i].reshape(3, 3)
                    self._planes_without_frame.discard(plane)
        if link_collisions:
            feet = self._is_foot[geoms[:, 1]]
            geoms, forces = geoms[feet], forces.reshape(-1, 3)[feet].ravel()
        return geoms, forces

    def forces(self, geoms: npt.NDArray[np.int32], contact_frame_forces: Array) -> Array:
        """Forces on the points at N instants, shape (N, points, 3), N, world.

        geoms: (N, n, 2), contact_frame_forces: (N, 3 n), as from `read`, with geom 0 for none.
        """
        n, planes, foot_geoms = len(geoms), geoms[:, :, 0], geoms[:, :, 1]
        forces = np.zeros((n, len(self._is_foot), 3))
        per_contact = contact_frame_forces.reshape(*foot_geoms.shape, 3)
        for plane, frame in enumerate(self._contact_frames):
            # no ball touches a plane twice, so nothing is added to a sum twice
            rows, columns = np.nonzero(planes == plane)
            forces[rows, foot_geoms[rows, columns]] += per_contact[rows, columns] @ frame
        return forces[:, self.geoms]

    def positions(self, centres: Array) -> Array:
        """The point of each ball that is nearest to the ground, shape (…, points, 3), m, world.

        centres: (…, points, 3), m, world, of the balls.
        """
        nearest = np.argmin(self._ground.clearances(centres), axis=-1)
        positions: Array = centres - self._radii * self._ground.normals[nearest]
        return positions
