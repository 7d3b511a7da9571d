"""All contacts and constraints of a robot, stacked in order."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_instance,
    as_number,
    as_strings,
    cached_property,
    frozen,
    numeric_copy,
    read_only,
    short_repr,
)
from floatbase.dynamics._compiled import Acceleration
from floatbase.dynamics.constraints import RollingWheel
from floatbase.dynamics.contact import (
    DEFAULT_MU,
    UP,
    FlatFootContact,
    FrictionContact,
    MotionConstraint,
    PointContact,
)
from floatbase.errors import InputError, unknown_name
from floatbase.robots import Foot, Robot, State

PerFoot: TypeAlias = float | Sequence[float] | Array | Mapping[str, float]
_FRICTION_PARTS = ("mu", "normal", "point_names", "positions")  # a contact has all or none
_HINT = "fb.Contacts.points(robot, frames=[…]) makes contacts from names of frames"
Normals: TypeAlias = npt.ArrayLike | Mapping[str, npt.ArrayLike] | None


@dataclass(frozen=True, eq=False, repr=False)
class Contacts(Value):
    """The contacts and other constraints of a robot, stacked in order.

    Without any contact the robot is in free flight. The object is immutable: `only`, `without` and
    `+` make new ones. `contacts[name]` gives one contact, and iteration gives all of them.

    Parameters
    ----------
    items : sequence of MotionConstraint
        Contacts and other constraints, in the order of their forces in λ.

    Raises
    ------
    InputError
        If an item is not a contact, or if two contacts have the same name.

    Examples
    --------
    >>> robot = fb.load("go2")
    >>> contacts = fb.Contacts.points(robot, mu=0.6)
    >>> contacts
    Contacts(FL_foot, FR_foot, RL_foot, RR_foot; k=12)
    >>> contacts.without("FL_foot").k
    9
    """

    _example = "fb.Contacts.points(robot)"
    items: Sequence[MotionConstraint]

    def __post_init__(self) -> None:
        if not isinstance(self.items, Sequence) or isinstance(self.items, str):
            raise InputError(
                f"Contacts needs a list of contacts, not {short_repr(self.items)}. {_HINT}."
            )
        object.__setattr__(self, "items", tuple(self.items))
        for contact in self.items:
            if isinstance(contact, type) or not isinstance(contact, MotionConstraint):
                raise InputError(f"{short_repr(contact)} is not a contact. {_HINT}.")
            missing = [part for part in _FRICTION_PARTS if not hasattr(contact, part)]
            if 0 < len(missing) < len(_FRICTION_PARTS):
                raise InputError(
                    f"Contact {contact.name!r} has only some of the attributes of a contact with "
                    f"friction. Add the missing {', '.join(missing)}; see "
                    f"floatbase.dynamics.FrictionContact."
                )
        duplicates = sorted({name for name in self.names if self.names.count(name) > 1})
        if duplicates:
            raise InputError(
                f"Duplicate contact name {duplicates[0]!r}. Contact names must be unique."
            )

    @staticmethod
    def none() -> Contacts:
        """Make an empty set of contacts, for free flight."""
        return Contacts([])

    @staticmethod
    def points(
        robot: Robot,
        mu: PerFoot = DEFAULT_MU,
        frames: Sequence[str] | None = None,
        normals: Normals = None,
        acceleration: Acceleration = None,
    ) -> Contacts:
        """Make point contacts at the robot's feet or at other frames.

        A flat foot touches the ground at the middle of its corners; `flat_feet` uses its area. A
        wheel touches it at its lowest point, as a `floatbase.dynamics.RollingWheel`.

        Parameters
        ----------
        robot : Robot
            Robot, such as `fb.load("go2")`.
        mu : float, array_like of shape (n,), or mapping of str to float, optional
            Coefficient of friction, dimensionless: one number for all, one for each frame in
            order, or a mapping from frame names, with 0.7 for frames that it does not name.
        frames : sequence of str, optional
            Names of the frames in contact; all feet by default.
        normals : array_like of shape (3,) or (n, 3), or mapping of str to array_like, optional
            Normals in the world frame, pointing out of the ground: one for all, one for each frame
            in order, or a mapping from frame names to shape (3,). The default is straight up.
        acceleration : array_like, shape (3,), or callable, optional
            Acceleration of the ground below all these contacts, in the world frame [m/s²]: constant
            or a function `acceleration(t)` of the time [s].

        Returns
        -------
        Contacts
            One contact for each frame, with one point.

        Raises
        ------
        InputError
            If the robot has no feet and `frames` is not given.
        UnknownNameError
            If `frames`, `mu` or `normals` has a name that does not exist.
        """
        feet = _selected_feet(robot, frames, mu, normals)
        return Contacts([_make_contact(*foot_data, acceleration, flat=False) for foot_data in feet])

    @staticmethod
    def flat_feet(
        robot: Robot,
        mu: PerFoot = DEFAULT_MU,
        frames: Sequence[str] | None = None,
        normals: Normals = None,
        acceleration: Acceleration = None,
    ) -> Contacts:
        """Make flat-foot contacts, with forces at the corners of each foot.

        Parameters
        ----------
        robot : Robot
            Robot with flat feet, such as `fb.load("talos")`.
        mu : float, array_like of shape (n,), or mapping of str to float, optional
            Coefficient of friction, dimensionless, as for `points`.
        frames : sequence of str, optional
            Names of the feet in contact; all feet by default.
        normals : array_like of shape (3,) or (n, 3), or mapping of str to array_like, optional
            Normals in the world frame, pointing out of the ground, as for `points`.
        acceleration : array_like, shape (3,), or callable, optional
            Acceleration of the ground, as for `points`.

        Returns
        -------
        Contacts
            One flat-foot contact for each foot.

        Raises
        ------
        InputError
            If one of the feet has no area.
        """
        feet = _selected_feet(robot, frames, mu, normals)
        for foot, *_ in feet:
            if not foot.is_flat:
                hint = (
                    "Use fb.Contacts.points, or load the robot with "
                    "feet=[floatbase.robots.Foot(frame, corners=…)]"
                )
                raise InputError(f"{foot.frame} of {robot.name} is not a flat foot. {hint}.")
        return Contacts([_make_contact(*foot_data, acceleration) for foot_data in feet])

    @staticmethod
    def feet(
        robot: Robot,
        mu: PerFoot = DEFAULT_MU,
        normals: Normals = None,
        acceleration: Acceleration = None,
    ) -> Contacts:
        """Make contacts of all feet: flat feet with their corners, wheels that roll, and points.

        Parameters
        ----------
        robot : Robot
            Robot, such as `fb.load("talos")`. Without feet, a fixed-base robot gets no contacts.
        mu : float, array_like of shape (n,), or mapping of str to float, optional
            Coefficient of friction, dimensionless, as for `points`.
        normals : array_like of shape (3,) or (n, 3), or mapping of str to array_like, optional
            Normals in the world frame, pointing out of the ground, as for `points`.
        acceleration : array_like, shape (3,), or callable, optional
            Acceleration of the ground, as for `points`.

        Returns
        -------
        Contacts
            One contact for each foot.

        Raises
        ------
        InputError
            If a floating-base robot has no feet.
        """
        if not as_instance("robot", robot, Robot).feet:
            if not robot.is_floating:
                return Contacts.none()
            raise InputError(
                f"{robot.name} has no feet. Name them when you load the robot, "
                f'fb.load(path, feet=["…"]), or name the frames in contact, '
                f'fb.Contacts.points(robot, frames=["…"]). For free flight, use fb.Contacts.none().'
            )
        feet = _selected_feet(robot, None, mu, normals)
        return Contacts([_make_contact(*foot_data, acceleration) for foot_data in feet])

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the contacts."""
        return tuple(contact.name for contact in self.items)

    @cached_property
    def friction_contacts(self) -> tuple[FrictionContact, ...]:
        """Contacts whose forces act at points with friction cones, unlike a `LinearConstraint`."""
        return tuple(c for c in self.items if isinstance(c, FrictionContact))

    @cached_property
    def point_names(self) -> tuple[str, ...]:
        """Names of the n points that carry forces, with three entries of λ each."""
        return tuple(name for contact in self.friction_contacts for name in contact.point_names)

    @property
    def n_points(self) -> int:
        """Number of points that carry forces."""
        return len(self.point_names)

    @cached_property
    def k(self) -> int:
        """Length of λ, three for each point and one for each row of a `LinearConstraint`."""
        return sum(contact.k for contact in self.items)

    @cached_property
    def normals(self) -> Array:
        """Ground normals at the points, unit vectors of shape (n, 3), world frame."""
        return read_only(
            np.reshape([c.normal for c in self.friction_contacts for _ in c.point_names], (-1, 3))
        )

    @cached_property
    def mus(self) -> Array:
        """Coefficient of friction at each point, shape (n,), dimensionless."""
        return read_only([c.mu for c in self.friction_contacts for _ in c.point_names])

    @cached_property
    def point_force_indices(self) -> npt.NDArray[np.intp]:
        """Entries of λ that are forces at points, as indices, shape (3n,)."""
        friction = {contact.name for contact in self.friction_contacts}
        entries = np.flatnonzero(
            [contact.name in friction for contact in self.items for _ in range(contact.k)]
        )
        entries.flags.writeable = False
        return entries

    def positions(self, state: State) -> Array:
        """Compute the positions of the contact points.

        The contact point of a ball foot lies one radius below its centre.

        Parameters
        ----------
        state : State
            State of the robot.

        Returns
        -------
        ndarray, shape (n, 3)
            Positions in the world frame [m].
        """
        as_instance("state", state, State)
        return read_only(
            np.vstack([np.zeros((0, 3)), *(c.positions(state) for c in self.friction_contacts)])
        )

    def jacobian(self, state: State, t: float = 0.0) -> Array:
        """Compute the stacked Jacobian J of eq. (4).

        Parameters
        ----------
        state : State
            State of the robot.
        t : float, optional
            Time at which moving constraints are evaluated [s].

        Returns
        -------
        ndarray, shape (k, nv)
            Jacobian of the contact points in world axes; Jᵀ λ is the generalized contact force.
        """
        return self._jacobian_and_constraint(state, t)[0]

    def constraint(self, state: State, t: float = 0.0) -> tuple[Array, Array]:
        """Compute the stacked rows A q̈ = b that the contacts impose on the motion.

        Parameters
        ----------
        state : State
            State of the robot.
        t : float, optional
            Time at which moving constraints are evaluated [s].

        Returns
        -------
        A : ndarray, shape (m, nv)
            Matrix of the constraint rows.
        b : ndarray, shape (m,)
            Right-hand side [m/s², or rad/s² for angular rows].

        Notes
        -----
        [FBR]_, eq. (5).
        """
        return self._jacobian_and_constraint(state, t)[1:]

    def _jacobian_and_constraint(self, state: State, t: float) -> tuple[Array, Array, Array]:
        """Compute J, A and b, evaluating each contact once where J equals A."""
        as_instance("state", state, State)
        t = as_number("t", t, "s")
        parts = [constraint_and_jacobian(contact, state, t) for contact in self.items]
        none = np.zeros((0, state.robot.nv))
        A = frozen(np.concatenate([none, *(A for A, _, _ in parts)]))
        b = frozen(np.concatenate([np.zeros(0), *(b for _, b, _ in parts)]))
        if all(J is A for A, _, J in parts):
            return A, A, b
        return frozen(np.concatenate([none, *(J for _, _, J in parts)])), A, b

    def force_slice(self, name: str) -> slice:
        """Return the slice of λ that belongs to one contact.

        Parameters
        ----------
        name : str
            Name of the contact.

        Returns
        -------
        slice
            Entries of λ.
        """
        contact = self[name]
        start = sum(before.k for before in self.items[: self.names.index(name)])
        return slice(start, start + contact.k)

    def force_of(self, forces: npt.ArrayLike, name: str) -> Array:
        """Return the force of one contact; for a flat foot, the resultant of its corner forces.

        Parameters
        ----------
        forces : array_like, shape (k,) or (n, k)
            Contact forces λ in world axes [N], or n rows of them.
        name : str
            Name of the contact.

        Returns
        -------
        ndarray, shape (3,) or (n, 3)
            Force of the ground on the robot at this contact, in world axes [N].

        Raises
        ------
        UnknownNameError
            If there is no contact with this name.
        InputError
            If the forces of this contact do not act at points.
        """
        part = self.force_slice(self.friction_contact(name).name)
        stacked = numeric_copy(forces)
        if stacked is None or stacked.ndim not in (1, 2) or stacked.shape[-1] != self.k:
            got = f"is {short_repr(forces)}" if stacked is None else f"has shape {stacked.shape}"
            raise InputError(
                f"forces {got}, but {self!r} needs shape ({self.k},) or (n, {self.k}) [N]."
            )
        components = [stacked[..., part][..., i::3].sum(axis=-1) for i in range(3)]
        return read_only(np.stack(components, axis=-1))

    def friction_contact(self, name: str) -> FrictionContact:
        """Return a contact whose forces act at points.

        Parameters
        ----------
        name : str
            Name of the contact.

        Returns
        -------
        FrictionContact
            The contact of this name.

        Raises
        ------
        UnknownNameError
            If there is no contact with this name.
        InputError
            If the forces of this contact do not act at points.
        """
        contact = self[name]
        if not isinstance(contact, FrictionContact):
            raise InputError(
                f"The forces of {name} do not act at points, so they have no resultant. Use "
                f"force_slice to get their entries of λ."
            )
        return contact

    def only(self, *names: str) -> Contacts:
        """Select contacts by name.

        Parameters
        ----------
        *names : str
            Names of the contacts to keep.

        Returns
        -------
        Contacts
            The contacts with these names, in the order of this object.
        """
        chosen = [self[name].name for name in names]
        return Contacts([contact for contact in self.items if contact.name in chosen])

    def without(self, *names: str) -> Contacts:
        """Leave contacts out by name.

        Parameters
        ----------
        *names : str
            Names of the contacts to leave out.

        Returns
        -------
        Contacts
            The other contacts, in the order of this object.
        """
        dropped = [self[name].name for name in names]
        return Contacts([contact for contact in self.items if contact.name not in dropped])

    def __getitem__(self, name: str) -> MotionConstraint:
        if not isinstance(name, str) or name not in self.names:
            raise unknown_name("contact", name, self.names)
        return self.items[self.names.index(name)]

    def __add__(self, other: Contacts) -> Contacts:
        example = "fb.Contacts([contact])"
        as_instance("the right-hand side of Contacts + …", other, Contacts, example)
        return Contacts([*self.items, *other.items])

    def __iter__(self) -> Iterator[MotionConstraint]:
        return iter(self.items)

    def __len__(self) -> int:
        return len(self.items)

    def __repr__(self) -> str:
        return f"Contacts({', '.join(self.names)}; k={self.k})"


def constraint_and_jacobian(
    contact: MotionConstraint, state: State, t: float
) -> tuple[Array, Array, Array]:
    """Compute A and b of eq. (5) and J of eq. (4) of one contact, and check their shapes.

    Parameters
    ----------
    contact : MotionConstraint
        Contact or other constraint.
    state : State
        State of the robot.
    t : float
        Time [s].

    Returns
    -------
    A : ndarray, shape (m, nv)
        Matrix of the constraint rows, read-only.
    b : ndarray, shape (m,)
        Right-hand side [m/s², or rad/s² for angular rows], read-only.
    J : ndarray, shape (k, nv)
        Jacobian of the forces in world axes, read-only.

    Raises
    ------
    InputError
        If an array has the wrong shape.
    """
    # copied, since user code may reuse its arrays
    A, b = map(read_only, contact.constraint(state, t))
    is_A = vars(type(contact)).get("jacobian_is_constraint", False)
    J = A if is_A else read_only(contact.jacobian(state, t))
    m, nv = len(contact.row_names), state.robot.nv
    if A.shape != (m, nv) or b.shape != (m,) or J.shape != (contact.k, nv):
        required = f"they must have shapes ({m}, {nv}), ({m},) and ({contact.k}, {nv})"
        raise InputError(
            f"A, b and J of {contact.name!r} have shapes {A.shape}, {b.shape} and {J.shape}, but "
            f"{required}."
        )
    return A, b, J


def _make_contact(
    foot: Foot, mu: float, normal: Array, acceleration: Acceleration, flat: bool = True
) -> FrictionContact:
    """Make the contact of a foot: a wheel, a sole if `flat` is True, or else a point."""
    moving = {"acceleration": acceleration}
    if foot.axis is not None:
        return RollingWheel(foot.frame, foot.axis, foot.radius, normal, mu, foot.centre, **moving)
    if flat and foot.is_flat:
        return FlatFootContact(foot.frame, foot.points, normal, mu, **moving)
    return PointContact(foot.frame, normal, mu, foot.radius, foot.middle, **moving)


def _selected_feet(
    robot: Robot, frames: Sequence[str] | None, mu: PerFoot, normals: Normals
) -> list[tuple[Foot, float, Array]]:
    """Return the feet in contact, each with its coefficient of friction and its normal."""
    as_instance("robot", robot, Robot)
    feet = robot.feet
    if frames is not None:
        feet = tuple(robot.foot(frame) for frame in as_strings("frames", frames))
    if not feet:
        raise InputError(
            f'{robot.name} has no feet. Name the frames in contact, frames=["…"]; robot.frames '
            f"lists all names."
        )
    names = [foot.frame for foot in feet]
    normals = UP if normals is None else normals
    mus = _per_name("mu", mu, names, DEFAULT_MU)
    return list(zip(feet, mus, _per_name("normals", normals, names, UP, (3,)), strict=True))


def _per_name(
    argument: str, value: Any, names: Sequence[str], default: Any, shape: tuple[int, ...] = ()
) -> list[Any]:
    """Return one value for each name: the same for all, in order, or by name with a default."""
    if isinstance(value, Mapping):
        for name in (name for name in value if name not in names):
            raise unknown_name(f"contact frame in {argument}", name, names)
        return [value.get(name, default) for name in names]
    if isinstance(value, Sequence) and value and all(isinstance(entry, str) for entry in value):
        raise InputError(
            f"{argument} must be numbers, not {short_repr(value)}. Pass names of frames as "
            f"frames=[…]."
        )
    numeric = numeric_copy(value)
    is_list = isinstance(value, Sequence | np.ndarray)
    is_one = not is_list if numeric is None else numeric.ndim == len(shape)
    if is_one:
        return [value] * len(names)
    return list(as_array(argument, value, (len(names), *shape)))
