"""`LIPM`: the centre of mass as a linear inverted pendulum above a zero-moment point (ZMP) that is
planned ahead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

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
# ω times the length of a plan: e^{300} is a number still, and half a minute of any robot
_MAX_EXPONENT = 300.0
_MAX_GAP = 1e-6  # s: segments of a ZMP that are further apart are not one after the other


@dataclass(frozen=True, eq=False)
class LIPM(Value):
    """c̈ = ω² (c - p): the horizontal motion of a centre of mass c at constant height above a ZMP
    p, in closed form.

    segments: of p, one after the other: (begin, end, p at begin, p at end), s and (2,) m, world; p
        is linear in each. At the end of the last one the divergent component of motion (DCM) ξ = c
        + ċ / ω is on p: the motion comes to rest.
    com: (2,), m, world, where the centre of mass is at first. Its velocity follows: there is one
        that stays bounded.
    omega: 1/s, √(g / height).

    Sources: Kajita et al., 3D linear inverted pendulum mode, 2001; Englsberger, Ott, Albu-Schäffer,
    3D walking based on the divergent component of motion, 2015. Raises `InputError` for segments
    with gaps.
    """

    segments: Sequence[ZMPSegment]
    com: Array = field(metadata=checked(as_array, (2,), "m"))
    omega: float = field(metadata=checked(as_positive, "1/s"))

    def __post_init__(self) -> None:
        super().__post_init__()
        form = "a plan needs segments of the ZMP: [(begin, end, p at begin, p at end), …]"
        if not isinstance(self.segments, list | tuple) or not self.segments:
            raise InputError(f"{form}, not {short_repr(self.segments)}.")
        segments: list[ZMPSegment] = []
        for segment in self.segments:
            if not isinstance(segment, list | tuple) or len(segment) != 4:
                raise InputError(f"{form}; one of them is {short_repr(segment)}.")
            begin, end, p0, p1 = segment
            begin, end = (
                as_number("begin of a segment", begin, "s"),
                as_number("end of a segment", end, "s"),
            )
            if not end > begin or (segments and abs(segments[-1][1] - begin) > _MAX_GAP):
                raise InputError(
                    f"a segment of the ZMP goes from {begin:g} to {end:g} s; each must end later, "
                    f"and the next begin there."
                )
            segments.append(
                (begin, end, as_array("ZMP", p0, (2,), "m"), as_array("ZMP", p1, (2,), "m"))
            )
        length = segments[-1][1] - segments[0][0]
        if self.omega * length > _MAX_EXPONENT:
            raise InputError(
                f"a plan of {length:g} s is too long: omega times its length must be at most "
                f"{_MAX_EXPONENT:g}."
            )
        object.__setattr__(self, "segments", tuple(segments))

    def __call__(self, t: float) -> tuple[Array, Array, Array]:
        """Position, m, velocity, m/s, and acceleration, m/s², of the centre of mass, shape (2,)
        each, at time t in s.
        """
        p, slope, a, b = self._evaluate(t)
        return (
            read_only(p + a + b),
            read_only(slope + self.omega * (a - b)),
            read_only(self.omega**2 * (a + b)),
        )

    def dcm(self, t: float) -> Array:
        """ξ = c + ċ / ω, shape (2,), m, at time t in s."""
        p, slope, a, _ = self._evaluate(t)
        return read_only(p + slope / self.omega + 2.0 * a)

    def zmp(self, t: float) -> Array:
        """p, shape (2,), m, at time t in s."""
        return read_only(self._evaluate(t)[0])

    @cached_property
    def _closed_form(self) -> tuple[tuple[float, Array, Array, Array, Array], ...]:
        """Of each segment: begin, p there, its slope, and a and b of c = p + a e^{ω s} + b e^{-ω
        s}, s = t - begin.

        a comes from the end backwards, by the DCM, and b from the beginning forwards, by the CoM.
        One more part goes on for ever from the end: the ZMP stays, and the CoM comes to it.
        """
        omega, xi, divergent = self.omega, self.segments[-1][3], []
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
        """p, its slope, and the rising and the falling part of c - p at time t; before the first
        segment as at its begin.
        """
        t = max(as_number("t", t, "s"), self.segments[0][0])
        begin, p0, slope, a, b = next(
            solution for solution in reversed(self._closed_form) if solution[0] <= t
        )
        growth = np.exp(
            min(self.omega * (t - begin), _MAX_EXPONENT)
        )  # beyond the last segment a is 0
        return p0 + slope * (t - begin), slope, a * growth, b / growth
