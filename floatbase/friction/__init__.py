"""Friction cones, their polyhedral approximations, and the wrenches that a stance can produce."""

from floatbase.errors import explain_arguments
from floatbase.friction.cones import (
    Decomposition,
    FrictionCone,
    FrictionPolyhedron,
    decompose,
    tangents,
)
from floatbase.friction.pressure import centre_of_pressure, contact_wrench
from floatbase.friction.wrenches import WrenchSet, wrench_set

__all__ = [
    "Decomposition", "FrictionCone", "FrictionPolyhedron", "WrenchSet",
    "centre_of_pressure",
    "contact_wrench", "decompose", "tangents", "wrench_set",
]  # fmt: skip

explain_arguments(globals())
