"""The wrenches that a stance can produce: the sum of its friction cones (28) by (20) and (21), and slices of it.

A wrench is w = (f_c, τ_c), shape (6,): the total contact force, N, and its moment about the centre of mass, N·m, both
world: τ_c = Σ (x_i - x_c) × f_i. Sources: the document, §3.1 and §4.2; Caron, Pham and Nakamura, Leveraging cone double
description for multi-contact stability of humanoids, RSS 2015.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from floatbase._arrays import Array, Value, cached_property, checked, of_kind, plain_numbers, positive, read_only, whole
from floatbase.dynamics import Contacts, grasp_matrix
from floatbase.errors import InfeasibleError, InputError
from floatbase.friction.cones import FrictionPolyhedron
from floatbase.friction.polytopes import cone_rows, vertices
from floatbase.qp import INFEASIBLE, UNBOUNDED, linear_program
from floatbase.robots import State

TOLERANCE = 1e-6  # N, by which `contains` lets contact forces pass their facets: what a linear program leaves
_MOST_DIRECTIONS = 3600  # a tenth of a degree apart; each takes a linear program


@dataclass(frozen=True, eq=False)
class WrenchSet(Value):
    """(20)(21)(28) All wrenches Σ_i (f_i, (x_i - x_c) × f_i), f_i in its friction polyhedron: the contact wrench cone (CWC).

    `wrench_set` makes it from a state and its contacts. The torque limits of the joints do not enter.

    points: x_i, shape (P, 3), m, world.
    cones: a `FrictionPolyhedron` for each point.
    about: x_c, shape (3,), m, world.
    weight: of the robot, N; (0, 0, weight) is the force that `torques` and `support_region` assume.
    max_normal_force: shape (P,), N, +inf where there is no limit. Without limits the set is a cone; with a limit on every
        point it is bounded.
    """

    points: Array
    cones: tuple[FrictionPolyhedron, ...]
    about: Array
    weight: float
    max_normal_force: Array

    def __post_init__(self) -> None:
        points = checked("points", self.points, (None, 3), "m")
        cones = tuple(self.cones) if isinstance(self.cones, Sequence) else ()
        if not len(points):
            raise InputError("a wrench set needs at least one contact point; a robot in the air can produce no wrench.")
        if len(cones) != len(points) or not all(isinstance(cone, FrictionPolyhedron) for cone in cones):
            raise InputError(f"cones must hold one FrictionPolyhedron for each of the {len(points)} points.")
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "cones", cones)
        object.__setattr__(self, "about", checked("about", self.about, (3,), "m"))
        object.__setattr__(self, "weight", positive("weight", self.weight, "N"))
        limits = plain_numbers(self.max_normal_force)  # +inf is allowed
        if limits is None or limits.shape != (len(points),) or not np.all(limits > 0):
            count = f"one number > 0 or {len(points)} of them, one for each contact point (N)"
            raise InputError(f"max_normal_force must be {count}.")
        object.__setattr__(self, "max_normal_force", read_only(limits))

    @cached_property
    def arm(self) -> float:
        """The largest distance of a point from x_c, m (1 where all are 0): torque / arm is comparable to force."""
        return float(np.max(np.linalg.norm(self.points - self.about, axis=1))) or 1.0

    @cached_property
    def rays(self) -> Array:
        """The edges of all cones as wrenches, shape (6, N), point after point, each with normal component 1 N."""
        parts = [grasp_matrix(x[None], self.about) @ cone.rays.T for x, cone in zip(self.points, self.cones, strict=True)]
        return read_only(np.hstack(parts))

    @cached_property
    def rows(self) -> Array:
        """Facets of the set, shape (m, 6): rows @ w ≤ 0, beside equalities @ w = 0. Empty where every wrench is produced.

        A row (a, b) has ‖a‖² + ‖arm b‖² = 1, so rows @ w is in N. `InputError` for a set with limits on the normal force.
        """
        return self._halfspaces[0]

    @cached_property
    def equalities(self) -> Array:
        """What no contact force can produce, shape (m, 6): equalities @ w = 0, scaled as `rows`.

        Two point feet cannot twist about the line through them (1 row), one foot makes no torque about itself (3 rows).
        """
        return self._halfspaces[1]

    def margin(self, wrench: npt.ArrayLike) -> float:
        """How far inside its facets every contact force can be, N, when together they make the wrench.

        wrench: shape (6,), world: force, N, then moment about `about`, N·m.

        The largest t for which there are f_i with margin ≥ t each, and t below the normal force's limit. -inf where no forces
        make the wrench (see `equalities`), +inf where contacts that face each other can be squeezed as hard as one likes.
        """
        w = checked("wrench", wrench, (6,))
        scale = float(np.linalg.norm(self._to_newton @ w)) or self.weight
        G = np.hstack([self._to_newton @ grasp_matrix(self.points, self.about), np.zeros((6, 1))])
        rows, h = self._force_rows
        cost = np.append(np.zeros(3 * len(self.points)), -1.0)
        result = linear_program(cost, (G, self._to_newton @ w / scale), (rows, h / scale), (None, None))
        if result.status == INFEASIBLE:
            return -np.inf
        return np.inf if result.status == UNBOUNDED else -scale * float(result.fun)

    def contains(self, wrench: npt.ArrayLike, tolerance: float = TOLERANCE) -> bool:
        """Whether contact forces that pass their facets and limits by a tolerance, N, at most make the wrench, shape (6,)."""
        return self.margin(wrench) >= -positive("tolerance", tolerance, "N", allow_zero=True)

    def reach(self, direction: npt.ArrayLike, start: npt.ArrayLike | None = None) -> float:
        """The largest s with start + s · direction in the set: how hard the stance can push in just this direction.

        direction, start: wrenches of shape (6,); start is 0 by default, (0, 0, weight, 0, 0, 0) while the weight is carried.
        +inf where there is no end, negative where the set lies behind. Raises `InfeasibleError` when the line misses it.
        """
        d = checked("direction", direction, (6,))
        if not np.any(d):
            raise InputError("direction is the zero wrench; it must have a direction.")
        w = checked("start", np.zeros(6) if start is None else start, (6,))
        N, scale = self.rays.shape[1], float(np.linalg.norm(self._to_newton @ d))
        result = linear_program(
            np.append(np.zeros(N), -1.0),
            (self._to_newton @ np.column_stack([self.rays, -d / scale]), self._to_newton @ w),
            self._limit_rows(1),
            [(0.0, None)] * N + [(None, None)],
        )
        if result.status == INFEASIBLE:
            raise InfeasibleError("no wrench start + s · direction can be produced, however large or small s is.")
        return np.inf if result.status == UNBOUNDED else -float(result.fun) / scale

    def horizontal_reach(self, n: int = 72) -> tuple[Array, Array]:
        """The largest horizontal force that goes with the full weight and no moment about the CoM, in each of n directions.

        Angles, shape (n,), rad, from the world's x axis towards y, evenly spaced, and forces, shape (n,), N: `reach` of that
        direction from (0, 0, weight, 0, 0, 0). Over `weight` they are the parts of g by which the CoM can be accelerated;
        facets and the height of the CoM end them. +inf where there is no end. Raises `InfeasibleError` where the contacts
        cannot carry the weight without moment.
        """
        angles = 2.0 * np.pi * np.arange(whole("number of directions n", n, 1, _MOST_DIRECTIONS)) / n
        carried = np.array([0.0, 0.0, self.weight, 0.0, 0.0, 0.0])
        if not self.contains(carried):
            raise InfeasibleError("these contacts cannot carry the weight without a moment about the centre of mass.")
        forces = [self.reach([np.cos(angle), np.sin(angle), 0.0, 0.0, 0.0, 0.0], carried) for angle in angles]
        return read_only(angles), read_only(forces)

    def torques(self, force: npt.ArrayLike | None = None) -> Array:
        """The slice at a total force: vertices, shape (k, 3), N·m, of the torques τ_c that can go with it.

        force: f_c, shape (3,), N, world; by default (0, 0, weight), which carries the robot. No rows when no contact forces
        add up to it. Raises `InputError` when the slice has no end, as where walls that face each other can be squeezed.
        """
        f = checked("force", (0.0, 0.0, self.weight) if force is None else force, (3,), "N")
        return self._slice(self.rays[3:], self.rays[:3], f, (float(np.linalg.norm(f)) or 1.0) * self.arm)

    def support_region(self) -> Array:
        """Where the CoM may be for the robot to stand still: vertices of a polygon, shape (k, 2), m, world x and y.

        All horizontal positions c for which forces in the polyhedra carry the weight without torque about c; its height and
        `about` do not matter. The vertices come counter-clockwise; on level ground they are those of the feet. Two rows are a
        segment, one is a point, none says that the stance cannot carry the weight. Raises `InputError` when it has no end.
        """
        origin = self.points.mean(axis=0)
        rays = np.vstack([self.rays[:3], self.rays[3:] + np.cross(self.about - origin, self.rays[:3].T).T])
        # (c - origin) × (0, 0, weight) = (weight c_y, -weight c_x, 0) must be the moment about the origin
        places = np.array([-rays[4], rays[3]]) / self.weight
        carried = np.array([0.0, 0.0, self.weight, 0.0])
        size = float(np.max(np.linalg.norm(self.points - origin, axis=1))) or 1.0
        return read_only(origin[:2] + self._slice(places, rays[[0, 1, 2, 5]], carried, size))

    def _slice(self, values: Array, fixed: Array, at: Array, size: float) -> Array:
        """Vertices of {values @ x : fixed @ x = at, x ≥ 0 within the limits}, shape (k, n)."""
        scale = float(np.linalg.norm(at)) or self.weight
        limits = self._limit_rows(0, scale)

        def farthest(direction: Array) -> Array:
            result = linear_program(-(direction @ values), (fixed, at / scale), limits)
            if result.status == UNBOUNDED:
                endless = "contacts can be squeezed against each other without limit"
                raise InputError(f"this slice of the wrench set has no end: {endless}. Give max_normal_force.")
            if result.status == INFEASIBLE:
                raise InfeasibleError("no contact forces add up to the requested force.")
            return scale * (values @ result.x)

        try:
            return read_only(vertices(farthest, len(values), size))
        except InfeasibleError:
            return read_only(np.zeros((0, len(values))))

    @cached_property
    def _to_newton(self) -> Array:
        """Divides torques by `arm`, shape (6, 6)."""
        return np.diag(np.repeat([1.0, 1.0 / self.arm], 3))

    @cached_property
    def _force_rows(self) -> tuple[Array, Array]:
        """Facets and limits of all points on (λ, t): every slack at least t."""
        rows, h = [], []
        for at, cone, limit in zip(np.eye(len(self.points)), self.cones, self.max_normal_force, strict=True):
            own = np.vstack([cone.rows, cone.normal]) if np.isfinite(limit) else cone.rows
            rows.append(np.hstack([np.kron(at, own), np.ones((len(own), 1))]))
            h.append(np.append(np.zeros(cone.facets), limit)[: len(own)])
        return np.vstack(rows), np.concatenate(h)

    def _limit_rows(self, more: int, scale: float = 1.0) -> tuple[Array, Array] | None:
        """Limits of the normal force on the weights of the rays, `more` columns of zeros after them; N / scale."""
        limited = np.isfinite(self.max_normal_force)
        if not np.any(limited):
            return None
        rows = np.repeat(np.eye(len(self.points)), [cone.facets for cone in self.cones], axis=1)[limited]
        return np.hstack([rows, np.zeros((len(rows), more))]), self.max_normal_force[limited] / scale

    @cached_property
    def _halfspaces(self) -> tuple[Array, Array]:
        if np.any(np.isfinite(self.max_normal_force)):
            raise InputError(
                "rows describe the cone of a stance without limits on the normal force; make the set without "
                "max_normal_force, or ask contains and margin."
            )
        G, E = cone_rows(self._to_newton @ self.rays)
        return read_only(G @ self._to_newton), read_only(E @ self._to_newton)


def wrench_set(
    state: State,
    contacts: Contacts,
    *,
    facets: int = 4,
    inside: bool = True,
    turn: float = 0.0,
    max_normal_force: npt.ArrayLike | None = None,
) -> WrenchSet:
    """(20)(21)(28) The wrenches about the centre of mass that a state's contacts can produce.

    state: where the robot is.
    contacts: its contacts, each with a friction cone.
    facets, inside, turn: the friction polyhedron of every point (see `FrictionPolyhedron`); by default the controller's.
    max_normal_force: N, one number or one for each contact point; no limit by default.

    Raises `InputError` where there is no contact, or one whose forces have no cone. Source: the document, §3.1, §4.2.
    """
    of_kind("state", state, State)
    of_kind("contacts", contacts, Contacts)
    coneless = [contact.name for contact in contacts if contact.k != 3 * len(contact.point_names)]
    if coneless:
        raise InputError(f"{', '.join(coneless)} has forces without a cone; leave it out: contacts.without(…).")
    shapes = zip(contacts.normals, contacts.mus, strict=True)
    cones = tuple(FrictionPolyhedron(n, mu, facets, inside, turn) for n, mu in shapes)
    limits: Any = np.inf if max_normal_force is None else max_normal_force
    number = plain_numbers(limits)
    limits = np.repeat(number, len(cones)) if number is not None and number.ndim == 0 else limits
    return WrenchSet(contacts.positions(state), cones, state.com, state.robot.weight, limits)
