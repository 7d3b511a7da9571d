"""`LIPM`: the linear inverted pendulum, with a zero-moment point (ZMP) that is planned ahead."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol, TypeAlias

import numpy as np

from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_number,
    as_positive,
    cached_property,
    checked,
    read_only,
    short_repr,
)
from floatbase.errors import InputError

ZMPSegment: TypeAlias = tuple[float, float, Array, Array]
# ω times the length of a plan: e^{300} is still a finite number, and half a minute of any robot
_MAX_EXPONENT = 300.0
_MAX_GAP = 1e-6  # s: segments of a ZMP that are further apart are not consecutive


class CoMPlan(Protocol):
    """Plan of the centre of mass's horizontal motion, such as `LIPM`."""

    @property
    def omega(self) -> float:
        """Natural frequency of the pendulum [1/s]."""

    def __call__(self, t: float) -> tuple[Array, Array, Array]:
        """Return position, velocity and acceleration at t [s], each (2,), in the world frame."""

    def dcm(self, t: float) -> Array:
        """Return the divergent component of motion at t [s], shape (2,), world frame [m]."""

    def zmp(self, t: float) -> Array:
        """Return the zero-moment point at t [s], shape (2,), world frame [m]."""


@dataclass(frozen=True, eq=False)
class LIPM(Value):
    """Linear inverted pendulum: horizontal motion of the centre of mass at constant height.

    The motion c̈ = ω² (c - p) of the centre of mass c above a planned zero-moment point (ZMP) p is
    computed in closed form. The initial velocity is the only one for which the motion stays
    bounded.

    Parameters
    ----------
    segments : sequence of (float, float, array_like, array_like)
        Consecutive segments (begin, end, p at begin, p at end) of the ZMP, with times [s] and
        positions of shape (2,) in the world frame [m]. The ZMP is linear in each segment. At the
        end of the last one, the divergent component of motion (DCM) ξ = c + ċ / ω equals p: the
        motion comes to rest.
    com : array_like, shape (2,)
        Initial position of the centre of mass in the world frame [m].
    omega : float
        Natural frequency of the pendulum, √(g / height) [1/s].

    Raises
    ------
    InputError
        If the segments have gaps, or if the plan is too long.

    Notes
    -----
    Before the first segment, the motion is that at its beginning. After the last segment, the
    ZMP does not move, and the centre of mass approaches it.

    The model is the three-dimensional linear inverted pendulum mode of [Kajita2001]_. The
    plan follows the DCM, as in [Englsberger2015]_; for the ZMP see [Vukobratovic2004]_.

    Examples
    --------
    >>> from floatbase.behaviours import LIPM
    >>> plan = LIPM([(0.0, 1.0, [0.0, 0.0], [0.0, 0.1])], com=[0.0, 0.0], omega=3.0)
    >>> plan.zmp(0.5)
    array([0.  , 0.05])
    """

    segments: Sequence[ZMPSegment]
    com: Array = field(metadata=checked(as_array, (2,), "m"))
    omega: float = field(metadata=checked(as_positive, "1/s"))

    def __post_init__(self) -> None:
        super().__post_init__()
        form = "segments must be a list [(begin, end, ZMP at begin, ZMP at end), …]"
        if not isinstance(self.segments, list | tuple) or not self.segments:
            raise InputError(f"{form}, not {short_repr(self.segments)}.")
        segments: list[ZMPSegment] = []
        for segment in self.segments:
            if not isinstance(segment, list | tuple) or len(segment) != 4:
                raise InputError(f"{form}, but one of its entries is {short_repr(segment)}.")
            begin, end, p0, p1 = segment
            begin = as_number("begin of a segment", begin, "s")
            end = as_number("end of a segment", end, "s")
            if not end > begin or (segments and abs(segments[-1][1] - begin) > _MAX_GAP):
                raise InputError(
                    f"A segment of the ZMP goes from {begin:g} to {end:g} s. Each segment must end "
                    f"later than it begins, and begin where the one before ends."
                )
            p0, p1 = (as_array("ZMP", p, (2,), "m") for p in (p0, p1))
            segments.append((begin, end, p0, p1))
        length = segments[-1][1] - segments[0][0]
        if self.omega * length > _MAX_EXPONENT:
            raise InputError(
                f"A plan of {length:g} s is too long. omega times its length must be at most "
                f"{_MAX_EXPONENT:g}."
            )
        object.__setattr__(self, "segments", tuple(segments))

    def __call__(self, t: float) -> tuple[Array, Array, Array]:
        """Compute the motion of the centre of mass at a given time.

        Parameters
        ----------
        t : float
            The time [s].

        Returns
        -------
        position : ndarray, shape (2,)
            Position in the world frame [m].
        velocity : ndarray, shape (2,)
            Velocity in the world frame [m/s].
        acceleration : ndarray, shape (2,)
            Acceleration in the world frame [m/s²].
        """
        (p, slope, a, b), omega = self._evaluate(t), self.omega
        x, v = read_only(p + a + b), read_only(slope + omega * (a - b))
        return x, v, read_only(omega**2 * (a + b))

    def dcm(self, t: float) -> Array:
        """Compute the divergent component of motion ξ = c + ċ / ω at a given time.

        Parameters
        ----------
        t : float
            The time [s].

        Returns
        -------
        ndarray, shape (2,)
            DCM in the world frame [m].
        """
        p, slope, a, _ = self._evaluate(t)
        return read_only(p + slope / self.omega + 2.0 * a)

    def zmp(self, t: float) -> Array:
        """Return the zero-moment point at a given time.

        Parameters
        ----------
        t : float
            The time [s].

        Returns
        -------
        ndarray, shape (2,)
            ZMP in the world frame [m].
        """
        return read_only(self._evaluate(t)[0])

    @cached_property
    def pieces(self) -> Array:
        """Return the closed form of the motion as numbers, shape (n, 9).

        Each row has the time at which a piece begins [s], the ZMP p there [m], its slope [m/s], and
        the coefficients a and b [m] of c = p + slope s + a e^{ω s} + b e^{-ω s}, with the time s
        since the piece began. The last piece never ends.
        """
        return read_only(np.array([np.concatenate([[t], *rest]) for t, *rest in self._closed_form]))

    @cached_property
    def _closed_form(self) -> tuple[tuple[float, Array, Array, Array, Array], ...]:
        """Return begin, p there, its slope, and the coefficients a and b of each segment.

        In a segment, c = p + a e^{ω s} + b e^{-ω s} with s = t - begin. The coefficient a is
        computed backwards from the end, by the DCM, and b forwards from the beginning, by the CoM.
        The last segment continues indefinitely: the ZMP does not move, and the CoM approaches it.
        """
        omega = self.omega
        xi = self.segments[-1][3]
        divergent = []
        for begin, end, p0, p1 in reversed(self.segments):
            slope = (p1 - p0) / (end - begin)
            ahead = (xi - p1 - slope / omega) * np.exp(-omega * (end - begin))
            divergent.append(ahead / 2.0)
            xi = p0 + slope / omega + ahead
        c, solutions = self.com, []
        for (begin, end, p0, p1), a in zip(self.segments, reversed(divergent), strict=True):
            b, growth = c - p0 - a, np.exp(omega * (end - begin))
            solutions.append((begin, p0, (p1 - p0) / (end - begin), a, b))
            c = p1 + a * growth + b / growth
        _, end, _, last = self.segments[-1]
        return *solutions, (end, last, np.zeros(2), np.zeros(2), c - last)

    def _evaluate(self, t: float) -> tuple[Array, Array, Array, Array]:
        """Return p, its slope, and the growing and the decaying part of c - p at time t.

        Before the first segment, the values are those at the segment's beginning.
        """
        t = max(as_number("t", t, "s"), self.segments[0][0])
        begin, p0, slope, a, b = next(s for s in reversed(self._closed_form) if s[0] <= t)
        # beyond the last segment a is 0
        growth = np.exp(min(self.omega * (t - begin), _MAX_EXPONENT))
        return p0 + slope * (t - begin), slope, a * growth, b / growth
