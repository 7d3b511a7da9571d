"""Friction cones, polyhedra and the wrenches that a stance can produce (§4.2 of the document)."""

from floatbase.friction.cones import Decomposition, FrictionCone, FrictionPolyhedron, decompose, tangents
from floatbase.friction.polytopes import cone_rows, vertices
from floatbase.friction.wrenches import WrenchSet, wrench_set

__all__ = [
    "Decomposition",
    "FrictionCone",
    "FrictionPolyhedron",
    "WrenchSet",
    "cone_rows",
    "decompose",
    "tangents",
    "vertices",
    "wrench_set",
]
