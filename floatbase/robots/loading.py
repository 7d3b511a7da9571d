"""Robots from files: the catalogue, any other robot of example-robot-data once its feet are given, and URDFs of one's own."""

from __future__ import annotations

import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._arrays import Array, flag, of_kind, positive, read_only, said, text, texts
from floatbase.errors import InputError, UnknownNameError, unknown_name
from floatbase.robots.entries import CATALOGUE, Entry
from floatbase.robots.robot import Foot, Robot

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
    import example_robot_data as data

    loader, entry = _loader(name, data.robots_loader.ROBOTS), CATALOGUE.get(name, Entry(""))
    urdf = f"{loader.path}/{loader.urdf_subpath}/{loader.urdf_filename}"
    root = Path(data.getModelPath(urdf)).resolve()
    model = _model(root / urdf, loader.free_flyer)
    srdf = root / loader.path / loader.srdf_subpath / loader.srdf_filename if loader.srdf_filename else None
    start = _reference(model, loader, srdf, entry)  # also where a posture is given: it reads the inertia of rotors
    if feet is None:
        if foot_radius is not None:
            raise InputError("foot_radius goes with feet=[…]: the catalogue's feet have their own radius.")
        if name not in CATALOGUE and loader.free_flyer:
            raise InputError(
                f"{name} is not in the catalogue ({', '.join(CATALOGUE)}), so its feet must be given: "
                f'fb.load("{name}", feet=["name of a foot frame", …], foot_radius=0.02). '
                f"Its limbs end with {', '.join(_limb_ends(model))}."
            )
    return Robot(
        name=name,
        model=model,
        urdf=root / urdf,
        package_dirs=(root.parent.parent, root),
        feet=entry.feet if feet is None else _feet(feet, foot_radius),
        torque_limits=_torque_limits(model, loader.free_flyer, entry.torque_limit if torque_limits is None else torque_limits),
        posture=start if posture is None else posture,  # type: ignore[arg-type]  # Robot checks it
        description=entry.description,
        sources=entry.sources,
    )


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
    urdf = Path(text("path", str(path) if isinstance(path, Path) else path)).expanduser().resolve()
    listed = isinstance(package_dirs, list | tuple)
    plain = [str(folder) if isinstance(folder, Path) else folder for folder in package_dirs] if listed else package_dirs
    folders = texts("package_dirs", plain)
    flag("floating", floating)
    if not urdf.is_file():
        raise InputError(f"there is no file {urdf}; give the path of a URDF file.")
    try:
        model = _model(urdf, floating)
    except (RuntimeError, ValueError) as error:
        raise InputError(f"Pinocchio cannot read {urdf.name} as a URDF: {error}") from None
    for joint in list(model.joints)[2 if floating else 1 :]:
        if joint.nv != 1:
            raise InputError(
                f"joint {model.names[joint.id]!r} of {urdf.name} moves in {joint.nv} ways; a motor drives one. Make it "
                "revolute, continuous, prismatic or fixed; the base is made free by floating=True."
            )
    return Robot(
        name=urdf.stem if name is None else text("name", name),
        model=model,
        urdf=urdf,
        package_dirs=(*map(Path, folders), urdf.parent),
        feet=_feet(feet, foot_radius),
        torque_limits=_torque_limits(model, floating, torque_limits),
        posture=pin.neutral(model) if posture is None else posture,  # type: ignore[arg-type]  # Robot checks it
    )


def unbolted(robot: Robot, plate: bool = False) -> Robot:
    """A fixed-base robot with its base free to move: the links and joints of its URDF are the same, the bolts are gone.

    Bolts are the link "world", which some URDFs have below the base, and the joints that hang from it.

    robot: with a fixed base, such as ur5.
    plate: let it stand on a square plate that has no weight (`PLATE`); else it touches nothing and floats 1 m up.
    """
    flag("plate", plate)
    if of_kind("robot", robot, Robot, 'fb.load("ur5")').is_floating:
        raise InputError(f"{robot.name} has no bolts; unbolted takes a robot with a fixed base, such as ur5.")
    tree = ElementTree.parse(robot.urdf).getroot()
    for element in [*tree.findall("link[@name='world']"), *tree.findall("joint/parent[@link='world']/..")]:
        tree.remove(element)
    urdf = Path(tempfile.mkdtemp(dir=_scratch().name)) / f"{robot.name}.urdf"
    urdf.write_text(ElementTree.tostring(tree, encoding="unicode"), encoding="utf-8")
    width, thick = PLATE
    corners = np.array([[x * width, y * width, -thick] for x, y in ((0.5, 0.5), (0.5, -0.5), (-0.5, -0.5), (-0.5, 0.5))])
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


def _loader(name: str, known: Mapping[str, Any]) -> Any:
    """What example-robot-data says about a robot."""
    if str(name).endswith((".urdf", ".xml", ".xacro")) or "/" in str(name):
        raise UnknownNameError(
            f"{str(name)!r} is no robot's name but a file's; fb.load_urdf({str(name)!r}, feet=[…]) loads a URDF of your own. "
            f"Names that fb.load knows: {', '.join(CATALOGUE)}, and the others of example-robot-data."
        )
    if not isinstance(name, str) or name not in known:
        raise unknown_name("robot", name, known, "fb.catalogue() says what the catalogue's robots are for.")
    if not known[name].urdf_filename:
        raise InputError(f"{name} comes as an SDF file; floatbase reads URDF. Choose one of {', '.join(CATALOGUE)}.")
    return known[name]


def _reference(model: pin.Model, loader: Any, srdf: Path | None, entry: Entry) -> Array:
    """The SRDF's reference configuration with the catalogue's joint angles on top; loads rotor inertia too."""
    q = pin.neutral(model)
    if srdf is not None:
        if loader.has_rotor_parameters:
            pin.loadRotorParameters(model, str(srdf), False)
            model.armature = model.rotorInertia * model.rotorGearRatio**2
        pin.loadReferenceConfigurations(model, str(srdf), False)
        q = np.array({found.key(): found.data() for found in model.referenceConfigurations}.get(loader.ref_posture, q))
    for joint, angle in entry.joints.items():
        q[model.idx_qs[model.getJointId(joint)]] = angle
    return read_only(pin.normalize(model, q))


def _torque_limits(model: pin.Model, floating: bool, requested: npt.ArrayLike | None) -> Any:
    """Requested limits, which Robot checks, or those of the URDF's joints, where 0 stands for unknown."""
    effort = np.array(model.effortLimit)[6 if floating else 0 :]
    return np.where(effort > 0, effort, np.inf) if requested is None else requested


def _limb_ends(model: pin.Model) -> list[str]:
    """Names of the links that carry no other link, behind the last joint of a limb: feet, fingers, heads."""
    frames, inner = model.frames, set(model.parents)
    bodies = [frame for frame in frames if frame.type == pin.FrameType.BODY]
    carrying = {frames[frames[frame.parentFrame].parentFrame].name for frame in bodies}  # a link hangs from a joint's frame
    return [str(frame.name) for frame in bodies if frame.name not in carrying and frame.parentJoint not in inner]


def _feet(requested: Sequence[str | Foot], radius: float | None) -> tuple[Foot, ...]:
    """Feet of frames and `Foot` values."""
    if isinstance(requested, str) or not isinstance(requested, Sequence):
        raise InputError(f'feet must be a list of frames, as in feet=["FL_foot"], not {said(requested)}.')
    r = 0.0 if radius is None else positive("foot_radius", radius, "m", allow_zero=True)
    return tuple(foot if isinstance(foot, Foot) else Foot(foot, r) for foot in requested)
