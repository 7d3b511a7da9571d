"""MuJoCo models built from a robot's URDF, with ground, feet and torque motors.

Balls at the feet and convex hulls of the links can collide with the ground. There are no other
collisions. Links that are welded together become one body with their combined inertia.
"""

from __future__ import annotations

import copy
import xml.etree.ElementTree as ElementTree
from collections.abc import Collection, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
import pinocchio as pin

from floatbase.dynamics import Contacts, FlatFootContact, MotionConstraint, RollingWheel
from floatbase.dynamics._compiled import connected_frames
from floatbase.errors import SimulationError
from floatbase.robots import Robot
from floatbase.simulation._conversion import rotation_matrix
from floatbase.simulation.agreement import check_agreement
from floatbase.simulation.ground import Ground
from floatbase.simulation.hulls import link_hulls

# MuJoCo's contact model: https://mujoco.readthedocs.io/en/stable/modeling.html#solver-parameters

# impedance of friction relative to that of the normal force: stiffer friction makes feet creep less
# under a steady load
_IMPEDANCE_RATIO = 100.0
# s, time constant of a critically damped contact: four of the default timesteps; two is the least
_CONTACT_TIME_CONSTANT = 0.004
# MuJoCo's default, but with 0.95 and 0.99 instead of 0.9 and 0.95: stiffer contacts
_CONTACT_IMPEDANCE = 0.95, 0.99, 0.001, 0.5, 2.0
_CONNECTION_IMPEDANCE = 0.999  # nearly rigid: two hands turn by 0.1 mrad under 5 N·m
_IMPACT_TIME = 0.004  # s in which a link that hits the ground stops; four of the default timesteps
# s in which a link comes out that was below the ground when collisions were switched on
_PENETRATION_RECOVERY_TIME = 0.2
# m: a flat foot stands on small balls whose lowest points are its corners
_CORNER_BALL_RADIUS = 0.005
# m: MuJoCo has no balls of radius 0, which is the radius of a foot without a size
_MIN_BALL_RADIUS = 1e-4
# m: half of the width of a wheel's rim, which touches the ground at one point
_RIM_WIDTH = 1e-3
# m: boxes of the ground have no bottom, but MuJoCo's have; nothing gets below it
_BOX_DEPTH = 10.0
_MIN_INERTIA = 1e-15  # kg m²: MuJoCo treats smaller principal inertias as zero (mjMINVAL)
# relative: for a thin plate the triangle inequality of principal inertias is an equality, up to
# rounding
_RELATIVE_ROUNDING = 1e-9

_JOINT_ATTRIBUTES = ("name", "type", "range", "limited", "actfrcrange", "actfrclimited")


class World(NamedTuple):
    """What a model has besides the robot. Worlds with equal numbers are equal."""

    mus: tuple[float, ...]  # one for each plane
    planes: tuple[tuple[float, ...], ...]  # normal, offset
    boxes: tuple[tuple[float, ...], ...]  # both ends along x, both ends along y, top
    timestep: float
    losses: bool
    extra: tuple[MotionConstraint, ...]  # contacts that are not feet, and connections


def world_of(ground: Ground, timestep: float, losses: bool, extra: Contacts) -> World:
    """Return the world of a simulation; extra: as from `connections.parts_of`."""
    planes = np.column_stack([ground.normals, ground.offsets])
    return World(
        tuple(ground.mus.tolist()),
        tuple(map(tuple, planes.tolist())),
        tuple(map(tuple, ground.box_bounds.tolist())),
        timestep,
        losses,
        tuple(extra),
    )


def build_model(robot: Robot, world: World) -> mujoco.MjModel:
    """Build the MuJoCo model of a robot in a world.

    The ground can touch the feet and the links' hulls. Geoms have the names of the contact points,
    and motors the names of the joints.
    """
    return copy.copy(_compiled_model(robot, robot.package_dirs, world))


@lru_cache(maxsize=8)  # the hulls of its links make a robot's model 2 MB large
def _compiled_model(robot: Robot, folders: tuple[Path, ...], world: World) -> mujoco.MjModel:
    """Compile a model, which takes MuJoCo ten times as long as a copy. Do not change it.

    Equal robots with meshes in other folders can have other hulls.
    """
    try:
        model = build_spec(robot, world).compile()
    except ValueError as error:
        raise SimulationError(
            f"MuJoCo cannot build {robot.name}. Correct the URDF: {error}"
        ) from None
    if model.nv != robot.nv:
        raise SimulationError(
            f"MuJoCo finds {model.nv} degrees of freedom in the URDF of {robot.name}, but the "
            f"robot has {robot.nv}. Load the robot again if its model was changed after loading."
        )
    check_agreement(robot, model)
    return model


def build_spec(robot: Robot, world: World) -> mujoco.MjSpec:
    """Write the description from which `build_model` builds the model."""
    spec = _spec_from_urdf(robot)
    spec.option.timestep = world.timestep
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = _IMPEDANCE_RATIO
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    contact = spec.default.geom
    # no torsional or rolling friction
    contact.condim = 3
    contact.friction = [world.mus[0], 0.0, 0.0]
    contact.solref, contact.solimp = [_CONTACT_TIME_CONSTANT, 1.0], _CONTACT_IMPEDANCE
    if robot.is_floating:
        spec.body(body_name(robot.base)).add_freejoint()
    for name, limit in zip(robot.joint_names, robot.torque_limits, strict=True):
        joint, i = spec.joint(name), robot.model.idx_vs[robot.model.getJointId(name)]
        joint.armature = float(robot.model.armature[i])
        # the force of damping is linear in the velocity; MuJoCo has terms of higher order, too
        joint.damping[:] = [world.losses * robot.model.damping[i], 0.0, 0.0]
        joint.frictionloss = world.losses * float(robot.model.friction[i])
        joint.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE  # the motor has the limit
        motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.set_to_motor()
        if np.isfinite(limit):
            motor.ctrlrange = [-limit, limit]
    for mu, (*direction, offset) in zip(world.mus, world.planes, strict=True):
        normal = np.array(direction)
        plane = spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_PLANE, contype=1, conaffinity=0, pos=offset * normal
        )
        plane.size[2] = 0.05  # MuJoCo requires a size, but does not use it
        plane.friction[0] = mu
        mujoco.mju_quatZ2Vec(plane.quat, normal)
    for x0, x1, y0, y1, top in world.boxes:
        box, half = mujoco.mjtGeom.mjGEOM_BOX, 0.5 * np.array([x1 - x0, y1 - y0, _BOX_DEPTH])
        centre = [x0 + half[0], y0 + half[1], top - half[2]]
        spec.worldbody.add_geom(type=box, contype=1, conaffinity=0, pos=centre, size=half)
    feet = Contacts.feet(robot) if robot.feet else Contacts.none()
    for part in (*feet, *world.extra):
        if frames := connected_frames(part):
            weld = spec.add_equality(name=part.name, type=mujoco.mjtEq.mjEQ_WELD)
            weld.objtype, weld.data[10] = mujoco.mjtObj.mjOBJ_BODY, 1.0  # no scale of moments
            weld.solref[:], weld.solimp[:2] = contact.solref, _CONNECTION_IMPEDANCE
            weld.name1, weld.name2 = (_carrier(spec, robot, frame)[0].name for frame in frames)
        else:
            # of two coefficients of friction, MuJoCo takes the larger one, which is the plane's
            _add_foot_balls(spec, robot, part, min(world.mus))
    _add_link_hulls(spec, robot)
    return spec


def body_name(link: str) -> str:
    """Return MuJoCo's name of a floating robot's link.

    The name is that of the link, except for "world": MuJoCo would weld that link to the ground.
    """
    return "world of the robot" if link == "world" else link


def _spec_from_urdf(robot: Robot) -> mujoco.MjSpec:
    """Return the URDF as MuJoCo reads it, with welded links fused into one body."""
    root = ElementTree.fromstring(robot.urdf)
    if robot.is_floating:
        for link in root.findall("link"):
            link.set("name", body_name(link.get("name", "")))
        for joint_end in (*root.findall("joint/parent"), *root.findall("joint/child")):
            joint_end.set("link", body_name(joint_end.get("link", "")))
    for link in root.findall("link"):
        for shape in link.findall("visual") + link.findall("collision"):
            link.remove(shape)
    try:
        spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))
    except ValueError as error:
        raise SimulationError(
            f"MuJoCo cannot read {robot.name}. Correct the URDF: {error}"
        ) from None
    spec.compiler.fusestatic, spec.compiler.discardvisual = True, False
    bodies = spec.bodies[1:]  # the first is the world
    for body in bodies:
        _move_joint_of_massless_link(spec, body, {body_name(foot.frame) for foot in robot.feet})
    inertias = {
        body.name: _fused_inertia(body)
        for body in bodies
        if body.joints or (robot.is_floating and body.parent.name == "world")
    }
    moving = [body for body in bodies if body.name in inertias]
    inconsistent = [b for b in moving if not _is_physically_consistent(inertias[b.name])]
    if inconsistent:
        raise SimulationError(_inertia_error(robot, inconsistent, inertias[inconsistent[0].name]))
    for body in bodies:
        inertia = inertias.get(body.name, pin.Inertia.Zero())
        tensor, body.explicitinertial = inertia.inertia, body.name in inertias
        body.mass = inertia.mass
        body.ipos = inertia.lever
        body.iquat = [1.0, 0.0, 0.0, 0.0]
        # how MuJoCo marks a missing inertia
        diagonal = tensor.diagonal() if body.explicitinertial else [np.nan, 0.0, 0.0]
        body.fullinertia = [*diagonal, tensor[0, 1], tensor[0, 2], tensor[1, 2]]
    return spec


def _move_joint_of_massless_link(
    spec: mujoco.MjSpec, link: mujoco.MjsBody, feet: Collection[str]
) -> None:
    """Let the joint of a massless link between two joints move the next link instead.

    MuJoCo moves no body without mass, but several joints can move one body in succession.
    """
    if not link.joints or len(link.bodies) != 1 or link.name in feet:
        return
    body = link.bodies[0]
    if not body.joints or _fused_inertia(link).mass > 0.0:
        return
    to_body = pin.SE3(rotation_matrix(body.quat), np.array(body.pos)).inverse()
    moved = []
    for joint in (*link.joints, *body.joints):
        placement = to_body if joint.parent.name == link.name else pin.SE3.Identity()
        attributes = {name: copy.copy(getattr(joint, name)) for name in _JOINT_ATTRIBUTES}
        attributes["pos"] = placement.act(np.array(joint.pos))
        attributes["axis"] = placement.rotation @ joint.axis
        moved.append(attributes)
        spec.delete(joint)
    for attributes in moved:
        body.add_joint(**attributes)


def _fused_inertia(body: mujoco.MjsBody) -> pin.Inertia:
    """Return the URDF's inertia of a body and all links welded below it, in the body's frame."""
    # the constructor rejects tensors that are not positive definite, but their sum may be so
    inertia = pin.Inertia.Zero()
    if body.explicitinertial:  # else the URDF gives none
        # MuJoCo stores NaN for a tensor of zeros
        ixx, iyy, izz, ixy, ixz, iyz = np.nan_to_num(body.fullinertia)
        R = rotation_matrix(body.iquat)  # from the axes of <inertial> to the body's
        inertia.mass, inertia.lever = float(body.mass), np.array(body.ipos)
        inertia.inertia = R @ np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]]) @ R.T
    for child in body.bodies:
        if not child.joints:
            placement = pin.SE3(rotation_matrix(child.quat), np.array(child.pos))
            inertia = inertia + placement.act(_fused_inertia(child))
    return inertia


def _is_physically_consistent(inertia: pin.Inertia) -> bool:
    """Return whether some mass distribution has this inertia; a mass of zero does not count."""
    smallest, middle, largest = np.linalg.eigvalsh(inertia.inertia)
    return bool(
        inertia.mass > 0.0
        and smallest > _MIN_INERTIA
        and smallest + middle >= largest * (1.0 - _RELATIVE_ROUNDING)
    )


def _inertia_error(robot: Robot, bodies: Sequence[mujoco.MjsBody], inertia: pin.Inertia) -> str:
    """Return the message about bodies that MuJoCo cannot move; `inertia` is that of the first."""
    smallest, middle, largest = np.linalg.eigvalsh(inertia.inertia)
    others = f" (and {len(bodies) - 1} more)" if len(bodies) > 1 else ""
    joints = [joint.name for body in bodies for joint in body.joints]
    weld = f", or weld such links to their parents with locked={joints} of fb.load"
    return (
        f"MuJoCo cannot move link {bodies[0].name!r} of {robot.name}{others}. Together with the "
        f"links welded to it, it has {inertia.mass:.4g} kg and principal inertias {smallest:.4g}, "
        f"{middle:.4g}, {largest:.4g} kg m². All of these must be positive, and no principal "
        f"inertia may exceed the sum of the other two. Correct the URDF{weld if joints else ''}."
    )


def _add_foot_balls(spec: mujoco.MjSpec, robot: Robot, contact: Any, mu: float) -> None:
    """Add a ball or a disc for each contact point of a foot; the point is its lowest one."""
    body, pose = _carrier(spec, robot, contact.frame)
    if isinstance(contact, FlatFootContact):
        # corners lie below the balls, along the z axis of the foot
        centres, radius = contact.corners + [0.0, 0.0, _CORNER_BALL_RADIUS], _CORNER_BALL_RADIUS
    else:
        centres, radius = contact.centre[None], max(contact.radius, _MIN_BALL_RADIUS)
    for name, centre in zip(contact.point_names, centres, strict=True):
        geom = body.add_geom(  # a geom without a type is a sphere
            name=name, size=[radius, 0.0, 0.0], mass=0.0, contype=0, conaffinity=1
        )
        geom.pos, geom.friction[0] = pose.act(centre), mu
        if isinstance(contact, RollingWheel):
            geom.type, geom.size = mujoco.mjtGeom.mjGEOM_ELLIPSOID, [radius, radius, _RIM_WIDTH]
            mujoco.mju_quatZ2Vec(geom.quat, pose.rotation @ contact.axis)


def _carrier(spec: mujoco.MjSpec, robot: Robot, name: str) -> tuple[mujoco.MjsBody, pin.SE3]:
    """Return the body that carries a frame of the robot, and the frame's pose in it."""
    if body := spec.body(body_name(name)):
        return body, pin.SE3.Identity()
    frame = robot.model.frames[robot.frame_id(name)]
    if frame.parentJoint == 0:
        return spec.worldbody, frame.placement
    joint = spec.joint(robot.model.names[frame.parentJoint])  # None for the free joint
    return spec.body(body_name(robot.base)) if joint is None else joint.parent, frame.placement


def _add_link_hulls(spec: mujoco.MjSpec, robot: Robot) -> None:
    """Add the massless hulls of links; they stop at once on impact and leave the ground slowly."""
    impact_time = max(_IMPACT_TIME, 4.0 * spec.option.timestep)
    for joint_id, points in link_hulls(robot, robot.package_dirs):
        joint = spec.joint(robot.model.names[joint_id])  # None for the free joint: its name differs
        body = spec.body(body_name(robot.base)) if joint is None else joint.parent
        mesh = spec.add_mesh(name=f"hull of {body.name}", uservert=points.ravel())
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
        hull = body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH, meshname=mesh.name, name=mesh.name, mass=0.0
        )
        hull.contype = 0
        hull.conaffinity = 1
        hull.priority = 1
        # stiffness and damping for 1 kg, overdamped
        hull.solref = [-1.0 / (impact_time * _PENETRATION_RECOVERY_TIME), -1.0 / impact_time]
