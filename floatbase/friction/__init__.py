"""Friction cones, polyhedra and the wrenches that a stance can produce (§4.2)."""

from floatbase.friction.cones import (
    Decomposition,
    FrictionCone,
    FrictionPolyhedron,
    Status,
    decompose,
    tangents,
)
from floatbase.friction.polytopes import cone_face_matrix, polytope_vertices
from floatbase.friction.pressure import centre_of_pressure, contact_wrench
from floatbase.friction.wrenches import WrenchSet, wrench_set

__all__ = [
    "Decomposition", "FrictionCone", "FrictionPolyhedron", "Status", "WrenchSet",
    "centre_of_pressure", "cone_face_matrix",
    "contact_wrench", "decompose", "polytope_vertices", "tangents", "wrench_set",
]  # fmt: skip
