"""The camera: from where the page looks at the robot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from floatbase._validation import Array, as_array, as_bool, as_number, as_positive
from floatbase.errors import InputError


@dataclass(frozen=True)
class View:
    """A direction to look from, and what fills the picture.

    azimuth: degrees around the vertical; 0 is in front of the robot (+x), 90 at its left (+y).
    elevation: degrees above the horizontal.
    distance: 1 fills the picture; 2 is twice as far away.
    angle: vertical field of view, degrees.
    feet: whether the robot's feet fill the picture, instead of the whole robot.
    around: a point, (3,), m, world, and a radius, m: this ball fills the picture, instead of the
        robot.
    Raises `InputError` for an elevation beyond ±90, an angle not between 0 and 180, a distance or
    radius that is not positive, and numbers that are not finite.
    """

    azimuth: float = 40.0
    elevation: float = 18.0
    distance: float = 1.0
    angle: float = 32.0
    feet: bool = False
    around: tuple[tuple[float, float, float], float] | None = None

    def __post_init__(self) -> None:
        as_positive("distance of a View", self.distance)
        for name in ("azimuth", "elevation"):
            as_number(f"{name} of a View", getattr(self, name), "degrees")
        as_bool("feet of a View", self.feet)
        if abs(self.elevation) > 90.0:
            raise InputError(
                f"elevation of a View is {self.elevation:g}; it must be from -90 (below) to 90 "
                f"(above) degrees."
            )
        if as_positive("angle of a View", self.angle, "degrees") >= 180.0:
            raise InputError(
                f"angle of a View is {self.angle:g}; it must be below 180 degrees; 32 is usual."
            )
        if self.around is not None:
            _check_around(self.around)


def _check_around(around: Any) -> None:
    try:
        point, radius = around
    except (TypeError, ValueError):
        raise InputError(
            f"around of a View is {around!r}; it must be a point and a radius, as ((0, 0, 0.3), "
            f"0.5)."
        ) from None
    as_array("point in around of a View", point, (3,), "m")
    as_positive("radius in around of a View", radius, "m")


PRESETS = {
    "default": View(),
    "front": View(0.0, 8.0),
    "back": View(180.0, 8.0),
    "left": View(90.0, 8.0),
    "right": View(-90.0, 8.0),
    "top": View(0.0, 89.0),
    "feet": View(25.0, 12.0, feet=True),
}


def target_and_eye(view: View, low: Array, high: Array) -> tuple[Array, Array]:
    """The point that the camera looks at, and where the camera is: (3,) each, m, world.

    low, high: (3,), m, world, corners of the box that fills the picture.
    """
    if view.around is None:
        target, radius = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
    else:
        target, radius = np.array(view.around[0]), view.around[1]
    distance = view.distance * radius / np.sin(np.radians(view.angle) / 2)
    azimuth, elevation = np.radians([view.azimuth, view.elevation])
    direction = [
        np.cos(elevation) * np.cos(azimuth),
        np.cos(elevation) * np.sin(azimuth),
        np.sin(elevation),
    ]
    return target, target + distance * np.array(direction)
