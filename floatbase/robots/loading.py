"""What can be loaded: the catalogue, and any other robot of example-robot-data once its feet are given."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._arrays import Array, checked, positive, read_only
from floatbase.errors import InputError, UnknownNameError, unknown_name
from floatbase.robots.robot import Foot, Robot, check_turns, torque_limits_of


@dataclass(frozen=True)
class Entry:
    """What the catalogue adds to a robot of example-robot-data: its feet, true torque limits, and what it is for."""

    description: str
    feet: tuple[Foot, ...] = ()
    torque_limit: float | None = None
    joints: Mapping[str, float] = field(default_factory=dict)
    sources: Mapping[str, str] = field(default_factory=dict)


def _balls(frames: Sequence[str], radius: float, centre: Sequence[float] = (0.0, 0.0, 0.0)) -> tuple[Foot, ...]:
    return tuple(Foot(frame, radius, np.array(centre)) for frame in frames)


def _soles(frames: Sequence[str], x: tuple[float, float], y: tuple[float, float]) -> tuple[Foot, ...]:
    corners = np.array([[x[1], y[1], 0.0], [x[1], y[0], 0.0], [x[0], y[0], 0.0], [x[0], y[1], 0.0]])
    return tuple(Foot(frame, corners=corners) for frame in frames)


_SOLO_FEET = ("FL_FOOT", "FR_FOOT", "HL_FOOT", "HR_FOOT")
_SOLO_SOURCES = {
    "foot radius": "half the width of the foot's mesh in example-robot-data",
    "torque limit": "2.7 N·m at 12 A: Grimminger et al., An open torque-controlled modular robot architecture, 2020 "
    "(the URDF says 1000 N·m, which no motor of this size gives)",
}

CATALOGUE: Mapping[str, Entry] = {
    "go2": Entry(
        "quadruped with 3 joints a leg: as many leg torques as contact forces",
        _balls(("FL_foot", "FR_foot", "RL_foot", "RR_foot"), 0.022),
        sources={"foot radius": "the foot's mesh in example-robot-data", "torque limits": "URDF"},
    ),
    "solo12": Entry(
        "small quadruped with 3 joints a leg, weak motors: torque limits are near",
        _balls(_SOLO_FEET, 0.016),
        torque_limit=2.7,
        sources=_SOLO_SOURCES,
    ),
    "solo8": Entry(
        "small quadruped with 2 joints a leg: fewer torques than contact forces",
        _balls(_SOLO_FEET, 0.016),
        torque_limit=2.7,
        sources=_SOLO_SOURCES,
    ),
    "anymal_kinova": Entry(
        "quadruped with an arm: more torques than contact forces",
        _balls(("LF_FOOT", "RF_FOOT", "LH_FOOT", "RH_FOOT"), 0.031, (0.0, 0.0, 0.02325)),
        sources={"foot radius": "URDF collision sphere", "torque limits": "URDF"},
    ),
    "talos": Entry(
        "humanoid with flat feet: each foot carries a wrench through its corners",
        _soles(("left_sole_link", "right_sole_link"), (-0.1, 0.1), (-0.06, 0.06)),
        sources={"sole": "20 cm × 12 cm, within the ankle's collision mesh", "torque limits": "URDF"},
    ),
    "ur5": Entry(
        "arm bolted to the ground: the fixed-base equations (1)",
        joints={"shoulder_lift_joint": -1.3, "elbow_joint": 1.6, "wrist_1_joint": -0.3, "wrist_2_joint": 0.0},
        sources={"torque limits": "URDF"},
    ),
}


def catalogue() -> dict[str, str]:
    """The catalogue: name -> what the robot is for. `load` also takes the other names of example-robot-data."""
    return {name: entry.description for name, entry in CATALOGUE.items()}


def load(
    name: str,
    *,
    feet: Sequence[str | Foot] | None = None,
    foot_radius: float | None = None,
    torque_limits: npt.ArrayLike | None = None,
    posture: npt.ArrayLike | None = None,
) -> Robot:
    """Load a robot by name.

    name: one of `catalogue()`, or any other robot of example-robot-data that has a URDF. feet: frames (or `Foot` values)
    that can touch the ground; by default as the catalogue has them. A floating-base robot outside the catalogue needs
    them. foot_radius: radius of the feet given as frames, m, 0 by default. torque_limits: one number or shape (d,),
    N·m; by default those of the catalogue or the URDF. posture: shape (nq,), a configuration to stand in; by default
    the one that comes with the robot. Raises `UnknownNameError` with the near names, and `InputError` for feet or
    limits that do not fit.
    """
    loader = _loader(name)
    entry = CATALOGUE.get(name)
    model = _model(loader.urdf, loader.free_flyer)
    start = _reference(model, loader, entry)
    return _robot(name, model, loader, entry, start, feet, foot_radius, torque_limits, posture)


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
) -> Robot:
    """Load a robot of your own from a URDF file.

    name: the file's name without its ending by default. floating: whether the root link is free to move. package_dirs: where
    meshes named package://… lie; the file's own folder is always searched. The rest as for `load`; the posture is that of
    all joints at zero by default. Raises `InputError` for a file that is not there or cannot be read, and for planar and
    floating joints inside the robot.
    """
    urdf = Path(path).expanduser().resolve()
    if not urdf.is_file():
        raise InputError(f"there is no file {urdf}; give the path of a URDF file.")
    name = urdf.stem if name is None else name
    dirs = (*(Path(folder) for folder in package_dirs), urdf.parent)
    loader = _Loader(urdf, None, None, floating, False, dirs)
    try:
        model = _model(urdf, floating)
    except (RuntimeError, ValueError) as error:
        raise InputError(f"Pinocchio cannot read {urdf.name} as a URDF: {error}") from None
    for i in range(2 if floating else 1, model.njoints):
        if model.joints[i].nv != 1:
            raise InputError(
                f"joint {model.names[i]!r} of {urdf.name} moves in {model.joints[i].nv} ways; a motor drives one. Make it "
                "revolute, continuous, prismatic or fixed; the base is made free by floating=True."
            )
    return _robot(name, model, loader, None, pin.neutral(model), list(feet), foot_radius, torque_limits, posture)


def _model(urdf: Path, floating: bool) -> pin.Model:
    return pin.buildModelFromUrdf(str(urdf), *([pin.JointModelFreeFlyer()] if floating else []))


def _robot(
    name: str,
    model: pin.Model,
    loader: _Loader,
    entry: Entry | None,
    start: Array,
    feet: Sequence[str | Foot] | None,
    foot_radius: float | None,
    torque_limits: npt.ArrayLike | None,
    posture: npt.ArrayLike | None,
) -> Robot:
    """The robot, after every argument was checked."""
    robot = Robot(
        name=name,
        model=model,
        urdf=loader.urdf,
        package_dirs=loader.package_dirs,
        feet=_feet(name, model, entry, feet, foot_radius, loader.free_flyer),
        torque_limits=_torque_limits(model, loader.free_flyer, entry, torque_limits),
        posture=start if posture is None else _checked_posture(model, posture),
        description=entry.description if entry else "",
        sources=entry.sources if entry else {},
    )
    for foot in robot.feet:
        robot.frame_id(foot.frame)
    return robot


@dataclass(frozen=True)
class _Loader:
    """Where a robot's files are, and what is said in them."""

    urdf: Path
    srdf: Path | None
    reference: str | None
    free_flyer: bool
    rotors: bool
    package_dirs: tuple[Path, ...]


def _loader(name: str) -> _Loader:
    """A robot of example-robot-data."""
    import example_robot_data as data

    known = data.robots_loader.ROBOTS
    if str(name).endswith((".urdf", ".xml", ".xacro")) or "/" in str(name):
        raise UnknownNameError(
            f"{str(name)!r} is no robot's name but a file's; fb.load_urdf({str(name)!r}, feet=[…]) loads a URDF of your own. "
            f"Names that fb.load knows: {', '.join(CATALOGUE)}, and the others of example-robot-data."
        )
    if name not in known:
        raise unknown_name("robot", name, known, "fb.catalogue() says what the catalogue's robots are for.")
    loader: Any = known[name]
    if not loader.urdf_filename:
        raise InputError(f"{name} comes as an SDF file; floatbase reads URDF. Choose one of {', '.join(CATALOGUE)}.")
    urdf = f"{loader.path}/{loader.urdf_subpath}/{loader.urdf_filename}"
    root = Path(data.getModelPath(urdf)).resolve()
    srdf = root / loader.path / loader.srdf_subpath / loader.srdf_filename if loader.srdf_filename else None
    dirs = (root.parent.parent, root)
    return _Loader(root / urdf, srdf, loader.ref_posture, loader.free_flyer, loader.has_rotor_parameters, dirs)


def _reference(model: pin.Model, loader: _Loader, entry: Entry | None) -> Array:
    """The SRDF's reference configuration with the catalogue's joint angles on top; loads rotor inertia too."""
    q = pin.neutral(model)
    if loader.srdf is not None:
        if loader.rotors:
            pin.loadRotorParameters(model, str(loader.srdf), False)
            model.armature = model.rotorInertia * model.rotorGearRatio**2
        pin.loadReferenceConfigurations(model, str(loader.srdf), False)
        references = {entry.key(): entry.data() for entry in model.referenceConfigurations}
        q = np.array(references.get(loader.reference, q))
    for joint, angle in (entry.joints if entry else {}).items():
        q[model.idx_qs[model.getJointId(joint)]] = angle
    return read_only(pin.normalize(model, q))


def _checked_posture(model: pin.Model, asked: npt.ArrayLike) -> Array:
    q = checked("posture", asked, (model.nq,))
    check_turns(model, "posture", q)
    return q


def _torque_limits(model: pin.Model, free_flyer: bool, entry: Entry | None, asked: npt.ArrayLike | None) -> Array:
    d = model.nv - (6 if free_flyer else 0)
    if asked is not None:
        return torque_limits_of(d, asked)
    if entry is not None and entry.torque_limit is not None:
        return read_only(np.full(d, entry.torque_limit))
    effort = np.array(model.effortLimit)[model.nv - d :]
    return read_only(np.where(effort > 0, effort, np.inf))  # URDF writers put 0 where they do not know


def limb_ends(model: pin.Model) -> tuple[str, ...]:
    """Names of the links that carry no other link, behind the last joint of a limb: feet, fingers, heads."""
    inner = set(model.parents)
    bodies = {i for i, frame in enumerate(model.frames) if frame.type == pin.FrameType.BODY}
    above: set[int] = set()
    for i in bodies:
        while i:
            i = int(model.frames[i].parentFrame)
            above.add(i)
    return tuple(str(model.frames[i].name) for i in sorted(bodies - above) if model.frames[i].parentJoint not in inner)


def _feet(
    name: str, model: pin.Model, entry: Entry | None, asked: Sequence[str | Foot] | None, radius: float | None, free_flyer: bool
) -> tuple[Foot, ...]:
    if asked is None:
        if radius is not None:
            raise InputError("foot_radius goes with feet=[…]: the catalogue's feet have their own radius.")
        if entry is None and free_flyer:
            raise InputError(
                f"{name} is not in the catalogue ({', '.join(CATALOGUE)}), so its feet must be given: "
                f'fb.load("{name}", feet=["name of a foot frame", …], foot_radius=0.02). '
                f"Its limbs end with {', '.join(limb_ends(model))}."
            )
        return entry.feet if entry else ()
    if isinstance(asked, str):
        raise InputError(f'feet must be a list of frames, as in feet=["{asked}"].')
    r = 0.0 if radius is None else positive("foot_radius", radius, "m", allow_zero=True)
    return tuple(foot if isinstance(foot, Foot) else Foot(foot, r) for foot in asked)
