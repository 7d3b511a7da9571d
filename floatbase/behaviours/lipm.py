"""`LIPM`: the centre of mass as a linear inverted pendulum above a zero-moment point (ZMP) that is planned ahead."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from floatbase._validation import Array, Value, as_array, as_number, as_positive, cached_property, read_only, short_repr
from floatbase.errors import InputError

Piece: TypeAlias = tuple[float, float, Array, Array]
_FARTHEST = 300.0  # ω times the length of a plan: e^{300} is a number still, and half a minute of any robot
_GAP = 1e-6  # s: pieces of a ZMP that are further apart are not one after the other


@dataclass(frozen=True, eq=False)
class LIPM(Value):
    """c̈ = ω² (c - p): the horizontal motion of a centre of mass c at constant height above a ZMP p, in closed form.

    pieces: of p, one after the other: (begin, end, p at begin, p at end), s and (2,) m, world; p is linear in each. At the end
        of the last one the divergent component of motion (DCM) ξ = c + ċ / ω is on p: the motion comes to rest.
    com: (2,), m, world, where the centre of mass is at first. Its velocity follows: there is one that stays bounded.
    omega: 1/s, √(g / height).

    Sources: Kajita et al., 3D linear inverted pendulum mode, 2001; Englsberger, Ott, Albu-Schäffer, 3D walking based on the
    divergent component of motion, 2015. Raises `InputError` for pieces with gaps.
    """

    pieces: Sequence[Piece]
    com: Array
    omega: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "com", as_array("com", self.com, (2,), "m"))
        object.__setattr__(self, "omega", as_positive("omega", self.omega, "1/s"))
        form = "a plan needs pieces of the ZMP: [(begin, end, p at begin, p at end), …]"
        if not isinstance(self.pieces, list | tuple) or not self.pieces:
            raise InputError(f"{form}, not {short_repr(self.pieces)}.")
        pieces: list[Piece] = []
        for piece in self.pieces:
            if not isinstance(piece, list | tuple) or len(piece) != 4:
                raise InputError(f"{form}; one of them is {short_repr(piece)}.")
            begin, end, p0, p1 = piece
            begin, end = as_number("begin of a piece", begin, "s"), as_number("end of a piece", end, "s")
            if not end > begin or (pieces and abs(pieces[-1][1] - begin) > _GAP):
                raise InputError(
                    f"a piece of the ZMP goes from {begin:g} to {end:g} s; each must end later, and the next begin there."
                )
            pieces.append((begin, end, as_array("ZMP", p0, (2,), "m"), as_array("ZMP", p1, (2,), "m")))
        length = pieces[-1][1] - pieces[0][0]
        if self.omega * length > _FARTHEST:
            raise InputError(f"a plan of {length:g} s is too long: omega times its length must be at most {_FARTHEST:g}.")
        object.__setattr__(self, "pieces", tuple(pieces))

    def __call__(self, t: float) -> tuple[Array, Array, Array]:
        """Position, m, velocity, m/s, and acceleration, m/s², of the centre of mass, shape (2,) each, at time t in s."""
        p, slope, a, b = self._at(t)
        return read_only(p + a + b), read_only(slope + self.omega * (a - b)), read_only(self.omega**2 * (a + b))

    def dcm(self, t: float) -> Array:
        """ξ = c + ċ / ω, shape (2,), m, at time t in s."""
        p, slope, a, _ = self._at(t)
        return read_only(p + slope / self.omega + 2.0 * a)

    def zmp(self, t: float) -> Array:
        """p, shape (2,), m, at time t in s."""
        return read_only(self._at(t)[0])

    @cached_property
    def _parts(self) -> tuple[tuple[float, Array, Array, Array, Array], ...]:
        """Of each piece: begin, p there, its slope, and a and b of c = p + a e^{ω s} + b e^{-ω s}, s = t - begin.

        a comes from the end backwards, by the DCM, and b from the beginning forwards, by the CoM. One more part goes on for
        ever from the end: the ZMP stays, and the CoM comes to it.
        """
        omega, xi, rising = self.omega, self.pieces[-1][3], []
        for begin, end, p0, p1 in reversed(self.pieces):
            slope = (p1 - p0) / (end - begin)
            ahead = (xi - p1 - slope / omega) * np.exp(-omega * (end - begin))
            rising.append(ahead / 2.0)
            xi = p0 + slope / omega + ahead
        c, parts = self.com, []
        for (begin, end, p0, p1), a in zip(self.pieces, reversed(rising), strict=True):
            b, growth = c - p0 - a, np.exp(omega * (end - begin))
            parts.append((begin, p0, (p1 - p0) / (end - begin), a, b))
            c = p1 + a * growth + b / growth
        _, end, _, last = self.pieces[-1]
        return *parts, (end, last, np.zeros(2), np.zeros(2), c - last)

    def _at(self, t: float) -> tuple[Array, Array, Array, Array]:
        """p, its slope, and the rising and the falling part of c - p at time t; before the first piece as at its begin."""
        t = max(as_number("t", t, "s"), self.pieces[0][0])
        begin, p0, slope, a, b = next(part for part in reversed(self._parts) if part[0] <= t)
        growth = np.exp(min(self.omega * (t - begin), _FARTHEST))  # beyond the last piece a is 0
        return p0 + slope * (t - begin), slope, a * growth, b / growth
