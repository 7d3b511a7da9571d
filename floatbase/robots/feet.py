"""Feet found from the shapes of a robot's links, and a posture in which its legs are bent."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from floatbase._validation import Array, as_positive, short_repr
from floatbase.errors import InputError
from floatbase.robots._checks import clamp_to_limits, has_floating_base, joint_limits
from floatbase.robots._shapes import link_shapes, placed_points
from floatbase.robots.inertia import origin_attributes, shifted
from floatbase.robots.robot import Foot, Robot
from floatbase.robots.state import State

_LEVEL = 0.05  # of the robot's height: by how much the ends of legs may differ in height
# with fewer joints, a leg cannot choose both the position of its sole and the way the sole faces
_SOLE_JOINTS = 5
_MIN_UPRIGHT = 0.9  # vertical component of the z axis of a frame in which a sole can be given
_SOLE_DEPTH = 0.02  # of a foot's size: points that are higher above the lowest one do not touch
_MIN_SOLE = 0.4  # least length and width of a sole, relative to those of the foot
_MIN_ROUNDNESS = 0.75  # of a wheel: how far it extends in any direction, relative to its radius
_CIRCLE = np.exp(2j * np.pi * np.arange(24) / 24).view(float).reshape(-1, 2)  # directions
_BEND = 0.5  # rad or m: change of all joints that takes a leg out of a singular posture
# ratio of a leg's smallest to its largest singular value below which the leg counts as singular:
# about sin θ / 5 for two equal links that are θ from straight, so this is 3°
_MIN_SINGULAR_VALUE = 0.01
# of a leg's height: by how much bent legs on soles and on balls are shorter than straight ones.
# `Walk` makes no steps with a leg on a ball that is less than 0.1 shorter
_CROUCH_ON_SOLES, _CROUCH = 0.05, 0.2
_KICK = 0.3  # rad or m: first change of the joints of a straight leg, which shows how it bends
_NEARNESS = 1e-3  # weight of the joints' distance from the given posture: m per rad
_MAX_ERROR = 1e-3  # m and rad: of the feet of bent legs; larger than the pull of `_NEARNESS`

# of a joint's range: how far its middle is from the posture if the joint bends to one side only
_ONE_SIDED = 0.1
_DIGITS = 6  # of lengths [m], so that rounding errors do not show
# the corners of a sole: front left, front right, rear right, rear left
DIAGONALS = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0]])


def as_feet(
    requested: Sequence[str | Foot] | None,
    radius: float | None,
    model: pin.Model,
    urdf: str,
    folders: Sequence[Path],
    q: Array,
    known: tuple[Foot, ...] | None = None,
) -> tuple[Foot, ...]:
    """Return feet, given as frames or `Foot` values, known or found in the URDF."""
    if requested is None:
        if radius is not None:
            raise InputError(
                "foot_radius requires feet=[…], since other feet have their own radius."
            )
        if known is None and has_floating_base(model):
            return _find_feet(model, urdf, folders, q)
        return known or ()
    if isinstance(requested, str) or not isinstance(requested, Sequence):
        raise InputError(
            f'feet must be a list of frames, as in feet=["FL_foot"], not {short_repr(requested)}.'
        )
    if radius is not None:
        radius = as_positive("foot_radius", radius, "m", allow_zero=True)
    return tuple(
        foot
        if isinstance(foot, Foot)
        else _find_foot(model, urdf, folders, q, foot)
        if radius is None and isinstance(foot, str)
        else Foot(foot, radius or 0.0)
        for foot in requested
    )


def with_foot_links(
    model: pin.Model, urdf: str, feet: Sequence[Foot]
) -> tuple[str, tuple[Foot, ...]]:
    """Give each ball that its link's origin is not in a link of its own, in the URDF and the model.

    A swing moves the origin of a foot's frame, which is the knee if the ball belongs to the calf.
    """
    root, placed = ElementTree.fromstring(urdf), list(feet)
    for i, foot in enumerate(feet):
        is_ball = not foot.is_flat and foot.axis is None
        if not is_ball or np.linalg.norm(foot.centre) <= foot.radius:
            continue
        if not model.existFrame(foot.frame, pin.BODY):
            continue
        name, link = f"{foot.frame} foot", model.getFrameId(foot.frame, pin.BODY)
        offset, frame = shifted(foot.centre), model.frames[link]
        model.addFrame(pin.Frame(name, frame.parentJoint, link, frame.placement * offset, pin.BODY))
        ElementTree.SubElement(root, "link", name=name)
        joint = ElementTree.SubElement(root, "joint", name=f"{name} weld", type="fixed")
        for tag, attributes in (
            ("origin", origin_attributes(offset)),
            ("parent", {"link": foot.frame}),
            ("child", {"link": name}),
        ):
            ElementTree.SubElement(joint, tag, attributes)
        placed[i] = Foot(name, foot.radius)
    return ElementTree.tostring(root, encoding="unicode"), tuple(placed)


def with_bent_legs(robot: Robot) -> Robot:
    """Return a robot whose legs are bent, or the robot itself if its joints do not allow it.

    A posture of zeros in which no leg is straight stays as it is.
    """
    if not robot.is_floating or not robot.feet:
        return robot
    if not singular_legs(robot) and np.array_equal(robot.posture, pin.neutral(robot.model)):
        return robot
    posture = _bent_posture(robot)
    bent = robot if posture is None else replace(robot, posture=posture)
    return robot if singular_legs(bent) else bent


def singular_legs(robot: Robot) -> list[str]:
    """Return the feet that move in fewer directions than they would with bent legs."""
    bend = np.r_[np.zeros(6), np.full(robot.d, _BEND)]
    posture = np.array(robot.posture)
    present, bent = (State(robot, q) for q in (posture, pin.integrate(robot.model, posture, bend)))
    singular = []
    for foot in robot.feet:
        rows = 6 if foot.is_flat else 3
        values, bent_values = (
            np.linalg.svd(state.frame_jacobian(foot.frame)[:rows, 6:], compute_uv=False)
            for state in (present, bent)
        )
        rank = int((bent_values > _MIN_SINGULAR_VALUE * bent_values[:1].sum()).sum())
        if (values[:rank] < _MIN_SINGULAR_VALUE * values[:1].sum()).any():
            singular.append(foot.frame)
    return singular


def _find_feet(model: pin.Model, urdf: str, folders: Sequence[Path], q: Array) -> tuple[Foot, ...]:
    """Return the feet of a floating-base robot: the lowest ends of its limbs in a configuration.

    A single such limb is more likely an arm.
    """
    ends = [joint for joint in range(2, model.njoints) if not model.children[joint]]
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    shapes = _shapes_of(model, urdf, folders, ends)
    lowest = dict[int, tuple[float, str]]()  # height of the lowest point of a limb, and its link
    for joint in ends:
        heights = [
            (float(placed_points(shape, data.oMi[joint])[:, 2].min()), _link_of(model, shape))
            for shape in shapes
            if shape.parentJoint == joint
        ] or [
            (float(data.oMf[model.getFrameId(link, pin.BODY)].translation[2]), link)
            for link in _links_of(model, joint)
        ]
        if heights:
            lowest[joint] = min(heights)
    ground = min((height for height, _ in lowest.values()), default=0.0)
    tolerance = _LEVEL * (max(placement.translation[2] for placement in data.oMi) - ground)
    feet = [
        _make_foot(model, data, shapes, [link, *_links_of(model, joint)])
        for joint, (height, link) in lowest.items()
        if height - ground < tolerance
    ]
    return tuple(feet) if len(feet) > 1 else ()


def _find_foot(model: pin.Model, urdf: str, folders: Sequence[Path], q: Array, link: str) -> Foot:
    """Return the foot that a link is, or a point at its origin if it has no shape or joint."""
    if not model.existFrame(link, pin.BODY):
        return Foot(link)
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    joint = model.frames[model.getFrameId(link, pin.BODY)].parentJoint
    return _make_foot(model, data, _shapes_of(model, urdf, folders, [joint]), [link])


def _bent_posture(robot: Robot) -> Array | None:
    """Return a posture whose legs are bent, or None if the joints do not allow it.

    The feet are above their places at joint positions of zero, and soles are level.
    """
    from scipy.optimize import least_squares  # slow to import, and rarely needed

    model, data, start = robot.model, robot.model.createData(), np.array(robot.posture)
    frames = [robot.frame_id(foot.frame) for foot in robot.feet]
    legs = sorted({i for f in frames for i in model.supports[model.frames[f].parentJoint]} - {0, 1})
    if not legs:  # the feet belong to the base
        return None
    columns = np.array(model.idx_vs)[legs]
    flat = np.array([foot.is_flat for foot in robot.feet])

    def feet(q: Array) -> tuple[Array, Array]:
        """Return the middles of the feet, (n, 3), and the tilts of the flat ones, (m, 2)."""
        pin.framesForwardKinematics(model, data, q)
        pairs = list(zip([data.oMf[frame] for frame in frames], robot.feet, strict=True))
        middles = np.array([pose.act(np.array(foot.middle)) for pose, foot in pairs])
        return middles, np.array([pose.rotation[:2, 2] for pose, _ in pairs])[flat]

    def bend(x: Array) -> Array:
        """Return the posture after a displacement of the legs' joints."""
        v = np.zeros(model.nv)
        v[columns] = x
        return np.asarray(pin.integrate(model, start, v))

    now, _ = feet(start)
    targets, _ = feet(np.concatenate([start[:7], pin.neutral(model)[7:]]))
    top, z = max(data.oMi[i].translation[2] for i in legs), targets[:, 2]
    crouch = np.array([_CROUCH_ON_SOLES if foot.is_flat else _CROUCH for foot in robot.feet])
    targets[:, 2] = np.maximum(z + crouch * (top - z), now[:, 2])

    def errors(x: Array) -> Array:
        middles, tilts = feet(bend(x))
        return np.concatenate([(middles - targets).ravel(), tilts.ravel()])

    lower, upper = np.full((2, model.nv), [[-np.inf], [np.inf]])
    joints, index, low, high = joint_limits(model)
    limited = np.array(model.idx_vs)[joints]
    lower[limited], upper[limited] = low - start[index], high - start[index]
    lower, upper = lower[columns], upper[columns]
    side = np.clip(lower, -np.pi, None) + np.clip(upper, None, np.pi)
    bends_one_way = np.abs(side) > _ONE_SIDED * (upper - lower)
    kick = np.clip(_KICK * np.where(bends_one_way, np.sign(side), 1.0), lower, upper)
    found = least_squares(
        lambda x: np.concatenate([errors(x), _NEARNESS * x]), kick, bounds=(lower, upper)
    )
    if abs(errors(found.x)).max() >= _MAX_ERROR:
        return None
    return clamp_to_limits(model, bend(found.x.round(_DIGITS)))


def _links_of(model: pin.Model, joint: int) -> list[str]:
    """Return the links that a joint moves directly."""
    return [str(f.name) for f in model.frames if f.parentJoint == joint and f.type == pin.BODY]


def _link_of(model: pin.Model, shape: Any) -> str:
    """Return the link of a shape."""
    return str(model.frames[shape.parentFrame].name)


def _shapes_of(
    model: pin.Model, urdf: str, folders: Sequence[Path], joints: Sequence[int]
) -> list[Any]:
    """Return the shapes of the links that joints move, without stand-ins for missing meshes.

    A shape without a size marks a place, and nothing touches it.
    """
    links = {link for joint in joints for link in _links_of(model, joint)}
    shapes, incomplete = link_shapes(model, urdf, folders, links=links)
    found = [shape for shape in shapes if _link_of(model, shape) not in incomplete]
    return [shape for shape in found if len(p := placed_points(shape)) and np.ptp(p, axis=0).any()]


def _make_foot(model: pin.Model, data: pin.Data, shapes: list[Any], links: Sequence[str]) -> Foot:
    """Return the wheel, sole or ball that the first of some links is.

    The z axis of a sole's frame points up while joints are at zero. One of the other links, which
    the same joint moves, may have such a frame.
    """
    frame = model.frames[model.getFrameId(links[0], pin.BODY)]
    joint, n_joints = frame.parentJoint, len(model.supports[frame.parentJoint]) - 2
    on_joint = [shape for shape in shapes if shape.parentJoint == joint]
    own = [shape for shape in on_joint if _link_of(model, shape) == links[0]] or on_joint
    if not own or n_joints < 1:
        return Foot(links[0])
    straight = model.createData()
    pin.framesForwardKinematics(model, straight, clamp_to_limits(model, pin.neutral(model)))
    wheel = _wheel(model, frame, own) if _turns_freely(model, joint) else None
    if wheel is not None:
        return wheel
    world = data.oMi[joint]
    for link in links if n_joints >= _SOLE_JOINTS else ():
        link_frame = model.getFrameId(link, pin.BODY)
        if straight.oMf[link_frame].rotation[2, 2] > _MIN_UPRIGHT:
            corners = _sole(model.frames[link_frame].placement.inverse(), on_joint)
            if corners is not None:
                return Foot(link, corners=corners)
    lowest = min(own, key=lambda shape: float(placed_points(shape, world)[:, 2].min()))
    return _ball(frame, world, lowest)


def _turns_freely(model: pin.Model, joint: int) -> bool:
    """Return whether a joint can make a whole turn."""
    joints, _, lower, upper = joint_limits(model)
    is_angle = model.joints[joint].shortname().startswith("JointModelR")
    return bool(is_angle and np.all((upper - lower)[joints == joint] >= 2.0 * np.pi))


def _wheel(model: pin.Model, frame: pin.Frame, shapes: list[Any]) -> Foot | None:
    """Return the wheel or driven ball that shapes form, or None if they are not round."""
    joint, data = frame.parentJoint, model.createData()
    J = pin.computeJointJacobian(model, data, pin.neutral(model), joint)
    axis, points = J[3:, model.idx_vs[joint]], np.vstack(list(map(placed_points, shapes)))
    along = points @ axis
    across = points @ np.linalg.svd(axis[None])[2][1:].T
    radius = float(np.linalg.norm(across, axis=1).max())
    if (across @ _CIRCLE.T).max(axis=0).min() < _MIN_ROUNDNESS * radius:
        return None
    centre = frame.placement.actInv(0.5 * (along.min() + along.max()) * axis)
    is_ball = all(isinstance(shape.geometry, coal.Sphere) for shape in shapes)
    axle = None if is_ball else (frame.placement.rotation.T @ axis).round(_DIGITS)
    return Foot(str(frame.name), round(radius, _DIGITS), centre.round(_DIGITS), axis=axle)


def _sole(placement: pin.SE3, shapes: list[Any]) -> Array | None:
    """Return up to four corners of the lowest part of shapes, or None if that part is small.

    `placement` is that of the joint in the frame of the sole.
    """
    points = np.vstack(
        [
            [placement.act(shape.placement.translation) - [0.0, 0.0, shape.geometry.radius]]
            if isinstance(shape.geometry, coal.Sphere)
            else placed_points(shape, placement)
            for shape in shapes
        ]
    )
    size, bottom = np.ptp(points[:, :2], axis=0), points[:, 2].min()
    sole = points[points[:, 2] < bottom + _SOLE_DEPTH * size.max()]
    if len(sole) < 3 or np.any(np.ptp(sole[:, :2], axis=0) < _MIN_SOLE * size) or not size.all():
        return None
    # the corners farthest to the front left, front right, rear right and rear left
    farthest = list(dict.fromkeys((sole[:, :2] @ (DIAGONALS / size).T).argmax(axis=0).tolist()))
    if len(farthest) < 3:
        return None
    corners = np.column_stack([sole[farthest, :2], np.full(len(farthest), bottom)])
    return np.asarray(corners.round(_DIGITS))


def _ball(frame: pin.Frame, world: pin.SE3, shape: Any) -> Foot:
    """Return the ball at the lowest end of a shape of a link."""
    if isinstance(shape.geometry, coal.Sphere):
        radius, centre = shape.geometry.radius, shape.placement.translation
    else:
        points = placed_points(shape, world)
        size, bottom = np.ptp(points, axis=0), points[:, 2].min()
        radius = 0.5 * size.min()
        low = points[points[:, 2] < bottom + _SOLE_DEPTH * size.max()].mean(axis=0)
        centre = world.actInv(np.array([*low[:2], bottom + radius]))
    centre = frame.placement.actInv(np.array(centre).ravel())
    return Foot(str(frame.name), round(float(radius), _DIGITS), centre.round(_DIGITS))
