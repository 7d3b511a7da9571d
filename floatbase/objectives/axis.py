"""Task for an axis of a frame that points along a direction."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, pi
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array, cross, unit_vector
from floatbase.affine import Affine
from floatbase.dynamics import Block, EquationsOfMotion
from floatbase.objectives._task import Shapes, Target, TargetTask
from floatbase.robots import Robot

_ZERO3 = (0.0, 0.0, 0.0)
_SMALL_SINE = 1e-9  # of the angle; below it, e is proportional to the sine, or its axis arbitrary


@dataclass(frozen=True, eq=False)
class AxisTask(TargetTask):
    """A task that points an axis of a frame along a direction of the world.

    Rotation about the axis is free. The error e is the smallest rotation vector from the direction
    d to the axis n, in world axes [rad]: its length is the angle between them. The residual has
    three rows of rank 2, because it is orthogonal to n.

    Parameters
    ----------
    frame : str
        Name of the frame; "base" is the base link.
    axis : array_like, shape (3,)
        Axis in the frame, dimensionless; it is scaled to unit length.
    direction : array_like, shape (3,), or callable
        Target of the axis in the world frame, dimensionless, scaled to unit length, or a function
        of the time t [s] that returns `direction` or `(direction, angular_velocity,
        angular_acceleration)`.
    angular_velocity : array_like, shape (3,), optional
        Angular velocity of the direction in the world frame [rad/s], if `direction` is not a
        function. Its component along the direction has no effect.
    angular_acceleration : array_like, shape (3,), optional
        Angular acceleration of the direction in the world frame [rad/s²], if `direction` is not a
        function.
    kp : float, optional
        Gain on the angle [1/s²].
    kd : float, optional
        Gain on the angular velocity error [1/s]. The default, 2 √kp, is critical damping.
    weight : float, optional
        Weight of ½‖residual‖² in the objective [1/(rad/s²)²].

    Notes
    -----
    For an axis with angular velocity ω, n × ṅ = P ω and n × n̈ = P ω̇ + (n · ω) n × ω, where
    P = 1 - n nᵀ. The residual is n × n̈ - P (d × d̈ - kp e - kd (n × ṅ - d × ḋ)). The feedback acts
    along the shortest way on the sphere, as in [Bullo1995]_, so it is largest close to the opposite
    direction. If the axis is exactly opposite to the direction, all ways are equally short, and the
    task chooses one of them.

    Examples
    --------
    Keep the base level, with any heading:

    >>> from floatbase.objectives import AxisTask
    >>> AxisTask("base", [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]).name
    'axis of base'
    """

    frame: str
    axis: npt.ArrayLike
    direction: Target
    angular_velocity: npt.ArrayLike = _ZERO3
    angular_acceleration: npt.ArrayLike = _ZERO3
    kp: float = 100.0
    kd: float | None = None
    weight: float = 10.0
    block: ClassVar[Block] = "qdd"
    target_shapes: ClassVar[Shapes] = {
        "direction": (3,),
        "angular_velocity": (3,),
        "angular_acceleration": (3,),
    }
    compiled_as = "axis"

    def __post_init__(self) -> None:
        """Check the axis as well."""
        super().__post_init__()
        object.__setattr__(self, "axis", unit_vector(f"axis of {self.name}", self.axis))

    @property
    def name(self) -> str:
        """Name in messages and tables, such as "axis of base"."""
        return f"axis of {self.frame}"

    def _checked(self, target: Array, robot: Robot | None) -> Array:
        return unit_vector(f"direction of {self.name}", target)

    def _displacement(self, start: Array, end: Array, robot: Robot) -> Array:
        return _rotation_vector(start, end)

    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> Affine:
        """Compute the residual n × n̈ - P (d × d̈ - kp e - kd (n × ṅ - d × ḋ)).

        Parameters
        ----------
        eom : EquationsOfMotion
            Equations of motion at the current state.
        t : float, optional
            Time at which the targets are evaluated [s].

        Returns
        -------
        Affine
            Map from q̈ to the residual, shape (3,), in world axes [rad/s²].
        """
        d, omega_d, alpha_d = self._targets(eom, t)
        state = eom.state
        n = state.frame_pose(self.frame).rotation @ self.axis
        rate, drift = _rates(
            n, state.frame_velocity(self.frame)[3:], state.frame_drift(self.frame)[3:]
        )
        rate_d, acceleration_d = _rates(d, omega_d, alpha_d)
        assert self.kd is not None  # set by the constructor
        J = state.frame_jacobian(self.frame)[3:]
        feedback = self.kp * _rotation_vector(d, n) + self.kd * (rate - rate_d) - acceleration_d
        return Affine(_across(n, J), drift + _across(n, feedback))


def _across(n: Array, x: Array) -> Array:
    """Return P x = x - n (n · x), for a vector or for the columns of a matrix."""
    return x - np.multiply.outer(n, n @ x)


def _rates(n: Array, omega: Array, alpha: Array) -> tuple[Array, Array]:
    """Return n × ṅ and n × n̈ of a direction with angular velocity ω and acceleration α."""
    return _across(n, omega), _across(n, alpha) + (n @ omega) * cross(n, omega)


def _rotation_vector(d: Array, n: Array) -> Array:
    """Return the smallest rotation vector from one unit vector to another [rad]."""
    along = cross(d, n)
    sine, cosine = float(np.linalg.norm(along)), float(d @ n)
    if sine > _SMALL_SINE:
        return along * (atan2(sine, cosine) / sine)
    if cosine > 0.0:
        return along
    across = cross(d, np.eye(3)[np.argmin(np.abs(d))])  # opposite: any axis across d
    return across * (pi / float(np.linalg.norm(across)))
