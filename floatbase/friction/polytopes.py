"""Geometry of cones and polytopes that `wrenches` needs: facets from rays, vertices from farthest
points.

qhull only says which rays or points belong to a facet; its numbers are computed again, so that its
tolerances do not stay.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array
from floatbase.errors import SolverError
from floatbase.linear_algebra import svd_with_rank
from floatbase.qp import linear_program

if TYPE_CHECKING:
    from scipy.spatial import ConvexHull

# part of the size below which a set is flat, a point on a facet: above a linear program's rounding
_FLATNESS_TOLERANCE = 1e-9
# of looking for farther points; each adds one at least, and the stances of the course need about
# ten
_MAX_ROUNDS = 200
_QHULL_TOLERANCE = 1e-8  # part of the size by which qhull's facets may miss the points on them
# singular value, of the largest, below which rays are too nearly dependent to fix a facet
_SLIVER_TOLERANCE = 1e-7
_SAME_DIRECTION = 1e-6  # rad, normals nearer than this are one: qhull's triangles of one facet
_DIGITS = 9  # to which the equations of qhull's triangles of one facet agree


def cone_face_matrix(rays: Array) -> tuple[Array, Array]:
    """The cone {Σ w_j ray_j, w ≥ 0} as rows: (G, E) with G x ≤ 0 and E x = 0, each row of unit
    length.

    rays: shape (n, N), one ray a column. E, shape (n - r, n), spans the directions that no ray
        reaches, r being the rays'
    rank. Where the cone contains whole lines G is zero along them. Source: facets of a cone are
    facets of its cross-section, whose convex hull qhull finds (Barber, Dobkin, Huhdanpaa, The
    Quickhull algorithm for convex hulls, 1996).
    """
    rays = rays / np.linalg.norm(rays, axis=0)  # length does not matter in a cone
    span, E = _span(rays)
    coordinates = span.T @ rays
    c, on_lines = _supporting_direction(coordinates)
    transverse = (
        _span(coordinates[:, on_lines])[1] if np.any(on_lines) else np.eye(len(coordinates))
    )
    G = _pointed_face_matrix(transverse @ coordinates[:, ~on_lines], transverse @ c)
    return G @ transverse @ span.T, E


def polytope_vertices(support_point: Callable[[Array], Array], n: int, size: float) -> Array:
    """The vertices of a bounded convex polytope in R^n, n ≤ 3, shape (k, n), from its farthest
    points.

    support_point: direction (n,) -> a point of the set with the largest direction · x. size: a
        length of the set; 1e-9 of it
    counts as zero. The hull of the known points grows at each of its facets until no point lies
    beyond any: the answer is exact. In the plane the vertices come counter-clockwise. A flat set
    gives one point, the two ends of a segment, or a polygon in space.
    Source: Bretl and Lall, Testing static equilibrium for legged robots, IEEE Transactions on
    Robotics, 2008.
    """
    tolerance = _FLATNESS_TOLERANCE * size
    basis, points = _affine_hull(support_point, n, tolerance)
    origin = points[0]
    if basis.shape[1] == 0:
        return origin[None]
    flat = (points - origin) @ basis
    if basis.shape[1] == 1:
        return points[[int(np.argmin(flat)), int(np.argmax(flat))]]
    for _ in range(_MAX_ROUNDS):
        hull = _hull(flat)
        _, first = np.unique(np.round(hull.equations, _DIGITS), axis=0, return_index=True)
        normals, offsets = hull.equations[first, :-1], hull.equations[first, -1]
        candidates = np.array(
            [(support_point(basis @ normal) - origin) @ basis for normal in normals]
        )
        beyond = np.einsum("ij,ij->i", normals, candidates) + offsets > tolerance
        if not np.any(beyond):
            return origin + flat[_hull_vertices(hull, flat, normals, offsets, tolerance)] @ basis.T
        flat = np.vstack([flat[hull.vertices], candidates[beyond]])
    raise SolverError(
        f"the vertices of a polytope were not all found in {_MAX_ROUNDS} rounds; {len(flat)} are "
        f"known."
    )


def _span(rays: Array) -> tuple[Array, Array]:
    """Orthonormal bases of what the rays span, shape (n, r), and of the rest, as rows, shape (n -
    r, n).
    """
    U, _, _, rank = svd_with_rank(rays)
    return U[:, :rank], U[:, rank:].T


def _supporting_direction(rays: Array) -> tuple[Array, npt.NDArray[np.bool_]]:
    """A c with c · ray ≥ 0 for every ray, = 0 only for rays on lines of the cone, and which these
    are.
    """
    n, N = rays.shape
    result = linear_program(
        np.concatenate([np.zeros(n), -np.ones(N)]),
        inequalities=(np.hstack([-rays.T, np.eye(N)]), np.zeros(N)),
        bounds=[(None, None)] * n + [(0.0, 1.0)] * N,
    )
    return result.x[:n], result.x[n:] < 0.5


def _pointed_face_matrix(rays: Array, c: Array) -> Array:
    """Rows of a pointed cone of full dimension, shape (facets, n); c · ray > 0 for all rays."""
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
        on_facet = np.abs(
            section @ equations[:, :-1].T + equations[:, -1]
        ) < _QHULL_TOLERANCE * float(np.max(np.abs(section)))
        facet_rays = {frozenset(np.flatnonzero(column).tolist()) for column in on_facet.T}
    rows = [_facet_through(rays, sorted(chosen)) for chosen in sorted(facet_rays, key=sorted)]
    return np.array([row for row in rows if row is not None])


def _facet_through(rays: Array, chosen: list[int]) -> Array | None:
    """The unit row that is 0 on the rays chosen and ≤ 0 on the others; None where they do not fix
    it (a sliver).
    """
    U, s, _ = np.linalg.svd(rays[:, chosen])
    if np.sum(s > _SLIVER_TOLERANCE * s[0]) != len(rays) - 1:
        return None
    row = U[:, -1]
    return -np.sign(row @ rays.sum(axis=1)) * row


def _affine_hull(
    support_point: Callable[[Array], Array], n: int, tolerance: float
) -> tuple[Array, Array]:
    """An orthonormal basis of the directions in which the set extends, shape (n, r), and points
    that show it.
    """
    basis, flat, points = np.zeros((n, 0)), np.zeros((n, 0)), []
    while basis.shape[1] + flat.shape[1] < n:
        direction = (
            np.linalg.svd(np.hstack([basis, flat]))[0][:, -1]
            if basis.size + flat.size
            else np.eye(n)[0]
        )
        ends = [support_point(direction), support_point(-direction)]
        points += ends
        step = ends[0] - ends[1]
        if direction @ step <= tolerance:
            flat = np.hstack([flat, direction[:, None]])
        else:
            step -= basis @ (basis.T @ step)
            basis = np.hstack([basis, (step / np.linalg.norm(step))[:, None]])
    # the plane's own axes where nothing is flat, so that counter-clockwise stays so
    return np.eye(n) if basis.shape[1] == n else basis, np.array(points)


def _hull(points: Array) -> ConvexHull:
    from scipy.spatial import ConvexHull, QhullError  # slow to load, and no controller needs it

    try:
        return ConvexHull(points)
    except QhullError as error:
        raise SolverError(
            f"qhull found no hull of {len(points)} points in R^{points.shape[1]}: {error}"
        ) from None


def _hull_vertices(
    hull: ConvexHull, points: Array, normals: Array, offsets: Array, tolerance: float
) -> list[int]:
    """Which points are vertices: those where facets of enough different directions meet."""
    indices: list[int] = []
    for i in hull.vertices:
        facet_normals = normals[np.abs(normals @ points[i] + offsets) <= tolerance]
        rank = (
            int(np.sum(np.linalg.svd(facet_normals, compute_uv=False) > _SAME_DIRECTION))
            if len(facet_normals)
            else 0
        )
        duplicate = any(np.linalg.norm(points[i] - points[j]) <= tolerance for j in indices)
        if rank == points.shape[1] and not duplicate:
            indices.append(int(i))
    return indices
