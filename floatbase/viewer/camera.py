"""The camera: where the page looks at the robot from, and what it follows."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np

from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_bool,
    as_number,
    as_positive,
    checked,
    short_repr,
)
from floatbase.errors import InputError
from floatbase.robots import Robot, State
from floatbase.viewer.scene import protocol
from floatbase.viewer.scene.ground import displacement
from floatbase.viewer.scene.painter import Painter

# paths in the picture: the robot, and its position averaged over a stride
ROBOT, FOLLOWED = "robot", "followed"
_Ball: TypeAlias = tuple[tuple[float, float, float], float]  # centre, m, world, and radius, m


def _as_ball(name: str, value: Any) -> _Ball | None:
    """Return a centre and a radius as plain numbers, checked; None stays None."""
    if value is None:
        return None
    try:
        point, radius = value
    except (TypeError, ValueError):
        raise InputError(
            f"{name} is {short_repr(value)}; it must be a centre and a radius, as in "
            f"((0, 0, 0.3), 0.5)."
        ) from None
    x, y, z = as_array(f"point in {name}", point, (3,), "m").tolist()
    return (x, y, z), as_positive(f"radius in {name}", radius, "m")


@dataclass(frozen=True)
class View(Value):
    """A direction to look from, and what fills the picture.

    Parameters
    ----------
    azimuth : float, optional
        Angle around the vertical [degrees]; 0 is in front of the robot (+x), 90 on its left (+y).
    elevation : float, optional
        Angle above the horizontal [degrees], from -90 to 90.
    distance : float, optional
        Relative distance, dimensionless: 1 fills the picture, 2 is twice as far away.
    angle : float, optional
        Vertical field of view [degrees], between 0 and 180.
    feet : bool, optional
        Whether the robot's feet fill the picture, instead of the whole robot.
    around : tuple, optional
        Centre, in the world frame [m], and radius [m] of a ball that fills the picture instead of
        the robot, as `((x, y, z), radius)`.

    Raises
    ------
    InputError
        If a number is not finite or outside its range, or if a distance or radius is not positive.
    """

    azimuth: float = field(default=40.0, metadata=checked(as_number, "degrees"))
    elevation: float = field(default=18.0, metadata=checked(as_number, "degrees", -90.0, 90.0))
    distance: float = field(default=1.0, metadata=checked(as_positive))
    angle: float = field(default=32.0, metadata=checked(as_positive, "degrees"))
    feet: bool = field(default=False, metadata=checked(as_bool))
    around: _Ball | None = field(default=None, metadata=checked(_as_ball))

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.angle >= 180.0:
            raise InputError(
                f"angle of View is {self.angle:g}; it must be less than 180 degrees. The default "
                "is 32."
            )


PRESETS = {
    "default": View(),
    "front": View(0.0, 8.0),
    "back": View(180.0, 8.0),
    "left": View(90.0, 8.0),
    "right": View(-90.0, 8.0),
    "top": View(0.0, 89.0),
    "feet": View(25.0, 12.0, feet=True),
}


def target_and_eye(view: View, low: Array, high: Array) -> tuple[Array, Array]:
    """Compute the point that the camera looks at, and its own position."""
    if view.around is None:
        target, radius = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
    else:
        target, radius = np.array(view.around[0]), view.around[1]
    distance = view.distance * radius / np.sin(np.radians(view.angle) / 2)
    azimuth, elevation = np.radians([view.azimuth, view.elevation])
    x, y = np.cos(elevation) * np.array([np.cos(azimuth), np.sin(azimuth)])
    return target, target + distance * np.array([x, y, np.sin(elevation)])


class FollowingCamera:
    """The camera of a viewer: it looks at a robot, and can follow it."""

    def __init__(self, robot: Robot, follows: bool):
        self.robot, self.follows = robot, follows
        self._state: State | None = None  # the robot's state when the camera was set

    def commands(
        self, painter: Painter, view: View, state: State | None, followed: str = ROBOT
    ) -> tuple[protocol.Update, ...]:
        """Return the commands for the camera, for what it follows, and for the presets."""
        self._state = state
        presets = protocol.set_views(
            {name: self._placement(painter, preset) for name, preset in PRESETS.items()}
        )
        return (
            protocol.set_camera(*self._placement(painter, view)),
            self.follow_command(painter, followed),
            presets,
        )

    def follow_command(self, painter: Painter, followed: str) -> protocol.Update:
        """Return the command that sets what the camera follows; nothing if it does not follow."""
        base = f"{ROBOT}/{self.robot.model.names[1]}" if followed == ROBOT else followed
        follows = self.follows and self.robot.is_floating
        start = (self._state or painter.standing).joint_transforms[1][:3, 3]
        node, moved = protocol.ROOT + base if follows else "", self._displacement(painter)
        return protocol.set_follow(node, start, moved, smooth=followed == ROBOT)

    def _placement(self, painter: Painter, view: View) -> tuple[Array, Array, float]:
        """Return the camera's position and target, shape (3,) [m], and its angle [degrees]."""
        low, high = painter.feet_box if view.feet else painter.box
        height = painter.drawn_ground.height(painter.standing.com)
        moved = self._displacement(painter) + [0.0, 0.0, height]
        target, eye = target_and_eye(view, low + moved, high + moved)
        return eye, target, view.angle

    def _displacement(self, painter: Painter) -> Array:
        """Return how far the robot was from its standing pose, along the ground [m]."""
        return displacement(
            painter.drawn_ground, painter.standing.com, (self._state or painter.standing).com
        )
