"""Inequality constraints of the whole-body QP: friction, normal forces, torques, user-defined."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from types import MappingProxyType
from typing import Any, Literal, TypeAlias, cast

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
    frozen,
    numeric_copy,
    read_only,
    short_repr,
)
from floatbase.control.joint_limits import JointLimits, as_weight
from floatbase.dynamics import Block, Contacts, EquationsOfMotion
from floatbase.errors import InputError, unknown_name
from floatbase.friction import FrictionPolyhedron
from floatbase.friction._polytopes import MAX_FACETS
from floatbase.qp import ConstraintLabel
from floatbase.robots import Robot
from floatbase.robots._checks import as_torque_limits

# sizes of the blocks of x: attributes of the equations of motion (7)
SIZES = {"qdd": "nv", "tau": "d", "forces": "k"}
BLOCKS = tuple(SIZES)
_BOUNDS = "min_normal_force", "max_normal_force"
NormalForces: TypeAlias = float | Mapping[str, float | Callable[[float], float]]
Coefficients: TypeAlias = tuple[npt.ArrayLike, npt.ArrayLike]


@dataclass(frozen=True, eq=False)
class LinearInequality(Value):
    """User-defined inequality constraints G x ≤ h on one block x of (q̈, τ, λ).

    Parameters
    ----------
    name : str
        Name used in messages. A single row has this name; several rows are called "name 0",
        "name 1" and so on.
    block : {"qdd", "tau", "forces"}
        Block x on which the inequalities act.
    coefficients : tuple or callable
        G, shape (m, n), and h, shape (m,), or a function of (eom, t in s) that returns them. n is
        the size of the block, which for "forces" depends on the contacts. The unit of h is that of
        G x, for example N for forces, m/s² or rad/s² for accelerations.
    row_names : sequence of str, optional
        One label for each row instead of its number, such as the names of joints.
    weight : float, optional
        None makes the inequalities hard. A number makes them soft: their violation times this
        weight is added to the objective [units of the objective per unit of h]. The weight of a
        task multiplies the square of its residual instead.

    Raises
    ------
    InputError
        If the block is unknown, or if shapes do not fit. Shapes that depend on the robot are
        checked by `at`.

    Examples
    --------
    Joint accelerations of at most 50 rad/s²:

    >>> robot = fb.load("go2")
    >>> E = np.eye(robot.nv)[6:]
    >>> limit = LinearInequality("acceleration", "qdd", (E, np.full(robot.d, 50.0)))
    >>> len(limit.labels(robot.d))
    12

    A total vertical force of at most 500 N, whatever the number of feet in contact:

    >>> def coefficients(eom, t):
    ...     return np.tile([0.0, 0.0, 1.0], (1, eom.k // 3)), [500.0]
    >>> total = LinearInequality("total", "forces", coefficients)
    """

    name: str = field(metadata=checked(as_string))
    block: Block = field(metadata=checked(as_string))
    coefficients: Coefficients | Callable[[EquationsOfMotion, float], Coefficients]
    row_names: Sequence[str] = field(default=(), metadata=checked(as_strings))
    weight: float | None = field(default=None, metadata=checked(as_weight))

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.block not in BLOCKS:
            raise InputError(
                f"block of {self._label()} is {short_repr(self.block)}. It must be "
                f'"qdd", "tau" or "forces".'
            )
        if callable(self.coefficients) and not isinstance(self.coefficients, type):
            as_callable(f"coefficients of {self.name}", self.coefficients, "coefficients(eom, t)")
        else:
            object.__setattr__(self, "coefficients", self._checked(self.coefficients, None))

    def _label(self) -> str:
        return f"inequality {short_repr(self.name)}"

    def at(self, eom: EquationsOfMotion, t: float = 0.0) -> tuple[Array, Array]:
        """Return G and h at a state and a time, checked.

        Parameters
        ----------
        eom : EquationsOfMotion
            Equations of motion at the state.
        t : float, optional
            Time [s].

        Returns
        -------
        G : ndarray, shape (m, n)
            Coefficients; n is the size of the block.
        h : ndarray, shape (m,)
            Right-hand side, in the unit of G x.

        Raises
        ------
        InputError
            If the shapes do not fit.
        """
        n = getattr(eom, SIZES[self.block])
        if callable(self.coefficients):
            return self._checked(self.coefficients(eom, t), n)
        if np.shape(self.coefficients[0])[1] == n:  # everything else was checked at construction
            return cast("tuple[Array, Array]", self.coefficients)
        return self._checked(self.coefficients, n)

    def labels(self, m: int) -> tuple[ConstraintLabel, ...]:
        """Return a label for each of m rows.

        Parameters
        ----------
        m : int
            Number of rows.

        Returns
        -------
        tuple of ConstraintLabel
            The labels.

        Raises
        ------
        InputError
            If `row_names` has the wrong length.
        """
        if self.row_names and len(self.row_names) != m:
            raise InputError(
                f"inequality {self.name!r} has {len(self.row_names)} row names but {m} rows. Pass "
                f"one name for each row."
            )
        name = self.name
        if self.row_names:
            return tuple(ConstraintLabel(f"{name} {row}", name, row) for row in self.row_names)
        texts = [f"{name} {i}" for i in range(m)] if m > 1 else [name] * m
        return tuple(ConstraintLabel(text, "inequality", name, i) for i, text in enumerate(texts))

    def _checked(self, given: Any, n: int | None) -> tuple[Array, Array]:
        """Return G and h as arrays, checked; n: size of the block, None if it is unknown."""
        if not isinstance(given, tuple | list) or len(given) != 2:
            raise InputError(
                f"coefficients of inequality {self.name!r} must be a pair (G, h), not "
                f"{short_repr(given)}."
            )
        G = as_array(f"G of {self.name}", given[0], (None, None))
        if n is not None and G.shape[1] != n:
            advice = " Use a function of (eom, t) to follow the contacts."
            raise InputError(
                f"G of inequality {self.name!r} has {G.shape[1]} columns, but its block "
                f"{self.block!r} has {n} entries.{advice if self.block == 'forces' else ''}"
            )
        return G, as_array(f"h of {self.name}", given[1], (len(G),))


def _as_limits(name: str, value: npt.ArrayLike) -> Array:
    """Return torque limits for as many joints as `value` has entries, checked."""
    limits = numeric_copy(value)
    return as_torque_limits(1 if limits is None else limits.size, value)


def _as_bounds(name: str, value: Any, optional: bool = False) -> NormalForces:
    """Return a checked copy of bounds of normal forces; `optional` allows None for no bound."""
    given = {} if optional and value is None else value
    if not isinstance(given, Mapping):
        number = numeric_copy(given)
        if number is None or number.ndim:
            raise InputError(
                f"{name} is {short_repr(given)}. It must be one number [N], or a mapping from "
                f"names of contacts to numbers or functions of t, such as "
                f'{{"FL_foot": lambda t: …}}.'
            )
        return as_positive(name, given, "N", allow_zero=True)
    bounds = dict(given)
    for contact, bound in bounds.items():
        if callable(bound):
            as_callable(f"{name} at {contact}", bound, "force(t)")
        else:
            bounds[contact] = as_positive(f"{name} at {contact}", bound, "N", allow_zero=True)
    return MappingProxyType(bounds)


def _as_inequalities(name: str, value: Any) -> tuple[LinearInequality, ...]:
    """Return user-defined inequalities as a tuple, checked."""
    if isinstance(value, LinearInequality) or not isinstance(value, Sequence):
        raise InputError(f"{name} must be a list of LinearInequality, not {short_repr(value)}.")
    example = "floatbase.control.LinearInequality(name, block, (G, h))"
    return tuple(as_instance(f"each of {name}", each, LinearInequality, example) for each in value)


@dataclass(frozen=True, eq=False)
class Limits(Value):
    """Inequality constraints of a controller.

    Parameters
    ----------
    torque_limits : array_like, shape (d,)
        Torque limits, +inf for none [N·m].
    facets : int, optional
        Number of facets of the friction polyhedron, eq. (28), at every contact point.
    inner_approximation : bool, optional
        Whether the polyhedron lies inside the friction cone (safe) or outside it (optimistic).
    min_normal_force : float or mapping, optional
        Minimum of normal · f at every contact point, and thus at each corner of a flat foot [N]. It
        is one number for all points, or a mapping from names of contacts to numbers or functions of
        the time t [s]. Contacts that are not in the mapping have a minimum of 0. A name that is not
        among the contacts has no effect until its contact is added, since a lifted foot will be in
        contact again.
    max_normal_force : float or mapping, optional
        Maximum of normal · f, in the same form [N]. Contacts that are not in the mapping have no
        maximum.
    inequalities : sequence of LinearInequality, optional
        User-defined inequality constraints.
    facet_rotation : float, optional
        Angle by which the facets are rotated about the normal [rad].
    joint_limits : JointLimits, optional
        Position, velocity and acceleration limits of the joints; none by default. `of` takes those
        of the robot.
    normal_force_weight : float, optional
        None makes the bounds of normal forces hard. A number makes them soft: their violation
        times this weight is added to the objective [units of the objective per N]. Normal forces
        below 0 remain impossible.

    Raises
    ------
    InputError
        If an argument has a wrong type, shape or value.
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
    joint_limits: JointLimits | None = None
    normal_force_weight: float | None = field(default=None, metadata=checked(as_weight))

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.joint_limits is not None and not isinstance(self.joint_limits, JointLimits):
            raise InputError(
                f"joint_limits must be None or JointLimits, such as "
                f"floatbase.control.JointLimits.of(robot, weight=1e4), not "
                f"{short_repr(self.joint_limits)}. Controllers and "
                f'floatbase.control.Limits.of(robot) also accept "robot".'
            )

    @classmethod
    def of(
        cls,
        robot: Robot,
        *,
        torque_limits: npt.ArrayLike | None = None,
        joint_limits: JointLimits | Literal["robot"] | None = "robot",
        **options: Any,
    ) -> Limits:
        """Return the limits that a controller of a robot has with the same arguments.

        Parameters
        ----------
        robot : Robot
            The robot.
        torque_limits : float or array_like, shape (d,), optional
            Torque limits [N·m]; np.inf for none. The default is those of the robot.
        joint_limits : JointLimits or {"robot"}, optional
            Limits of the joints. "robot" uses those of the URDF, with a braking acceleration that
            the torque limits allow. None for no limits.
        **options
            Other parameters of the class, such as facets=8.

        Returns
        -------
        Limits
            The limits.

        Raises
        ------
        InputError
            If an argument has a wrong type, shape or value.
        """
        as_instance("robot", robot, Robot, 'fb.load("go2")')
        torque_limits = robot.torque_limits if torque_limits is None else torque_limits
        torques = as_torque_limits(robot.d, torque_limits)
        if isinstance(joint_limits, str) and joint_limits == "robot":
            joint_limits = JointLimits.of(robot, torque_limits=torques)
        return cls(torques, joint_limits=joint_limits, **options)

    def softened(self, weight: float) -> Limits:
        """Return limits whose hard constraints are soft, except the physical ones.

        All joint limits, user-defined inequalities and bounds of normal forces are then soft.
        Friction, torque limits and normal forces ≥ 0 remain hard.

        Parameters
        ----------
        weight : float
            Weight of the constraints that are hard now [units of the objective per unit of h].

        Returns
        -------
        Limits
            The limits; this object if nothing changes.
        """
        joints, inequalities = self.joint_limits, list(self.inequalities)
        changes: dict[str, Any] = {}
        bounded = bool(self.min_normal_force) or self.max_normal_force != {}
        if joints is not None and joints.weight is None:
            changes["joint_limits"] = replace(joints, weight=weight)
        for i, each in enumerate(inequalities):
            if each.weight is None:
                inequalities[i] = replace(each, weight=weight)
                changes["inequalities"] = inequalities
        if bounded and self.normal_force_weight is None:
            changes["normal_force_weight"] = weight
        return replace(self, **changes) if changes else self

    @property
    def polyhedron_options(self) -> tuple[int, bool, float]:
        """Options of the friction polyhedra: the arguments of `FrictionPolyhedron` after mu."""
        return self.facets, self.inner_approximation, self.facet_rotation

    @cached_property
    def time_varying(self) -> bool:
        """Whether a bound of a normal force is a function of time."""
        bounds = self._bounds_by_name.values()
        return any(callable(value) for bound in bounds for value in bound.values())

    @property
    def _bounds_by_name(self) -> dict[str, Mapping[str, Any]]:
        """Bounds of normal forces that are mappings, by the name of the argument."""
        both = {name: getattr(self, name) for name in _BOUNDS}
        return {name: bound for name, bound in both.items() if isinstance(bound, Mapping)}

    def check_names(
        self, robot: Robot, contacts: Iterable[str], before: Limits | None = None
    ) -> None:
        """Check that bounds of normal forces name known contacts only.

        Parameters
        ----------
        robot : Robot
            The robot. The frames of its feet are known, since they are the names of contacts there.
        contacts : iterable of str
            Other known names.
        before : Limits, optional
            Earlier limits, whose names count as known.

        Raises
        ------
        UnknownNameError
            If a name is neither known nor in the limits before.
        """
        names = {*contacts, *(foot.frame for foot in robot.feet)}
        names = names.union(*(before._bounds_by_name.values() if before else ()))
        for argument, bound in self._bounds_by_name.items():
            for name in bound:
                if name not in names:
                    raise unknown_name(f"contact in {argument}", name, names)

    def normal_forces(self, contacts: Contacts, t: float = 0.0) -> tuple[Array, Array]:
        """Return minimum and maximum normal force of each contact point.

        Parameters
        ----------
        contacts : Contacts
            Contacts with P points.
        t : float, optional
            Time [s].

        Returns
        -------
        minimum : ndarray, shape (P,)
            Minimum normal forces [N].
        maximum : ndarray, shape (P,)
            Maximum normal forces, inf for none [N].

        Raises
        ------
        InputError
            If a function returns a value that is not a number ≥ 0.
        """
        if not self.time_varying:
            return _constant_normal_forces(contacts, self, 0.0)
        return _normal_forces_at(contacts, self, t)

    def hard_normal_forces(self, contacts: Contacts, t: float = 0.0) -> tuple[Array, Array]:
        """Return the bounds that normal forces must satisfy: 0 and inf if the bounds are soft.

        Parameters
        ----------
        contacts : Contacts
            Contacts with P points.
        t : float, optional
            Time [s].

        Returns
        -------
        minimum, maximum : ndarray, shape (P,)
            Normal forces [N].

        Raises
        ------
        InputError
            If a function returns a value that is not a number ≥ 0.
        """
        if self.normal_force_weight is None:
            return self.normal_forces(contacts, t)
        return np.zeros(contacts.n_points), np.full(contacts.n_points, np.inf)

    def all_inequalities(self, contacts: Contacts) -> tuple[LinearInequality, ...]:
        """Return the user-defined inequalities, and soft bounds of normal forces if there are any.

        Parameters
        ----------
        contacts : Contacts
            Contacts to which the bounds apply.

        Returns
        -------
        tuple of LinearInequality
            The inequalities.
        """
        is_soft = self.normal_force_weight is not None
        bounds = _soft_force_bounds(contacts, self) if is_soft else None
        return (*self.inequalities, *([bounds] if bounds else []))

    def bounded_points(self, contacts: Contacts) -> npt.NDArray[np.bool_]:
        """Return which contact points have bounds of their normal force, hard or soft.

        Parameters
        ----------
        contacts : Contacts
            Contacts with P points.

        Returns
        -------
        ndarray of bool, shape (2, P)
            True for points with a minimum that is not always 0, and for points with a maximum.
        """
        least, largest = self.min_normal_force, self.max_normal_force
        bounded = list[tuple[bool, bool]]()
        for foot in contacts.friction_contacts:
            has_minimum = _bound_of(least, foot.name, 0.0) != 0.0
            has_maximum = _bound_of(largest, foot.name, None) is not None
            bounded += [(has_minimum, has_maximum)] * len(foot.point_names)
        return np.array(bounded, dtype=np.bool_).reshape(-1, 2).T


def _bound_of(given: NormalForces | None, name: str, otherwise: Any) -> Any:
    """Return the bound of the normal forces of a contact: a number, a function or `otherwise`."""
    return given.get(name, otherwise) if isinstance(given, Mapping) else given


def _normal_forces_at(contacts: Contacts, limits: Limits, t: float) -> tuple[Array, Array]:
    """Return minimum and maximum normal force of each contact point at time t, (P,)."""
    found: tuple[list[float], list[float]] = [], []
    for name, otherwise, bounds in zip(_BOUNDS, (0.0, np.inf), found, strict=True):
        for each in contacts.friction_contacts:
            value = _bound_of(getattr(limits, name), each.name, otherwise)
            if callable(value):
                value = as_positive(f"{name} at {each.name}", value(t), "N", allow_zero=True)
            bounds += [value] * len(each.point_names)
    return frozen(np.array(found[0], np.float64)), frozen(np.array(found[1], np.float64))


# what does not depend on the state is cached; contacts, robots and limits are immutable
_constant_normal_forces = lru_cache(maxsize=64)(_normal_forces_at)


@lru_cache(maxsize=64)
def _soft_force_bounds(contacts: Contacts, limits: Limits) -> LinearInequality | None:
    """Return soft bounds of the normal forces as an inequality on λ, or None if there are none."""
    has_minimum, has_maximum = limits.bounded_points(contacts)
    if not np.any(has_minimum | has_maximum):
        return None
    G = np.zeros((contacts.n_points, contacts.k))
    for i in range(contacts.n_points):
        at = contacts.point_force_indices[3 * i : 3 * i + 3]
        G[i, at] = contacts.normals[i]
    rows = read_only(np.vstack([-G[has_minimum], G[has_maximum]]))

    def coefficients(eom: EquationsOfMotion | None, t: float) -> Coefficients:
        """Return the rows and the bounds at time t."""
        least, largest = limits.normal_forces(contacts, t)
        return rows, np.concatenate([-least[has_minimum], largest[has_maximum]])

    points = np.array(contacts.point_names)
    names = [f"smallest {point}" for point in points[has_minimum]]
    names += [f"largest {point}" for point in points[has_maximum]]
    weight = limits.normal_force_weight
    given = coefficients if limits.time_varying else coefficients(None, 0.0)
    return LinearInequality("soft normal force", "forces", given, names, weight)


@lru_cache(maxsize=64)
def force_rows(contacts: Contacts, limits: Limits) -> tuple[Array, tuple[ConstraintLabel, ...]]:
    """Return G of the constraints on contact forces, and their names.

    The rows are the friction facets and the minimum normal force of every point, then the maximum
    normal forces.
    """
    per_point = limits.facets + 1
    names: list[ConstraintLabel] = []
    G = np.zeros((per_point * contacts.n_points, contacts.k))
    for i, point in enumerate(contacts.point_names):
        cone = FrictionPolyhedron(contacts.normals[i], contacts.mus[i], *limits.polyhedron_options)
        rows, columns = slice(per_point * i, per_point * (i + 1)), slice(3 * i, 3 * i + 3)
        G[rows, contacts.point_force_indices[columns]] = np.vstack([cone.face_matrix, -cone.normal])
        for facet in range(limits.facets):
            names.append(ConstraintLabel(f"{point} facet {facet}", "friction", point, facet))
        names.append(ConstraintLabel(f"{point} normal force", "normal force", point))
    bounded = np.flatnonzero(hard_maximum(contacts, limits))
    for point in (contacts.point_names[i] for i in bounded):
        kind = "largest normal force"
        names.append(ConstraintLabel(f"{point} {kind}", kind, point))
    return read_only(np.vstack([G, -G[limits.facets :: per_point][bounded]])), tuple(names)


def force_bounds(contacts: Contacts, limits: Limits, least: Array, largest: Array) -> Array:
    """Return h of `force_rows`."""
    h = np.zeros((contacts.n_points, limits.facets + 1))
    h[:, -1] = -least
    return np.concatenate([h.ravel(), largest[hard_maximum(contacts, limits)]])


@lru_cache(maxsize=64)
def hard_maximum(contacts: Contacts, limits: Limits) -> npt.NDArray[np.bool_]:
    """Return which contact points have a hard maximum of the normal force."""
    has_maximum: npt.NDArray[np.bool_] = limits.bounded_points(contacts)[1]
    has_maximum &= limits.normal_force_weight is None
    has_maximum.setflags(write=False)
    return has_maximum


@lru_cache(maxsize=64)
def torque_rows(robot: Robot, limits: Limits) -> tuple[Array, Array, tuple[ConstraintLabel, ...]]:
    """Return G, h and names of τ ≤ limit and -τ ≤ limit, for every joint that has a limit."""
    limited = np.flatnonzero(np.isfinite(limits.torque_limits))
    rows, bound = np.eye(robot.d)[limited], limits.torque_limits[limited]
    sides = [(side, robot.joint_names[i]) for side in ("upper", "lower") for i in limited]
    names = tuple(
        ConstraintLabel(f"torque limit {joint} {side}", f"{side} torque limit", joint)
        for side, joint in sides
    )
    return read_only(np.vstack([rows, -rows])), read_only(np.tile(bound, 2)), names
