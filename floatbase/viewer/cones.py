"""Where a force stands against its friction cone: the colour that a cone gets, and the facets that light up."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from floatbase.friction import FrictionPolyhedron

NEAR = 0.02  # of the friction limit: nearer than this, the surface counts as reached


def cone_status(force: npt.ArrayLike, normal: npt.ArrayLike, mu: float) -> str:
    """(28) "inside", "active" (on the cone's surface, within 2 %) or "outside".

    force: shape (3,), N, world. normal: shape (3,), unit, out of the ground.
    """
    f, n = np.asarray(force, dtype=np.float64), np.asarray(normal, dtype=np.float64)
    push = float(n @ f)
    slide = float(np.linalg.norm(f - push * n))
    return _status(slide, mu * push)


def polyhedron_status(force: npt.ArrayLike, polyhedron: FrictionPolyhedron) -> tuple[str, list[int]]:
    """The same against the polyhedron's facets, and the numbers of the facets that the force has reached or passed."""
    f = np.asarray(force, dtype=np.float64)
    limit = polyhedron.mu_facet * float(polyhedron.normal @ f)
    slides = polyhedron.rows @ f + limit  # along each facet's direction
    active = [] if limit <= 0 else [int(i) for i in np.flatnonzero(slides > (1 - NEAR) * limit)]
    return _status(float(slides.max()), limit), active


def _status(slide: float, limit: float) -> str:
    """limit: the largest tangential force, N; negative where the force pulls."""
    if slide > (1 + NEAR) * limit:
        return "outside"
    return "active" if slide > (1 - NEAR) * limit else "inside"
