"""Loading robots: the catalogue, other robots of example-robot-data, your own URDFs and MJCFs.

Robots of example-robot-data that are not in the catalogue need their feet to be given.
"""

from __future__ import annotations

import os
import warnings
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._validation import (
    Array,
    as_bool,
    as_positive,
    as_string,
    as_strings,
    short_repr,
)
from floatbase.errors import InputError, RobotWarning, UnknownNameError, unknown_name
from floatbase.robots._checks import as_posture, clamp_to_limits, has_floating_base
from floatbase.robots.catalogue_data import CATALOGUE, CatalogueEntry
from floatbase.robots.plausibility import warn_if_it_cannot_stand
from floatbase.robots.robot import Foot, Robot
from floatbase.robots.state import State
from floatbase.robots.urdf import (
    check_couplings,
    check_model,
    normalize_urdf,
    parse_urdf,
    read_text,
    with_locked_joints,
)

_FILE_ENDINGS = (".urdf", ".xml", ".mjcf")
# characters that may precede a URDF text: an XML declaration must be at the very beginning
_WHITESPACE = "\ufeff \t\r\n"
_BEND = 0.5  # rad or m: change of all joints that takes a leg out of a singular posture
# ratio of a leg's smallest to its largest singular value below which the leg counts as singular:
# about sin θ / 5 for two equal links that are θ from straight, so this is 3°
_MIN_SINGULAR_VALUE = 0.01


def catalogue() -> dict[str, str]:
    """List the robots of the catalogue.

    Returns
    -------
    dict of str to str
        Name and purpose of each robot. `load` also accepts the other names of example-robot-data.
    """
    return {name: entry.description for name, entry in CATALOGUE.items()}


def load(
    name: str | Path,
    *,
    feet: Sequence[str | Foot] | None = None,
    foot_radius: float | None = None,
    torque_limits: npt.ArrayLike | None = None,
    posture: npt.ArrayLike | None = None,
    locked: Sequence[str] = (),
) -> Robot:
    """Load a robot by name.

    Parameters
    ----------
    name : str or Path
        One of `catalogue()`, any other robot of example-robot-data that has a URDF, or the path of
        a file, which `load_urdf` or `load_mjcf` loads.
    feet : sequence of str or Foot, optional
        Frames or `Foot` values that can touch the ground; by default those of the catalogue.
        Floating-base robots outside the catalogue require them.
    foot_radius : float, optional
        Radius of the feet that are given as frames [m]; 0 by default.
    torque_limits : float or array_like, shape (d,), optional
        Torque limits [N·m]; by default those of the catalogue or the URDF.
    posture : array_like, shape (nq,) or (nq - 7,), optional
        Standing configuration of the robot before joints are locked, or its joints alone. By
        default the one that comes with the robot, with its joints brought within their limits.
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
        If the motors are too weak to hold the robot in its posture or on its feet, or if the robot
        is upside down.

    Examples
    --------
    >>> fb.load("go2").d
    12
    """
    import example_robot_data as data

    name = str(name) if isinstance(name, Path) else name
    load_file = file_loader(name)
    if load_file is not None:
        return load_file(
            name,
            feet=feet or (),
            foot_radius=foot_radius,
            torque_limits=torque_limits,
            posture=posture,
            locked=locked,
        )
    loader = _find_loader(name, data.robots_loader.ROBOTS)
    entry = CATALOGUE.get(name, CatalogueEntry(""))
    path = f"{loader.path}/{loader.urdf_subpath}/{loader.urdf_filename}"
    root = Path(data.getModelPath(path)).resolve()
    urdf = normalize_urdf(name, read_text(root / path), loader.free_flyer)
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
    if feet is None:
        if foot_radius is not None:
            raise InputError(
                "foot_radius requires feet=[…], since the feet of the catalogue have their own "
                "radius."
            )
        if name not in CATALOGUE and loader.free_flyer:
            raise InputError(
                f"{name} is not in the catalogue ({', '.join(CATALOGUE)}), so you must give its "
                f'feet: fb.load("{name}", feet=["name of a foot frame", …], foot_radius=0.02). '
                f"The links at the ends of its limbs are {', '.join(_limb_ends(model))}. For a "
                f"flying robot, use feet=[]."
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
    warn_if_it_cannot_stand(robot)
    return robot


def file_loader(path: str) -> Callable[..., Robot] | None:
    """Choose the function that loads a robot's file, according to its outermost element.

    Parameters
    ----------
    path : str
        Path of a file, or the name of a robot.

    Returns
    -------
    callable or None
        `load_urdf` or `load_mjcf`; None unless the path ends like a URDF or MJCF file.
    """
    endings = *_FILE_ENDINGS, ".xacro", ".sdf"  # of these, load_urdf says what to run first
    if not isinstance(path, str) or not path.lower().endswith(endings):
        return None
    try:
        tag = ElementTree.fromstring(read_text(Path(os.path.expanduser(path)))).tag
    except ElementTree.ParseError:
        tag = ""  # load_urdf describes the error
    return load_mjcf if tag == "mujoco" else load_urdf


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

    Parameters
    ----------
    path : str or Path
        Path of the URDF file, or the text of the URDF itself, such as `robot.urdf`.
    name : str, optional
        Name of the robot. By default the file name without its extension, or "robot" if the text is
        given.
    floating : bool, optional
        Whether the base can move freely. The base is then the first link with mass: links without
        mass below it, such as "world", are removed, together with a floating joint.
    package_dirs : sequence of str or Path, optional
        Folders that contain meshes named package://…; the folder of the file is always searched.
    feet : sequence of str or Foot, optional
        Frames or `Foot` values that can touch the ground; none by default.
    foot_radius : float, optional
        Radius of the feet that are given as frames [m]; 0 by default.
    torque_limits : float or array_like, shape (d,), optional
        Torque limits [N·m]; by default those of the URDF.
    posture : array_like, shape (nq,) or (nq - 7,), optional
        Standing configuration of the robot before joints are locked, or its joints alone. By
        default all joints are at zero, or at the limit nearest to zero.
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
        If the motors are too weak to hold the robot in its posture or on its feet, if the robot is
        upside down, if its lengths are probably not in metres, if no posture is given and a leg of
        a floating-base robot is straight or otherwise singular, if only some joints have a torque
        limit, or if the URDF has settings for MuJoCo, which are ignored.

    Notes
    -----
    `Robot.urdf` is not the text of the file. It holds the links, joints and materials alone, in a
    form that Pinocchio and MuJoCo read in the same way.
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
        urdf, directories = read_text(file), (*directories, file.resolve().parent)
    urdf = normalize_urdf(name, urdf, floating)
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
    warn_if_it_cannot_stand(robot)
    if posture is None:
        _warn_if_legs_are_singular(robot)
    if torque_limits is None:
        _warn_if_joints_are_passive(robot)
    return robot


def load_mjcf(
    path: str | Path,
    *,
    name: str | None = None,
    floating: bool | None = None,
    feet: Sequence[str | Foot] = (),
    foot_radius: float | None = None,
    torque_limits: npt.ArrayLike | None = None,
    posture: npt.ArrayLike | str | None = None,
    locked: Sequence[str] = (),
) -> Robot:
    """Load your own robot from an MJCF, the file format of MuJoCo.

    MuJoCo compiles the file. `Robot.urdf` is then a URDF of the robot in it: of the free body with
    the most joints, or of everything that is attached to the world. Bodies, sites and named
    geoms that can touch others are links. Rotor inertias (armature) become part of M.

    Parameters
    ----------
    path : str or Path
        Path of the MJCF file.
    name : str, optional
        Name of the robot. By default the file name without its extension.
    floating : bool, optional
        Whether the base can move freely; by default, whether it has a free joint in the file. With
        True, a free joint replaces the joints between the base and the world.
    feet : sequence of str or Foot, optional
        Bodies, sites, geoms or `Foot` values that can touch the ground; none by default.
    foot_radius : float, optional
        Radius of the feet that are given as names [m]; 0 by default.
    torque_limits : float or array_like, shape (d,), optional
        Torque limits [N·m]; by default what the actuators and joints of the file allow.
    posture : str or array_like, shape (nq,) or (nq - 7,), optional
        Standing configuration of the robot before joints are locked: the name of a keyframe, or
        numbers as in `load_urdf`. By default the first keyframe, or the file's initial
        configuration, with joints brought within their limits.
    locked : sequence of str, optional
        Names of joints to fix at their positions in the posture. They have no entry in q, v and τ.

    Returns
    -------
    Robot
        The robot.

    Raises
    ------
    UnknownNameError
        If a keyframe, a foot or a locked joint does not exist.
    InputError
        If MuJoCo cannot read the file, if the robot has ball joints, if the base cannot float, or
        for the same reasons as in `load_urdf`.

    Warns
    -----
    RobotWarning
        If the file contains parts that the robot does not have, such as tendons, springs,
        constraints and other free bodies, or for the same reasons as in `load_urdf`.
    """
    from floatbase.robots.mjcf import read_mjcf  # imports MuJoCo

    file = Path(
        os.path.expanduser(as_string("path", str(path) if isinstance(path, Path) else path))
    )
    if floating is not None:
        as_bool("floating", floating)
    name = file.stem if name is None else as_string("name", name)
    keyframe = posture if isinstance(posture, str) else None
    mjcf = read_mjcf(name, file, floating, keyframe)
    robot = _make_robot(
        name,
        mjcf.urdf,
        mjcf.model,
        mjcf.posture if posture is None or isinstance(posture, str) else posture,
        locked,
        torque_limits,
        package_dirs=(mjcf.folder,),
        feet=_as_feet(feet, foot_radius),
    )
    if mjcf.differences:
        message = f"{name} differs from its MJCF. It is loaded {', '.join(mjcf.differences)}."
        warnings.warn(message, RobotWarning, stacklevel=2)
    _warn_if_motors_are_weak(robot)
    if posture is None:
        _warn_if_legs_are_singular(robot)
    return robot


def _as_directories(paths: Sequence[str | Path]) -> tuple[Path, ...]:
    """Return folders, given as strings or paths, as paths."""
    strings = (
        [str(path) if isinstance(path, Path) else path for path in paths]
        if isinstance(paths, list | tuple)
        else paths
    )
    return tuple(map(Path, as_strings("package_dirs", strings)))


def _make_robot(
    name: str,
    urdf: str,
    model: pin.Model,
    posture: npt.ArrayLike,
    locked: Sequence[str],
    torque_limits: npt.ArrayLike | None,
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
    check_couplings(name, urdf)
    check_model(name, model)
    if torque_limits is None:
        effort = np.array(model.effortLimit)[6 if floating else 0 :]
        torque_limits = np.where(effort > 0, effort, np.inf)  # 0 means unknown
    return Robot(name, model, urdf, posture=posture, torque_limits=torque_limits, **fields)  # type: ignore[arg-type]  # it checks


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


def _warn_if_joints_are_passive(robot: Robot) -> None:
    """Warn if only some joints have a torque limit in the URDF: the others may have no motor.

    The warning points at the code that called the loading function.
    """
    unlimited = np.array(robot.joint_names)[np.isinf(robot.torque_limits)].tolist()
    if 0 < len(unlimited) < robot.d:
        message = (
            f"The URDF of {robot.name} gives no effort, or effort=0, for {', '.join(unlimited)}. "
            f"Their motors have no torque limits. If these joints are passive, for example in a "
            f"closed loop, lock them with locked=[…]. Otherwise, pass torque_limits."
        )
        warnings.warn(message, RobotWarning, stacklevel=3)


def _warn_if_legs_are_singular(robot: Robot) -> None:
    """Warn if a foot of a floating-base robot moves in fewer directions than with a bent leg.

    The warning points at the code that called the loading function.
    """
    if not robot.is_floating:
        return
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
    if singular:
        message = (
            f"{robot.name} has no posture, so all its joints are at zero or at the nearest limit. "
            f"The legs of {', '.join(singular)} are then singular, for example straight, and "
            f"cannot move their feet in all directions. Pass posture=[…] with bent legs to "
            f"load_urdf: {robot.nq - 7} joint positions."
        )
        warnings.warn(message, RobotWarning, stacklevel=3)


def _find_loader(name: str, known: Mapping[str, Any]) -> Any:
    """Return the entry of a robot in example-robot-data."""
    text = name if isinstance(name, str) else ""
    if "/" in text:
        raise UnknownNameError(
            f"{short_repr(text)} is the name of a file, but names of URDF and MJCF files end in "
            f"{', '.join(_FILE_ENDINGS)}. fb.load also accepts {', '.join(CATALOGUE)}, and the "
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


def _limb_ends(model: pin.Model) -> list[str]:
    """Return the names of the links at the ends of limbs: feet, fingers, heads.

    These links are behind the last joint of a limb and carry no other link.
    """
    frames, parent_joints = model.frames, set(model.parents)
    bodies = [frame for frame in frames if frame.type == pin.FrameType.BODY]
    # the parent of a link is the frame of a joint
    parents = {frames[frames[frame.parentFrame].parentFrame].name for frame in bodies}
    return [
        str(frame.name)
        for frame in bodies
        if frame.name not in parents and frame.parentJoint not in parent_joints
    ]


def _as_feet(requested: Sequence[str | Foot], radius: float | None) -> tuple[Foot, ...]:
    """Return feet, given as frames or `Foot` values, as `Foot` values."""
    if isinstance(requested, str) or not isinstance(requested, Sequence):
        raise InputError(
            f'feet must be a list of frames, as in feet=["FL_foot"], not {short_repr(requested)}.'
        )
    r = 0.0 if radius is None else as_positive("foot_radius", radius, "m", allow_zero=True)
    return tuple(foot if isinstance(foot, Foot) else Foot(foot, r) for foot in requested)
