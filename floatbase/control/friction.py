"""Friction: the polyhedron with n facets that stands in for the cone (28)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from floatbase._arrays import Array, checked, positive, read_only, unit_vector
from floatbase.errors import InputError


def tangents(normal: npt.ArrayLike) -> Array:
    """Two unit vectors t1, t2 with t1 × t2 = normal, as rows, shape (2, 3).

    t1 is the world's x axis laid into the surface (its y axis where x stands on it), so pictures and rows do not jump.
    """
    n = unit_vector("normal", normal)
    axis = np.array([1.0, 0.0, 0.0]) if abs(n[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    t1 = axis - n * (n @ axis)
    t1 /= np.linalg.norm(t1)
    return read_only([t1, np.cross(n, t1)])


@dataclass(frozen=True, eq=False)
class FrictionPolyhedron:
    """(28) as linear rows: a polyhedron with n facets in place of the cone ‖f_tangent‖ ≤ μ f_normal.

    normal: shape (3,), world, out of the ground. mu: coefficient of friction. facets: n ≥ 3. inside: the polyhedron lies
    inside the cone (safe: it allows no force that slips) or outside it, touching it (optimistic). Inside, a facet allows
    μ cos(π/n) and only the edges reach μ. Source: the document, §4.2.
    """

    normal: Array
    mu: float
    facets: int = 4
    inside: bool = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "normal", unit_vector("normal", self.normal))
        positive("friction coefficient mu", self.mu)
        if int(self.facets) != self.facets or self.facets < 3:
            raise InputError(f"facets is {self.facets}; a polyhedron around a cone needs a whole number ≥ 3.")

    @property
    def mu_facet(self) -> float:
        """The friction that the middle of a facet allows: μ cos(π/n) inside, μ outside."""
        return self.mu * float(np.cos(np.pi / self.facets)) if self.inside else self.mu

    @cached_property
    def rows(self) -> Array:
        """Rows, shape (n, 3), with rows @ f ≤ 0 for f in the polyhedron; each is d_i - μ_facet · normal.

        d_i is the unit tangent that facet i looks along; facet 0 looks along t1 of `tangents`. Their intersection also
        keeps normal · f ≥ 0.
        """
        return read_only(self._directions(0.0) - self.mu_facet * self.normal)

    @cached_property
    def rays(self) -> Array:
        """The edges, shape (n, 3), each with normal component 1: forces in the polyhedron are their sums with weights ≥ 0."""
        reach = self.mu_facet / float(np.cos(np.pi / self.facets))
        return read_only(self.normal + reach * self._directions(0.5))

    @property
    def names(self) -> tuple[str, ...]:
        """A name for each row."""
        return tuple(f"facet {i}" for i in range(self.facets))

    def margin(self, force: npt.ArrayLike) -> float:
        """How far inside its facets a force is, N: the smallest of -rows @ f; negative outside."""
        return float(np.min(-self.rows @ checked("force", force, (3,), "N")))

    def _directions(self, shift: float) -> Array:
        """Unit tangents, shape (n, 3), turned by `shift` of a facet's angle."""
        angles = 2.0 * np.pi * (np.arange(self.facets) + shift) / self.facets
        t1, t2 = tangents(self.normal)
        return np.outer(np.cos(angles), t1) + np.outer(np.sin(angles), t2)
