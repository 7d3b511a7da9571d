"""Loading robots: the catalogue, other robots of example-robot-data, your own URDFs and MJCFs.

The feet of robots outside the catalogue are found from the shapes of their links.
"""

from __future__ import annotations

import os
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Mapping, Sequence
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._validation import Array, as_bool, as_string, as_strings, short_repr
from floatbase.errors import (
    InputError,
    RobotWarning,
    UnknownNameError,
    check_arguments,
    unknown_name,
    warn,
)
from floatbase.robots._checks import as_posture, clamp_to_limits, has_floating_base, with_angles
from floatbase.robots.catalogue_data import CATALOGUE, CatalogueEntry
from floatbase.robots.couplings import lock_coupled_joints, read_couplings, with_followers_placed
from floatbase.robots.feet import as_feet, with_bent_legs, with_foot_links
from floatbase.robots.plausibility import missing_meshes_message, passive_joints_message, problems
from floatbase.robots.robot import Foot, Robot
from floatbase.robots.urdf import (
    check_model,
    normalize_urdf,
    parse_urdf,
    read_text,
    with_locked_joints,
)

_FILE_ENDINGS = (".urdf", ".xml", ".mjcf")
# characters that may precede a URDF text: an XML declaration must be at the very beginning
_WHITESPACE = "\ufeff \t\r\n"


def catalogue() -> dict[str, str]:
    """List the robots in the catalogue.

    Returns
    -------
    dict of str to str
        Name and purpose of each robot. `load` also accepts the other names of example-robot-data.
    """
    return {name: entry.description for name, entry in CATALOGUE.items()}


def load(
    name: str | Path,
    /,
    *,
    feet: Sequence[str | Foot] | None = None,
    foot_radius: float | None = None,
    torque_limits: npt.ArrayLike | None = None,
    posture: npt.ArrayLike | Mapping[str, float] | None = None,
    locked: Sequence[str] = (),
    **file_options: Any,
) -> Robot:
    """Load a robot by name, or from a file.

    Parameters
    ----------
    name : str or Path
        One of `catalogue()`, any other robot of example-robot-data that has a URDF, or the path of
        a file, which `load_urdf` or `load_mjcf` loads.
    feet : sequence of str or Foot, optional
        Frames or `Foot` values that can touch the ground; by default those from the catalogue, or
        the lowest ends of the limbs of a floating-base robot outside the catalogue.
    foot_radius : float, optional
        Radius of the feet that are given as frames [m]; by default each is the ball, the sole or
        the wheel that its collision shapes form, or a point if it has none.
    torque_limits : float or array_like, shape (d,), optional
        Torque limits [N·m]; by default those from the catalogue or the URDF.
    posture : array_like, shape (nq,) or (nq - 7,), or mapping of str to float, optional
        Standing configuration of the robot before joints are locked, or its joints alone. By
        default the one that comes with the robot, with its joints brought within their limits. A
        mapping changes joints of that posture [rad or m]; an asterisk in a name stands for any
        characters, as in ``{"*_knee": 0.6}``.
    locked : sequence of str, optional
        Names of joints to fix at their positions in the posture. Fixed joints have no entry in q, v
        and τ.
    **file_options
        Other arguments of `load_urdf` or `load_mjcf`, if `name` is a path.

    Returns
    -------
    Robot
        The robot.

    Raises
    ------
    UnknownNameError
        If there is no robot, frame or joint with a given name; the message lists similar names.
    InputError
        If the feet, limits or posture do not fit the robot, if coupled joints follow each other, or
        if the robot's inertia matrix M is singular.

    Warns
    -----
    RobotWarning
        If the robot probably cannot stand: legs that remain straight without a posture, one or two
        feet that are points, motors that are too weak, a base that is upside down, or lengths that
        are not in metres. Also if joints are coupled: a joint that follows another joint by
        <mimic>, and its leader, are locked in the posture.

    Notes
    -----
    In the posture, the positions of followers are those that their leaders require. If `locked`
    names all followers of a leader, the leader itself remains free. Its followers are then locked,
    unlike those of the real robot.

    Examples
    --------
    >>> fb.load("go2").d
    12
    """
    import example_robot_data as data

    name = str(name) if isinstance(name, Path) else name
    load_file = _file_loader(name)
    function = load_file or load
    known = signature(function).parameters.keys() - {"path", "file_options"}
    known = known if load_file else known - {"name"}
    check_arguments(function.__name__, file_options, known)
    if load_file is not None:
        return load_file(
            name,
            feet=feet,
            foot_radius=foot_radius,
            torque_limits=torque_limits,
            posture=posture,
            locked=locked,
            **file_options,
        )
    loader = _find_loader(name, data.robots_loader.ROBOTS)
    entry = CATALOGUE.get(name, CatalogueEntry(""))
    path = f"{loader.path}/{loader.urdf_subpath}/{loader.urdf_filename}"
    root = Path(data.getModelPath(path)).resolve()
    urdf = normalize_urdf(name, read_text(root / path), loader.free_flyer)
    model = parse_urdf(name, urdf, loader.free_flyer)
    # also if a posture is given, since it reads the rotor inertias
    start = _reference_posture(model, loader, root, entry)
    if loader.__init__ is not data.robots_loader.RobotLoader.__init__:
        start = _posture_of_modified_robot(name, loader, model)
    return _make_robot(
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


def _file_loader(path: str) -> Callable[..., Robot] | None:
    """Return the function that loads a file of this name and content; None for a robot's name."""
    endings = *_FILE_ENDINGS, ".xacro", ".sdf"  # of these, load_urdf says what to run first
    if not isinstance(path, str) or not path.lower().endswith(endings):
        return None
    text = read_text(Path(os.path.expanduser(path)))
    try:
        tag = ElementTree.fromstring(text).tag
    except ElementTree.ParseError:  # the function that loads the file describes the error
        tag = "mujoco" if "<mujoco" in text and "<robot" not in text else ""
    return load_mjcf if tag == "mujoco" else load_urdf


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
        Whether the base can move freely. The base is then the first link with mass: links without
        mass below it, such as "world", are removed, together with a floating joint.
    package_dirs : sequence of str or Path, optional
        Folders that contain meshes named package://…; the folder of the file and all folders above
        these are always searched.
    feet : sequence of str or Foot, optional
        Frames or `Foot` values that can touch the ground; by default the lowest ends of the limbs,
        or none if the base is fixed. A ball away from the origin of its link, as at the end of a
        calf, is a foot of its own with a name such as "calf foot".
    foot_radius : float, optional
        Radius of the feet that are given as frames [m]; by default each is the ball, the sole or
        the wheel that its collision shapes form, or a point if it has none.
    torque_limits : float or array_like, shape (d,), optional
        Torque limits [N·m]; by default those of the URDF.
    posture : array_like, shape (nq,) or (nq - 7,), or mapping of str to float, optional
        Standing configuration of the robot before joints are locked, or its joints alone. A mapping
        holds some joints [rad or m]; an asterisk in a name stands for any characters, as in
        ``{"*_knee": 0.6}``, and later entries take precedence. Other joints are at zero, or at the
        limit nearest to zero. By default all joints are, except that legs which would be straight
        are bent.
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
        If the robot probably cannot stand: legs that remain straight without a posture, one or two
        feet that are points, motors that are too weak, a base that is upside down, or lengths that
        are not in metres. Also if joints are coupled, as in `load`, if mesh files are missing, if
        only some joints have a torque limit, or if the URDF has settings for MuJoCo, which are
        ignored.

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
        # not file.exists(), which raises for a name that is too long
        if urdf in CATALOGUE and not os.path.exists(file):
            raise InputError(
                f"There is no file {urdf}, but there is a robot with this name. Load it with "
                f'fb.load("{urdf}").'
            )
        urdf, directories = read_text(file), (*directories, file.resolve().parent)
    urdf = normalize_urdf(name, urdf, floating)
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
        choose_posture=posture is None,
    )
    if torque_limits is None:
        _warn(passive_joints_message(robot))
    if directories:
        _warn(missing_meshes_message(robot))
    return robot


def load_mjcf(
    path: str | Path,
    *,
    name: str | None = None,
    floating: bool | None = None,
    feet: Sequence[str | Foot] | None = None,
    foot_radius: float | None = None,
    torque_limits: npt.ArrayLike | None = None,
    posture: npt.ArrayLike | Mapping[str, float] | str | None = None,
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
        True, a free joint replaces the joints between the base and the world. With False, the base
        is welded to the world where it is initially.
    feet : sequence of str or Foot, optional
        Bodies, sites, geoms or `Foot` values that can touch the ground; by default as in
        `load_urdf`.
    foot_radius : float, optional
        Radius of the feet that are given as names [m]; by default as in `load_urdf`.
    torque_limits : float or array_like, shape (d,), optional
        Torque limits [N·m]; by default what the actuators and joints of the file allow.
    posture : str, array_like, shape (nq,) or (nq - 7,), or mapping of str to float, optional
        Standing configuration of the robot before joints are locked: the name of a keyframe, or
        positions as in `load_urdf`, where a mapping changes the default. This is the first
        keyframe, with joints brought within their limits. In a file without keyframes it is the
        initial configuration, with bent legs as in `load_urdf`.
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
        constraints and other free bodies, or for the same reasons as in `load_urdf`. A linear
        equality constraint between two joints couples them like <mimic> in a URDF.
    """
    from floatbase.robots.mjcf import read_mjcf  # imports MuJoCo

    path = as_string("path", str(path) if isinstance(path, Path) else path)
    file = Path(os.path.expanduser(path))
    if floating is not None:
        as_bool("floating", floating)
    name = file.stem if name is None else as_string("name", name)
    keyframe = posture if isinstance(posture, str) else None
    mjcf = read_mjcf(name, file, floating, keyframe)
    if mjcf.differences:
        _warn(f"{name} is loaded from its MJCF {', '.join(mjcf.differences)}.")
    return _make_robot(
        name,
        mjcf.urdf,
        mjcf.model,
        with_angles(name, mjcf.model, mjcf.posture, None if keyframe else posture),
        locked,
        torque_limits,
        feet,
        foot_radius,
        package_dirs=(file.resolve().parent,),
        choose_posture=posture is None,
        bend_legs=not mjcf.has_keyframes,
    )


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
    feet: Sequence[str | Foot] | None,
    foot_radius: float | None,
    known_feet: tuple[Foot, ...] | None = None,
    *,
    package_dirs: tuple[Path, ...],
    choose_posture: bool = False,
    bend_legs: bool = True,
    **fields: Any,
) -> Robot:
    """Build a robot from a URDF text and its model, and warn about it.

    If the posture is not the user's choice, legs that would be straight are bent or warned about.
    """
    locked, floating = as_strings("locked", locked), has_floating_base(model)
    joints = list(model.names)[2 if floating else 1 :]
    for joint in locked:
        if joint not in joints:
            raise unknown_name(
                f"joint of {name}", joint, joints, "Joints that are already fixed need no lock."
            )
    couplings = read_couplings(urdf)
    if locked or couplings:
        full_model, q = model, as_posture(name, model, posture)
        q = with_followers_placed(name, model, q, couplings)
        locked = (*locked, *lock_coupled_joints(name, joints, couplings, locked))
        urdf = with_locked_joints(urdf, full_model, q, locked)
        model = parse_urdf(name, urdf, floating)
        kept_joints = [
            full_model.joints[full_model.getJointId(joint)] for joint in list(model.names)[1:]
        ]
        positions = (q[joint.idx_q :][: joint.nq] for joint in kept_joints)
        armatures = (full_model.armature[joint.idx_v :][: joint.nv] for joint in kept_joints)
        posture = np.concatenate([[], *positions])  # none if all joints of an arm are locked
        model.armature = np.concatenate([[], *armatures])
    check_model(name, model)
    if torque_limits is None:
        effort = np.array(model.effortLimit)[6 if floating else 0 :]
        torque_limits = np.where(effort > 0, effort, np.inf)  # 0 means unknown
    posture = as_posture(name, model, posture)
    found = as_feet(feet, foot_radius, model, urdf, package_dirs, posture, known_feet)
    if known_feet is None:
        urdf, found = with_foot_links(model, urdf, found)
    robot = Robot(name, model, urdf, package_dirs, found, torque_limits, posture, **fields)  # type: ignore[arg-type]  # it checks
    if choose_posture and bend_legs:
        robot = with_bent_legs(robot)
    for message in problems(robot, feet or (), choose_posture):
        _warn(message)
    return robot


def _warn(message: str) -> None:
    """Warn about a robot, unless the message is empty."""
    if message:
        warn(message, RobotWarning)


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
            "robot", name, known, "fb.catalogue() describes the robots in the catalogue."
        )
    if not known[name].urdf_filename:
        raise InputError(
            f"{name} is an SDF file, but floatbase reads only URDF. Choose one of "
            f"{', '.join(CATALOGUE)}."
        )
    return known[name]


def _reference_posture(model: pin.Model, loader: Any, root: Path, entry: CatalogueEntry) -> Array:
    """Return the reference posture of the SRDF with the joint angles from the catalogue.

    The rotor inertias of the SRDF are stored in the model.
    """
    q = pin.neutral(model)
    if loader.srdf_filename:
        srdf = str(root / loader.path / loader.srdf_subpath / loader.srdf_filename)
        read = model.copy()  # so that the URDF and the rotor inertias are all that a robot is
        if loader.has_rotor_parameters:
            pin.loadRotorParameters(read, srdf, False)
            model.armature = read.rotorInertia * read.rotorGearRatio**2
        pin.loadReferenceConfigurations(read, srdf, False)
        postures = {found.key(): found.data() for found in read.referenceConfigurations}
        q = np.array(postures.get(loader.ref_posture, q))
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
