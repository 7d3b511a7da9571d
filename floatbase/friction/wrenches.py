"""The wrenches that a stance can produce: the sum of its friction cones (28) by (20) and (21), and
slices of it.

A wrench is w = (f_c, τ_c), shape (6,): the total contact force, N, and its moment about the centre
of mass, N·m, both in world axes: τ_c = Σ (x_i - x_c) × f_i.

Sources: [FBR], §3.1 and §4.2; Caron, Pham and Nakamura, Leveraging cone double description for
multi-contact stability of humanoids, RSS 2015.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_instance,
    as_integer,
    as_positive,
    cached_property,
    checked,
    numeric_copy,
    read_only,
)
from floatbase.dynamics import Contacts, FrictionContact, grasp_matrix
from floatbase.errors import InfeasibleError, InputError
from floatbase.friction._polytopes import cone_face_matrix, polytope_vertices
from floatbase.friction.cones import FrictionPolyhedron
from floatbase.qp._linear_programs import INFEASIBLE, UNBOUNDED, linear_program
from floatbase.robots import State

# N, by which `contains` lets contact forces pass their facets: what a linear program leaves
TOLERANCE = 1e-6
_MAX_DIRECTIONS = 3600  # a tenth of a degree apart; each takes a linear program


@dataclass(frozen=True, eq=False)
class WrenchSet(Value):
    """(20)(21)(28) All wrenches Σ_i (f_i, (x_i - x_c) × f_i), f_i in its friction polyhedron: the
    contact wrench cone (CWC).

    `wrench_set` makes it from a state and its contacts. The torque limits of the joints do not
    enter.

    points: x_i, shape (P, 3), m, world.
    cones: a `FrictionPolyhedron` for each point.
    reference_point: x_c, shape (3,), m, world.
    weight: of the robot, N; (0, 0, weight) is the force that `moment_vertices` and `support_region`
        assume.
    max_normal_force: shape (P,), N, +inf where there is no limit. Without limits the set is a cone;
        with a limit on every point it is bounded.
    """

    points: Array = field(metadata=checked(as_array, (None, 3), "m"))
    cones: tuple[FrictionPolyhedron, ...]
    reference_point: Array = field(metadata=checked(as_array, (3,), "m"))
    weight: float = field(metadata=checked(as_positive, "N"))
    max_normal_force: Array

    def __post_init__(self) -> None:
        super().__post_init__()
        points, cones = self.points, self.cones
        cones = tuple(cones) if isinstance(cones, Sequence) else ()
        if not len(points):
            raise InputError(
                "a wrench set needs at least one contact point; a robot in the air can produce no "
                "wrench."
            )
        if len(cones) != len(points) or not all(
            isinstance(cone, FrictionPolyhedron) for cone in cones
        ):
            raise InputError(
                f"cones must hold one FrictionPolyhedron for each of the {len(points)} points."
            )
        object.__setattr__(self, "cones", cones)
        limits = numeric_copy(self.max_normal_force)  # +inf is allowed
        if limits is None or limits.shape != (len(points),) or not np.all(limits > 0):
            count = f"one number > 0 or {len(points)} of them, one for each contact point (N)"
            raise InputError(f"max_normal_force must be {count}.")
        object.__setattr__(self, "max_normal_force", read_only(limits))

    @cached_property
    def max_lever_arm(self) -> float:
        """The largest distance of a point from x_c, m (1 where all are 0): torque / max_lever_arm
        is comparable to force.
        """
        return float(np.max(np.linalg.norm(self.points - self.reference_point, axis=1))) or 1.0

    @cached_property
    def rays(self) -> Array:
        """The edges of all cones as wrenches, shape (6, N), point after point, each with normal
        component 1 N.
        """
        parts = [
            grasp_matrix(x[None], self.reference_point) @ cone.rays.T
            for x, cone in zip(self.points, self.cones, strict=True)
        ]
        return read_only(np.hstack(parts))

    @cached_property
    def face_matrix(self) -> Array:
        """Facets of the set, (m, 6): face_matrix @ w ≤ 0, beside equalities @ w = 0. Empty where
        every wrench is produced.

        A row (a, b) has ‖a‖² + ‖max_lever_arm b‖² = 1, so face_matrix @ w is in N. `InputError` for
        a set with limits on the normal force.
        """
        return self._halfspaces[0]

    @cached_property
    def equalities(self) -> Array:
        """What no contact force can produce, shape (m, 6): equalities @ w = 0, scaled as
        `face_matrix`.

        Two point feet cannot twist about the line through them (1 row), one foot makes no torque
        about itself (3 rows).
        """
        return self._halfspaces[1]

    def margin(self, wrench: npt.ArrayLike) -> float:
        """How far inside its facets every contact force can be, N, when together they make the
        wrench.

        wrench: shape (6,), world: force, N, then moment about `reference_point`, N·m.

        The largest t for which there are f_i with margin ≥ t each, and t below the normal force's
        limit. -inf where no forces make the wrench (see `equalities`), +inf where contacts that
        face each other can be squeezed as hard as one likes.
        """
        w = as_array("wrench", wrench, (6,))
        scale = float(np.linalg.norm(self._wrench_scaling @ w)) or self.weight
        G = np.hstack(
            [
                self._wrench_scaling @ grasp_matrix(self.points, self.reference_point),
                np.zeros((6, 1)),
            ]
        )
        rows, h = self._force_inequalities
        cost = np.append(np.zeros(3 * len(self.points)), -1.0)
        result = linear_program(
            cost, (G, self._wrench_scaling @ w / scale), (rows, h / scale), (None, None)
        )
        if result.status == INFEASIBLE:
            return -np.inf
        return np.inf if result.status == UNBOUNDED else -scale * float(result.fun)

    def contains(self, wrench: npt.ArrayLike, tolerance: float = TOLERANCE) -> bool:
        """Whether contact forces that pass their facets and limits by a tolerance, N, at most make
        the wrench, shape (6,).
        """
        return self.margin(wrench) >= -as_positive("tolerance", tolerance, "N", allow_zero=True)

    def max_scaling(self, direction: npt.ArrayLike, start: npt.ArrayLike | None = None) -> float:
        """The largest s with start + s · direction in the set: how hard the stance can push in just
        this direction.

        direction, start: wrenches of shape (6,); start is 0 by default, (0, 0, weight, 0, 0, 0)
            while the weight is carried.
        +inf where there is no end, negative where the set lies behind. Raises `InfeasibleError`
        when the line misses it.
        """
        d = as_array("direction", direction, (6,))
        if not np.any(d):
            raise InputError("direction is the zero wrench; it must have a direction.")
        w = as_array("start", np.zeros(6) if start is None else start, (6,))
        N, scale = self.rays.shape[1], float(np.linalg.norm(self._wrench_scaling @ d))
        result = linear_program(
            np.append(np.zeros(N), -1.0),
            (
                self._wrench_scaling @ np.column_stack([self.rays, -d / scale]),
                self._wrench_scaling @ w,
            ),
            self._limit_inequalities(1),
            [(0.0, None)] * N + [(None, None)],
        )
        if result.status == INFEASIBLE:
            raise InfeasibleError(
                "no wrench start + s · direction can be produced, however large or small s is."
            )
        return np.inf if result.status == UNBOUNDED else -float(result.fun) / scale

    def max_horizontal_forces(self, n: int = 72) -> tuple[Array, Array]:
        """The largest horizontal force that goes with the full weight and no moment about the CoM,
        in each of n directions.

        Angles, shape (n,), rad, from the world's x axis towards y, evenly spaced, and forces, shape
        (n,), N: `max_scaling` of that direction from (0, 0, weight, 0, 0, 0). Over `weight` they
        are the parts of g by which the CoM can be accelerated; facets and the height of the CoM end
        them. +inf where there is no end. Raises `InfeasibleError` where the contacts cannot carry
        the weight without moment.
        """
        angles = (
            2.0 * np.pi * np.arange(as_integer("number of directions n", n, 1, _MAX_DIRECTIONS)) / n
        )
        weight_wrench = np.array([0.0, 0.0, self.weight, 0.0, 0.0, 0.0])
        if not self.contains(weight_wrench):
            raise InfeasibleError(
                "these contacts cannot carry the weight without a moment about the centre of mass."
            )
        forces = [
            self.max_scaling([np.cos(angle), np.sin(angle), 0.0, 0.0, 0.0, 0.0], weight_wrench)
            for angle in angles
        ]
        return read_only(angles), read_only(forces)

    def moment_vertices(self, force: npt.ArrayLike | None = None) -> Array:
        """The slice at a total force: vertices, shape (k, 3), N·m, of the torques τ_c that can go
        with it.

        force: f_c, shape (3,), N, world; by default (0, 0, weight), which carries the robot. No
            rows when no contact forces
        add up to it. Raises `InputError` when the slice has no end, as where walls that face each
        other can be squeezed.
        """
        f = as_array("force", (0.0, 0.0, self.weight) if force is None else force, (3,), "N")
        return self._slice(
            self.rays[3:], self.rays[:3], f, (float(np.linalg.norm(f)) or 1.0) * self.max_lever_arm
        )

    def support_region(self) -> Array:
        """Where the CoM may be for the robot to stand still: vertices of a polygon, shape (k, 2),
        m, world x and y.

        All horizontal positions c for which forces in the polyhedra carry the weight without torque
        about c; its height and `reference_point` do not matter. The vertices come
        counter-clockwise; on level ground they are those of the feet. Two rows are a segment, one
        is a point, none says that the stance cannot carry the weight. Raises `InputError` when it
        has no end.
        """
        origin = self.points.mean(axis=0)
        rays = np.vstack(
            [
                self.rays[:3],
                self.rays[3:] + np.cross(self.reference_point - origin, self.rays[:3].T).T,
            ]
        )
        # (c - origin) × (0, 0, weight) = (weight c_y, -weight c_x, 0) must be the moment about the
        # origin
        places = np.array([-rays[4], rays[3]]) / self.weight
        carried = np.array([0.0, 0.0, self.weight, 0.0])
        size = float(np.max(np.linalg.norm(self.points - origin, axis=1))) or 1.0
        return read_only(origin[:2] + self._slice(places, rays[[0, 1, 2, 5]], carried, size))

    def _slice(self, values: Array, fixed: Array, at: Array, size: float) -> Array:
        """Vertices of {values @ x : fixed @ x = at, x ≥ 0 within the limits}, shape (k, n)."""
        scale = float(np.linalg.norm(at)) or self.weight
        limits = self._limit_inequalities(0, scale)

        def support_point(direction: Array) -> Array:
            result = linear_program(-(direction @ values), (fixed, at / scale), limits)
            if result.status == UNBOUNDED:
                endless = "contacts can be squeezed against each other without limit"
                raise InputError(
                    f"this slice of the wrench set has no end: {endless}. Give max_normal_force."
                )
            if result.status == INFEASIBLE:
                raise InfeasibleError("no contact forces add up to the requested force.")
            point: Array = scale * (values @ result.x)
            return point

        try:
            return read_only(polytope_vertices(support_point, len(values), size))
        except InfeasibleError:
            return read_only(np.zeros((0, len(values))))

    @cached_property
    def _wrench_scaling(self) -> Array:
        """Divides torques by `max_lever_arm`, shape (6, 6)."""
        return np.diag(np.repeat([1.0, 1.0 / self.max_lever_arm], 3))

    @cached_property
    def _force_inequalities(self) -> tuple[Array, Array]:
        """Facets and limits of all points on (λ, t): every slack at least t."""
        rows, h = [], []
        for at, cone, limit in zip(
            np.eye(len(self.points)), self.cones, self.max_normal_force, strict=True
        ):
            face_matrix = (
                np.vstack([cone.face_matrix, cone.normal])
                if np.isfinite(limit)
                else cone.face_matrix
            )
            rows.append(np.hstack([np.kron(at, face_matrix), np.ones((len(face_matrix), 1))]))
            h.append(np.append(np.zeros(cone.facets), limit)[: len(face_matrix)])
        return np.vstack(rows), np.concatenate(h)

    def _limit_inequalities(
        self, extra_columns: int, scale: float = 1.0
    ) -> tuple[Array, Array] | None:
        """Limits of the normal force on the weights of the rays, `extra_columns` columns of zeros
        after them; N / scale.
        """
        limited = np.isfinite(self.max_normal_force)
        if not np.any(limited):
            return None
        rows = np.repeat(np.eye(len(self.points)), [cone.facets for cone in self.cones], axis=1)[
            limited
        ]
        return np.hstack([rows, np.zeros((len(rows), extra_columns))]), self.max_normal_force[
            limited
        ] / scale

    @cached_property
    def _halfspaces(self) -> tuple[Array, Array]:
        if np.any(np.isfinite(self.max_normal_force)):
            raise InputError(
                "face_matrix describes the cone of a stance without limits on the normal force; "
                "make the set without "
                "max_normal_force, or ask contains and margin."
            )
        G, E = cone_face_matrix(self._wrench_scaling @ self.rays)
        return read_only(G @ self._wrench_scaling), read_only(E @ self._wrench_scaling)


def wrench_set(
    state: State,
    contacts: Contacts,
    *,
    facets: int = 4,
    inner_approximation: bool = True,
    facet_rotation: float = 0.0,
    max_normal_force: npt.ArrayLike | None = None,
) -> WrenchSet:
    """(20)(21)(28) The wrenches about the centre of mass that a state's contacts can produce.

    state: where the robot is.
    contacts: its contacts, each with a friction cone.
    facets, inner_approximation, facet_rotation: the friction polyhedron of every point (see
        `FrictionPolyhedron`); by default the controller's.
    max_normal_force: N, one number or one for each contact point; no limit by default.

    Raises `InputError` where there is no contact, or one whose forces have no cone. Source: [FBR],
    §3.1, §4.2.
    """
    as_instance("state", state, State)
    as_instance("contacts", contacts, Contacts)
    without_cone = [c.name for c in contacts if not isinstance(c, FrictionContact)]
    if without_cone:
        raise InputError(
            f"{', '.join(without_cone)} has forces without a cone; leave it out: "
            f"contacts.without(…)."
        )
    point_data = zip(contacts.normals, contacts.mus, strict=True)
    cones = tuple(
        FrictionPolyhedron(n, mu, facets, inner_approximation, facet_rotation)
        for n, mu in point_data
    )
    limits: Any = np.inf if max_normal_force is None else max_normal_force
    numeric = numeric_copy(limits)
    limits = np.repeat(numeric, len(cones)) if numeric is not None and numeric.ndim == 0 else limits
    return WrenchSet(contacts.positions(state), cones, state.com, state.robot.weight, limits)
