"""Robots from files: the catalogue, any other robot of example-robot-data once its feet are given, and URDFs of one's own."""

from __future__ import annotations

import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._arrays import Array, positive, read_only
from floatbase.errors import InputError, UnknownNameError, unknown_name
from floatbase.robots.entries import CATALOGUE, Entry
from floatbase.robots.robot import Foot, Robot, torque_limits_of

PLATE = (0.4, 0.03)  # width and thickness, m, of the plate on which `unbolted` lets a robot stand
_FLIGHT_HEIGHT = 1.0  # m: where a robot without bolts and plate floats


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

    name: one of `catalogue()`, or any other robot of example-robot-data that has a URDF.
    feet: frames (or `Foot` values) that can touch the ground; by default as the catalogue has them. A floating-base robot
        outside the catalogue needs them.
    foot_radius: radius of the feet given as frames, m, 0 by default.
    torque_limits: one number or shape (d,), N·m; by default those of the catalogue or the URDF.
    posture: shape (nq,), a configuration to stand in; by default the one that comes with the robot.

    Raises `UnknownNameError` with the near names, and `InputError` for feet or limits that do not fit.
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

    path: of the URDF file.
    name: the file's name without its ending by default.
    floating: whether the root link is free to move.
    package_dirs: where meshes named package://… lie; the file's own folder is always searched.
    feet, foot_radius, torque_limits, posture: as for `load`; the posture is that of all joints at zero by default.

    Raises `InputError` for a file that is not there or cannot be read, and for planar and floating joints inside the robot.
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


def unbolted(robot: Robot, plate: bool = False) -> Robot:
    """A fixed-base robot with its base free to move: the links and joints of its URDF are the same, the bolts are gone.

    Bolts are the link "world", which some URDFs have below the base, and the joints that hang from it.

    robot: with a fixed base, such as ur5.
    plate: let it stand on a square plate that has no weight (`PLATE`); else it touches nothing and floats 1 m up.
    """
    if robot.is_floating:
        raise InputError(f"{robot.name} has no bolts; unbolted takes a robot with a fixed base, such as ur5.")
    tree = ElementTree.parse(robot.urdf).getroot()
    for element in [*tree.findall("link[@name='world']"), *tree.findall("joint/parent[@link='world']/..")]:
        tree.remove(element)
    urdf = Path(tempfile.mkdtemp(dir=_scratch().name)) / f"{robot.name}.urdf"
    urdf.write_text(ElementTree.tostring(tree, encoding="unicode"), encoding="utf-8")
    half, thick = 0.5 * PLATE[0], PLATE[1]
    corners = np.array([[x, y, -thick] for x, y in ((half, half), (half, -half), (-half, -half), (-half, half))])
    loose = load_urdf(urdf, name=robot.name, package_dirs=robot.package_dirs, torque_limits=robot.torque_limits)
    return replace(
        loose,
        feet=(Foot(loose.base, corners=corners),) if plate else (),
        posture=read_only([0.0, 0.0, thick if plate else _FLIGHT_HEIGHT, 0.0, 0.0, 0.0, 1.0, *robot.posture]),
    )


@cache
def _scratch() -> tempfile.TemporaryDirectory[str]:
    """A folder that goes when Python ends."""
    return tempfile.TemporaryDirectory(prefix="floatbase-")


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
        posture=start if posture is None else posture,  # type: ignore[arg-type]  # Robot checks it
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


def _torque_limits(model: pin.Model, free_flyer: bool, entry: Entry | None, requested: npt.ArrayLike | None) -> Array:
    d = model.nv - (6 if free_flyer else 0)
    if requested is not None:
        return torque_limits_of(d, requested)
    if entry is not None and entry.torque_limit is not None:
        return read_only(np.full(d, entry.torque_limit))
    effort = np.array(model.effortLimit)[model.nv - d :]
    return read_only(np.where(effort > 0, effort, np.inf))  # URDF writers put 0 where they do not know


def _limb_ends(model: pin.Model) -> tuple[str, ...]:
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
    name: str,
    model: pin.Model,
    entry: Entry | None,
    requested: Sequence[str | Foot] | None,
    radius: float | None,
    free_flyer: bool,
) -> tuple[Foot, ...]:
    if requested is None:
        if radius is not None:
            raise InputError("foot_radius goes with feet=[…]: the catalogue's feet have their own radius.")
        if entry is None and free_flyer:
            raise InputError(
                f"{name} is not in the catalogue ({', '.join(CATALOGUE)}), so its feet must be given: "
                f'fb.load("{name}", feet=["name of a foot frame", …], foot_radius=0.02). '
                f"Its limbs end with {', '.join(_limb_ends(model))}."
            )
        return entry.feet if entry else ()
    if isinstance(requested, str):
        raise InputError(f'feet must be a list of frames, as in feet=["{requested}"].')
    r = 0.0 if radius is None else positive("foot_radius", radius, "m", allow_zero=True)
    return tuple(foot if isinstance(foot, Foot) else Foot(foot, r) for foot in requested)
