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
from floatbase.dynamics.constraints import LinearConstraint
from floatbase.dynamics.contact import (
    DEFAULT_MU,
    UP,
    Contact,
    FlatFootContact,
    PointContact,
    SinglePointContact,
)
from floatbase.errors import InputError, unknown_name
from floatbase.robots import Foot, Robot, State

PerFoot: TypeAlias = float | Sequence[float] | Array | Mapping[str, float]
_HINT = "fb.Contacts.points(robot, frames=[…]) makes them from names"
Normals: TypeAlias = npt.ArrayLike | Mapping[str, npt.ArrayLike] | None


@dataclass(frozen=True, eq=False, repr=False)
class Contacts(Value):
    """Contacts stacked in order; none at all for free flight. `only`, `without` and `+` make new
    ones.

    Raises `InputError` for a name that stands twice.
    """

    items: Sequence[Contact]

    def __post_init__(self) -> None:
        if not isinstance(self.items, Sequence) or isinstance(self.items, str):
            raise InputError(
                f"Contacts takes a list of contacts, not {short_repr(self.items)}; {_HINT}."
            )
        object.__setattr__(self, "items", tuple(self.items))
        for contact in self.items:
            if isinstance(contact, type) or not isinstance(contact, Contact):
                raise InputError(f"{short_repr(contact)} is no contact; {_HINT}.")
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
    def point_names(self) -> tuple[str, ...]:
        """Names of the points that carry forces, n of them; forces has 3 n entries."""
        return tuple(name for contact in self.items for name in contact.point_names)

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
        return read_only(np.reshape([c.normal for c in self.items for _ in c.point_names], (-1, 3)))

    @cached_property
    def mus(self) -> Array:
        """Coefficient of friction of each point, shape (n,)."""
        return read_only([contact.mu for contact in self.items for _ in contact.point_names])

    @cached_property
    def point_force_indices(self) -> npt.NDArray[np.intp]:
        """Which entries of λ are forces at points, shape (3 n,): all but those of a
        `LinearConstraint`.
        """
        entries = np.flatnonzero(
            [bool(contact.point_names) for contact in self.items for _ in range(contact.k)]
        )
        entries.flags.writeable = False
        return entries

    def positions(self, state: State) -> Array:
        """World positions of the points, shape (n, 3), m: where soles touch, for a ball foot one
        radius below its centre.
        """
        as_instance("state", state, State)
        return read_only(
            np.vstack([np.zeros((0, 3)), *(contact.positions(state) for contact in self.items)])
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
        part, contact = self.force_slice(name), self[name]
        if contact.k != 3 * len(contact.point_names):
            raise InputError(
                f"the forces of {name} do not act at points, so they add up to no force; see "
                f"force_slice."
            )
        stacked = numeric_copy(forces)
        if stacked is None or stacked.ndim not in (1, 2) or stacked.shape[-1] != self.k:
            got = f"is {short_repr(forces)}" if stacked is None else f"has shape {stacked.shape}"
            raise InputError(f"forces {got}; {self!r} takes ({self.k},) or (n, {self.k}) (N).")
        return read_only(stacked[..., part].reshape(*stacked.shape[:-1], -1, 3).sum(axis=-2))

    def only(self, *names: str) -> Contacts:
        """The contacts of these names, in the order they have here."""
        chosen = [self[name].name for name in names]
        return Contacts([contact for contact in self.items if contact.name in chosen])

    def without(self, *names: str) -> Contacts:
        """The contacts but those of these names."""
        dropped = [self[name].name for name in names]
        return Contacts([contact for contact in self.items if contact.name not in dropped])

    def __getitem__(self, name: str) -> Contact:
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

    def __iter__(self) -> Iterator[Contact]:
        return iter(self.items)

    def __len__(self) -> int:
        return len(self.items)

    def __repr__(self) -> str:
        return f"Contacts({', '.join(self.names)}; k={self.k})"


def constraint_and_jacobian(contact: Contact, state: State, t: float) -> tuple[Array, Array, Array]:
    """A, shape (m, nv), and b, shape (m,), of (5) and J, shape (k, nv), of (4) of one contact;
    read-only, at time t in s.

    J is A where that is so by definition, as for a point: such a contact is asked once. Raises
    `InputError` for other shapes.
    """
    A, b = map(read_only, contact.constraint(state, t))  # one's own may write to its arrays again
    cls: Any = type(contact)  # one derived from ours may have another Jacobian
    is_point = isinstance(contact, SinglePointContact) and (cls.jacobian, cls.constraint) == (
        SinglePointContact.jacobian,
        SinglePointContact.constraint,
    )
    is_linear = getattr(cls, "jacobian", None) is LinearConstraint.jacobian
    J = A if is_point or is_linear else read_only(contact.jacobian(state, t))
    m, nv = len(contact.row_names), state.robot.nv
    if A.shape != (m, nv) or b.shape != (m,) or J.shape != (contact.k, nv):
        required = f"they must have ({m}, {nv}), ({m},) and ({contact.k}, {nv})"
        raise InputError(
            f"A, b and J of {contact.name!r} have shapes {A.shape}, {b.shape} and {J.shape}; "
            f"{required}."
        )
    return A, b, J


def _make_contact(foot: Foot, mu: float, normal: Array, flat: bool = True) -> Contact:
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
