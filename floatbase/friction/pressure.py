"""Centre of pressure and total wrench of contact forces."""

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
    """Return the total force and moment of contact forces about a point.

    Parameters
    ----------
    state : State
        State of the robot.
    contacts : Contacts
        Contacts whose forces are summed, such as `contacts.only("left_sole_link")` for one sole.
    forces : array_like, shape (k,) or (k / 3, 3)
        Forces λ of these contacts in the world frame [N].
    reference_point : array_like, shape (3,)
        Point about which the moment is taken, in the world frame [m], such as the middle of a sole,
        `state.point("left_sole_link")`.

    Returns
    -------
    ndarray, shape (6,)
        Force Σ f_i [N] and moment Σ (x_i - reference_point) × f_i [N·m], in world axes.

    Raises
    ------
    InputError
        If forces of the contacts do not act at points.

    Notes
    -----
    These are eqs. (20) and (21) about any point. The four corner forces of a sole have twelve
    components but only six effects on the robot. The remaining six components lie in the null space
    of this map, so the motion of a rigid sole does not reveal them.
    """
    points, flat = _points_and_forces(state, contacts, forces)
    return read_only(grasp_matrix(points, reference_point) @ flat)  # type: ignore[arg-type]  # grasp_matrix checks it


def centre_of_pressure(state: State, contacts: Contacts, forces: npt.ArrayLike) -> Array:
    """Return the centre of pressure of contact forces.

    Parameters
    ----------
    state : State
        State of the robot.
    contacts : Contacts
        Contacts that are taken together, such as `contacts.only("left_sole_link")` for one sole.
    forces : array_like, shape (k,) or (k / 3, 3)
        Forces λ of these contacts in the world frame [N].

    Returns
    -------
    ndarray, shape (3,)
        Mean of the contact points weighted by their normal forces, Σ (n_i · f_i) x_i / Σ n_i · f_i,
        in the world frame [m].

    Raises
    ------
    InputError
        If forces of the contacts do not act at points, or if the normal forces do not add up to a
        positive number.

    Notes
    -----
    About this point, the forces of a sole have no tangential moment. If the wrench about a point x
    of a level sole is (f, τ), the centre of pressure is x + (-τ_y, τ_x, 0) / f_z. For all contacts
    on level ground it is the zero-moment point (ZMP) [Vukobratovic2004]_. The centre of pressure
    lies in the convex hull of the points as long as none of them pulls. See also Sardain and
    Bessonnet, Forces acting on a biped robot: center of pressure - zero moment point, 2004.
    """
    points, flat = _points_and_forces(state, contacts, forces)
    normal = np.sum(contacts.normals * flat.reshape(-1, 3), axis=1)
    total = float(normal.sum())
    if not total > _MIN_TOTAL_FORCE:
        raise InputError(
            f"The normal forces add up to {total:g} N. A centre of pressure exists only if the "
            f"sum is positive."
        )
    return read_only(normal @ points / total)


_MIN_TOTAL_FORCE = 1e-9  # N: rounding of forces that are zero


def _points_and_forces(
    state: State, contacts: Contacts, forces: npt.ArrayLike
) -> tuple[Array, Array]:
    """Return where the forces act, (n, 3), and the forces, (3 n,)."""
    as_instance("contacts", contacts, Contacts)
    if contacts.k != 3 * contacts.n_points:
        raise InputError(
            f"Not all forces of {contacts!r} act at points. Select the contacts whose forces do "
            f"with contacts.only(…)."
        )
    return contacts.positions(as_instance("state", state, State)), as_forces(forces, contacts.k)
