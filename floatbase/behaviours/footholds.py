"""Where to step: the rules that `Walk` uses by default, as functions that can be exchanged."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from floatbase._arrays import Array, checked, number, positive, read_only


def neutral_point(place: npt.ArrayLike, velocity: npt.ArrayLike, stance_time: float) -> Array:
    """Raibert's neutral point: the foothold, (2,), m, that the body passes in the middle of the coming stance.

    place: (2,), m, world, of the foot below the body at touch-down, as it stands.
    velocity: (2,), m/s, world, of the body.
    stance_time: s, for which the foot will stand.

    Source: Raibert, Legged robots that balance, 1986.
    """
    place, velocity = checked("place", place, (2,), "m"), checked("velocity", velocity, (2,), "m/s")
    return read_only(place + velocity * positive("stance_time", stance_time, "s", allow_zero=True) / 2.0)


def capture_point(com: npt.ArrayLike, velocity: npt.ArrayLike, omega: float) -> Array:
    """ξ = c + ċ / ω, shape (2,), m: where a linear inverted pendulum must step to come to rest.

    com, velocity: (2,) or (3,), m and m/s, world, of the centre of mass; heights do not count.
    omega: 1/s, √(g / height).

    It is the divergent component of motion, too: ξ̇ = ω (ξ - p), so it runs away from the ZMP p. Sources: Pratt et al., Capture
    point, 2006; Englsberger, Ott, Albu-Schäffer, 2015.
    """
    c, v = (np.asarray(checked(name, x, (None,)))[:2] for name, x in (("com", com), ("velocity", velocity)))
    return read_only(c + v / positive("omega", omega, "1/s"))


def step_adjustment(dcm_error: npt.ArrayLike, time_left: float, omega: float, dead_zone: float = 0.0) -> Array:
    """e^{ω (land - t)} (ξ - ξ_planned): how far to shift a foothold, (2,), m, so that an error now is caught at touch-down.

    dcm_error: ξ - ξ_planned, (2,), m, world, now.
    time_left: s, until the foot lands; the error grows by e^{ω time_left} until then.
    omega: 1/s, √(g / height).
    dead_zone: m; an error below it counts as none, and a larger one by what is beyond.
    """
    error = checked("dcm_error", dcm_error, (2,), "m")
    size = float(np.linalg.norm(error))
    beyond = max(0.0, size - positive("dead_zone", dead_zone, "m", allow_zero=True)) / (size or 1.0)
    return read_only(beyond * np.exp(positive("omega", omega, "1/s") * max(0.0, number("time_left", time_left, "s"))) * error)
