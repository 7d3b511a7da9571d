"""The ground: planes, and boxes on them for steps, stairs, tiles and gaps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_half_spaces,
    as_instance,
    as_integer,
    as_number,
    as_positive,
    cached_property,
    checked,
    numeric_copy,
    one_or_each,
    read_only,
)
from floatbase.dynamics import UP
from floatbase.dynamics._compiled import Acceleration, as_acceleration
from floatbase.errors import InputError

_PLATFORM = 10.0  # m: length of the level parts before and after stairs or a gap
_MAX_TILES = 10_000  # MuJoCo needs a few seconds to build so many boxes
# outward normals of the sides and the top of a box
_FACE_NORMALS = np.array([[-1.0, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, 1]])
_MIN_VERTICAL = 1e-6  # smallest vertical component of the normal of a plane that has a height


def _as_interval(name: str, value: Any) -> Array:
    """Check two increasing coordinates, shape (2,) [m]."""
    ends = as_array(name, value, (2,), "m")
    if not ends[0] < ends[1]:
        raise InputError(
            f"{name} is {ends.tolist()}, but the first number must be smaller than the second. "
            f"Pass the two ends of the box in increasing order."
        )
    return ends


@dataclass(frozen=True, eq=False)
class Box(Value):
    """A block of the ground with vertical sides and a level top.

    Parameters
    ----------
    x : array_like, shape (2,)
        Both ends along the world's x axis, in increasing order [m].
    y : array_like, shape (2,)
        Both ends along the world's y axis, in increasing order [m].
    top : float
        Height of the top in the world frame [m]. The box is solid below it.

    Examples
    --------
    >>> from floatbase.simulation import Box
    >>> Box(x=[0.5, 0.8], y=[-1.0, 1.0], top=0.1).top
    0.1
    """

    x: Array = field(metadata=checked(_as_interval))
    y: Array = field(metadata=checked(_as_interval))
    top: float = field(metadata=checked(as_number, "m"))


def _as_boxes(name: str, value: Any) -> tuple[Box, ...]:
    """Check a sequence of boxes."""
    if not isinstance(value, Sequence) or isinstance(value, str):
        raise InputError(
            f"{name} must be a list of boxes, such as [Box(x=[0.5, 0.8], y=[-1.0, 1.0], top=0.1)], "
            f"not of type {type(value).__name__}."
        )
    return tuple(as_instance(f"box {i} of {name}", box, Box) for i, box in enumerate(value))


class Ground(Value):
    """The ground: a plane or several planes, and boxes on them.

    All planes are solid below, so two planes can be the sides of a valley. `Ground.stairs`,
    `Ground.tiles` and `Ground.gap` make common terrains from boxes.

    Parameters
    ----------
    mu : float or array_like, shape (n,), optional
        Coefficient of friction between the ground and the feet, positive: one number for all, or
        one for each of n planes [-]. Boxes and the links of a fallen robot use the first number.
    normal : array_like, shape (3,) or (n, 3), optional
        Normal of the plane, or of each of n planes, in the world frame, pointing out of the ground;
        it is normalized.
    offset : float or array_like, shape (n,), optional
        Offset of each plane, which holds the points with normal · x = offset [m]. One number
        applies to all planes; a plane with offset 0 goes through the origin.
    boxes : sequence of Box, optional
        Boxes on the planes. Where boxes overlap, the highest one is the ground.
    acceleration : array_like, shape (3,), or callable, optional
        Acceleration of the whole ground in the world frame [m/s²], constant or as a function
        `acceleration(t)` of the simulation's time [s]. The ground is at rest at time 0, does not
        rotate, and carries feet and fixed frames along. Planes and boxes are given at time 0.

    Attributes
    ----------
    mus : ndarray, shape (n,)
        Coefficient of friction of each plane [-].
    normals : ndarray, shape (n, 3)
        Unit normals of all planes in the world frame.
    offsets : ndarray, shape (n,)
        Offsets of all planes [m].
    boxes : tuple of Box
        The boxes.
    acceleration : ndarray, callable or None
        Acceleration of the ground; None if the ground is at rest.

    Examples
    --------
    >>> import floatbase as fb
    >>> valley = fb.Ground(normal=[[0.0, -0.34, 0.94], [0.0, 0.34, 0.94]])
    >>> valley.offsets
    array([0., 0.])
    >>> stairs = fb.Ground.stairs(3, rise=0.1, run=0.3)
    >>> stairs.height([0.95, 0.0])
    0.2
    """

    mus: Array
    normals: Array
    offsets: Array
    boxes: tuple[Box, ...]
    acceleration: Acceleration

    def __init__(
        self,
        mu: npt.ArrayLike = 1.0,
        normal: npt.ArrayLike = UP,
        offset: npt.ArrayLike = 0.0,
        boxes: Sequence[Box] = (),
        acceleration: Acceleration = None,
    ):
        normals, offsets = as_half_spaces("the ground", normal, offset)
        mus = one_or_each("mu of Ground", mu, len(normals), ())
        for i, each in enumerate(mus):
            as_positive(f"mu of Ground for plane {i}", float(each))
        vars(self).update(
            mus=read_only(mus),
            normals=normals,
            offsets=offsets,
            boxes=_as_boxes("boxes of Ground", boxes),
            acceleration=as_acceleration("acceleration of Ground", acceleration),
        )

    def __repr__(self) -> str:
        boxes = f", boxes=[{len(self.boxes)} boxes]" if self.boxes else ""
        moving = "" if self.acceleration is None else ", acceleration=…"
        return (
            f"Ground(mu={self.mus.tolist()}, normal={self.normals.tolist()}, "
            f"offset={self.offsets.tolist()}{boxes}{moving})"
        )

    @classmethod
    def stairs(
        cls,
        steps: int,
        rise: float,
        run: float = 0.3,
        start: float = 0.5,
        width: float = 2.0,
        mu: float = 1.0,
    ) -> Ground:
        """Make a staircase along the x axis, between two level platforms.

        The ground is level at height 0 before the stairs. A single step is a staircase of one step.

        Parameters
        ----------
        steps : int
            Number of steps.
        rise : float
            Height of each step [m], negative for stairs that go down.
        run : float, optional
            Depth of each tread [m].
        start : float, optional
            x coordinate of the first edge [m].
        width : float, optional
            Width of the stairs along the y axis [m].
        mu : float, optional
            Coefficient of friction [-].

        Returns
        -------
        Ground
            The stairs. The upper platform is as wide as the stairs and 10 m long.
        """
        n = as_integer("steps", steps, 1, _MAX_TILES)
        rise = as_number("rise", rise, "m", -1.0, 1.0)
        if rise == 0.0:
            raise InputError("rise is 0, but a step must go up or down. For level ground, use mu.")
        run, width = as_positive("run", run, "m"), as_positive("width", width, "m")
        edges = as_number("start", start, "m") + run * np.arange(n)
        # boxes that touch but do not overlap: coplanar contacts would count twice
        if rise > 0.0:
            ends, first, floor = np.append(edges, edges[-1] + _PLATFORM), 1, 0.0
        else:
            ends, first, floor = np.insert(edges, 0, edges[0] - _PLATFORM), 0, rise * n
        side = np.array([-0.5 * width, 0.5 * width])
        boxes = [Box(ends[i : i + 2], side, rise * (first + i)) for i in range(n)]
        return cls(mu, offset=floor, boxes=boxes)

    @classmethod
    def tiles(
        cls,
        height: float,
        tile: float = 0.2,
        start: float = 0.4,
        size: tuple[float, float] = (4.0, 2.0),
        seed: int = 0,
        mu: float = 1.0,
    ) -> Ground:
        """Make rough ground: a field of square tiles with random heights on level ground.

        Parameters
        ----------
        height : float
            Largest height of a tile [m]. Heights are uniformly distributed from 0.
        tile : float, optional
            Side of a tile [m].
        start : float, optional
            x coordinate at which the field begins [m].
        size : tuple of float, optional
            Length of the field along x, and its width along y around the x axis [m].
        seed : int, optional
            Seed of the random heights.
        mu : float, optional
            Coefficient of friction [-].

        Returns
        -------
        Ground
            The field.
        """
        height, tile = as_positive("height", height, "m"), as_positive("tile", tile, "m")
        length, width = as_array("size", size, (2,), "m")
        start, seed = as_number("start", start, "m"), as_integer("seed", seed, 0, 2**32 - 1)
        n, m = round(length / tile), round(width / tile)
        if min(n, m) < 1 or n * m > _MAX_TILES:
            raise InputError(
                f"A field of {length:g} m by {width:g} m has {n} by {m} tiles of {tile:g} m. It "
                f"must have at least one and at most {_MAX_TILES}. Choose another size or tile."
            )
        tops = np.random.default_rng(seed).uniform(0.0, height, (n, m))
        x, y = start + tile * np.arange(n + 1), tile * (np.arange(m + 1) - 0.5 * m)
        boxes = [Box(x[i : i + 2], y[j : j + 2], tops[i, j]) for i in range(n) for j in range(m)]
        return cls(mu, boxes=boxes)

    @classmethod
    def gap(
        cls,
        length: float,
        depth: float = 0.5,
        start: float = 0.5,
        width: float = 2.0,
        mu: float = 1.0,
    ) -> Ground:
        """Make two level platforms at height 0 with a gap across the x axis.

        Parameters
        ----------
        length : float
            Length of the gap along x [m].
        depth : float, optional
            Depth of the gap [m].
        start : float, optional
            x coordinate at which the gap begins [m].
        width : float, optional
            Width of the platforms along the y axis [m].
        mu : float, optional
            Coefficient of friction [-].

        Returns
        -------
        Ground
            The platforms, each 10 m long, and the floor of the gap.
        """
        length, depth = as_positive("length", length, "m"), as_positive("depth", depth, "m")
        start, width = as_number("start", start, "m"), as_positive("width", width, "m")
        side = np.array([-0.5 * width, 0.5 * width])
        begins = np.array([start - _PLATFORM, start + length])
        boxes = [Box(begin + np.array([0.0, _PLATFORM]), side, 0.0) for begin in begins]
        return cls(mu, offset=-depth, boxes=boxes)

    @cached_property
    def box_bounds(self) -> Array:
        """Coordinates x0, x1, y0, y1 and top of each of m boxes, shape (m, 5), world frame [m]."""
        rows = [[*box.x, *box.y, box.top] for box in self.boxes]
        return read_only(np.reshape(rows, (-1, 5)))

    def height(self, xy: npt.ArrayLike) -> Any:
        """Compute the height of the ground's surface.

        Parameters
        ----------
        xy : array_like, shape (2,) or (..., 2)
            Horizontal coordinates in the world frame [m].

        Returns
        -------
        float or ndarray, shape (...)
            Height of the highest plane or box there, in the world frame [m].

        Raises
        ------
        InputError
            If all planes of the ground are vertical.
        """
        heights = self._heights(xy).max(axis=-1)
        return heights if np.ndim(heights) else float(heights)

    def normal(self, xy: npt.ArrayLike) -> Array:
        """Compute the normal of the ground's surface.

        Parameters
        ----------
        xy : array_like, shape (2,) or (..., 2)
            Horizontal coordinates in the world frame [m].

        Returns
        -------
        ndarray, shape (3,) or (..., 3)
            Unit normal of the highest plane or box there, in the world frame. The top of a box has
            a vertical normal.

        Raises
        ------
        InputError
            If all planes of the ground are vertical.
        """
        highest = self._heights(xy).argmax(axis=-1)
        normals: Array = self._surface_normals[highest]
        return normals

    def clearances(self, points: npt.ArrayLike) -> Array:
        """Compute the distances of points from each plane and each box.

        Parameters
        ----------
        points : array_like, shape (..., 3)
            Points in the world frame [m].

        Returns
        -------
        ndarray, shape (..., n + m)
            Distance from each of the n planes, negative below it, and from each of the m boxes,
            negative inside it [m].
        """
        points = np.asarray(points)
        to_planes = points @ self.normals.T - self.offsets
        if not self.boxes:
            return to_planes
        to_boxes = [box_distance(points, bounds)[0] for bounds in self.box_bounds]
        return np.concatenate([to_planes, np.stack(to_boxes, axis=-1)], axis=-1)

    @cached_property
    def _upward_planes(self) -> npt.NDArray[np.intp]:
        """Numbers of the planes that are not vertical and can be stood on."""
        return np.flatnonzero(self.normals[:, 2] > _MIN_VERTICAL)

    @cached_property
    def _surface_normals(self) -> Array:
        """All unit normals: of planes that can be stood on, then of boxes."""
        tops = np.tile(UP, (len(self.boxes), 1))
        return np.concatenate([self.normals[self._upward_planes], tops])

    def _heights(self, xy: npt.ArrayLike) -> Array:
        """Return the heights of planes and boxes at points, shape (..., planes + boxes) [m].

        A box that does not reach a point has the height -∞ there.
        """
        points = numeric_copy(xy)
        shape = (2,) if points is None or points.shape[-1:] != (2,) else points.shape
        points = as_array("xy", xy, shape, "m")
        normals, offsets = self.normals[self._upward_planes], self.offsets[self._upward_planes]
        if not len(normals):
            raise InputError(
                "All planes of this ground are vertical, so it has no height. Add a plane "
                "whose normal points upwards."
            )
        heights = (offsets - points @ normals[:, :2].T) / normals[:, 2]
        if not self.boxes:
            return np.asarray(heights)
        x0, x1, y0, y1, tops = self.box_bounds.T
        x, y = points[..., :1], points[..., 1:]
        inside = (x0 <= x) & (x <= x1) & (y0 <= y) & (y <= y1)
        return np.concatenate([heights, np.where(inside, tops, -np.inf)], axis=-1)


def box_distance(points: Array, bounds: Array) -> tuple[Array, Array]:
    """Return the distances of points from a box, and the directions in which they grow."""
    x0, x1, y0, y1, top = bounds
    x, y, z = np.moveaxis(points, -1, 0)
    # how far a point lies outside each of the five faces, negative inside
    faces = np.stack([x0 - x, x - x1, y0 - y, y - y1, z - top], axis=-1)
    outwards = np.maximum(faces, 0.0) @ _FACE_NORMALS
    outside = np.linalg.norm(outwards, axis=-1)
    nearest = faces.argmax(axis=-1)
    is_outside = outside > 0.0
    distances = np.where(is_outside, outside, faces.max(axis=-1))
    unit = outwards / np.where(is_outside, outside, 1.0)[..., None]
    return distances, np.where(is_outside[..., None], unit, _FACE_NORMALS[nearest])
