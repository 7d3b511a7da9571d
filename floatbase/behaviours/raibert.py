"""`raibert_foothold`: the default footholds of a `Walk`."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from floatbase._validation import Array
from floatbase.behaviours._level_place import foot_outline, level_place
from floatbase.behaviours.footholds import neutral_point
from floatbase.behaviours.gait import Gait
from floatbase.behaviours.options import WalkOptions
from floatbase.behaviours.path import Path
from floatbase.robots import Robot

_EDGE_REACH = 0.15  # m: footholds are moved by at most this much to avoid an edge


class Walking(Protocol):
    """A walk, such as `Walk`, that needs a foothold."""

    @property
    def robot(self) -> Robot:
        """The robot."""

    @property
    def options(self) -> WalkOptions:
        """Options that do not change."""

    @property
    def gait(self) -> Gait:
        """The contact schedule."""

    @property
    def omega(self) -> float:
        """Natural frequency of the pendulum [1/s]."""

    def path_at(self, t: float) -> Path:
        """Predict the path of the body at t [s]."""

    def nominal_foothold(self, foot: str, t: float) -> Array:
        """Return where a foot would stand below the body at t [s], shape (2,) [m]."""


def raibert_foothold(foot: str, touchdown: float, walk: Walking) -> Array:
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
    point = neutral_point(nominal, velocity + turning, gait.period - gait.swing)
    foothold: Array = point - centripetal / walk.omega**2
    if walk.options.ground is None:
        return foothold
    around = foot_outline(walk.robot.foot(foot), path.yaw)
    return level_place(walk.options.ground, foothold, around, _EDGE_REACH)
