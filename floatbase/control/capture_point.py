"""Inequality that keeps the capture point inside the support polygon."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from floatbase._geometry import first_corner, next_corner
from floatbase._validation import Array, as_positive
from floatbase.control.limits import LinearInequality
from floatbase.dynamics import EquationsOfMotion
from floatbase.errors import InputError


def capture_point_inequality(
    margin: float = 0.0,
    horizon: float = 0.1,
    name: str = "capture point",
    weight: float | None = None,
) -> LinearInequality:
    """Make inequalities that keep the capture point inside the support polygon.

    The capture point ξ = c + ċ / ω is where the robot can come to rest, with ω = √(g / height of
    the centre of mass above the contact points). With a constant acceleration c̈, which is affine in
    q̈, the capture point after the horizon T is ξ(T) = c + T ċ + T² c̈ / 2 + (ċ + T c̈) / ω. The
    inequalities require ξ(T) to be inside the support polygon, the convex hull of the contact
    points, at a distance of at least `margin` from each edge. The ground is level.

    Parameters
    ----------
    margin : float, optional
        Distance from the edges of the support polygon [m].
    horizon : float, optional
        Horizon T [s]. With a shorter horizon, the capture point may approach an edge faster.
    name : str, optional
        Name in messages.
    weight : float, optional
        None makes the inequalities hard. A number makes them soft: their violation times this
        weight is added to the objective [units of the objective per m/s²].

    Returns
    -------
    LinearInequality
        One row on q̈ for each edge of the support polygon, in m/s², for the `inequalities` of a
        controller. Evaluating the rows raises `InputError` if the polygon has no interior, as with
        two point feet, or if the centre of mass is not above the contact points.

    Notes
    -----
    The constraint is from [Ramos2014]_, and the capture point from [Pratt2006]_. The inequalities
    keep tasks from moving the robot to a state from which it must step or fall. A disturbance can
    still move the capture point so far that no contact forces bring it back within the horizon.
    Then the problem is infeasible, unless the inequalities are soft.

    Examples
    --------
    >>> from floatbase.control import capture_point_inequality
    >>> robot = fb.load("go2")
    >>> contacts = fb.Contacts.points(robot)
    >>> inside = capture_point_inequality(margin=0.02)
    >>> controller = fb.WholeBodyController(
    ...     robot, contacts, fb.standing_tasks(robot.standing()), inequalities=[inside]
    ... )
    """
    margin = as_positive("margin", margin, "m", allow_zero=True)
    horizon = as_positive("horizon", horizon, "s")
    return LinearInequality(name, "qdd", CapturePointRows(margin, horizon), weight=weight)


@dataclass(frozen=True)
class CapturePointRows:
    """Coefficients of a `capture_point_inequality` with these arguments."""

    margin: float
    horizon: float

    def __call__(self, eom: EquationsOfMotion, t: float) -> tuple[Array, Array]:
        """Return G and h [m/s²]."""
        state, horizon, points = eom.state, self.horizon, eom.contacts.positions(eom.state)
        normals, offsets = _edges(points[:, :2])
        name = "height of the centre of mass above the contact points"
        height = as_positive(name, state.com[2] - points[:, 2].mean(), "m")
        omega = np.sqrt(eom.robot.gravity / height)
        # ξ(T) = still + gain c̈
        still = state.com[:2] + (horizon + 1.0 / omega) * state.com_velocity[:2]
        gain = 0.5 * horizon**2 + horizon / omega
        allowed = (offsets - self.margin - normals @ still) / gain
        return normals @ state.com_jacobian[:2], allowed - normals @ state.com_drift[:2]


def support_corners(points: Array) -> list[int]:
    """Return the sorted indices of those points, (n, 2 or more), that are corners of the hull."""
    corner, corners = first_corner(points), list[int]()
    while corner not in corners:
        corners.append(corner)
        corner = next_corner(points, corner)
    return sorted(corners)


def _edges(points: Array) -> tuple[Array, Array]:
    """Return n and d of the half-planes n · x ≤ d whose intersection is the support polygon.

    The half-planes are in the order of the points at which their edges start. Each edge ends at the
    next corner counter-clockwise.
    """
    corners = support_corners(points)
    if len(corners) < 3:
        raise InputError(
            f"The support polygon of {len(points)} contact points has no interior. The capture "
            f"point needs at least 3 contact points that are not on one line."
        )
    starts, ends = points[corners], points[[next_corner(points, i) for i in corners]]
    normals = np.column_stack([ends[:, 1] - starts[:, 1], starts[:, 0] - ends[:, 0]])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return normals, np.sum(normals * starts, axis=1)
