"""Geometry of cones and polytopes: facets from rays, vertices from extreme points.

qhull only determines which rays or points belong to a facet. The numbers are computed again, so
that its tolerances do not remain.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array
from floatbase.errors import SolverError
from floatbase.linear_algebra import svd_with_rank
from floatbase.qp._linear_programs import linear_program

if TYPE_CHECKING:
    from scipy.spatial import ConvexHull

# facets of a friction polyhedron, which then misses the cone by 5e-6 of μ: no μ is known as well
MAX_FACETS = 1000
# fraction of the size below which a set is flat or a point lies on a facet: above a linear
# program's rounding
_FLATNESS_TOLERANCE = 1e-9
# rounds of search for farther points; each adds at least one, and the stances of the course need
# about ten
_MAX_ROUNDS = 200
_QHULL_TOLERANCE = 1e-8  # fraction of the size by which qhull's facets may miss their points
# fraction of the largest singular value; below it, rays are too dependent to determine a facet
_SLIVER_TOLERANCE = 1e-7
_SAME_DIRECTION = 1e-6  # rad, closer normals count as one: qhull's triangles of one facet
_DIGITS = 9  # digits to which the equations of qhull's triangles of one facet agree


def cone_face_matrix(rays: Array) -> tuple[Array, Array]:
    """Return the cone {Σ w_j ray_j, w ≥ 0} as rows (G, E) of unit length with G x ≤ 0 and E x = 0.

    rays: shape (n, N), one ray per column. E, shape (n - r, n), spans the directions that no ray
    reaches, where r is the rank of the rays. If the cone contains whole lines, G is zero along
    them. The facets of a cone are the facets of its cross-section, whose convex hull qhull finds
    (Barber, Dobkin, Huhdanpaa, The Quickhull algorithm for convex hulls, 1996).
    """
    rays = rays / np.linalg.norm(rays, axis=0)  # length does not matter in a cone
    span, E = _span(rays)
    coordinates = span.T @ rays
    c, on_lines = _supporting_direction(coordinates)
    transverse: Array = np.eye(len(coordinates))
    if np.any(on_lines):
        transverse = _span(coordinates[:, on_lines])[1]
    G = _pointed_face_matrix(transverse @ coordinates[:, ~on_lines], transverse @ c)
    return G @ transverse @ span.T, E


def polytope_vertices(support_point: Callable[[Array], Array], n: int, size: float) -> Array:
    """Return the vertices of a bounded convex polytope in R^n, n ≤ 3, shape (k, n).

    support_point: function that maps a direction, shape (n,), to a point of the set with the
    largest direction · x. size: a length of the set; 1e-9 of it counts as zero. The convex hull of
    the known points grows at each of its facets until no point lies beyond any of them, so the
    answer is exact. In the plane the vertices are in counter-clockwise order. A flat set gives one
    point, the two ends of a segment, or a polygon in space. The method is that of [BretlLall2008]_.
    """
    tolerance = _FLATNESS_TOLERANCE * size
    basis, points = _affine_hull(support_point, n, tolerance)
    origin: Array = points[0]
    if basis.shape[1] == 0:
        return origin[None]
    flat = (points - origin) @ basis
    if basis.shape[1] == 1:
        return points[[int(np.argmin(flat)), int(np.argmax(flat))]]
    for _ in range(_MAX_ROUNDS):
        hull = _hull(flat)
        _, first = np.unique(np.round(hull.equations, _DIGITS), axis=0, return_index=True)
        normals, offsets = hull.equations[first, :-1], hull.equations[first, -1]
        farthest = [support_point(basis @ normal) for normal in normals]
        candidates = np.array([(point - origin) @ basis for point in farthest])
        beyond = np.einsum("ij,ij->i", normals, candidates) + offsets > tolerance
        if not np.any(beyond):
            return origin + flat[_hull_vertices(hull, flat, normals, offsets, tolerance)] @ basis.T
        flat = np.vstack([flat[hull.vertices], candidates[beyond]])
    raise SolverError(
        f"Only {len(flat)} vertices of a polytope were found in {_MAX_ROUNDS} rounds, and some are "
        f"missing."
    )


def _span(rays: Array) -> tuple[Array, Array]:
    """Return orthonormal bases of the rays' span, (n, r), and its complement, (n - r, n)."""
    U, _, _, rank = svd_with_rank(rays)
    return U[:, :rank], U[:, rank:].T


def _supporting_direction(rays: Array) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Return a c with c · ray ≥ 0 for all rays, and which rays lie on lines of the cone.

    c · ray = 0 only for the rays on lines.
    """
    n, N = rays.shape
    result = linear_program(
        np.concatenate([np.zeros(n), -np.ones(N)]),
        inequalities=(np.hstack([-rays.T, np.eye(N)]), np.zeros(N)),
        bounds=[(None, None)] * n + [(0.0, 1.0)] * N,
    )
    return result.x[:n], result.x[n:] < 0.5


def _pointed_face_matrix(rays: Array, c: Array) -> Array:
    """Return the rows of a full-dimensional pointed cone, shape (facets, n).

    c · ray > 0 for all rays.
    """
    n = len(rays)
    if n == 0:
        return np.zeros((0, 0))
    if n == 1:
        return -np.sign(c)[None]
    _, plane = _span(c[:, None])
    section = ((plane @ rays) / (c @ rays)).T
    if n == 2:
        facet_rays = {frozenset([int(np.argmin(section))]), frozenset([int(np.argmax(section))])}
    else:  # all points on each facet of their convex hull
        equations = _hull(section).equations
        tolerance = _QHULL_TOLERANCE * float(np.max(np.abs(section)))
        on_facet = np.abs(section @ equations[:, :-1].T + equations[:, -1]) < tolerance
        facet_rays = {frozenset(np.flatnonzero(column).tolist()) for column in on_facet.T}
    rows = [_facet_through(rays, sorted(chosen)) for chosen in sorted(facet_rays, key=sorted)]
    return np.array([row for row in rows if row is not None])


def _facet_through(rays: Array, chosen: list[int]) -> Array | None:
    """Return the unit row that is 0 on the chosen rays and ≤ 0 on the others.

    Returns None if the chosen rays do not determine the row (a sliver).
    """
    U, s, _ = np.linalg.svd(rays[:, chosen])
    if np.sum(s > _SLIVER_TOLERANCE * s[0]) != len(rays) - 1:
        return None
    row: Array = U[:, -1]
    row = -np.sign(row @ rays.sum(axis=1)) * row
    return row


def _affine_hull(
    support_point: Callable[[Array], Array], n: int, tolerance: float
) -> tuple[Array, Array]:
    """Return an orthonormal basis, (n, r), of the directions in which the set extends, and points.

    The points are those that were found in these directions.
    """
    basis = np.zeros((n, 0))
    flat = np.zeros((n, 0))
    points = []
    while basis.shape[1] + flat.shape[1] < n:
        known = np.hstack([basis, flat])
        direction = np.linalg.svd(known)[0][:, -1] if known.size else np.eye(n)[0]
        ends = [support_point(direction), support_point(-direction)]
        points += ends
        step = ends[0] - ends[1]
        if direction @ step <= tolerance:
            flat = np.hstack([flat, direction[:, None]])
        else:
            step -= basis @ (basis.T @ step)
            basis = np.hstack([basis, (step / np.linalg.norm(step))[:, None]])
    # the original axes if the set is not flat, so that the order stays counter-clockwise
    return np.eye(n) if basis.shape[1] == n else basis, np.array(points)


def _hull(points: Array) -> ConvexHull:
    """Return qhull's convex hull of points."""
    from scipy.spatial import ConvexHull, QhullError  # slow to load; no controller needs it

    try:
        return ConvexHull(points)
    except QhullError as error:
        raise SolverError(
            f"qhull cannot compute the convex hull of {len(points)} points in R^{points.shape[1]}: "
            f"{error}"
        ) from None


def _hull_vertices(
    hull: ConvexHull, points: Array, normals: Array, offsets: Array, tolerance: float
) -> list[int]:
    """Return the indices of the vertices: points where facets of enough directions meet."""
    indices: list[int] = []
    for i in hull.vertices:
        facet_normals = normals[np.abs(normals @ points[i] + offsets) <= tolerance]
        sizes = (
            np.linalg.svd(facet_normals, compute_uv=False) if len(facet_normals) else np.zeros(0)
        )
        rank = int(np.sum(sizes > _SAME_DIRECTION))
        duplicate = any(np.linalg.norm(points[i] - points[j]) <= tolerance for j in indices)
        if rank == points.shape[1] and not duplicate:
            indices.append(int(i))
    return indices
