"""Contacts: where the world pushes on the robot, and what motion that leaves (§2.1, (5)).

A contact has three parts: the rows A q̈ = b that its motion keeps, the points where forces act (their Jacobian J brings
them into the equations of motion as Jᵀ λ), and the friction cone of each point. For a point contact A is J. A flat foot
keeps 6 rows and pushes at its corners.

Forces are what the ground does to the robot, in the world-aligned frame, three numbers a point, stacked in order.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, TypeAlias, runtime_checkable

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._arrays import Array, checked, cross, positive, read_only, unit_vector
from floatbase.errors import InputError, unknown_name
from floatbase.robots import Foot, Robot, State, spread_corners

UP = read_only([0.0, 0.0, 1.0])
_MU = 0.7
PerFoot: TypeAlias = float | Sequence[float] | Array | Mapping[str, float]


@runtime_checkable
class Contact(Protocol):
    """What every contact offers; n_points may be 0 for a constraint whose forces have no friction cone."""

    @property
    def name(self) -> str:
        """Name in messages, active rows and pictures."""

    @property
    def mu(self) -> float:
        """Coefficient of friction."""

    @property
    def normal(self) -> Array:
        """Unit normal out of the ground, shape (3,), world."""

    @property
    def point_names(self) -> tuple[str, ...]:
        """One name for each point that carries a force."""

    @property
    def k(self) -> int:
        """Number of force components."""

    @property
    def row_names(self) -> tuple[str, ...]:
        """One name for each row of (5)."""

    def positions(self, state: State) -> Array:
        """World positions of the points, shape (n_points, 3), m."""

    def jacobian(self, state: State, t: float = 0.0) -> Array:
        """J of (4): Jᵀ λ is the generalised force of λ at time t, s; shape (k, nv)."""

    def constraint(self, state: State, t: float = 0.0) -> tuple[Array, Array]:
        """(5) The rows A, shape (m, nv), and b, shape (m,), of A q̈ = b at time t, s."""


@dataclass(frozen=True, eq=False)
class PointContact:
    """A point of the robot that does not move on the ground: A = J, b = -J̇ q̇ (5).

    frame: the frame that carries it. normal: shape (3,), world, out of the ground, made unit. mu: coefficient of
    friction. radius, centre: the ball foot, m (see `Foot`). The contact point is the ball's lowest point, centre -
    radius · normal; as the ball rolls that point moves on the ball, which b takes into account.
    """

    frame: str
    normal: Array = field(default_factory=lambda: UP)
    mu: float = 0.7
    radius: float = 0.0
    centre: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        object.__setattr__(self, "normal", unit_vector(f"normal of {self.frame}", self.normal))
        object.__setattr__(self, "mu", positive(f"friction coefficient mu of {self.frame}", self.mu))
        object.__setattr__(self, "radius", positive(f"radius of {self.frame}", self.radius, "m", allow_zero=True))
        object.__setattr__(self, "centre", checked(f"centre of {self.frame}", self.centre, (3,), "m"))

    @property
    def name(self) -> str:
        """The frame's name."""
        return self.frame

    @property
    def point_names(self) -> tuple[str, ...]:
        """The frame's name: one point."""
        return (self.frame,)

    @property
    def k(self) -> int:
        """3."""
        return 3

    @property
    def row_names(self) -> tuple[str, ...]:
        """x, y, z: world-aligned."""
        return ("x", "y", "z")

    def positions(self, state: State) -> Array:
        """World position of the contact point, shape (1, 3), m."""
        return read_only([state.point(self.frame, self.centre) - self.radius * self.normal])

    def jacobian(self, state: State, t: float = 0.0) -> Array:
        """Jacobian of the contact point, shape (3, nv), world-aligned."""
        return read_only(point_jacobian(state, self.frame, self._arm(state)))

    def constraint(self, state: State, t: float = 0.0) -> tuple[Array, Array]:
        """(5) A = J and b = -J̇ q̇, shapes (3, nv) and (3,), m/s²: the contact point does not accelerate."""
        drift = state.frame_drift(self.frame)
        omega = state.frame_velocity(self.frame)[3:]
        # J v = v_o + ω × (R c - r n): only R c turns with the foot, the contact point stays below the centre
        arm = self._arm(state)
        turning = cross(omega, cross(omega, arm + self.radius * self.normal))
        J_dot_v = drift[:3] + cross(drift[3:], arm) + turning
        return self.jacobian(state), read_only(-J_dot_v)

    def _arm(self, state: State) -> Array:
        """From the frame's origin to the contact point, shape (3,), m, world."""
        return state.frame_pose(self.frame).rotation @ self.centre - self.radius * self.normal


@dataclass(frozen=True, eq=False)
class FlatFootContact:
    """A foot with area that neither moves nor turns: 6 motion rows, and forces at its corners (note 9 of the document).

    corners: shape (n, 3), m, in the frame. Twelve corner motion rows would have rank 6 and contradict each other when
    the foot turns, so motion is kept by the six rows of the frame and the corners only carry forces.
    """

    frame: str
    corners: Array
    normal: Array = field(default_factory=lambda: UP)
    mu: float = 0.7

    def __post_init__(self) -> None:
        object.__setattr__(self, "normal", unit_vector(f"normal of {self.frame}", self.normal))
        object.__setattr__(self, "mu", positive(f"friction coefficient mu of {self.frame}", self.mu))
        corners = checked(f"corners of {self.frame}", self.corners, (None, 3), "m")
        object.__setattr__(self, "corners", spread_corners(self.frame, corners))

    @property
    def name(self) -> str:
        """The frame's name."""
        return self.frame

    @property
    def point_names(self) -> tuple[str, ...]:
        """The corners: frame name and number."""
        return tuple(f"{self.frame} corner {i}" for i in range(len(self.corners)))

    @property
    def k(self) -> int:
        """3 for each corner."""
        return 3 * len(self.corners)

    @property
    def row_names(self) -> tuple[str, ...]:
        """Linear x, y, z, then angular: world-aligned."""
        return ("x", "y", "z", "angular x", "angular y", "angular z")

    def positions(self, state: State) -> Array:
        """World positions of the corners, shape (n, 3), m."""
        return read_only([state.point(self.frame, corner) for corner in self.corners])

    def generators(self, state: State) -> Array:
        """The wrench at the frame's origin that corner forces make, shape (6, k): J = generatorsᵀ A."""
        R = state.frame_pose(self.frame).rotation
        return read_only(np.hstack([np.vstack([np.eye(3), pin.skew(R @ corner)]) for corner in self.corners]))

    def jacobian(self, state: State, t: float = 0.0) -> Array:
        """Jacobian of the corners, shape (k, nv), world-aligned; its rank is at most 6."""
        return read_only(self.generators(state).T @ state.frame_jacobian(self.frame))

    def constraint(self, state: State, t: float = 0.0) -> tuple[Array, Array]:
        """(5) The frame's six rows and -J̇ q̇, shapes (6, nv) and (6,), m/s² and rad/s²."""
        return state.frame_jacobian(self.frame), read_only(-state.frame_drift(self.frame))


def point_jacobian(state: State, frame: str, arm: Array) -> Array:
    """Jacobian of the point of a frame's body at `arm` (m, world) from its origin, shape (3, nv), world-aligned."""
    J = state.frame_jacobian(frame)
    return J[:3] - pin.skew(arm) @ J[3:]


class Contacts:
    """Contacts stacked in order, with their names. Immutable; `only`, `without` and `+` make new ones.

    Raises `InputError` for no contacts at all unless made with `Contacts.none`, and for a name that stands twice.
    """

    def __init__(self, contacts: Sequence[Contact]):
        if not contacts:
            raise InputError("no contacts given; use fb.Contacts.none() when the robot really touches nothing.")
        self._set(tuple(contacts))

    def _set(self, contacts: tuple[Contact, ...]) -> None:
        for contact in contacts:
            if not isinstance(contact, Contact):
                raise InputError(f"{contact!r} is no contact; fb.Contacts.points(robot, frames=[…]) makes them from names.")
        names = [contact.name for contact in contacts]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise InputError(f"contact {twice[0]!r} stands twice in the list; each name may stand once.")
        self._contacts = contacts

    @staticmethod
    def none() -> Contacts:
        """No contacts: free flight."""
        contacts = Contacts.__new__(Contacts)
        contacts._set(())
        return contacts

    @staticmethod
    def points(
        robot: Robot,
        mu: PerFoot = 0.7,
        frames: Sequence[str] | None = None,
        normals: npt.ArrayLike | Mapping[str, npt.ArrayLike] | None = None,
    ) -> Contacts:
        """Point contacts at the robot's feet.

        mu: coefficient of friction, one number for all, (n,) in the order of the frames, or a mapping from frame to number,
        0.7 where it has none. frames: which frames; all feet by default. normals: shape (3,) for all, (n, 3) in the order of
        the frames, or a mapping from frame to (3,); straight up by default. A flat foot touches at the middle of its corners
        here; `Contacts.flat_feet` uses its area.
        """
        feet = _feet(robot, frames)
        return Contacts(
            [
                PointContact(foot.frame, n, m, foot.radius, foot.centre if foot.corners is None else foot.corners.mean(axis=0))
                for foot, n, m in zip(feet, _normals(feet, normals), _mus(feet, mu), strict=True)
            ]
        )

    @staticmethod
    def flat_feet(
        robot: Robot,
        mu: PerFoot = 0.7,
        frames: Sequence[str] | None = None,
        normals: npt.ArrayLike | Mapping[str, npt.ArrayLike] | None = None,
    ) -> Contacts:
        """Flat-foot contacts at the robot's feet with area; arguments as for `points`."""
        feet = _feet(robot, frames)
        for foot in feet:
            if foot.corners is None:
                raise InputError(
                    f"{foot.frame} of {robot.name} is not a flat foot; use fb.Contacts.points, or load the robot with "
                    "feet=[floatbase.robots.Foot(frame, corners=…)]."
                )
        return Contacts(
            [
                FlatFootContact(foot.frame, foot.corners, n, m)
                for foot, n, m in zip(feet, _normals(feet, normals), _mus(feet, mu), strict=True)
                if foot.corners is not None
            ]
        )

    @staticmethod
    def feet(robot: Robot, mu: PerFoot = 0.7) -> Contacts:
        """All feet of the robot as they are, flat ones with their corners, the others as points; none where it has none.

        mu: as for `points`.
        """
        contacts = Contacts.none()
        for foot, each in zip(robot.feet, _mus(robot.feet, mu), strict=True):
            make = Contacts.flat_feet if foot.is_flat else Contacts.points
            contacts = contacts + make(robot, each, [foot.frame])
        return contacts

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the contacts."""
        return tuple(contact.name for contact in self._contacts)

    @property
    def point_names(self) -> tuple[str, ...]:
        """Names of the points that carry forces, n of them; forces has 3 n entries."""
        return tuple(name for contact in self._contacts for name in contact.point_names)

    @property
    def n_points(self) -> int:
        """Number of points that carry forces."""
        return len(self.point_names)

    @property
    def k(self) -> int:
        """Length of λ."""
        return sum(contact.k for contact in self._contacts)

    @property
    def normals(self) -> Array:
        """Normal of each point, shape (n, 3), world."""
        return read_only(np.reshape([c.normal for c in self._contacts for _ in c.point_names], (-1, 3)))

    @property
    def mus(self) -> Array:
        """Coefficient of friction of each point, shape (n,)."""
        return read_only([contact.mu for contact in self._contacts for _ in contact.point_names])

    @property
    def point_entries(self) -> npt.NDArray[np.intp]:
        """Which entries of λ are forces at points, shape (3 n,): all but those of a `LinearConstraint`."""
        ends = np.cumsum([0] + [contact.k for contact in self._contacts])
        entries = [np.arange(e, e + 3 * len(c.point_names)) for c, e in zip(self._contacts, ends[:-1], strict=True)]
        return np.concatenate([np.zeros(0, dtype=np.intp), *entries])

    def positions(self, state: State) -> Array:
        """World positions of the points, shape (n, 3), m: where soles touch, for a ball foot one radius below its centre.

        A `FrameTask` follows the frame's origin instead, which for most ball feet is the ball's centre.
        """
        return read_only(np.vstack([np.zeros((0, 3))] + [contact.positions(state) for contact in self._contacts]))

    def jacobian(self, state: State, t: float = 0.0) -> Array:
        """J of (4), shape (k, nv), at time t, s."""
        empty = np.zeros((0, state.robot.nv))
        return read_only(np.vstack([empty] + [contact.jacobian(state, t) for contact in self._contacts]))

    def constraint(self, state: State, t: float = 0.0) -> tuple[Array, Array]:
        """(5) A, shape (m, nv), and b, shape (m,), at time t, s."""
        rows = [contact.constraint(state, t) for contact in self._contacts]
        A = np.vstack([np.zeros((0, state.robot.nv))] + [row[0] for row in rows])
        return read_only(A), read_only(np.concatenate([np.zeros(0)] + [row[1] for row in rows]))

    def force_slice(self, name: str) -> slice:
        """Which entries of λ belong to a contact."""
        start = 0
        for contact in self._contacts:
            if contact.name == name:
                return slice(start, start + contact.k)
            start += contact.k
        raise unknown_name("contact", name, self.names)

    def force_of(self, forces: npt.ArrayLike, name: str) -> Array:
        """The force of one contact among λ, shape (3,), N, world: for a flat foot the resultant of its corners.

        forces: λ, shape (k,), or (n, k) for n of them, which gives (n, 3). Raises `UnknownNameError` for a name that is no
        contact's, `InputError` for a contact whose forces do not act at points.
        """
        part, contact = self.force_slice(name), self[name]
        if contact.k != 3 * len(contact.point_names):
            raise InputError(f"the forces of {name} do not act at points, so they add up to no force; see force_slice.")
        stacked = np.asarray(forces, dtype=np.float64)
        if stacked.ndim not in (1, 2) or stacked.shape[-1] != self.k:
            raise InputError(f"forces has shape {stacked.shape}; {self!r} takes ({self.k},) or (n, {self.k}) (N).")
        return read_only(stacked[..., part].reshape(*stacked.shape[:-1], -1, 3).sum(axis=-2))

    def only(self, *names: str) -> Contacts:
        """The contacts of these names, in the order they have here."""
        for name in names:
            self.force_slice(name)
        return Contacts([contact for contact in self._contacts if contact.name in names])

    def without(self, *names: str) -> Contacts:
        """The contacts but those of these names."""
        for name in names:
            self.force_slice(name)
        kept = [contact for contact in self._contacts if contact.name not in names]
        return Contacts(kept) if kept else Contacts.none()

    def __getitem__(self, name: str) -> Contact:
        for contact in self._contacts:
            if contact.name == name:
                return contact
        raise unknown_name("contact", name, self.names)

    def __add__(self, other: Contacts) -> Contacts:
        if not isinstance(other, Contacts):
            raise InputError(f"only Contacts can be added to Contacts, not {type(other).__name__}.")
        both = (*self._contacts, *other)
        return Contacts(both) if both else Contacts.none()

    def __iter__(self) -> Iterator[Contact]:
        return iter(self._contacts)

    def __len__(self) -> int:
        return len(self._contacts)

    def __repr__(self) -> str:
        return f"Contacts({', '.join(self.names)}; k={self.k})"


def _feet(robot: Robot, frames: Sequence[str] | None) -> tuple[Foot, ...]:
    if not isinstance(robot, Robot):
        raise InputError(f"contacts are made for a Robot, as from fb.load, not for {robot!r}.")
    if isinstance(frames, str):
        raise InputError(f'frames must be a list of names, as in frames=["{frames}"].')
    feet = robot.feet if frames is None else tuple(robot.foot(frame) for frame in frames)
    if not feet:
        raise InputError(f'{robot.name} has no feet; name the frames that touch: frames=["…"] (robot.frames lists them).')
    return feet


def _mus(feet: Sequence[Foot], mu: PerFoot) -> list[float]:
    """One coefficient of friction for each foot."""
    names = [foot.frame for foot in feet]
    if isinstance(mu, Mapping):
        for frame in mu:
            if frame not in names:
                raise unknown_name("contact frame in mu", frame, names)
        return [mu.get(name, _MU) for name in names]
    return [mu] * len(feet) if np.ndim(mu) == 0 else list(checked("mu", mu, (len(feet),)))  # type: ignore[list-item]


def _normals(feet: Sequence[Foot], normals: npt.ArrayLike | Mapping[str, npt.ArrayLike] | None) -> list[Array]:
    """One normal for each foot."""
    if normals is None:
        return [UP] * len(feet)
    if isinstance(normals, Mapping):
        for frame in normals:
            if frame not in [foot.frame for foot in feet]:
                raise unknown_name("contact frame in normals", frame, [foot.frame for foot in feet])
        return [checked(f"normal of {foot.frame}", normals.get(foot.frame, UP), (3,)) for foot in feet]
    if np.ndim(normals) == 1:
        return [checked(f"normal of {foot.frame}", normals, (3,)) for foot in feet]
    return list(checked("normals", normals, (len(feet), 3)))
