"""`Swing`: the path of a foot through the air."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_number,
    as_positive,
    checked,
    read_only,
)
from floatbase.errors import InputError


@dataclass(frozen=True, eq=False)
class Swing(Value):
    """A foot's path from start to end, at rest at both: minimum jerk, and a bump of `height`
    upwards.

    start, end: (3,), m, world.
    lift_off, touchdown: s, when it begins and ends.
    height: m, of the bump, half-way.

    It may be aimed elsewhere at every tick, by `with_end`. Raises `InputError` for numbers that do
    not fit.
    """

    start: Array = field(metadata=checked(as_array, (3,), "m"))
    end: Array = field(metadata=checked(as_array, (3,), "m"))
    lift_off: float = field(metadata=checked(as_number, "s"))
    touchdown: float = field(metadata=checked(as_number, "s"))
    height: float = field(default=0.05, metadata=checked(as_positive, "m", allow_zero=True))

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.touchdown > self.lift_off:
            raise InputError(
                f"the foot lifts at {self.lift_off:g} s and lands at {self.touchdown:g} s; it must "
                f"land later."
            )

    def with_end(self, end: npt.ArrayLike) -> Swing:
        """The same path to another end, (3,), m, world; cheap enough for the loop."""
        other = object.__new__(Swing)
        vars(other).update(vars(self), end=as_array("end", end, (3,), "m"))
        return other

    def __call__(self, t: float) -> tuple[Array, Array, Array]:
        """Position, m, velocity, m/s, and acceleration, m/s², shape (3,) each, at time t in s; at
        rest before and after.

        With u from 0 to 1: start + (end - start) (10 u³ - 15 u⁴ + 6 u⁵), and 64 u³ (1 - u)³ height
        upwards.
        """
        T = self.touchdown - self.lift_off
        u = min(max((as_number("t", t, "s") - self.lift_off) / T, 0.0), 1.0)
        w = u * (1.0 - u)
        path_derivatives = (
            u**3 * (10.0 - 15.0 * u + 6.0 * u * u),
            30.0 * w * w / T,
            60.0 * w * (1.0 - 2.0 * u) / T**2,
        )
        height_derivatives = (
            64.0 * w**3,
            192.0 * w * w * (1.0 - 2.0 * u) / T,
            384.0 * w * (1.0 - 5.0 * w) / T**2,
        )
        displacement, up = self.end - self.start, np.array([0.0, 0.0, self.height])
        x, v, a = (
            s * displacement + b * up
            for s, b in zip(path_derivatives, height_derivatives, strict=True)
        )
        return read_only(self.start + x), read_only(v), read_only(a)
