"""Friction cones and polyhedra, coloured by the force at their contact point."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from floatbase._validation import Array
from floatbase.friction import FrictionCone, FrictionPolyhedron
from floatbase.viewer.scene import shapes
from floatbase.viewer.scene.shapes import Picture


class ConeShape(NamedTuple):
    """Shape of friction cones: round or polyhedral."""

    facets: int | None
    inner_approximation: bool
    facet_rotation: float


def cone_picture(
    shape: ConeShape, position: Array, normal: Array, mu: float, height: float, force: Array | None
) -> Picture:
    """Draw a cone or polyhedron in a colour that shows whether the force is inside."""
    key = (tuple(normal.tolist()), mu)
    status: str
    made: Picture
    if shape.facets is None:
        status = "idle" if force is None else _friction_cone(*key).status(force)
        polyhedron = _polyhedron(*key, 4, True, 0.0)  # for the rim: only its normal and friction
        made = {"/surface": shapes.friction_cone(position, normal, mu, height, status)}
    else:
        polyhedron = _polyhedron(
            *key, shape.facets, shape.inner_approximation, shape.facet_rotation
        )
        status = "idle" if force is None else polyhedron.status(force)
        if status == "active":
            status = "inside"  # an active facet has a colour of its own
        active = () if force is None else polyhedron.active_facets(force)
        made = shapes.friction_polyhedron(position, polyhedron, height, status, active)
    if status == "outside":  # marked by more than a colour
        made["/rim"] = shapes.cone_rim(position, polyhedron, height, is_round=shape.facets is None)
    return made


@lru_cache(maxsize=256)
def _friction_cone(normal: tuple[float, ...], mu: float) -> FrictionCone:
    """Return the cone with these values; each is made once, since there are few."""
    return FrictionCone(np.array(normal), mu)


@lru_cache(maxsize=256)
def _polyhedron(
    normal: tuple[float, ...],
    mu: float,
    facets: int,
    inner_approximation: bool,
    facet_rotation: float,
) -> FrictionPolyhedron:
    """Return the polyhedron with these values; each is made once, since there are few."""
    return FrictionPolyhedron(np.array(normal), mu, facets, inner_approximation, facet_rotation)
