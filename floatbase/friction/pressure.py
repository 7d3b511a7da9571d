"""Where the ground pushes: centre of pressure, and the wrench that a sole's corners make (note 9 of
the course text).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array, as_forces, as_instance, read_only
from floatbase.dynamics import Contacts, grasp_matrix
from floatbase.errors import InputError
from floatbase.robots import State


def contact_wrench(
    state: State, contacts: Contacts, forces: npt.ArrayLike, reference_point: npt.ArrayLike
) -> Array:
    """Σ f_i and Σ (x_i - reference_point) × f_i of contact forces, shape (6,), N and N·m, world:
    (20) and (21) about any point.

    state: where the robot is.
    contacts: those whose forces are summed; `contacts.only("left_sole_link")` for one sole.
    forces: λ of these contacts, shape (k,) or (k / 3, 3), N, world.
    reference_point: shape (3,), m, world, such as the middle of a sole,
        `state.point("left_sole_link")`.

    Four corners have twelve numbers and make six: what is left of their forces, null of this map,
    nobody can measure by the motion of a rigid sole. Raises `InputError` for contacts whose forces
    do not act at points.
    """
    points, flat = _points_and_forces(state, contacts, forces)
    return read_only(grasp_matrix(points, reference_point) @ flat)  # type: ignore[arg-type]  # it is checked there


def centre_of_pressure(state: State, contacts: Contacts, forces: npt.ArrayLike) -> Array:
    """Σ (n_i · f_i) x_i / Σ n_i · f_i: the mean of the contact points, weighted by their normal
    forces, shape (3,), m, world.

    About it the forces of a sole have no tangential moment: from the wrench (f, τ) about a point x
    on a level sole it is x + (-τ_y, τ_x, 0) / f_z. Of all contacts on level ground it is the
    zero-moment point (ZMP). It is inside the convex hull of the points as long as none of them
    pulls.

    state, contacts, forces: as for `contact_wrench`.

    Raises `InputError` where the normal forces add up to none. Source: Sardain and Bessonnet,
    Forces acting on a biped robot: center of pressure - zero moment point, 2004.
    """
    points, flat = _points_and_forces(state, contacts, forces)
    normal = np.sum(contacts.normals * flat.reshape(-1, 3), axis=1)
    total = float(normal.sum())
    if not total > _MIN_TOTAL_FORCE:
        raise InputError(
            f"the normal forces add up to {total:g} N; without pressure there is no centre of "
            f"pressure."
        )
    return read_only(normal @ points / total)


_MIN_TOTAL_FORCE = 1e-9  # N: rounding of forces that carry nothing


def _points_and_forces(
    state: State, contacts: Contacts, forces: npt.ArrayLike
) -> tuple[Array, Array]:
    """Where the forces act, (n, 3), and the forces, (3 n,)."""
    as_instance("contacts", contacts, Contacts)
    if contacts.k != 3 * contacts.n_points:
        raise InputError(
            f"the forces of {contacts!r} do not all act at points: choose those that do, "
            f"contacts.only(…)."
        )
    return contacts.positions(as_instance("state", state, State)), as_forces(forces, contacts.k)
