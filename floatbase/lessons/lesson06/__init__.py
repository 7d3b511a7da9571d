"""Lesson 06, Friction cones."""

from floatbase.lessons.lesson06.exercises import EXERCISES, on_hill
from floatbase.lessons.lesson06.helpers import ConeController, beside_its_feet, least_inside, rose_controller, with_feet
from floatbase.lessons.lesson06.pictures import (
    AROUND,
    FROM_ABOVE,
    compass_row,
    lean,
    region_picture,
    show_force,
    show_polyhedron,
    show_region,
    show_slope,
    uphill,
)

__all__ = [
    "AROUND", "EXERCISES", "FROM_ABOVE", "ConeController", "beside_its_feet", "compass_row", "lean", "least_inside", "on_hill",
    "region_picture", "rose_controller", "show_force", "show_polyhedron", "show_region", "show_slope", "uphill", "with_feet",
]  # fmt: skip
