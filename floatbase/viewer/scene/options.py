"""Options of a picture: what it shows beside the robot, its contacts and their forces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypedDict

import numpy.typing as npt

from floatbase._validation import as_array, as_bool, as_instance, as_strings, short_repr
from floatbase.control import JointLimits
from floatbase.errors import InputError
from floatbase.robots import State
from floatbase.viewer.scene.shapes import Item


class PictureKeywords(TypedDict, total=False):
    """Fields of `PictureOptions` as keyword arguments."""

    robot: bool
    com: bool
    cones: bool
    arrows: bool
    support: bool
    wrench: npt.ArrayLike | None
    push: tuple[str, npt.ArrayLike] | None
    ghost: State | None
    frames: Sequence[str]
    labels: bool
    extra: Mapping[str, Item] | None
    swing_feet: frozenset[str]
    joint_limits: bool | JointLimits
    qdd: npt.ArrayLike | None
    ground_position: npt.ArrayLike


@dataclass(frozen=True, eq=False, kw_only=True)
class PictureOptions:
    """Further contents of a picture, beside the robot, its contacts and their forces.

    Parameters
    ----------
    robot : bool
        Whether to draw the robot itself, which another visualizer may draw already.
    com : bool
        Whether to draw the centre of mass and its projection on the ground.
    cones : bool
        Whether to draw the friction cones.
    arrows : bool
        Whether to draw the forces. Forces colour the cones in any case.
    support : bool
        Whether to draw the support polygon, the convex hull of the contact points.
    wrench : array_like, shape (6,), or None
        Force [N] and moment [N·m] at the centre of mass, in the world frame. The moment is drawn as
        a ring around its axis. Its radius is the length of a force that has this moment at a lever
        arm of half the diagonal of the robot's bounding box.
    push : tuple or None
        Name of a frame, and the force that acts at its origin, shape (3,), in the world frame [N].
    ghost : State or None
        Another state of the robot, drawn translucent.
    frames : sequence of str
        Names of frames whose axes are drawn.
    labels : bool
        Whether to label the contact points.
    extra : dict or None
        Further items, path -> item, as from `floatbase.viewer.shapes` or
        `floatbase.viewer.markers`.
    swing_feet : frozenset of str
        Names of contacts that are in the air. Such contacts have no patch and no cone, and are not
        part of the support polygon.
    joint_limits : bool or JointLimits
        Whether to draw a ring around the axis of each joint that is within 5 % of its range from a
        position limit, and of each joint whose limit is active. True uses the limits in the robot's
        URDF.
    qdd : array_like, shape (nv,), or None
        Accelerations that the controller planned in this state, such as `command.qdd` [m/s²
        or rad/s²]. A joint limit is active if a planned acceleration is at its bound.
    ground_position : array_like, shape (3,)
        How far the ground has moved, in the world frame [m], as in `Simulation.ground_position`.

    Raises
    ------
    InputError
        If a value has the wrong type or contains NaN.
    """

    robot: bool = True
    com: bool = True
    cones: bool = True
    arrows: bool = True
    support: bool = False
    wrench: npt.ArrayLike | None = None
    push: tuple[str, npt.ArrayLike] | None = None
    ghost: State | None = None
    frames: Sequence[str] = ()
    labels: bool = False
    extra: Mapping[str, Item] | None = None
    swing_feet: frozenset[str] = frozenset()
    joint_limits: bool | JointLimits = True
    qdd: npt.ArrayLike | None = None
    ground_position: npt.ArrayLike = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("robot", "com", "cones", "arrows", "support", "labels"):
            as_bool(name, getattr(self, name))
        if self.wrench is not None:
            as_array("wrench", self.wrench, (6,), "N and N·m")
        if self.push is not None:
            if not isinstance(self.push, tuple | list) or len(self.push) != 2:
                raise InputError(
                    f'push must be a frame and a force, such as ("base", [0.0, 30.0, 0.0]), not '
                    f"{short_repr(self.push)}."
                )
            as_array("force of the push", self.push[1], (3,), "N")
        if self.ghost is not None:
            as_instance("ghost", self.ghost, State)
        as_strings("frames", self.frames)
        as_instance("swing_feet", self.swing_feet, frozenset)
        if not isinstance(self.joint_limits, JointLimits):
            as_bool("joint_limits", self.joint_limits)
        if self.qdd is not None:
            as_array("qdd", self.qdd, (None,), "m/s² or rad/s²")
        as_array("ground_position", self.ground_position, (3,), "m")
        if not isinstance(self.extra, Mapping | None) or not all(
            isinstance(item, Item) for item in (self.extra or {}).values()
        ):
            raise InputError(
                f"extra must be a picture, path -> item, as made by shapes and markers, not "
                f"{short_repr(self.extra)}."
            )
