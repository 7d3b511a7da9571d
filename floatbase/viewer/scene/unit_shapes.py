"""Shapes of unit size.

Each shape is made once. Equal shapes are the same object, so a picture that shows a shape again
sends nothing.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from floatbase.friction import FrictionPolyhedron
from floatbase.viewer.scene import geometry, threejs
from floatbase.viewer.scene.colours import CONE_ALPHA, PATCH, RGB, WARNING
from floatbase.viewer.scene.threejs import Shape

_RIM = 0.025  # thickness of a rim, as a fraction of the radius of the mouth
FACET_ALPHA = 0.75
ARROW = (
    (0.0, 0.0),
    (1.0, 0.0),
    (1.0, 0.78),
    (2.1, 0.78),
    (0.0, 1.0),
)  # (radius, height) of the corners; length 1, shaft of radius 1


@lru_cache(maxsize=64)
def arrow(colour: RGB, opacity: float) -> Shape:
    """Return an arrow along z of length 1 whose shaft has radius 1."""
    return threejs.mesh(*geometry.surface_of_revolution(ARROW), colour, opacity=opacity)


@lru_cache(maxsize=64)
def cylinder(colour: RGB) -> Shape:
    """Return a rod along z of length 1 and radius 1."""
    return threejs.mesh(
        *geometry.surface_of_revolution([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)], 14),
        colour,
    )


@lru_cache(maxsize=64)
def disc(colour: RGB) -> Shape:
    """Return a disc around z of radius 1 and thickness 1, centred at the origin."""
    return threejs.mesh(
        *geometry.surface_of_revolution([(0.0, -0.5), (1.0, -0.5), (1.0, 0.5), (0.0, 0.5)], 32),
        colour,
    )


@lru_cache(maxsize=64)
def sphere(colour: RGB, on_top: bool = False) -> Shape:
    """Return a ball of radius 1."""
    return threejs.mesh(*geometry.sphere(1.0), colour, on_top=on_top)


@lru_cache(maxsize=1)
def cone() -> Shape:
    """Return a cone around z of height 1 with its tip at the origin and a mouth of radius 1."""
    return threejs.mesh(
        *geometry.surface_of_revolution([(0.0, 0.0), (1.0, 1.0)], 48),
        (1.0, 1.0, 1.0),
        opacity=CONE_ALPHA["inside"],
    )


@lru_cache(maxsize=64)
def polyhedron(mu: float, facets: int, inner_approximation: bool, facet_rotation: float) -> Shape:
    """Return a friction polyhedron around z of height 1 with its tip at the origin."""
    rays = FrictionPolyhedron(
        np.array([0.0, 0.0, 1.0]), mu, facets, inner_approximation, facet_rotation
    ).rays
    return threejs.mesh(
        *geometry.pyramid(rays), (1.0, 1.0, 1.0), opacity=CONE_ALPHA["inside"], flat=True
    )


@lru_cache(maxsize=64)
def polygonal_rim(
    mu: float, facets: int, inner_approximation: bool, facet_rotation: float
) -> Shape:
    """Return the rim of `polyhedron`."""
    rays = FrictionPolyhedron(
        np.array([0.0, 0.0, 1.0]), mu, facets, inner_approximation, facet_rotation
    ).rays
    edges = [
        geometry.cylinder(a, b, _RIM * mu)
        for a, b in zip(rays, np.roll(rays, -1, axis=0), strict=True)
    ]
    return threejs.mesh(*geometry.merged(edges), PATCH)


@lru_cache(maxsize=1)
def round_rim() -> Shape:
    """Return the rim of `cone`."""
    vertices, faces = geometry.torus_arc(1.0, _RIM, 0.0, 2.0 * np.pi)
    return threejs.mesh(vertices + np.array([0.0, 0.0, 1.0], dtype=np.float32), faces, PATCH)


@lru_cache(maxsize=8)
def ring(colour: RGB, thick: bool) -> Shape:
    """Return a ring around z of radius 1 that is drawn on top of objects in front of it."""
    mesh = geometry.torus_arc(1.0, 0.2 if thick else 0.1, 0.0, 2.0 * np.pi)
    return threejs.mesh(*mesh, colour, on_top=True)


@lru_cache(maxsize=256)
def facet(
    mu: float, facets: int, inner_approximation: bool, facet_rotation: float, facet: int
) -> Shape:
    """Return one facet of `polyhedron`; facet i lies between rays i - 1 and i."""
    rays = FrictionPolyhedron(
        np.array([0.0, 0.0, 1.0]), mu, facets, inner_approximation, facet_rotation
    ).rays
    corners = [np.zeros(3), rays[facet - 1], rays[facet]]
    return threejs.mesh(*geometry.convex_polygon(corners), WARNING, opacity=FACET_ALPHA, flat=True)


@lru_cache(maxsize=256)
def label(text: str, height: float, plate: bool, colour: RGB, on_top: bool = True) -> Shape:
    """Return an object that shows text."""
    return threejs.label(text, height, plate, colour, on_top)


@lru_cache(maxsize=256)
def polygon(corners: tuple[tuple[float, ...], ...], colour: RGB, opacity: float) -> Shape:
    """Return a flat convex polygon."""
    return threejs.mesh(*geometry.convex_polygon(corners), colour, opacity=opacity, lit=False)


@lru_cache(maxsize=1)
def invisible_point() -> Shape:
    """Return an invisible object."""
    return threejs.lines(np.zeros((2, 3)), PATCH)
