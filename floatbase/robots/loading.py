"""Loading robots: the catalogue, other robots of example-robot-data, and your own URDFs.

The feet of robots outside the catalogue are found from the shapes of their links.
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
    as_string,
    as_strings,
    read_only,
    short_repr,
)
from floatbase.errors import InputError, RobotWarning, UnknownNameError, unknown_name
from floatbase.robots._checks import (
    as_posture,
    clamp_to_limits,
    has_floating_base,
    with_angles,
)
from floatbase.robots._shapes import missing_meshes
from floatbase.robots.catalogue_data import CATALOGUE, CatalogueEntry
from floatbase.robots.feet import as_feet, with_bent_legs
from floatbase.robots.robot import Foot, Robot
from floatbase.robots.urdf import (
    check_urdf,
    parse_urdf,
    read_urdf,
    with_locked_joints,
    without_world_link,
)

# width and thickness, m, of the plate on which `with_floating_base` places a robot
PLATE_SIZE = (0.4, 0.03)
# characters that may precede a URDF text: an XML declaration must be at the very beginning
_WHITESPACE = "\ufeff \t\r\n"
_FLIGHT_HEIGHT = 1.0  # m: where a robot without a plate floats once its base is free


def catalogue() -> dict[str, str]:
    """List the robots of the catalogue.

    Returns
    -------
    dict of str to str
        Name and purpose of each robot. `load` also accepts the other names of example-robot-data.
    """
    return {name: entry.description for name, entry in CATALOGUE.items()}


def load(
    name: str,
    *,
    feet: Sequence[str | Foot] | None = None,
    foot_radius: float | None = None,
    torque_limits: npt.ArrayLike | None = None,
    posture: npt.ArrayLike | Mapping[str, float] | None = None,
    locked: Sequence[str] = (),
) -> Robot:
    """Load a robot by name.

    Parameters
    ----------
    name : str
        One of `catalogue()`, or any other robot of example-robot-data that has a URDF.
    feet : sequence of str or Foot, optional
        Frames or `Foot` values that can touch the ground; by default those of the catalogue, or
        the lowest ends of the limbs of a floating-base robot outside the catalogue.
    foot_radius : float, optional
        Radius of the feet that are given as frames [m]; by default each is the ball, the sole or
        the wheel that its collision shapes form, or a point if it has none.
    torque_limits : float or array_like, shape (d,), optional
        Torque limits [N·m]; by default those of the catalogue or the URDF.
    posture : array_like, shape (nq,) or (nq - 7,), or mapping of str to float, optional
        Standing configuration of the robot before joints are locked, or its joints alone. By
        default the one that comes with the robot, with its joints brought within their limits. A
        mapping changes joints of that posture [rad or m]; a * in a name stands for any characters,
        as in {"*_knee": 0.6}.
    locked : sequence of str, optional
        Names of joints to fix at their positions in the posture. Fixed joints have no entry in q, v
        and τ.

    Returns
    -------
    Robot
        The robot.

    Raises
    ------
    UnknownNameError
        If there is no robot, frame or joint with a given name; the message lists similar names.
    InputError
        If the feet, limits or posture do not fit the robot, if joints are coupled by <mimic>, or if
        the robot's inertia matrix M is singular.

    Warns
    -----
    RobotWarning
        If the motors of a fixed-base robot are too weak to hold its posture, or if a robot has one
        or two feet that are points.

    Examples
    --------
    >>> fb.load("go2").d
    12
    """
    import example_robot_data as data

    loader = _find_loader(name, data.robots_loader.ROBOTS)
    entry = CATALOGUE.get(name, CatalogueEntry(""))
    path = f"{loader.path}/{loader.urdf_subpath}/{loader.urdf_filename}"
    root = Path(data.getModelPath(path)).resolve()
    urdf = read_urdf(root / path)
    model = parse_urdf(name, urdf, loader.free_flyer)
    srdf = (
        root / loader.path / loader.srdf_subpath / loader.srdf_filename
        if loader.srdf_filename
        else None
    )
    # also if a posture is given, since it reads the rotor inertias
    start = _reference_posture(model, loader, srdf, entry)
    if loader.__init__ is not data.robots_loader.RobotLoader.__init__:
        start = _posture_of_modified_robot(name, loader, model)
    robot = _make_robot(
        name,
        urdf,
        model,
        with_angles(name, model, start, posture),
        locked,
        entry.torque_limit if torque_limits is None else torque_limits,
        feet,
        foot_radius,
        entry.feet if name in CATALOGUE else None,
        package_dirs=(root.parent.parent, root),
        description=entry.description,
        sources=entry.sources,
    )
    _warn_if_motors_are_weak(robot)
    _warn_if_feet_are_points(robot, feet)
    return robot


def load_urdf(
    path: str | Path,
    *,
    name: str | None = None,
    floating: bool = True,
    package_dirs: Sequence[str | Path] = (),
    feet: Sequence[str | Foot] | None = None,
    foot_radius: float | None = None,
    torque_limits: npt.ArrayLike | None = None,
    posture: npt.ArrayLike | Mapping[str, float] | None = None,
    locked: Sequence[str] = (),
) -> Robot:
    """Load your own robot from a URDF.

    Parameters
    ----------
    path : str or Path
        Path of the URDF file, or the text of the URDF itself, such as `robot.urdf`.
    name : str, optional
        Name of the robot. By default the file name without its extension, or "robot" if the text is
        given.
    floating : bool, optional
        Whether the root link can move freely.
    package_dirs : sequence of str or Path, optional
        Folders that contain meshes named package://…; the folder of the file and all folders above
        these are always searched.
    feet : sequence of str or Foot, optional
        Frames or `Foot` values that can touch the ground; by default the lowest ends of the limbs,
        or none if the base is fixed.
    foot_radius : float, optional
        Radius of the feet that are given as frames [m]; by default each is the ball, the sole or
        the wheel that its collision shapes form, or a point if it has none.
    torque_limits : float or array_like, shape (d,), optional
        Torque limits [N·m]; by default those of the URDF.
    posture : array_like, shape (nq,) or (nq - 7,), or mapping of str to float, optional
        Standing configuration of the robot before joints are locked, or its joints alone. A mapping
        holds some joints [rad or m]; a * in a name stands for any characters, as in {"*_knee":
        0.6}, and later entries take precedence. Other joints are at zero, or at the limit nearest
        to zero. By default all joints are, except that legs which would be straight are bent.
    locked : sequence of str, optional
        Names of joints to fix at their positions in the posture. They have no entry in q, v and τ.

    Returns
    -------
    Robot
        The robot.

    Raises
    ------
    UnknownNameError
        If a foot frame or a locked joint does not exist.
    InputError
        If the file does not exist or cannot be read, if the robot has planar or floating joints
        besides its base, or for the same reasons as in `load`.

    Warns
    -----
    RobotWarning
        If the motors of a fixed-base robot are too weak to hold its posture, if mesh files are
        missing, if a robot has one or two feet that are points, or if no posture is given and a leg
        of a floating-base robot remains straight or otherwise singular.
    """
    urdf = as_string("path", str(path) if isinstance(path, Path) else path)
    directories = _as_directories(package_dirs)
    as_bool("floating", floating)
    is_text = urdf.lstrip(_WHITESPACE).startswith("<")
    name = as_string("name", name) if name is not None else "robot" if is_text else Path(urdf).stem
    if is_text:
        urdf = urdf.lstrip(_WHITESPACE)
    else:
        file = Path(os.path.expanduser(urdf))
        if not os.path.exists(file):  # not file.exists(), which raises for a name that is too long
            import example_robot_data as data

            if urdf in data.robots_loader.ROBOTS:
                raise InputError(
                    f"There is no file {urdf}, but there is a robot with this name. Load it with "
                    f'fb.load("{urdf}").'
                )
        urdf, directories = read_urdf(file), (*directories, file.resolve().parent)
    model = parse_urdf(name, urdf, floating)
    start = clamp_to_limits(model, pin.neutral(model))
    robot = _make_robot(
        name,
        urdf,
        model,
        with_angles(name, model, start, posture),
        locked,
        torque_limits,
        feet,
        foot_radius,
        package_dirs=directories,
    )
    if posture is None:
        robot = with_bent_legs(robot)
    if directories:
        _warn_if_meshes_are_missing(robot)
    _warn_if_motors_are_weak(robot)
    _warn_if_feet_are_points(robot, feet)
    return robot


def _as_directories(paths: Sequence[str | Path]) -> tuple[Path, ...]:
    """Return folders, given as strings or paths, as paths."""
    strings = (
        [str(path) if isinstance(path, Path) else path for path in paths]
        if isinstance(paths, list | tuple)
        else paths
    )
    return tuple(map(Path, as_strings("package_dirs", strings)))


def with_floating_base(robot: Robot, plate: bool = False) -> Robot:
    """Free the base of a fixed-base robot.

    The links and joints of the URDF stay the same. The link "world", which some URDFs have below
    the base, and the joints attached to it are removed.

    Parameters
    ----------
    robot : Robot
        Robot with a fixed base, such as ur5.
    plate : bool, optional
        Whether the robot stands on a massless square plate of size `PLATE_SIZE`. Otherwise it
        touches nothing and floats 1 m above the ground.

    Returns
    -------
    Robot
        The robot with a floating base.

    Raises
    ------
    InputError
        If the base is already floating.
    """
    as_bool("plate", plate)
    if as_instance("robot", robot, Robot, 'fb.load("ur5")').is_floating:
        raise InputError(
            f"The base of {robot.name} is already floating. with_floating_base needs a robot with "
            f"a fixed base, such as ur5."
        )
    floating = load_urdf(
        without_world_link(robot.urdf),
        name=robot.name,
        torque_limits=robot.torque_limits,
        feet=(),
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
        package_dirs=robot.package_dirs,
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
    feet: Sequence[str | Foot] | None,
    foot_radius: float | None,
    known_feet: tuple[Foot, ...] | None = None,
    *,
    package_dirs: tuple[Path, ...],
    **fields: Any,
) -> Robot:
    """Build a robot from a URDF text and its model, after locking joints and checking the URDF."""
    locked, floating = as_strings("locked", locked), has_floating_base(model)
    if locked:
        full_model, q = model, as_posture(name, model, posture)
        joints = list(full_model.names)[2 if floating else 1 :]
        for joint in locked:
            if joint not in joints:
                raise unknown_name(
                    f"joint of {name}", joint, joints, "Joints that are already fixed need no lock."
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
        torque_limits = np.where(effort > 0, effort, np.inf)  # 0 means unknown
    posture = as_posture(name, model, posture)
    feet = as_feet(feet, foot_radius, model, urdf, package_dirs, posture, known_feet)
    return Robot(name, model, urdf, package_dirs, feet, torque_limits, posture, **fields)  # type: ignore[arg-type]  # it checks


def _warn_if_motors_are_weak(robot: Robot) -> None:
    """Warn if the motors of a fixed-base robot cannot hold its posture against gravity.

    The warning points at the code that called the loading function.
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
            f"{robot.name} will sink: its motors are too weak to hold its posture against "
            f"gravity (N·m or N): {', '.join(weak)}."
        )
        warnings.warn(message, RobotWarning, stacklevel=3)


def _warn_if_feet_are_points(robot: Robot, requested: Sequence[str | Foot] | None) -> None:
    """Warn if a robot has too few points of contact to stand on, unless they were given as `Foot`.

    The warning points at the code that called the loading function.
    """
    if (
        robot.is_floating
        and 1 <= len(robot.feet) <= 2
        and not any(foot.is_flat or foot in (requested or ()) for foot in robot.feet)
    ):
        names = [foot.frame for foot in robot.feet]
        message = (
            f"{robot.name} cannot stand still, because it touches the ground at {len(names)} "
            f"point(s) only: {', '.join(names)}. If it has soles, give their corners, as in "
            f"feet=[floatbase.robots.Foot({names[0]!r}, corners=[…]), …]."
        )
        warnings.warn(message, RobotWarning, stacklevel=3)


def _warn_if_meshes_are_missing(robot: Robot) -> None:
    """Warn if mesh files do not exist.

    The warning points at the code that called the loading function.
    """
    missing = missing_meshes(robot.urdf, robot.package_dirs)
    if missing:
        more = f" (and {len(missing) - 1} more)" if len(missing) > 1 else ""
        message = (
            f"The mesh file {missing[0]!r}{more} of {robot.name} does not exist. Its link is "
            f"represented by other shapes or a box. Give the folder that contains the meshes or "
            f"their package, as in package_dirs=[…]."
        )
        warnings.warn(message, RobotWarning, stacklevel=3)


def _find_loader(name: str, known: Mapping[str, Any]) -> Any:
    """Return the entry of a robot in example-robot-data."""
    text = str(name) if isinstance(name, str | Path) else ""
    if text.endswith((".urdf", ".xml", ".xacro")) or "/" in text:
        path = short_repr(text)
        raise UnknownNameError(
            f"{path} is the name of a file, not of a robot. Load your own URDF with "
            f"fb.load_urdf({path}, feet=[…]). fb.load accepts {', '.join(CATALOGUE)}, and the "
            f"other names of example-robot-data."
        )
    if not isinstance(name, str) or name not in known:
        raise unknown_name(
            "robot", name, known, "fb.catalogue() describes the robots of the catalogue."
        )
    if not known[name].urdf_filename:
        raise InputError(
            f"{name} is an SDF file, but floatbase reads only URDF. Choose one of "
            f"{', '.join(CATALOGUE)}."
        )
    return known[name]


def _reference_posture(
    model: pin.Model, loader: Any, srdf: Path | None, entry: CatalogueEntry
) -> Array:
    """Return the reference posture of the SRDF with the joint angles of the catalogue.

    The rotor inertias of the SRDF are stored in the model.
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
    """Return the posture of a loader that changes the model after reading the URDF.

    A loader may rotate the world under a floating base (human). The posture includes this rotation,
    since our q describes the base in the world frame. Any other change is an `InputError`.
    """
    loaded = loader().robot
    first = 2 if loader.free_flyer else 1
    fingerprints = [
        (m.nv, m.inertias.tolist(), m.jointPlacements.tolist()[first:])
        for m in (loaded.model, model)
    ]
    if fingerprints[0] != fingerprints[1]:
        raise InputError(
            f"example-robot-data modifies {name} after reading {loader.urdf_filename}: "
            f"{loaded.model.nv} of {model.nv} velocities remain. floatbase uses URDFs unmodified. "
            f"Load the whole robot and lock joints with locked=[…]."
        )
    q = np.array(loaded.q0)
    if loader.free_flyer:
        q[:7] = pin.SE3ToXYZQUAT(loaded.model.jointPlacements[1] * pin.XYZQUATToSE3(q[:7]))
    return clamp_to_limits(model, q)
