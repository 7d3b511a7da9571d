"""Friction (28): a force's normal and tangential parts, the exact cone, and the polyhedron with n
facets in its place.

A force is what the ground does to the robot, shape (3,), N, world. Normals point out of the ground.
Source: [FBR], §4.2.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_bool,
    as_integer,
    as_number,
    as_positive,
    cached_property,
    checked,
    read_only,
    unit_vector,
)

TOLERANCE = 1e-9  # N, by which `contains` lets a force be outside: rounding of forces up to 1 MN
MAX_FACETS = 1000  # they miss the cone by 5e-6 of μ, which nobody knows as well
# part of the friction limit μ α_⊥ within which a force counts as on the surface: measured ones
# scatter
ACTIVE_TOLERANCE = 0.02

Status: TypeAlias = Literal["inside", "active", "outside"]


def tangents(normal: npt.ArrayLike) -> Array:
    """Two unit vectors t1, t2 with t1 × t2 = normal, as rows, shape (2, 3).

    normal: shape (3,), world, made unit. t1 is the world's x axis projected onto the surface; y
        where x is nearly normal to it.
    """
    n = unit_vector("normal", normal)
    axis = np.array([1.0, 0.0, 0.0]) if abs(n[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    t1 = axis - n * (n @ axis)
    t1 /= np.linalg.norm(t1)
    return read_only([t1, np.cross(n, t1)])


@dataclass(frozen=True, eq=False)
class Decomposition(Value):
    """Figure 3: the normal and the tangential part of a contact force, f = f_perp + f_par.

    f_perp: n nᵀ f, shape (3,), N, world.
    f_par: (I - n nᵀ) f, shape (3,), N, world.
    alpha_perp: α_⊥ = nᵀ f, N, negative where the force pulls on the ground.
    alpha_par: α_∥ = ‖f_par‖ ≥ 0, N.
    """

    f_perp: Array
    f_par: Array
    alpha_perp: float
    alpha_par: float


def decompose(force: npt.ArrayLike, normal: npt.ArrayLike) -> Decomposition:
    """(28) The two components of a contact force that friction compares: α_∥ ≤ μ α_⊥.

    force: shape (3,), N, world. normal: shape (3,), world, out of the ground, made unit. Source:
        [FBR], Figure 3.
    """
    f, n = as_array("force", force, (3,), "N"), unit_vector("normal", normal)
    alpha = float(n @ f)
    f_par = f - alpha * n
    return Decomposition(
        read_only(alpha * n), read_only(f_par), alpha, float(np.linalg.norm(f_par))
    )


@dataclass(frozen=True, eq=False)
class FrictionCone(Value):
    """(28) The forces that Coulomb friction can make: α_∥ ≤ μ α_⊥, a round cone about the normal.

    normal: shape (3,), world, out of the ground, made unit. mu: coefficient of friction, > 0. The
        ground only pushes: α_⊥ ≥ 0.
    """

    normal: Array = field(metadata=checked(unit_vector))
    mu: float = field(metadata=checked(as_positive))

    @property
    def angle(self) -> float:
        """The angle between the normal and the cone's surface, rad: arctan μ."""
        return float(np.arctan(self.mu))

    def margin(self, force: npt.ArrayLike) -> float:
        """The slack of (28), N: μ α_⊥ - α_∥, negative outside.

        It is the tangential force that may be added, whatever its direction, before the foot slips;
        divided by √(1 + μ²) it is the distance to the cone's surface.
        """
        parts = decompose(force, self.normal)
        return self.mu * parts.alpha_perp - parts.alpha_par

    def contains(self, force: npt.ArrayLike, tolerance: float = TOLERANCE) -> bool:
        """(28) Whether friction can make this force: margin ≥ -tolerance, N."""
        return self.margin(force) >= -as_positive("tolerance", tolerance, "N", allow_zero=True)

    def status(self, force: npt.ArrayLike) -> Status:
        """(28) "inside", "active" (on the surface, within `ACTIVE_TOLERANCE` of μ α_⊥) or
        "outside"; force: (3,), N.
        """
        f = as_array("force", force, (3,), "N")
        alpha = float(self.normal @ f)  # as `decompose` has it, for pictures that ask for many
        return _status(float(np.linalg.norm(f - alpha * self.normal)), self.mu * alpha)

    def project(self, force: npt.ArrayLike) -> Array:
        """The force of the cone nearest to the one given, shape (3,), N: the Euclidean projection.

        A force inside stays, one of the polar cone, μ α_∥ ≤ -α_⊥, gives 0. Any other is projected
        at a right angle onto the line n + μ f_par / α_∥ of the surface.
        """
        parts = decompose(force, self.normal)
        if parts.alpha_par <= self.mu * parts.alpha_perp:
            return as_array("force", force, (3,), "N")
        scale = max(0.0, parts.alpha_perp + self.mu * parts.alpha_par) / (1.0 + self.mu**2)
        return (
            read_only(scale * (self.normal + self.mu * parts.f_par / parts.alpha_par))
            if scale
            else read_only(np.zeros(3))
        )


@dataclass(frozen=True, eq=False)
class FrictionPolyhedron(Value):
    """(28) as linear rows: a polyhedron with n facets in place of the cone α_∥ ≤ μ α_⊥.

    normal: shape (3,), world, out of the ground, made unit.
    mu: coefficient of friction, > 0.
    facets: n ≥ 3.
    inner_approximation: whether the polyhedron lies inside the cone (safe: it allows no force that
        slips) or outside it, touching it (optimistic). Inside, the middle of a facet allows μ
        cos(π/n) and only the edges reach μ.
    facet_rotation: rad, by which all facets are turned about the normal: facet 0 faces t1 of
        `tangents` without it.
    """

    _example = "FrictionPolyhedron(normal, mu)"
    normal: Array = field(metadata=checked(unit_vector))
    mu: float = field(metadata=checked(as_positive))
    facets: int = field(
        default=4, metadata=checked(as_integer, 3, MAX_FACETS, "μ is not known better")
    )
    inner_approximation: bool = field(default=True, metadata=checked(as_bool))
    facet_rotation: float = field(default=0.0, metadata=checked(as_number, "rad"))

    @property
    def mu_facet(self) -> float:
        """The friction that the middle of a facet allows: μ cos(π/n) inside, μ outside."""
        return self.mu * float(np.cos(np.pi / self.facets)) if self.inner_approximation else self.mu

    @property
    def area_ratio(self) -> float:
        """Area of the polyhedron's cross-section over the cone's: sin(2π/n) / (2π/n) inside,
        tan(π/n) / (π/n) outside.
        """
        half = np.pi / self.facets
        return float(
            np.sin(2.0 * half) / (2.0 * half) if self.inner_approximation else np.tan(half) / half
        )

    @cached_property
    def face_matrix(self) -> Array:
        """Face matrix, shape (n, 3): face_matrix @ f ≤ 0 for f in the polyhedron; each row is d_i -
        μ_facet · normal.

        d_i is the unit tangent that facet i faces. Together they imply normal · f ≥ 0.
        """
        return read_only(self._directions(0.0) - self.mu_facet * self.normal)

    @cached_property
    def rays(self) -> Array:
        """The edges, shape (n, 3), each with normal component 1; ray i lies between facets i and i
        + 1.
        """
        return read_only(
            self.normal + self.mu_facet / np.cos(np.pi / self.facets) * self._directions(0.5)
        )

    def margin(self, force: npt.ArrayLike) -> float:
        """The tangential force, N, that may be added before a facet is reached: the least of
        -face_matrix @ f; < 0 outside.
        """
        return float(np.min(-self.face_matrix @ as_array("force", force, (3,), "N")))

    def contains(self, force: npt.ArrayLike, tolerance: float = TOLERANCE) -> bool:
        """Whether a force lies in the polyhedron: margin ≥ -tolerance, N."""
        return self.margin(force) >= -as_positive("tolerance", tolerance, "N", allow_zero=True)

    def status(self, force: npt.ArrayLike) -> Status:
        """As `FrictionCone.status`, against the facets: the limit is μ_facet α_⊥."""
        tangential, limit = self._tangential_forces(force)
        return _status(float(tangential.max()), limit)

    def active_facets(self, force: npt.ArrayLike) -> tuple[int, ...]:
        """Numbers of the facets that a force has reached (within `ACTIVE_TOLERANCE`) or passed;
        none where it pulls.
        """
        tangential, limit = self._tangential_forces(force)
        return (
            tuple(np.flatnonzero(tangential > (1.0 - ACTIVE_TOLERANCE) * limit).tolist())
            if limit > 0.0
            else ()
        )

    def project(self, force: npt.ArrayLike) -> Array:
        """The force of the polyhedron nearest to the one given, shape (3,), N: min ‖raysᵀ w - f‖
        over weights w ≥ 0.
        """
        from scipy.optimize import nnls  # slow to load, and seldom needed

        f = as_array("force", force, (3,), "N")
        if self.margin(f) >= 0.0:
            return f
        size = np.linalg.norm(f)
        return read_only(size * (self.rays.T @ nnls(self.rays.T, f / size)[0]))

    def _tangential_forces(self, force: npt.ArrayLike) -> tuple[Array, float]:
        """The force along each facet's d_i, shape (n,), N, and what they all may be at most,
        μ_facet α_⊥, N.
        """
        f = as_array("force", force, (3,), "N")
        limit = self.mu_facet * float(self.normal @ f)
        return self.face_matrix @ f + limit, limit

    def _directions(self, shift: float) -> Array:
        """Unit tangents, shape (n, 3), turned by `shift` of a facet's angle."""
        angles = self.facet_rotation + 2.0 * np.pi * (np.arange(self.facets) + shift) / self.facets
        t1, t2 = tangents(self.normal)
        return np.outer(np.cos(angles), t1) + np.outer(np.sin(angles), t2)


def _status(tangential: float, limit: float) -> Status:
    """Of a tangential force and the largest that friction allows, N; that is negative where the
    force pulls.
    """
    if tangential > (1.0 + ACTIVE_TOLERANCE) * limit:
        return "outside"
    return "active" if tangential > (1.0 - ACTIVE_TOLERANCE) * limit else "inside"
