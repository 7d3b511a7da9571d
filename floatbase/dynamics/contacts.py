"""The set of all contacts of a robot, stacked in order (§2.1)."""

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
    numeric_copy,
    read_only,
    short_repr,
)
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
_FRICTION_PARTS = ("mu", "normal", "point_names", "positions")  # all of them, or none
_HINT = "fb.Contacts.points(robot, frames=[…]) makes them from names"
Normals: TypeAlias = npt.ArrayLike | Mapping[str, npt.ArrayLike] | None


@dataclass(frozen=True, eq=False, repr=False)
class Contacts(Value):
    """Contacts and other constraints stacked in order; none at all for free flight. `only`,
    `without` and `+` make new ones.

    Raises `InputError` for a name that stands twice.
    """

    _example = "fb.Contacts.points(robot)"
    items: Sequence[MotionConstraint]

    def __post_init__(self) -> None:
        if not isinstance(self.items, Sequence) or isinstance(self.items, str):
            raise InputError(
                f"Contacts takes a list of contacts, not {short_repr(self.items)}; {_HINT}."
            )
        object.__setattr__(self, "items", tuple(self.items))
        for contact in self.items:
            if isinstance(contact, type) or not isinstance(contact, MotionConstraint):
                raise InputError(f"{short_repr(contact)} is no contact; {_HINT}.")
            lacks = [part for part in _FRICTION_PARTS if not hasattr(contact, part)]
            if 0 < len(lacks) < len(_FRICTION_PARTS):
                raise InputError(
                    f"contact {contact.name!r} has friction but no {' and no '.join(lacks)}; see "
                    f"floatbase.dynamics.FrictionContact."
                )
        duplicates = sorted({name for name in self.names if self.names.count(name) > 1})
        if duplicates:
            raise InputError(
                f"contact {duplicates[0]!r} stands twice in the list; each name may stand once."
            )

    @staticmethod
    def none() -> Contacts:
        """No contacts: free flight."""
        return Contacts([])

    @staticmethod
    def points(
        robot: Robot,
        mu: PerFoot = DEFAULT_MU,
        frames: Sequence[str] | None = None,
        normals: Normals = None,
    ) -> Contacts:
        """Point contacts at the robot's feet. A flat foot touches at the middle of its corners;
        `flat_feet` uses its area.

        robot: as from `fb.load`.
        mu: coefficient of friction: one number for all, (n,) in the order of the frames, or a
            mapping from frame to number, 0.7 where it has none.
        frames: names of the frames that touch; all feet by default.
        normals: world, out of the ground: (3,) for all, (n, 3) in the order of the frames, or a
            mapping from frame to (3,); straight up by default.
        """
        return Contacts(
            [
                _make_contact(*foot_data, flat=False)
                for foot_data in _selected_feet(robot, frames, mu, normals)
            ]
        )

    @staticmethod
    def flat_feet(
        robot: Robot,
        mu: PerFoot = DEFAULT_MU,
        frames: Sequence[str] | None = None,
        normals: Normals = None,
    ) -> Contacts:
        """Flat-foot contacts at the robot's feet with area; arguments as for `points`."""
        feet = _selected_feet(robot, frames, mu, normals)
        for foot, *_ in feet:
            if not foot.is_flat:
                hint = (
                    "use fb.Contacts.points, or load the robot with "
                    "feet=[floatbase.robots.Foot(frame, corners=…)]"
                )
                raise InputError(f"{foot.frame} of {robot.name} is not a flat foot; {hint}.")
        return Contacts([_make_contact(*foot_data) for foot_data in feet])

    @staticmethod
    def feet(robot: Robot, mu: PerFoot = DEFAULT_MU, normals: Normals = None) -> Contacts:
        """All feet of the robot as they are, flat ones with their corners, the others as points;
        none where it has none.

        mu, normals: as for `points`.
        """
        return Contacts(
            [_make_contact(*foot_data) for foot_data in _selected_feet(robot, None, mu, normals)]
            if as_instance("robot", robot, Robot).feet
            else []
        )

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the contacts."""
        return tuple(contact.name for contact in self.items)

    @cached_property
    def friction_contacts(self) -> tuple[FrictionContact, ...]:
        """Those whose forces act at points, inside friction cones; the others are constraints like
        `LinearConstraint`.
        """
        return tuple(c for c in self.items if isinstance(c, FrictionContact))

    @cached_property
    def point_names(self) -> tuple[str, ...]:
        """Names of the points that carry forces, n of them, three entries of λ each."""
        return tuple(name for contact in self.friction_contacts for name in contact.point_names)

    @property
    def n_points(self) -> int:
        """Number of points that carry forces."""
        return len(self.point_names)

    @cached_property
    def k(self) -> int:
        """Length of λ."""
        return sum(contact.k for contact in self.items)

    @cached_property
    def normals(self) -> Array:
        """Normal of each point, shape (n, 3), world."""
        return read_only(
            np.reshape([c.normal for c in self.friction_contacts for _ in c.point_names], (-1, 3))
        )

    @cached_property
    def mus(self) -> Array:
        """Coefficient of friction of each point, shape (n,)."""
        return read_only([c.mu for c in self.friction_contacts for _ in c.point_names])

    @cached_property
    def point_force_indices(self) -> npt.NDArray[np.intp]:
        """Which entries of λ are forces at points, shape (3 n,): all but those of a
        `LinearConstraint`.
        """
        friction = {contact.name for contact in self.friction_contacts}
        entries = np.flatnonzero(
            [contact.name in friction for contact in self.items for _ in range(contact.k)]
        )
        entries.flags.writeable = False
        return entries

    def positions(self, state: State) -> Array:
        """World positions of the points, shape (n, 3), m: where soles touch, for a ball foot one
        radius below its centre.
        """
        as_instance("state", state, State)
        return read_only(
            np.vstack([np.zeros((0, 3)), *(c.positions(state) for c in self.friction_contacts)])
        )

    def jacobian(self, state: State, t: float = 0.0) -> Array:
        """J of (4), shape (k, nv), at time t, s."""
        as_instance("state", state, State)
        t = as_number("t", t, "s")
        return self._stacked(
            state, [read_only(contact.jacobian(state, t)) for contact in self.items]
        )

    def constraint(self, state: State, t: float = 0.0) -> tuple[Array, Array]:
        """(5) A, shape (m, nv), and b, shape (m,), at time t, s."""
        as_instance("state", state, State)
        t = as_number("t", t, "s")
        parts = [tuple(map(read_only, contact.constraint(state, t))) for contact in self.items]
        b = np.concatenate([np.zeros(0), *(part[1] for part in parts)])
        return self._stacked(state, [part[0] for part in parts]), read_only(b)

    def _jacobian_and_constraint(self, state: State, t: float) -> tuple[Array, Array, Array]:
        """J of (4) with A and b of (5)."""
        as_instance("state", state, State)
        t = as_number("t", t, "s")
        parts = [constraint_and_jacobian(contact, state, t) for contact in self.items]
        A, b = (
            self._stacked(state, [part[0] for part in parts]),
            np.concatenate([np.zeros(0), *(part[1] for part in parts)]),
        )
        return (
            A
            if all(J is A for A, _, J in parts)
            else self._stacked(state, [part[2] for part in parts]),
            A,
            read_only(b),
        )

    def _stacked(self, state: State, rows: Sequence[Array]) -> Array:
        return read_only(np.vstack([np.zeros((0, state.robot.nv)), *rows]))

    def force_slice(self, name: str) -> slice:
        """Which entries of λ belong to a contact."""
        contact = self[name]
        start = sum(before.k for before in self.items[: self.names.index(name)])
        return slice(start, start + contact.k)

    def force_of(self, forces: npt.ArrayLike, name: str) -> Array:
        """The force of one contact among λ, shape (3,), N, world: for a flat foot the resultant of
        its corners.

        forces: λ, shape (k,), or (n, k) for n of them, which gives (n, 3). Raises
            `UnknownNameError` for a name that is no
        contact's, `InputError` for a contact whose forces do not act at points.
        """
        part = self.force_slice(self.friction_contact(name).name)
        stacked = numeric_copy(forces)
        if stacked is None or stacked.ndim not in (1, 2) or stacked.shape[-1] != self.k:
            got = f"is {short_repr(forces)}" if stacked is None else f"has shape {stacked.shape}"
            raise InputError(f"forces {got}; {self!r} takes ({self.k},) or (n, {self.k}) (N).")
        return read_only(stacked[..., part].reshape(*stacked.shape[:-1], -1, 3).sum(axis=-2))

    def friction_contact(self, name: str) -> FrictionContact:
        """The contact of this name. Raises `InputError` for one without contact points."""
        contact = self[name]
        if not isinstance(contact, FrictionContact):
            raise InputError(
                f"the forces of {name} do not act at points, so they add up to no force; see "
                f"force_slice."
            )
        return contact

    def only(self, *names: str) -> Contacts:
        """The contacts of these names, in the order they have here."""
        chosen = [self[name].name for name in names]
        return Contacts([contact for contact in self.items if contact.name in chosen])

    def without(self, *names: str) -> Contacts:
        """The contacts but those of these names."""
        dropped = [self[name].name for name in names]
        return Contacts([contact for contact in self.items if contact.name not in dropped])

    def __getitem__(self, name: str) -> MotionConstraint:
        if not isinstance(name, str) or name not in self.names:
            raise unknown_name("contact", name, self.names)
        return self.items[self.names.index(name)]

    def __add__(self, other: Contacts) -> Contacts:
        return Contacts(
            [
                *self.items,
                *as_instance(
                    "what is added to Contacts", other, Contacts, "fb.Contacts([contact])"
                ).items,
            ]
        )

    def __iter__(self) -> Iterator[MotionConstraint]:
        return iter(self.items)

    def __len__(self) -> int:
        return len(self.items)

    def __repr__(self) -> str:
        return f"Contacts({', '.join(self.names)}; k={self.k})"


def constraint_and_jacobian(
    contact: MotionConstraint, state: State, t: float
) -> tuple[Array, Array, Array]:
    """A, shape (m, nv), and b, shape (m,), of (5) and J, shape (k, nv), of (4) of one contact;
    read-only, at time t in s.

    Raises `InputError` for other shapes.
    """
    A, b = map(read_only, contact.constraint(state, t))  # user code may write to its arrays again
    is_A = vars(type(contact)).get("jacobian_is_constraint", False)
    J = A if is_A else read_only(contact.jacobian(state, t))
    m, nv = len(contact.row_names), state.robot.nv
    if A.shape != (m, nv) or b.shape != (m,) or J.shape != (contact.k, nv):
        required = f"they must have ({m}, {nv}), ({m},) and ({contact.k}, {nv})"
        raise InputError(
            f"A, b and J of {contact.name!r} have shapes {A.shape}, {b.shape} and {J.shape}; "
            f"{required}."
        )
    return A, b, J


def _make_contact(foot: Foot, mu: float, normal: Array, flat: bool = True) -> FrictionContact:
    if flat and foot.corners is not None:
        return FlatFootContact(foot.frame, foot.corners, normal, mu)
    return PointContact(foot.frame, normal, mu, foot.radius, foot.middle)


def _selected_feet(
    robot: Robot, frames: Sequence[str] | None, mu: PerFoot, normals: Normals
) -> list[tuple[Foot, float, Array]]:
    """The feet that touch, each with its coefficient of friction and its normal."""
    as_instance("robot", robot, Robot)
    feet = (
        robot.feet
        if frames is None
        else tuple(robot.foot(frame) for frame in as_strings("frames", frames))
    )
    if not feet:
        raise InputError(
            f'{robot.name} has no feet; name the frames that touch: frames=["…"] (robot.frames '
            f"lists them)."
        )
    names = [foot.frame for foot in feet]
    normals = UP if normals is None else normals
    return list(
        zip(
            feet,
            _per_name("mu", mu, names, DEFAULT_MU),
            _per_name("normals", normals, names, UP, (3,)),
            strict=True,
        )
    )


def _per_name(
    argument: str, value: Any, names: Sequence[str], default: Any, shape: tuple[int, ...] = ()
) -> list[Any]:
    """One value of this shape for each name: the same for all, one after the other, or by name with
    a default.
    """
    if isinstance(value, Mapping):
        for name in set(value) - set(names):
            raise unknown_name(f"contact frame in {argument}", name, names)
        return [value.get(name, default) for name in names]
    if isinstance(value, Sequence) and value and all(isinstance(entry, str) for entry in value):
        raise InputError(
            f"{argument} must be numbers, not {short_repr(value)}; names of frames go to "
            f"frames=[…]."
        )
    numeric = numeric_copy(value)
    if (
        not isinstance(value, Sequence | np.ndarray)
        if numeric is None
        else numeric.ndim == len(shape)
    ):
        return [value] * len(names)
    return list(as_array(argument, value, (len(names), *shape)))
