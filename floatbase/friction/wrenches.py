"""The set of wrenches that a stance can produce: the sum of its friction cones, and slices of it.

A wrench is w = (f_c, τ_c), shape (6,): the total contact force [N] and its moment about the centre
of mass [N·m], both in world axes, with τ_c = Σ (x_i - x_c) × f_i. Sources: [FBR]_, §3.1 and §4.2;
[Caron2015b]_.
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

# N, by which `contains` lets contact forces exceed their facets: a linear program's residual
TOLERANCE = 1e-6
_MAX_DIRECTIONS = 3600  # a tenth of a degree apart; each needs a linear program


@dataclass(frozen=True, eq=False)
class WrenchSet(Value):
    """Contact wrench cone: all wrenches that a stance can produce within its friction polyhedra.

    The set is {Σ_i (f_i, (x_i - x_c) × f_i)} with each f_i in its polyhedron. `wrench_set` makes it
    from a state and its contacts. Torque limits of the joints are not included.

    Parameters
    ----------
    points : array_like, shape (P, 3)
        Contact points x_i in the world frame [m].
    cones : sequence of FrictionPolyhedron
        One polyhedron for each point.
    reference_point : array_like, shape (3,)
        Reference point x_c of the moments in the world frame [m].
    weight : float
        Weight of the robot [N]. `support_region` assumes the force (0, 0, weight).
    max_normal_force : array_like, shape (P,)
        Limit of the normal force at each point, +inf for none [N]. Without limits the set is a
        cone; with a limit at every point it is bounded.

    Raises
    ------
    InputError
        If there is no point, if the numbers of points, cones and limits differ, or if a limit is
        not positive.

    Notes
    -----
    [FBR]_, eqs. (20), (21), (28). The contact wrench cone of several contacts is described in
    [Caron2015b]_, and that of one rectangular sole in [Caron2015]_.
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
                "points is empty. A wrench set needs at least one contact point; a robot in the "
                "air cannot produce a wrench."
            )
        if len(cones) != len(points) or not all(
            isinstance(cone, FrictionPolyhedron) for cone in cones
        ):
            raise InputError(
                f"cones must contain one FrictionPolyhedron for each of the {len(points)} points."
            )
        object.__setattr__(self, "cones", cones)
        limits = numeric_copy(self.max_normal_force)  # +inf is allowed
        if limits is None or limits.shape != (len(points),) or not np.all(limits > 0):
            raise InputError(
                f"max_normal_force must be one number > 0, or {len(points)} numbers > 0, one for "
                f"each contact point [N]."
            )
        object.__setattr__(self, "max_normal_force", read_only(limits))

    @cached_property
    def max_lever_arm(self) -> float:
        """Largest distance of a point from x_c [m], or 1 if all are zero.

        A torque divided by this length is comparable to a force.
        """
        return float(np.max(np.linalg.norm(self.points - self.reference_point, axis=1))) or 1.0

    @cached_property
    def rays(self) -> Array:
        """Edges of all cones as wrenches, shape (6, N), each with normal component 1 N."""
        parts = [
            grasp_matrix(x[None], self.reference_point) @ cone.rays.T
            for x, cone in zip(self.points, self.cones, strict=True)
        ]
        return read_only(np.hstack(parts))

    @cached_property
    def face_matrix(self) -> Array:
        """Facets of the set, shape (m, 6): face_matrix @ w ≤ 0, together with equalities @ w = 0.

        The matrix is empty if every wrench can be produced. A row (a, b) has ‖a‖² + ‖max_lever_arm
        b‖² = 1, so face_matrix @ w is in N. A set with limits on the normal force raises
        `InputError`.
        """
        return self._halfspaces[0]

    @cached_property
    def equalities(self) -> Array:
        """Directions that no contact force can produce, shape (m, 6): equalities @ w = 0.

        The scaling is that of `face_matrix`. Two point feet cannot produce a moment about the line
        through them (1 row). One point foot produces no moment about itself (3 rows).
        """
        return self._halfspaces[1]

    def margin(self, wrench: npt.ArrayLike) -> float:
        """Return the largest margin that all contact forces can have when they produce a wrench.

        Parameters
        ----------
        wrench : array_like, shape (6,)
            Force [N], then moment about `reference_point` [N·m], in world axes.

        Returns
        -------
        float
            The largest t for which forces f_i exist with margin ≥ t each, and at least t below the
            limit of the normal force [N]. It is -inf if no forces produce the wrench (see
            `equalities`), and +inf if contacts that face each other can be squeezed without limit.
        """
        w = as_array("wrench", wrench, (6,))
        scale = float(np.linalg.norm(self._wrench_scaling @ w)) or self.weight
        grasp = self._wrench_scaling @ grasp_matrix(self.points, self.reference_point)
        G = np.hstack([grasp, np.zeros((6, 1))])
        rows, h = self._force_inequalities
        cost = np.append(np.zeros(3 * len(self.points)), -1.0)
        result = linear_program(
            cost, (G, self._wrench_scaling @ w / scale), (rows, h / scale), (None, None)
        )
        if result.status == INFEASIBLE:
            return -np.inf
        return np.inf if result.status == UNBOUNDED else -scale * float(result.fun)

    def contains(self, wrench: npt.ArrayLike, tolerance: float = TOLERANCE) -> bool:
        """Return whether contact forces can produce a wrench.

        Parameters
        ----------
        wrench : array_like, shape (6,)
            Force [N], then moment about `reference_point` [N·m], in world axes.
        tolerance : float, optional
            Amount by which the forces may at most exceed their facets and limits [N].

        Returns
        -------
        bool
            True if such forces exist.
        """
        return self.margin(wrench) >= -as_positive("tolerance", tolerance, "N", allow_zero=True)

    def max_scaling(self, direction: npt.ArrayLike, start: npt.ArrayLike | None = None) -> float:
        """Return the largest s for which start + s · direction lies in the set.

        This is how hard the stance can push in one direction.

        Parameters
        ----------
        direction : array_like, shape (6,)
            Wrench: force [N], then moment [N·m], in world axes.
        start : array_like, shape (6,), optional
            Wrench at s = 0: force [N], then moment [N·m], in world axes. The default is zero; (0,
            0, weight, 0, 0, 0) means that the weight is carried.

        Returns
        -------
        float
            The scaling s [-]: +inf if there is no limit, negative if the set lies behind `start`.

        Raises
        ------
        InfeasibleError
            If the line misses the set.
        InputError
            If `direction` is zero, or if an argument has the wrong shape.
        """
        d = as_array("direction", direction, (6,))
        if not np.any(d):
            raise InputError("direction is the zero wrench, but it must be non-zero.")
        w = as_array("start", np.zeros(6) if start is None else start, (6,))
        N, scale = self.rays.shape[1], float(np.linalg.norm(self._wrench_scaling @ d))
        A = self._wrench_scaling @ np.column_stack([self.rays, -d / scale])
        b = self._wrench_scaling @ w
        bounds = [(0.0, None)] * N + [(None, None)]
        cost = np.append(np.zeros(N), -1.0)
        result = linear_program(cost, (A, b), self._limit_inequalities(1), bounds)
        if result.status == INFEASIBLE:
            raise InfeasibleError("The contacts cannot produce start + s · direction for any s.")
        return np.inf if result.status == UNBOUNDED else -float(result.fun) / scale

    def max_horizontal_forces(self, n: int = 72) -> tuple[Array, Array]:
        """Return the largest horizontal forces, in n directions, with full weight and no moment.

        The moment is about `reference_point`, which is the centre of mass if `wrench_set` made the
        set.

        Parameters
        ----------
        n : int, optional
            Number of directions.

        Returns
        -------
        angles : ndarray, shape (n,)
            Directions from the world's x axis towards y, evenly spaced [rad].
        forces : ndarray, shape (n,)
            `max_scaling` of each direction from (0, 0, weight, 0, 0, 0) [N], +inf if there is no
            limit. Divided by `weight`, they are the largest accelerations of the centre of mass as
            fractions of g. The facets and the height of the centre of mass limit these
            accelerations.

        Raises
        ------
        InfeasibleError
            If the contacts cannot carry the weight without a moment.
        """
        n = as_integer("number of directions n", n, 1, _MAX_DIRECTIONS)
        angles = 2.0 * np.pi * np.arange(n) / n
        weight_wrench = np.array([0.0, 0.0, self.weight, 0.0, 0.0, 0.0])
        if not self.contains(weight_wrench):
            raise InfeasibleError(
                "The contacts cannot carry the weight without a moment about reference_point."
            )
        forces = [
            self.max_scaling([np.cos(angle), np.sin(angle), 0.0, 0.0, 0.0, 0.0], weight_wrench)
            for angle in angles
        ]
        return read_only(angles), read_only(forces)

    def support_region(self) -> Array:
        """Return the horizontal positions of the CoM at which the robot can stand still.

        Returns
        -------
        ndarray, shape (k, 2)
            Vertices of a polygon in the world's x and y [m], in counter-clockwise order. Two rows
            are a segment, and one row is a point. No rows mean that the stance cannot carry the
            weight.

        Raises
        ------
        InputError
            If the region is unbounded.

        Notes
        -----
        The region contains every c for which forces in the polyhedra carry the weight without a
        moment about c. The region does not depend on the height of the CoM or on `reference_point`.
        On level ground it is the support polygon, the convex hull of the feet. The method is that
        of [BretlLall2008]_.
        """
        origin = self.points.mean(axis=0)
        moments = self.rays[3:] + np.cross(self.reference_point - origin, self.rays[:3].T).T
        rays = np.vstack([self.rays[:3], moments])
        # the moment about the origin must be (c - origin) × (0, 0, weight), which is
        # (weight c_y, -weight c_x, 0)
        places = np.array([-rays[4], rays[3]]) / self.weight
        carried = np.array([0.0, 0.0, self.weight, 0.0])
        size = float(np.max(np.linalg.norm(self.points - origin, axis=1))) or 1.0
        return read_only(origin[:2] + self._slice(places, rays[[0, 1, 2, 5]], carried, size))

    def _slice(self, values: Array, fixed: Array, at: Array, size: float) -> Array:
        """Return the vertices of {values @ x : fixed @ x = at, x ≥ 0 within limits}, (k, n)."""
        scale = float(np.linalg.norm(at)) or self.weight
        limits = self._limit_inequalities(0, scale)

        def support_point(direction: Array) -> Array:
            result = linear_program(-(direction @ values), (fixed, at / scale), limits)
            if result.status == UNBOUNDED:
                raise InputError(
                    "This slice of the wrench set is unbounded, since contacts can be squeezed "
                    "against each other without limit. Set max_normal_force."
                )
            if result.status == INFEASIBLE:
                raise InfeasibleError("No contact forces add up to the requested force.")
            point: Array = scale * (values @ result.x)
            return point

        try:
            return read_only(polytope_vertices(support_point, len(values), size))
        except InfeasibleError:
            return read_only(np.zeros((0, len(values))))

    @cached_property
    def _wrench_scaling(self) -> Array:
        """Matrix that divides torques by `max_lever_arm`, shape (6, 6)."""
        return np.diag(np.repeat([1.0, 1.0 / self.max_lever_arm], 3))

    @cached_property
    def _force_inequalities(self) -> tuple[Array, Array]:
        """Facets and limits of all points as inequalities on (λ, t): every slack is at least t."""
        rows, h = [], []
        points = np.eye(len(self.points))
        for at, cone, limit in zip(points, self.cones, self.max_normal_force, strict=True):
            face_matrix = cone.face_matrix
            if np.isfinite(limit):
                face_matrix = np.vstack([face_matrix, cone.normal])
            rows.append(np.hstack([np.kron(at, face_matrix), np.ones((len(face_matrix), 1))]))
            h.append(np.append(np.zeros(cone.facets), limit)[: len(face_matrix)])
        return np.vstack(rows), np.concatenate(h)

    def _limit_inequalities(
        self, extra_columns: int, scale: float = 1.0
    ) -> tuple[Array, Array] | None:
        """Return the limits of the normal force as inequalities on the weights of the rays.

        The limits are in N divided by `scale`, and `extra_columns` columns of zeros follow the
        weights.
        """
        limited = np.isfinite(self.max_normal_force)
        if not np.any(limited):
            return None
        facets = [cone.facets for cone in self.cones]
        rows = np.repeat(np.eye(len(self.points))[limited], facets, axis=1)
        none = np.zeros((len(rows), extra_columns))
        return np.hstack([rows, none]), self.max_normal_force[limited] / scale

    @cached_property
    def _halfspaces(self) -> tuple[Array, Array]:
        """Facets and equalities of the cone, both scaled."""
        if np.any(np.isfinite(self.max_normal_force)):
            raise InputError(
                "face_matrix exists only for a stance without limits on the normal force. Make the "
                "set without max_normal_force, or use contains and margin."
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
    """Return the wrenches about the centre of mass that the contacts of a state can produce.

    Parameters
    ----------
    state : State
        State of the robot.
    contacts : Contacts
        Contacts of the robot, each with a friction cone.
    facets : int, optional
        Number of facets of the friction polyhedron of every point. The defaults of this argument
        and the next two are those of the controller.
    inner_approximation : bool, optional
        Whether the polyhedra lie inside the friction cones; see `FrictionPolyhedron`.
    facet_rotation : float, optional
        Angle by which the facets are rotated about the normal [rad].
    max_normal_force : float or array_like, shape (P,), optional
        Limit of the normal force, one number or one for each contact point [N]. The default is no
        limit.

    Returns
    -------
    WrenchSet
        The wrenches.

    Raises
    ------
    InputError
        If there is no contact, or if the forces of a contact have no cone.

    Notes
    -----
    [FBR]_, eqs. (20), (21), (28).

    Examples
    --------
    >>> state = fb.load("go2").standing()
    >>> stance = wrench_set(state, fb.Contacts.points(state.robot))
    >>> stance.contains([0.0, 0.0, stance.weight, 0.0, 0.0, 0.0])
    True
    """
    as_instance("state", state, State)
    as_instance("contacts", contacts, Contacts)
    without_cone = [c.name for c in contacts if not isinstance(c, FrictionContact)]
    if without_cone:
        raise InputError(
            f"These contacts have no friction cone: {', '.join(without_cone)}. Leave them out with "
            f"contacts.without(…)."
        )
    options = facets, inner_approximation, facet_rotation
    points = zip(contacts.normals, contacts.mus, strict=True)
    cones = tuple(FrictionPolyhedron(n, mu, *options) for n, mu in points)
    limits: Any = np.inf if max_normal_force is None else max_normal_force
    numeric = numeric_copy(limits)
    limits = np.repeat(numeric, len(cones)) if numeric is not None and numeric.ndim == 0 else limits
    return WrenchSet(contacts.positions(state), cones, state.com, state.robot.weight, limits)
