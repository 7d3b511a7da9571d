"""Foothold rules: neutral point, capture point, step adjustment, and the footholds of `Walk`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from floatbase._geometry import convex_hull, distance_to_polygon
from floatbase._validation import Array, as_array, as_number, as_positive, read_only
from floatbase.behaviours._level_place import foot_outline, level_place
from floatbase.errors import InputError

if TYPE_CHECKING:
    from floatbase.behaviours.walk.walk import Walk

_MAX_EXPONENT = 50.0  # ω times a time: an error that grows by e^{50} is beyond any robot's reach
_EDGE_REACH = 0.15  # m: footholds are moved by at most this much to avoid an edge


def neutral_point(
    nominal_foothold: npt.ArrayLike, velocity: npt.ArrayLike, stance_time: float
) -> Array:
    """Compute Raibert's neutral point: the body passes over it in the middle of the coming stance.

    Parameters
    ----------
    nominal_foothold : array_like, shape (2,)
        Position of the foot below the body at touchdown, as in the standing posture, in the world
        frame [m].
    velocity : array_like, shape (2,)
        Velocity of the body in the world frame [m/s].
    stance_time : float
        Duration of the coming stance [s].

    Returns
    -------
    ndarray, shape (2,)
        Foothold in the world frame [m].

    Notes
    -----
    The rule is from [Raibert1986]_.

    Examples
    --------
    >>> from floatbase.behaviours import neutral_point
    >>> neutral_point([0.2, 0.1], [0.4, 0.0], 0.5)
    array([0.3, 0.1])
    """
    nominal_foothold = as_array("nominal_foothold", nominal_foothold, (2,), "m")
    velocity = as_array("velocity", velocity, (2,), "m/s")
    stance_time = as_positive("stance_time", stance_time, "s", allow_zero=True)
    return read_only(nominal_foothold + velocity * stance_time / 2.0)


def capture_point(com: npt.ArrayLike, velocity: npt.ArrayLike, omega: float) -> Array:
    """Compute the capture point ξ = c + ċ / ω, where a linear inverted pendulum can come to rest.

    The capture point is also the divergent component of motion (DCM): since ξ̇ = ω (ξ - p), it
    moves away from the zero-moment point p.

    Parameters
    ----------
    com : array_like, shape (2,) or (3,)
        Centre of mass in the world frame [m]; its height is ignored.
    velocity : array_like, shape (2,) or (3,)
        Velocity of the centre of mass in the world frame [m/s]; its vertical component is ignored.
    omega : float
        Natural frequency of the pendulum, √(g / height) [1/s].

    Returns
    -------
    ndarray, shape (2,)
        Capture point in the world frame [m].

    Notes
    -----
    The capture point is from [Pratt2006]_; for the DCM see [Englsberger2015]_.
    """
    c, v = _horizontal_part("com", com, "m"), _horizontal_part("velocity", velocity, "m/s")
    return read_only(c + v / as_positive("omega", omega, "1/s"))


def _horizontal_part(name: str, vector: npt.ArrayLike, unit: str) -> Array:
    """Return x and y of a vector with two or three entries."""
    array = as_array(name, vector, (None,), unit)
    if len(array) not in (2, 3):
        raise InputError(
            f"{name} has shape {array.shape}; it must have shape (2,) or (3,) [{unit}]."
        )
    return array[:2]


def support_margin(point: npt.ArrayLike, feet: npt.ArrayLike) -> float:
    """Compute how far a point is inside the support polygon, on level ground.

    The support polygon is the convex hull of the contact points, seen from above. On other ground,
    the support region is a different one; the corners of
    `floatbase.friction.WrenchSet.support_region` can then be given as `feet`.

    Parameters
    ----------
    point : array_like, shape (2,) or (3,)
        Point such as the capture point or the zero-moment point, in the world frame [m]; its height
        is ignored.
    feet : array_like, shape (n, 2) or (n, 3)
        All contact points in the world frame [m]; heights are ignored.

    Returns
    -------
    float
        Distance from the edge, negative outside [m].

    Raises
    ------
    InputError
        If there are no contact points.

    Examples
    --------
    >>> from floatbase.behaviours import support_margin
    >>> support_margin([0.1, 0.0], [[-0.2, -0.3], [-0.2, 0.3], [0.2, -0.3], [0.2, 0.3]])
    0.1
    """
    point, feet = _horizontal_part("point", point, "m"), as_array("feet", feet, (None, None), "m")
    if feet.shape[1] not in (2, 3):
        raise InputError(f"feet has shape {feet.shape}; it must have shape (n, 2) or (n, 3) [m].")
    feet = feet[:, :2]
    if not len(feet):
        raise InputError(
            "feet must hold at least one point, because a robot in the air has no support polygon."
        )
    return float(distance_to_polygon(point, convex_hull(feet)))


def step_adjustment(
    dcm_error: npt.ArrayLike, time_to_touchdown: float, omega: float, dead_zone: float = 0.0
) -> Array:
    """Compute how far to shift a foothold so that a present error is corrected at touchdown.

    The shift is e^{ω (T - t)} (ξ - ξ_planned), with the divergent component of motion (DCM) ξ and
    the time of touchdown T.

    Parameters
    ----------
    dcm_error : array_like, shape (2,)
        Present error ξ - ξ_planned of the DCM in the world frame [m].
    time_to_touchdown : float
        Time until the foot lands [s]. The error grows by e^{ω time_to_touchdown} until then.
    omega : float
        Natural frequency of the pendulum, √(g / height) [1/s].
    dead_zone : float, optional
        Errors below this length are ignored, and larger errors are reduced by it [m].

    Returns
    -------
    ndarray, shape (2,)
        Shift of the foothold in the world frame [m].

    Notes
    -----
    For the dynamics of the DCM see [Englsberger2015]_.
    """
    error = as_array("dcm_error", dcm_error, (2,), "m")
    size = float(np.linalg.norm(error))
    dead_zone = as_positive("dead_zone", dead_zone, "m", allow_zero=True)
    scale = max(0.0, size - dead_zone) / (size or 1.0)
    time = max(0.0, as_number("time_to_touchdown", time_to_touchdown, "s"))
    exponent = as_positive("omega", omega, "1/s") * time
    return read_only(scale * np.exp(min(exponent, _MAX_EXPONENT)) * error)


def raibert_foothold(foot: str, touchdown: float, walk: Walk) -> Array:
    """Compute the default foothold of a `Walk`: the neutral point of the foot on the body's path.

    Where the body turns, the velocity is that of the foot's nominal position. The foothold also
    lies farther outside by a / ω², where a is the centripetal acceleration. The reason is that the
    centre of mass of a pendulum moves on a smaller circle than its zero-moment point.

    Parameters
    ----------
    foot : str
        Name of the foot.
    touchdown : float
        Time at which the foot lands [s].
    walk : Walk
        The walk.

    Returns
    -------
    ndarray, shape (2,)
        Foothold in the world frame [m].

    Notes
    -----
    The rule is from [Raibert1986]_.
    """
    gait, path = walk.gait, walk.path_at(touchdown)
    velocity = path.point_velocity(np.zeros(2))
    nominal, yaw_rate = walk.nominal_foothold(foot, touchdown), path.velocity[2]
    arm = nominal - path.position
    turning = yaw_rate * np.array([-arm[1], arm[0]])
    centripetal = yaw_rate * np.array([-velocity[1], velocity[0]])
    # as `neutral_point`, without its checks
    point = nominal + (velocity + turning) * (gait.period - gait.swing) / 2.0
    foothold: Array = point - centripetal / walk.omega**2
    if walk.options.ground is None:
        return foothold
    around = foot_outline(walk.robot.foot(foot), path.yaw)
    return level_place(walk.options.ground, foothold, around, _EDGE_REACH)
