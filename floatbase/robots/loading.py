"""Robots from files: the catalogue, any other robot of example-robot-data once its feet are given,
and your own URDFs.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._validation import (
    Array,
    as_bool,
    as_instance,
    as_positive,
    as_string,
    as_strings,
    read_only,
    short_repr,
)
from floatbase.errors import InputError, RobotWarning, UnknownNameError, unknown_name
from floatbase.robots._checks import as_posture, clamp_to_limits, has_floating_base
from floatbase.robots.catalogue_data import CATALOGUE, CatalogueEntry
from floatbase.robots.robot import Foot, Robot
from floatbase.robots.urdf import (
    check_urdf,
    parse_urdf,
    read_urdf,
    with_locked_joints,
    without_world_link,
)

PLATE_SIZE = (
    0.4,
    0.03,
)  # width and thickness, m, of the plate on which `with_floating_base` lets a robot stand
# what may stand before a text: an XML declaration stands only at the very beginning
_WHITESPACE = "\ufeff \t\r\n"
_FLIGHT_HEIGHT = 1.0  # m: where a robot without bolts and plate floats


def catalogue() -> dict[str, str]:
    """The catalogue: name -> what the robot is for. `load` also takes the other names of
    example-robot-data.
    """
    return {name: entry.description for name, entry in CATALOGUE.items()}


def load(
    name: str,
    *,
    feet: Sequence[str | Foot] | None = None,
    foot_radius: float | None = None,
    torque_limits: npt.ArrayLike | None = None,
    posture: npt.ArrayLike | None = None,
    locked: Sequence[str] = (),
) -> Robot:
    """Load a robot by name.

    name: one of `catalogue()`, or any other robot of example-robot-data that has a URDF.
    feet: frames (or `Foot` values) that can touch the ground; by default as the catalogue has them.
        A floating-base robot outside the catalogue needs them.
    foot_radius: radius of the feet given as frames, m, 0 by default.
    torque_limits: one number or shape (d,), N·m; by default those of the catalogue or the URDF.
    posture: shape (nq,), a configuration to stand in, of the robot before joints are locked; by
        default the one that comes with the robot, its joints brought within their limits.
    locked: names of joints that become fixed where the posture has them. They have no entry in q, v
        and τ.

    Raises `UnknownNameError` with the near names, and `InputError` for feet, limits or a posture
    that do not fit, for joints coupled by <mimic>, and for a robot whose inertia M is singular.
    Warns where the motors of a fixed-base robot are too weak to hold its posture.
    """
    import example_robot_data as data

    loader, entry = (
        _find_loader(name, data.robots_loader.ROBOTS),
        CATALOGUE.get(name, CatalogueEntry("")),
    )
    path = f"{loader.path}/{loader.urdf_subpath}/{loader.urdf_filename}"
    root = Path(data.getModelPath(path)).resolve()
    urdf = read_urdf(root / path)
    model = parse_urdf(name, urdf, loader.free_flyer)
    srdf = (
        root / loader.path / loader.srdf_subpath / loader.srdf_filename
        if loader.srdf_filename
        else None
    )
    start = _reference_posture(
        model, loader, srdf, entry
    )  # also where a posture is given: it reads the inertia of rotors
    if loader.__init__ is not data.robots_loader.RobotLoader.__init__:
        start = _posture_of_modified_robot(name, loader, model)
    if feet is None:
        if foot_radius is not None:
            raise InputError(
                "foot_radius goes with feet=[…]: the catalogue's feet have their own radius."
            )
        if name not in CATALOGUE and loader.free_flyer:
            raise InputError(
                f"{name} is not in the catalogue ({', '.join(CATALOGUE)}), so its feet must be "
                f"given: "
                f'fb.load("{name}", feet=["name of a foot frame", …], foot_radius=0.02). '
                f"Its limbs end with {', '.join(_limb_ends(model))}. A robot that flies has none: "
                f"feet=[]."
            )
    robot = _make_robot(
        name,
        urdf,
        model,
        start if posture is None else posture,
        locked,
        entry.torque_limit if torque_limits is None else torque_limits,
        package_dirs=(root.parent.parent, root),
        feet=entry.feet if feet is None else _as_feet(feet, foot_radius),
        description=entry.description,
        sources=entry.sources,
    )
    _warn_if_motors_are_weak(robot)
    return robot


def load_urdf(
    path: str | Path,
    *,
    name: str | None = None,
    floating: bool = True,
    package_dirs: Sequence[str | Path] = (),
    feet: Sequence[str | Foot] = (),
    foot_radius: float | None = None,
    torque_limits: npt.ArrayLike | None = None,
    posture: npt.ArrayLike | None = None,
    locked: Sequence[str] = (),
) -> Robot:
    """Load your own robot from a URDF.

    path: of the URDF file, or the URDF's text itself, such as `robot.urdf`.
    name: the file's name without its ending, or "robot" of a text, by default.
    floating: whether the root link is free to move.
    package_dirs: where meshes named package://… lie; the file's own folder is always searched.
    feet, foot_radius, torque_limits, locked: as for `load`.
    posture: as for `load`; that of all joints at zero, or at the limit that is nearest to it, by
        default.

    Raises `InputError` for a file that is not there or cannot be read, for planar and floating
    joints inside the robot, and as `load` does.
    """
    urdf, directories = (
        as_string("path", str(path) if isinstance(path, Path) else path),
        _as_directories(package_dirs),
    )
    as_bool("floating", floating)
    is_text = urdf.lstrip(_WHITESPACE).startswith("<")
    name = as_string("name", name) if name is not None else "robot" if is_text else Path(urdf).stem
    if is_text:
        urdf = urdf.lstrip(_WHITESPACE)
    else:
        file = Path(os.path.expanduser(urdf))
        if not file.exists():
            import example_robot_data as data

            if urdf in data.robots_loader.ROBOTS:
                raise InputError(
                    f'there is no file {urdf}, but a robot of that name: fb.load("{urdf}") loads '
                    f"it."
                )
        urdf, directories = read_urdf(file), (*directories, file.resolve().parent)
    model = parse_urdf(name, urdf, floating)
    start = clamp_to_limits(model, pin.neutral(model)) if posture is None else posture
    robot = _make_robot(
        name,
        urdf,
        model,
        start,
        locked,
        torque_limits,
        package_dirs=directories,
        feet=_as_feet(feet, foot_radius),
    )
    _warn_if_motors_are_weak(robot)
    return robot


def _as_directories(paths: Sequence[str | Path]) -> tuple[Path, ...]:
    """Folders given as texts or paths."""
    strings = (
        [str(path) if isinstance(path, Path) else path for path in paths]
        if isinstance(paths, list | tuple)
        else paths
    )
    return tuple(map(Path, as_strings("package_dirs", strings)))


def with_floating_base(robot: Robot, plate: bool = False) -> Robot:
    """A fixed-base robot with its base free to move: the links and joints of its URDF are the same,
    the bolts are gone.

    Bolts are the link "world", which some URDFs have below the base, and the joints that hang from
    it.

    robot: with a fixed base, such as ur5.
    plate: let it stand on a square plate that has no weight (`PLATE_SIZE`); else it touches nothing
        and floats 1 m up.
    """
    as_bool("plate", plate)
    if as_instance("robot", robot, Robot, 'fb.load("ur5")').is_floating:
        raise InputError(
            f"{robot.name} has no bolts; with_floating_base takes a robot with a fixed base, such "
            f"as ur5."
        )
    floating = load_urdf(
        without_world_link(robot.urdf),
        name=robot.name,
        package_dirs=robot.package_dirs,
        torque_limits=robot.torque_limits,
    )
    width, thickness = PLATE_SIZE
    corners = np.array(
        [
            [x * width, y * width, -thickness]
            for x, y in ((0.5, 0.5), (0.5, -0.5), (-0.5, -0.5), (-0.5, 0.5))
        ]
    )
    return replace(
        floating,
        feet=(Foot(floating.base, corners=corners),) if plate else (),
        posture=read_only(
            [0.0, 0.0, thickness if plate else _FLIGHT_HEIGHT, 0.0, 0.0, 0.0, 1.0, *robot.posture]
        ),
    )


def _make_robot(
    name: str,
    urdf: str,
    model: pin.Model,
    posture: npt.ArrayLike,
    locked: Sequence[str],
    torque_limits: npt.ArrayLike | None,
    **fields: Any,
) -> Robot:
    """A robot of a URDF's text and of the model read from it, after joints are locked and what
    cannot be held is refused.
    """
    locked, floating = as_strings("locked", locked), has_floating_base(model)
    if locked:
        full_model, q = model, as_posture(name, model, posture)
        joints = list(full_model.names)[2 if floating else 1 :]
        for joint in locked:
            if joint not in joints:
                raise unknown_name(
                    f"joint of {name}", joint, joints, "Those that are fixed already need no lock."
                )
        urdf = with_locked_joints(urdf, full_model, q, locked)
        model = parse_urdf(name, urdf, floating)
        kept_joints = [
            full_model.joints[full_model.getJointId(joint)] for joint in list(model.names)[1:]
        ]
        posture = [x for joint in kept_joints for x in q[joint.idx_q :][: joint.nq]]
        model.armature = np.array(
            [x for joint in kept_joints for x in full_model.armature[joint.idx_v :][: joint.nv]]
        )
    check_urdf(name, urdf, model)
    if torque_limits is None:
        effort = np.array(model.effortLimit)[6 if floating else 0 :]
        torque_limits = np.where(effort > 0, effort, np.inf)  # 0 stands for unknown
    return Robot(name, model, urdf, posture=posture, torque_limits=torque_limits, **fields)  # type: ignore[arg-type]  # it checks


def _warn_if_motors_are_weak(robot: Robot) -> None:
    """Warn the caller's caller where a fixed base's motors cannot hold the arm in its posture: it
    will sink.
    """
    if robot.is_floating:
        return
    gravity_torques = np.abs(
        pin.computeGeneralizedGravity(
            robot.model, robot.model.createData(), np.array(robot.posture)
        )
    )
    weak = [
        f"{joint} needs {required:.3g} and has {limit:.3g}"
        for joint, required, limit in zip(
            robot.joint_names, gravity_torques, robot.torque_limits, strict=True
        )
        if required > limit
    ]
    if weak:
        message = (
            f"{robot.name} sinks: its motors are too weak to hold its posture against "
            f"gravity, N·m or N: {', '.join(weak)}."
        )
        warnings.warn(message, RobotWarning, stacklevel=3)


def _find_loader(name: str, known: Mapping[str, Any]) -> Any:
    """What example-robot-data says about a robot."""
    if str(name).endswith((".urdf", ".xml", ".xacro")) or "/" in str(name):
        raise UnknownNameError(
            f"{str(name)!r} is no robot's name but a file's; fb.load_urdf({str(name)!r}, feet=[…]) "
            f"loads your own URDF. "
            f"Names that fb.load knows: {', '.join(CATALOGUE)}, and the others of "
            f"example-robot-data."
        )
    if not isinstance(name, str) or name not in known:
        raise unknown_name(
            "robot", name, known, "fb.catalogue() says what the catalogue's robots are for."
        )
    if not known[name].urdf_filename:
        raise InputError(
            f"{name} comes as an SDF file; floatbase reads URDF. Choose one of "
            f"{', '.join(CATALOGUE)}."
        )
    return known[name]


def _reference_posture(
    model: pin.Model, loader: Any, srdf: Path | None, entry: CatalogueEntry
) -> Array:
    """The SRDF's reference configuration with the catalogue's joint angles on top; loads rotor
    inertia too.
    """
    q = pin.neutral(model)
    if srdf is not None:
        if loader.has_rotor_parameters:
            pin.loadRotorParameters(model, str(srdf), False)
            model.armature = model.rotorInertia * model.rotorGearRatio**2
        pin.loadReferenceConfigurations(model, str(srdf), False)
        q = np.array(
            {found.key(): found.data() for found in model.referenceConfigurations}.get(
                loader.ref_posture, q
            )
        )
    for joint, angle in entry.joints.items():
        q[model.idx_qs[model.getJointId(joint)]] = angle
    return clamp_to_limits(model, pin.normalize(model, q))


def _posture_of_modified_robot(name: str, loader: Any, model: pin.Model) -> Array:
    """The posture of a loader that changes the model after reading the URDF; `InputError` where
    that is another robot then.

    A loader may turn the world under a free base (human): the posture takes that turn, since our q
    is the base in the world.
    """
    loaded = loader().robot
    first = 2 if loader.free_flyer else 1
    fingerprints = [
        (m.nv, m.inertias.tolist(), m.jointPlacements.tolist()[first:])
        for m in (loaded.model, model)
    ]
    if fingerprints[0] != fingerprints[1]:
        raise InputError(
            f"example-robot-data makes {name} from {loader.urdf_filename} by changing it after "
            f"reading: {loaded.model.nv} of "
            f"{model.nv} velocities stay. floatbase takes URDFs as they are: load the whole robot, "
            f"hold joints with locked=[…]."
        )
    q = np.array(loaded.q0)
    if loader.free_flyer:
        q[:7] = pin.SE3ToXYZQUAT(loaded.model.jointPlacements[1] * pin.XYZQUATToSE3(q[:7]))
    return clamp_to_limits(model, q)


def _limb_ends(model: pin.Model) -> list[str]:
    """Names of the links that carry no other link, behind the last joint of a limb: feet, fingers,
    heads.
    """
    frames, parent_joints = model.frames, set(model.parents)
    bodies = [frame for frame in frames if frame.type == pin.FrameType.BODY]
    parents = {
        frames[frames[frame.parentFrame].parentFrame].name for frame in bodies
    }  # a link hangs from a joint's frame
    return [
        str(frame.name)
        for frame in bodies
        if frame.name not in parents and frame.parentJoint not in parent_joints
    ]


def _as_feet(requested: Sequence[str | Foot], radius: float | None) -> tuple[Foot, ...]:
    """Feet of frames and `Foot` values."""
    if isinstance(requested, str) or not isinstance(requested, Sequence):
        raise InputError(
            f'feet must be a list of frames, as in feet=["FL_foot"], not {short_repr(requested)}.'
        )
    r = 0.0 if radius is None else as_positive("foot_radius", radius, "m", allow_zero=True)
    return tuple(foot if isinstance(foot, Foot) else Foot(foot, r) for foot in requested)
