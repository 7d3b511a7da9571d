"""Terrain for planning: a ground that is known, or a plane through the feet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np

from floatbase._validation import Array, short_repr
from floatbase.errors import InputError

_RANK_TOLERANCE = 1e-3  # fraction of the feet's extent: no slope is fitted along a smaller extent


@runtime_checkable
class Terrain(Protocol):
    """A ground whose shape is known, such as `fb.Ground`."""

    def height(self, xy: Array) -> float:
        """Return the height at a horizontal position, shape (2,), in the world frame [m]."""

    def normal(self, xy: Array) -> Array:
        """Return the upward unit normal at a horizontal position, shape (3,), world frame."""


def as_terrain(name: str, value: Any) -> Terrain | None:
    """Return `value` after checking that it is a terrain, or None."""
    if value is None or isinstance(value, Terrain):
        return value
    raise InputError(
        f"{name} must have the methods height(xy) and normal(xy), as fb.Ground has, but "
        f"{short_repr(value)} lacks at least one of them."
    )


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane z = slope · (x, y) + level."""

    slope: Array
    level: float

    @staticmethod
    def through(points: Array) -> Plane:
        """Fit a plane to points, shape (n, 3), in the world frame [m].

        If the points show no slope in some direction, for example because they are on a line, the
        plane is level in that direction.
        """
        middle = points.mean(axis=0)
        differences = points - middle
        slope = np.linalg.lstsq(differences[:, :2], differences[:, 2], rcond=_RANK_TOLERANCE)[0]
        return Plane(slope, float(middle[2] - slope @ middle[:2]))

    @staticmethod
    def tangent(terrain: Terrain, xy: Array) -> Plane:
        """Return the tangent plane of a terrain at a horizontal position, shape (2,) [m]."""
        return Plane.of_normal(terrain.normal(xy), np.array([*xy, terrain.height(xy)]))

    @staticmethod
    def of_normal(normal: Array, point: Array) -> Plane:
        """Return the plane with an upward normal, shape (3,), through a point, shape (3,) [m]."""
        slope = -np.asarray(normal)[:2] / normal[2]
        return Plane(slope, float(point[2] - slope @ point[:2]))

    def height(self, xy: Array) -> float:
        """Return the height at a horizontal position, shape (2,) [m]."""
        return float(self.slope @ xy + self.level)

    @property
    def tilt(self) -> Array:
        """Rotation from level ground to the plane as a rotation vector, its x and y, (2,) [rad]."""
        steepness = float(np.hypot(*self.slope))
        scale = np.arctan(steepness) / steepness if steepness > 0.0 else 1.0
        return scale * np.array([self.slope[1], -self.slope[0]])
