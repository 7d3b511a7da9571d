"""The inequalities of (27) without a state: friction, normal forces, torque limits, and
user-defined rows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from types import MappingProxyType
from typing import Any, TypeAlias, cast

import numpy as np
import numpy.typing as npt

from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_bool,
    as_callable,
    as_instance,
    as_integer,
    as_number,
    as_positive,
    as_string,
    as_strings,
    cached_property,
    checked,
    numeric_copy,
    read_only,
    short_repr,
)
from floatbase.dynamics import Block, Contacts, EquationsOfMotion
from floatbase.errors import InputError, unknown_name
from floatbase.friction import FrictionPolyhedron
from floatbase.friction._polytopes import MAX_FACETS
from floatbase.qp import ConstraintLabel
from floatbase.robots import Robot
from floatbase.robots._checks import as_torque_limits

SIZES = {"qdd": "nv", "tau": "d", "forces": "k"}  # of the blocks of x, attributes of (7)
BLOCKS = tuple(SIZES)
NormalForces: TypeAlias = float | Mapping[str, float | Callable[[float], float]]
Coefficients: TypeAlias = tuple[npt.ArrayLike, npt.ArrayLike]


@dataclass(frozen=True, eq=False)
class LinearInequality(Value):
    """User-defined inequality rows, G x ≤ h, on one block x of (q̈, τ, λ).

    name: in messages; of the row, where there is one, else of "name 0", "name 1", …
    block: "qdd", "tau" or "forces".
    coefficients: G, shape (m, n), and h, shape (m,), or a function of (eom, t in s) that gives
        them; n is the size of the block, which for forces goes with the contacts. The unit is that
        of the rows: N for forces, m/s² or rad/s² for accelerations.
    row_names: one text for each row instead of its number, such as the names of joints.

    Bounds on joints' accelerations, with E = np.eye(robot.nv)[6:]:
    `LinearInequality("acceleration", "qdd", (E, np.full(robot.d, 50.0)))`. At most 500 N from all
    feet, however many stand: `LinearInequality("total", "forces", lambda eom, t: (np.tile([0.0,
    0.0, 1.0], (1, eom.k // 3)), [500.0]))`. Raises `InputError` for another block;
    `at` does so for shapes that do not fit.
    """

    name: str = field(metadata=checked(as_string))
    block: Block = field(metadata=checked(as_string))
    coefficients: Coefficients | Callable[[EquationsOfMotion, float], Coefficients]
    row_names: Sequence[str] = field(default=(), metadata=checked(as_strings))

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.block not in BLOCKS:
            raise InputError(
                f'block of {self._label()} is {self.block!r}. It must be "qdd", "tau" or "forces".'
            )
        if callable(self.coefficients) and not isinstance(self.coefficients, type):
            as_callable(f"coefficients of {self.name}", self.coefficients, "coefficients(eom, t)")
        else:
            object.__setattr__(self, "coefficients", self._checked(self.coefficients, None))

    def _label(self) -> str:
        return f"inequality {self.name!r}"

    def at(self, eom: EquationsOfMotion, t: float = 0.0) -> tuple[Array, Array]:
        """G, shape (m, n), and h, shape (m,), at a state and a time t in s, checked."""
        n = getattr(eom, SIZES[self.block])
        if (
            not callable(self.coefficients) and np.shape(self.coefficients[0])[1] == n
        ):  # checked when they were made, but for that
            return cast("tuple[Array, Array]", self.coefficients)
        return self._checked(
            self.coefficients(eom, t) if callable(self.coefficients) else self.coefficients, n
        )

    def labels(self, m: int) -> tuple[ConstraintLabel, ...]:
        """A label for each of m rows. Raises `InputError` where there is another number of row
        names.
        """
        if self.row_names and len(self.row_names) != m:
            raise InputError(
                f"inequality {self.name!r} has {len(self.row_names)} row names and {m} rows; give "
                f"one for each row."
            )
        if self.row_names:
            return tuple(
                ConstraintLabel(f"{self.name} {row_name}", self.name, row_name)
                for row_name in self.row_names
            )
        return tuple(
            ConstraintLabel(f"{self.name} {i}" if m > 1 else self.name, "inequality", self.name, i)
            for i in range(m)
        )

    def _checked(self, given: Any, n: int | None) -> tuple[Array, Array]:
        if not isinstance(given, tuple | list) or len(given) != 2:
            raise InputError(
                f"inequality {self.name!r} must be G and h, as in (G, h), not {short_repr(given)}."
            )
        G = as_array(f"G of {self.name}", given[0], (None, None))
        if n is not None and G.shape[1] != n:
            follows = (
                "; a function of (eom, t) can follow the contacts" if self.block == "forces" else ""
            )
            raise InputError(
                f"inequality {self.name!r} takes {G.shape[1]} numbers; its block {self.block!r} "
                f"has {n}{follows}."
            )
        return G, as_array(f"h of {self.name}", given[1], (len(G),))


def _as_limits(name: str, value: npt.ArrayLike) -> Array:
    """Torque limits of as many joints as they are given for, checked."""
    limits = numeric_copy(value)
    return as_torque_limits(1 if limits is None else limits.size, value)


def _as_bounds(name: str, value: Any, optional: bool = False) -> NormalForces:
    """Return a checked copy of bounds of normal forces; none at all may be given if `optional`."""
    given = {} if optional and value is None else value
    if not isinstance(given, Mapping):
        number = numeric_copy(given)
        if number is None or number.ndim:
            raise InputError(
                f"{name} is {short_repr(given)}. It must be one number (N), or a mapping from "
                f"names of contacts to numbers or functions of t, such as "
                f'{{"FL_foot": lambda t: …}}.'
            )
        return as_positive(name, given, "N", allow_zero=True)
    return MappingProxyType(
        {
            contact: as_callable(f"{name} at {contact}", bound, "force(t)")
            if callable(bound)
            else as_positive(f"{name} at {contact}", bound, "N", allow_zero=True)
            for contact, bound in given.items()
        }
    )


def _as_inequalities(name: str, value: Any) -> tuple[LinearInequality, ...]:
    """Return user-defined inequalities as a tuple, checked."""
    if isinstance(value, LinearInequality) or not isinstance(value, Sequence):
        raise InputError(f"{name} must be a list of LinearInequality, not {short_repr(value)}.")
    example = "floatbase.control.LinearInequality(name, block, (G, h))"
    return tuple(as_instance(f"each of {name}", each, LinearInequality, example) for each in value)


@dataclass(frozen=True, eq=False)
class Limits(Value):
    """The inequalities of (27).

    torque_limits: shape (d,), N·m, +inf where there is none.
    facets: number of facets of the friction polyhedron (28) of every contact point.
    inner_approximation: whether the polyhedron lies inside the friction cone (safe) or outside it
        (optimistic).
    facet_rotation: rad, by which its facets are turned about the normal.
    min_normal_force, max_normal_force: N, bounds of normal · f at every contact point, so at each
        corner of a flat foot: one number for all, or a mapping from the name of a contact to a
        number or a function of the time t in s; 0 and none where it has none. The bound of a name
        that is not among the contacts waits until it is: a foot that has lifted will stand again.
    inequalities: user-defined inequality rows.

    Raises `InputError` for values that do not fit.
    """

    _example = "controller.limits"
    torque_limits: Array = field(metadata=checked(_as_limits))
    facets: int = field(
        default=4, metadata=checked(as_integer, 3, MAX_FACETS, "μ is never known more accurately")
    )
    inner_approximation: bool = field(default=True, metadata=checked(as_bool))
    min_normal_force: NormalForces = field(default=0.0, metadata=checked(_as_bounds))
    max_normal_force: NormalForces | None = field(
        default=None, metadata=checked(_as_bounds, optional=True)
    )
    inequalities: Sequence[LinearInequality] = field(default=(), metadata=checked(_as_inequalities))
    facet_rotation: float = field(default=0.0, metadata=checked(as_number, "rad"))

    @property
    def polyhedron_options(self) -> tuple[int, bool, float]:
        """Options of the friction polyhedra: arguments of `FrictionPolyhedron` after mu."""
        return self.facets, self.inner_approximation, self.facet_rotation

    @cached_property
    def time_varying(self) -> bool:
        """Whether a normal force is bounded by a function of time."""
        return any(
            callable(value) for bound in self._bounds_by_name.values() for value in bound.values()
        )

    @property
    def _bounds_by_name(self) -> dict[str, Mapping[str, Any]]:
        """The bounds of normal forces that are mappings, by the name of the argument."""
        both = {
            "min_normal_force": self.min_normal_force,
            "max_normal_force": self.max_normal_force,
        }
        return {name: bound for name, bound in both.items() if isinstance(bound, Mapping)}

    def check_names(self, *known: Iterable[str], before: Limits | None = None) -> None:
        """Raise `UnknownNameError` where a normal force is bounded by a name that is neither known
        nor in the limits before.
        """
        names = {
            name
            for some in (*known, *(before._bounds_by_name.values() if before else ()))
            for name in some
        }
        for argument, bound in self._bounds_by_name.items():
            for name in bound:
                if name not in names:
                    raise unknown_name(f"contact in {argument}", name, names)

    def normal_forces(self, contacts: Contacts, t: float = 0.0) -> tuple[Array, Array]:
        """Least and largest normal force, N, of each point at time t in s, shapes (P,); inf where
        none is the largest.

        Raises `InputError` for a function's value that is no force.
        """
        if not self.time_varying:
            return _constant_normal_forces(contacts, self)
        return self._normal_forces_at(contacts, t)

    def _normal_forces_at(self, contacts: Contacts, t: float) -> tuple[Array, Array]:
        assert self.max_normal_force is not None  # as it was made
        least = _bounds_at("min_normal_force", self.min_normal_force, contacts, t, 0.0)
        largest = _bounds_at("max_normal_force", self.max_normal_force, contacts, t, np.inf)
        return least, largest

    def bounded_points(self, contacts: Contacts) -> npt.NDArray[np.bool_]:
        """Which points have a largest normal force, shape (P,)."""
        given = self.max_normal_force
        names = given if isinstance(given, Mapping) else contacts.names
        return np.array(
            [c.name in names for c in contacts.friction_contacts for _ in c.point_names],
            dtype=np.bool_,
        )


def _bounds_at(
    name: str, given: NormalForces, contacts: Contacts, t: float, otherwise: float
) -> Array:
    """Bounds of normal forces at time t, (P,)."""
    if not isinstance(given, Mapping):
        return np.full(contacts.n_points, given)
    found = []
    for each in contacts.friction_contacts:
        value = given.get(each.name, otherwise)
        if callable(value):
            value = as_positive(f"{name} at {each.name}", value(t), "N", allow_zero=True)
        found += [value] * len(each.point_names)
    return np.array(found, dtype=np.float64)


# what does not depend on the state is built once for each contacts, robot and limits (all
# immutable)
@lru_cache(maxsize=64)
def _constant_normal_forces(contacts: Contacts, limits: Limits) -> tuple[Array, Array]:
    least, largest = limits._normal_forces_at(contacts, 0.0)
    return read_only(least), read_only(largest)


@lru_cache(maxsize=64)
def force_rows(contacts: Contacts, limits: Limits) -> tuple[Array, tuple[ConstraintLabel, ...]]:
    """G of friction facets and least normal force of every point, then of the largest normal
    forces, and the rows' names.
    """
    per_point = limits.facets + 1
    names: list[ConstraintLabel] = []
    G = np.zeros((per_point * contacts.n_points, contacts.k))
    for i, point in enumerate(contacts.point_names):
        cone = FrictionPolyhedron(contacts.normals[i], contacts.mus[i], *limits.polyhedron_options)
        G[per_point * i : per_point * (i + 1), contacts.point_force_indices[3 * i : 3 * i + 3]] = (
            np.vstack([cone.face_matrix, -cone.normal])
        )
        names += [
            ConstraintLabel(f"{point} facet {facet}", "friction", point, facet)
            for facet in range(limits.facets)
        ]
        names.append(ConstraintLabel(f"{point} normal force", "normal force", point))
    bounded = np.flatnonzero(limits.bounded_points(contacts))
    names += [
        ConstraintLabel(
            f"{contacts.point_names[i]} largest normal force",
            "largest normal force",
            contacts.point_names[i],
        )
        for i in bounded
    ]
    return read_only(np.vstack([G, -G[limits.facets :: per_point][bounded]])), tuple(names)


def force_bounds(contacts: Contacts, limits: Limits, least: Array, largest: Array) -> Array:
    """h of `force_rows` for the least and largest normal force of every point, (P,)."""
    h = np.zeros((contacts.n_points, limits.facets + 1))
    h[:, -1] = -least
    return np.concatenate([h.ravel(), largest[limits.bounded_points(contacts)]])


@lru_cache(maxsize=64)
def torque_rows(robot: Robot, limits: Limits) -> tuple[Array, Array, tuple[ConstraintLabel, ...]]:
    """τ ≤ limit and -τ ≤ limit for every joint that has one: G τ ≤ h, and the names of the rows."""
    limited = np.flatnonzero(np.isfinite(limits.torque_limits))
    rows, bound = np.eye(robot.d)[limited], limits.torque_limits[limited]
    sides = [(side, robot.joint_names[i]) for side in ("upper", "lower") for i in limited]
    names = tuple(
        ConstraintLabel(f"torque limit {joint} {side}", f"{side} torque limit", joint)
        for side, joint in sides
    )
    return read_only(np.vstack([rows, -rows])), read_only(np.tile(bound, 2)), names
