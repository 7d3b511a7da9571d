"""`Swing`: the path of a foot through the air."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
import numpy.typing as npt

from floatbase._geometry import bump, minimum_jerk
from floatbase._validation import Array, Value, as_array, as_number, as_positive, checked, read_only
from floatbase.errors import InputError

_MIN_DURATION = 1e-3  # s: a shorter swing must be in another unit


class SwingPath(Protocol):
    """Path of a foot through the air, such as `Swing`."""

    @property
    def start(self) -> Array:
        """Position at lift-off, shape (3,), world frame [m]."""

    @property
    def end(self) -> Array:
        """Position at touchdown, shape (3,), world frame [m]."""

    @property
    def lift_off(self) -> float:
        """Time of lift-off [s]."""

    @property
    def touchdown(self) -> float:
        """Time of touchdown [s]."""

    @property
    def height(self) -> float:
        """Height above the line from start to end, half-way, for pictures [m]."""

    def with_end(self, end: npt.ArrayLike) -> SwingPath:
        """Return the same path to another end, shape (3,), in the world frame [m]."""

    def __call__(self, t: float) -> tuple[Array, Array, Array]:
        """Return position, velocity and acceleration at t [s], each (3,), in the world frame."""


@dataclass(frozen=True, eq=False)
class Swing(Value):
    """Path of a foot through the air: minimum jerk from start to end, plus a bump upwards.

    The foot is at rest at both ends. `with_end` can change its target in every control step.

    Parameters
    ----------
    start : array_like, shape (3,)
        Position at lift-off, in the world frame [m].
    end : array_like, shape (3,)
        Position at touchdown, in the world frame [m].
    lift_off : float
        Time of lift-off [s].
    touchdown : float
        Time of touchdown, at least 1 ms later than `lift_off` [s].
    height : float, optional
        Height of the bump, half-way [m].

    Examples
    --------
    >>> from floatbase.behaviours import Swing
    >>> swing = Swing([0.0, 0.0, 0.0], [0.2, 0.0, 0.0], lift_off=0.0, touchdown=1.0)
    >>> position, velocity, acceleration = swing(0.5)
    >>> position
    array([0.1 , 0.  , 0.05])
    """

    start: Array = field(metadata=checked(as_array, (3,), "m"))
    end: Array = field(metadata=checked(as_array, (3,), "m"))
    lift_off: float = field(metadata=checked(as_number, "s"))
    touchdown: float = field(metadata=checked(as_number, "s"))
    height: float = field(default=0.05, metadata=checked(as_positive, "m", allow_zero=True))

    def __post_init__(self) -> None:
        super().__post_init__()
        duration = self.touchdown - self.lift_off
        if duration < _MIN_DURATION * (1.0 - 1e-9):  # the difference of two times is rounded
            raise InputError(
                f"touchdown is {self.touchdown:g} s, {duration:g} s after lift_off at "
                f"{self.lift_off:g} s. It must be at least {_MIN_DURATION:g} s later."
            )

    def with_end(self, end: npt.ArrayLike) -> Swing:
        """Return the same path to another end; it is fast enough for a control loop.

        Parameters
        ----------
        end : array_like, shape (3,)
            Position at touchdown, in the world frame [m].

        Returns
        -------
        Swing
            The new path.
        """
        position = as_array("end", end, (3,), "m")
        if type(self) is not Swing:  # a derived class may compute more from the end
            return replace(self, end=position)
        other = object.__new__(Swing)
        vars(other).update(vars(self), end=position)
        return other

    def __call__(self, t: float) -> tuple[Array, Array, Array]:
        """Compute the motion of the foot at a given time; it is at rest before and after the swing.

        With the phase u from 0 to 1, the position is start + (end - start) (10 u³ - 15 u⁴ + 6 u⁵),
        plus 64 u³ (1 - u)³ height upwards.

        Parameters
        ----------
        t : float
            The time [s].

        Returns
        -------
        position : ndarray, shape (3,)
            Position in the world frame [m].
        velocity : ndarray, shape (3,)
            Velocity in the world frame [m/s].
        acceleration : ndarray, shape (3,)
            Acceleration in the world frame [m/s²].
        """
        T = self.touchdown - self.lift_off
        u = min(max((as_number("t", t, "s") - self.lift_off) / T, 0.0), 1.0)
        displacement, up = self.end - self.start, np.array([0.0, 0.0, self.height])
        x, v, a = (
            path / scale * displacement + height / scale * up
            for path, height, scale in zip(minimum_jerk(u), bump(u), (1.0, T, T**2), strict=True)
        )
        return read_only(self.start + x), read_only(v), read_only(a)
