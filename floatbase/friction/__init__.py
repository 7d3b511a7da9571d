"""Friction cones, polyhedra and the wrenches that a stance can produce (§4.2 of the document)."""

from floatbase.friction.cones import Decomposition, FrictionCone, FrictionPolyhedron, Status, decompose, tangents
from floatbase.friction.polytopes import cone_rows, vertices
from floatbase.friction.wrenches import WrenchSet, wrench_set

__all__ = [
    "Decomposition", "FrictionCone", "FrictionPolyhedron", "Status", "WrenchSet", "cone_rows", "decompose", "tangents",
    "vertices", "wrench_set",
]  # fmt: skip
