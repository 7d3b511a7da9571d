"""Where to step: the rules that `Walk` uses by default, as functions that can be exchanged."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from floatbase._geometry import convex_hull, distance_to_polygon
from floatbase._validation import Array, as_array, as_number, as_positive, read_only
from floatbase.errors import InputError

_MAX_EXPONENT = 50.0  # ω times a time: what grows by e^{50} is out of reach of any robot


def neutral_point(
    nominal_foothold: npt.ArrayLike, velocity: npt.ArrayLike, stance_time: float
) -> Array:
    """Raibert's neutral point: the foothold, (2,), m, that the body passes in the middle of the
    coming stance.

    nominal_foothold: (2,), m, world, of the foot below the body at touch-down, as it stands.
    velocity: (2,), m/s, world, of the body.
    stance_time: s, for which the foot will stand.

    Source: Raibert, Legged robots that balance, 1986.
    """
    nominal_foothold, velocity = (
        as_array("nominal_foothold", nominal_foothold, (2,), "m"),
        as_array("velocity", velocity, (2,), "m/s"),
    )
    return read_only(
        nominal_foothold
        + velocity * as_positive("stance_time", stance_time, "s", allow_zero=True) / 2.0
    )


def capture_point(com: npt.ArrayLike, velocity: npt.ArrayLike, omega: float) -> Array:
    """ξ = c + ċ / ω, shape (2,), m: where a linear inverted pendulum must step to come to rest.

    com, velocity: (2,) or (3,), m and m/s, world, of the centre of mass; heights do not count.
    omega: 1/s, √(g / height).

    It is the divergent component of motion, too: ξ̇ = ω (ξ - p), so it runs away from the ZMP p.
    Sources: Pratt et al., Capture point, 2006; Englsberger, Ott, Albu-Schäffer, 2015.
    """
    c, v = _horizontal_part("com", com, "m"), _horizontal_part("velocity", velocity, "m/s")
    return read_only(c + v / as_positive("omega", omega, "1/s"))


def _horizontal_part(name: str, vector: npt.ArrayLike, unit: str) -> Array:
    """x and y of a vector of two or three."""
    array = as_array(name, vector, (None,), unit)
    if len(array) not in (2, 3):
        raise InputError(
            f"{name} has shape {array.shape}; it must have shape (2,) or (3,) ({unit})."
        )
    return array[:2]


def support_margin(point: npt.ArrayLike, feet: npt.ArrayLike) -> float:
    """How far a point is inside the convex hull of the feet, m; negative: how far outside. Level
    ground, seen from above.

    point: (2,), m, world, such as the capture point or the ZMP. feet: (n, 2), m, world, of all
        points that touch. Both may have heights, which do not count.
    On other ground the support region is another: `floatbase.friction.WrenchSet.support_region`,
    whose corners fit, too.
    """
    point, feet = _horizontal_part("point", point, "m"), as_array("feet", feet, (None, None), "m")
    if feet.shape[1] not in (2, 3):
        raise InputError(f"feet has shape {feet.shape}; it must have shape (n, 2) or (n, 3) (m).")
    feet = feet[:, :2]
    if not len(feet):
        raise InputError(
            "a robot in the air has no support region: feet must hold one point at least."
        )
    return float(distance_to_polygon(point, convex_hull(feet)))


def step_adjustment(
    dcm_error: npt.ArrayLike, time_to_touchdown: float, omega: float, dead_zone: float = 0.0
) -> Array:
    """e^{ω (land - t)} (ξ - ξ_planned): how far to shift a foothold, (2,), m, so that an error now
    is caught at touch-down.

    dcm_error: ξ - ξ_planned, (2,), m, world, now.
    time_to_touchdown: s, until the foot lands; the error grows by e^{ω time_to_touchdown} until
        then.
    omega: 1/s, √(g / height).
    dead_zone: m; an error below it counts as none, and a larger one by what is beyond.
    """
    error = as_array("dcm_error", dcm_error, (2,), "m")
    size = float(np.linalg.norm(error))
    scale = max(0.0, size - as_positive("dead_zone", dead_zone, "m", allow_zero=True)) / (
        size or 1.0
    )
    exponent = as_positive("omega", omega, "1/s") * max(
        0.0, as_number("time_to_touchdown", time_to_touchdown, "s")
    )
    return read_only(scale * np.exp(min(exponent, _MAX_EXPONENT)) * error)
