"""From where the page looks at the robot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from floatbase._arrays import Array


@dataclass(frozen=True)
class View:
    """A direction to look from.

    azimuth: degrees around the vertical, 0 in front of the robot (+x), 90 at its left (+y). elevation: degrees above the
    ground. distance: 1 fills the picture with the robot. angle: vertical field of view, degrees. feet: fill it with the
    robot's feet instead. around: a point, m, world, and a radius, m, to fill it with instead of the robot.
    """

    azimuth: float = 40.0
    elevation: float = 18.0
    distance: float = 1.0
    angle: float = 32.0
    feet: bool = False
    around: tuple[tuple[float, float, float], float] | None = None


PRESETS = {
    "default": View(),
    "front": View(0.0, 8.0),
    "back": View(180.0, 8.0),
    "left": View(90.0, 8.0),
    "right": View(-90.0, 8.0),
    "top": View(0.0, 89.0),
    "feet": View(25.0, 12.0, feet=True),
}


def eye_and_target(view: View, low: Array, high: Array) -> tuple[Array, Array]:
    """The point looked at and the point looked from, m, world, so that the box from `low` to `high` fills the picture."""
    if view.around is None:
        target, radius = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
    else:
        target, radius = np.array(view.around[0]), view.around[1]
    distance = view.distance * radius / np.sin(np.radians(view.angle) / 2)
    azimuth, elevation = np.radians([view.azimuth, view.elevation])
    direction = [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    return target, target + distance * np.array(direction)
