"""Gait overlay: planned footholds, swing paths, capture point and zero-moment point of a walk."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from floatbase._geometry import rotation_z
from floatbase._validation import Array, as_instance, as_number, short_repr
from floatbase.behaviours import CoMPlan, StepPlan, Swing, SwingPath, Walk, capture_point
from floatbase.errors import InputError, unknown_name
from floatbase.robots import Foot, Robot, State
from floatbase.viewer.scene import geometry, threejs
from floatbase.viewer.scene.colours import COM, GREYS, RGB
from floatbase.viewer.scene.ground import LEVEL, DrawnGround
from floatbase.viewer.scene.shapes import Item, Picture, transform
from floatbase.viewer.scene.threejs import Shape

COLOUR = GREYS[1]  # of all marks except the centre of mass; it is visible on any background
# fraction of the robot's size, above the ground: avoids flicker with its lines and the support
# polygon
_HEIGHT_ABOVE_GROUND = 0.005
# radius of the capture point's mark, half the height of the ZMP's: fractions of the robot's size
_RING_RADIUS, _DIAMOND_SIZE = 0.07, 0.05
_OUTLINE_WIDTH = 0.012  # of a foothold's outline, as a fraction of the robot's size
_MIN_LENGTH = 1e-6  # m: avoids a singular matrix for a path of zero length
_SEGMENTS = 24  # of a swing path


@dataclass(frozen=True, eq=False)
class Style:
    """Style of the marks of a gait."""

    size: float
    ground: DrawnGround = LEVEL
    colour: RGB = GREYS[1]


def walk_overlay(walk: Walk, state: State, style: Style) -> Picture:
    """Draw the current plan of a walk."""
    if as_instance("walk", walk, Walk).plan is None:
        return {}
    assert walk.plan is not None and walk.time is not None
    yaw_changes = {
        foot: walk.yaw_rate * max(path.touchdown - walk.time, 0.0)
        for foot, path in walk.swings.items()
    }
    return _capture_point_and_zmp(walk.plan, walk.time, state, style) | _footholds_and_swings(
        walk.footholds, walk.swings, yaw_changes, state, style.size
    )


def step_overlay(step: StepPlan, t: float, state: State, style: Style) -> Picture:
    """Draw a stored step as it was planned when its stance began."""
    marks = _capture_point_and_zmp(
        as_instance("step", step, StepPlan).plan, as_number("t", t, "s"), state, style
    )
    return marks | _footholds_and_swings(step.footholds, step.swings, {}, state, style.size)


def step_at(steps: Sequence[StepPlan], t: float) -> StepPlan | None:
    """Find the step of a walk that contains a time."""
    i = bisect_right(steps, as_number("t", t, "s") + 1e-9, key=lambda step: step.time)
    return steps[i - 1] if i else None


def as_steps(steps: Iterable[StepPlan]) -> list[StepPlan]:
    """Check a collection of steps."""
    try:
        steps = list(steps)
    except TypeError:
        raise InputError(
            f"steps must be the steps of a Walk, such as walk.history, not {short_repr(steps)}."
        ) from None
    return [as_instance("a step", step, StepPlan, "one of walk.history") for step in steps]


def _capture_point_and_zmp(plan: CoMPlan, t: float, state: State, style: Style) -> Picture:
    """Draw the capture point and the planned zero-moment point at time t [s]."""
    as_instance("state", state, State)
    dcm, zmp = capture_point(state.com, state.com_velocity, plan.omega), plan.zmp(t)
    lift = _HEIGHT_ABOVE_GROUND * style.size
    ring = transform([*dcm, style.ground.height(dcm) + lift], scale=_RING_RADIUS * style.size)
    diamond = transform([*zmp, style.ground.height(zmp) + lift], scale=_DIAMOND_SIZE * style.size)
    return {"dcm": Item(_ring(COM, 0.64, True), ring), "zmp": Item(_diamond(style.colour), diamond)}


def _footholds_and_swings(
    footholds: Mapping[str, Array],
    swings: Mapping[str, SwingPath],
    yaw_changes: Mapping[str, float],
    state: State,
    size: float,
) -> Picture:
    """Draw an outline at each foothold, and the paths of the feet in the air."""
    picture: Picture = {}
    forward_x, forward_y, _ = state.frame_pose("base").rotation[:, 0]
    yaw = float(np.arctan2(forward_y, forward_x))
    for name, place in footholds.items():
        foot, path = _foot(state.robot, name), name.replace("/", "_")
        rotation = rotation_z(yaw + yaw_changes.get(name, 0.0))
        offset = _offset_to_ground(foot, state.robot.standing())
        picture[f"foothold/{path}"] = _outline(foot, place + rotation @ offset, rotation, size)
        if name in swings:
            picture[f"swing/{path}"] = _swing_path(swings[name], rotation @ offset)
    return picture


def _foot(robot: Robot, name: str) -> Foot:
    """Return a foot of the robot by its frame."""
    feet = {foot.frame: foot for foot in robot.feet}
    if name not in feet:
        raise unknown_name(f"foot of {robot.name}", name, feet)
    return feet[name]


def _outline(foot: Foot, at: Array, rotation: Array, size: float) -> Item:
    """Draw where a foot will stand."""
    at = at + [0.0, 0.0, _HEIGHT_ABOVE_GROUND * size]
    if not foot.is_flat:
        radius = max(2.0 * foot.radius, 0.04 * size)
        return Item(_ring(COLOUR, 0.72), transform(at, rotation, radius))
    corners = np.round((foot.points - foot.middle)[:, :2], 4)
    width = round(_OUTLINE_WIDTH * size, 4)
    return Item(_foot_outline(tuple(map(tuple, corners.tolist())), width), transform(at, rotation))


def _offset_to_ground(foot: Foot, standing: State) -> Array:
    """Return the vector from a foot's frame to the ground below its centre, when standing [m]."""
    pose = standing.frame_pose(foot.frame)
    offset = np.array(pose.rotation @ foot.middle)
    offset[2] = -pose.translation[2]
    return offset


def _swing_path(swing: SwingPath, offset: Array) -> Item:
    """Draw the path of a swing, displaced by an offset, shape (3,) [m]."""
    step_vector = swing.end - swing.start
    length = float(np.linalg.norm(step_vector))
    x = step_vector / length if length > _MIN_LENGTH else np.array([1.0, 0.0, 0.0])
    y = np.cross([0.0, 0.0, 1.0], x)
    y /= max(float(np.linalg.norm(y)), _MIN_LENGTH)
    scale = (max(length, _MIN_LENGTH), 1.0, max(swing.height, _MIN_LENGTH))
    rotation = np.stack([x, y, np.cross(x, y)], axis=1)
    return Item(_unit_swing_path(), transform(swing.start + offset, rotation, scale))


@lru_cache(maxsize=8)
def _ring(colour: RGB, inner: float, on_top: bool = False) -> Shape:
    """Return a flat ring around z of radius 1 with the given inner radius."""
    ring = geometry.surface_of_revolution([(inner, 0.0), (1.0, 0.0)], 36)
    return threejs.mesh(*ring, colour, lit=False, on_top=on_top)


@lru_cache(maxsize=8)
def _diamond(colour: RGB) -> Shape:
    """Return an octahedron standing on its tip, which looks like a diamond from all sides."""
    octahedron = geometry.surface_of_revolution([(0.0, 0.0), (0.6, 1.0), (0.0, 2.0)], 4)
    return threejs.mesh(*octahedron, colour, lit=False, on_top=True)


@lru_cache(maxsize=32)
def _foot_outline(corners: tuple[tuple[float, float], ...], width: float) -> Shape:
    """Return a flat band around corners [m]."""
    inner = np.array(sorted(corners, key=lambda corner: np.arctan2(corner[1], corner[0])))
    outer = inner * (1.0 + np.sqrt(2.0) * width / np.linalg.norm(inner, axis=1, keepdims=True))
    n = len(inner)
    i, j = np.arange(n), np.roll(np.arange(n), -1)
    faces = np.vstack([np.stack([i, i + n, j + n], axis=1), np.stack([i, j + n, j], axis=1)])
    points: npt.NDArray[np.float64] = np.hstack([np.vstack([inner, outer]), np.zeros((2 * n, 1))])
    return threejs.mesh(points, faces, COLOUR, lit=False)


@lru_cache(maxsize=1)
def _unit_swing_path() -> Shape:
    """Return a swing of height 1 from the origin to 1 along x."""
    swing = Swing(np.zeros(3), np.array([1.0, 0.0, 0.0]), 0.0, 1.0, 1.0)
    points = np.array([swing(u)[0] for u in np.linspace(0.0, 1.0, _SEGMENTS + 1)])
    return threejs.lines(np.repeat(points, 2, axis=0)[1:-1], COLOUR)
