"""URDF text: reading, checking, locking joints and removing the world link."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Collection
from pathlib import Path

import pinocchio as pin

from floatbase._files import read_file
from floatbase._validation import Array
from floatbase.errors import InputError
from floatbase.robots._checks import has_floating_base

_INERTIA_ATTRIBUTES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_LIMITED_JOINT_TYPES = ("revolute", "prismatic")  # joint types that need a <limit>
# kg m²: some programs write -5e-20 for an inertia of 0, and every real part of a robot has more
_ROUNDING = 1e-12


def read_text(path: Path) -> str:
    """Read the text of a URDF or MJCF file."""
    try:
        # a comment in another encoding does not change the robot
        return read_file(path).decode("utf-8-sig", errors="replace")
    except (OSError, ValueError) as error:  # ValueError: the name contains a zero byte
        reason = getattr(error, "strerror", None) or error
        raise InputError(
            f"The file {path.absolute()} cannot be read ({reason}). Give the path of a URDF or "
            f"MJCF file."
        ) from None


def parse_urdf(name: str, urdf: str, floating: bool) -> pin.Model:
    """Build the Pinocchio model of a URDF text, with a root joint if the base is floating."""
    try:
        ElementTree.fromstring(urdf)
        return pin.buildModelFromXML(urdf, *([pin.JointModelFreeFlyer()] if floating else []))
    except (ElementTree.ParseError, RuntimeError, ValueError) as error:
        raise InputError(f"{name} is not a valid URDF: {_parse_error(urdf, error)}") from None


def _parse_error(urdf: str, error: Exception) -> str:
    """Return why text is not a URDF; Pinocchio prints the reason instead of raising it."""
    if "xacro:" in urdf:
        return (
            f"{str(error).rstrip('.')}. The file is written in xacro. Run xacro first, as in "
            f"`xacro robot.xacro > robot.urdf`."
        )
    if isinstance(error, ElementTree.ParseError):
        return str(error)
    root = ElementTree.fromstring(urdf)
    if root.tag != "robot":
        advice = " Load it with fb.load_mjcf." if root.tag == "mujoco" else ""
        return f"its outermost element is <{root.tag}>, but it must be <robot>.{advice}"
    for kind in ("link", "joint"):
        for duplicate, count in Counter(
            element.get("name") for element in root.findall(kind)
        ).items():
            if count > 1:
                return f"{count} {kind}s have the name {duplicate!r}. Names must be unique."
    for joint in root.findall("joint"):
        if joint.get("type") in _LIMITED_JOINT_TYPES and joint.find("limit") is None:
            return (
                f"{joint.get('type')} joint {joint.get('name')!r} has no <limit>. Add one with "
                f"lower, upper, effort and velocity."
            )
    return str(error)


def check_urdf(name: str, urdf: str, model: pin.Model) -> None:
    """Raise `InputError` for content that Pinocchio accepts but eqs. (1)-(7) cannot represent."""
    root = ElementTree.fromstring(urdf)
    for check in _CHECKS:
        check(name, root, model)


def _check_inertials(name: str, root: ElementTree.Element, model: pin.Model) -> None:
    """Check that masses and inertias are numbers, and that no mass is negative."""
    for link in root.findall("link"):
        for inertial in link.findall("inertial"):
            mass, tensor = inertial.find("mass"), inertial.find("inertia")
            values = {"mass": mass.get("value") if mass is not None else None}
            values |= {
                entry: tensor.get(entry) if tensor is not None else None
                for entry in _INERTIA_ATTRIBUTES
            }
            invalid = [
                f"{key} {text}"
                for key, text in values.items()
                if not math.isfinite(_as_float(text))
            ]
            invalid += [f"mass {values['mass']}"] if _as_float(values["mass"]) < 0.0 else []
            if invalid:
                raise InputError(
                    f"<inertial> of link {link.get('name')!r} of {name} has {invalid[0]}. It needs "
                    f"a mass ≥ 0 [kg] and six numbers ixx … izz [kg m²]."
                )


def _check_limits_and_axes(name: str, root: ElementTree.Element, model: pin.Model) -> None:
    """Check that no lower limit is above its upper limit, and that axes are not zero."""
    for joint in _movable_joints(root):
        label, limit, axis = joint.get("name"), joint.find("limit"), joint.find("axis")
        lower, upper = (
            _as_float(limit.get(end, "0")) if limit is not None else 0.0
            for end in ("lower", "upper")
        )
        if joint.get("type") in _LIMITED_JOINT_TYPES and lower > upper:
            raise InputError(
                f"The lower limit {lower:g} of joint {label!r} of {name} is above the upper limit "
                f"{upper:g} (rad or m; a missing limit is 0). Swap lower and upper in <limit>, or "
                f"make the joint continuous if it has no limits."
            )
        if axis is not None and not any(map(_as_float, axis.get("xyz", "1").split())):
            raise InputError(
                f"The <axis> of joint {label!r} of {name} is zero. Give a direction, as in "
                f'xyz="0 0 1".'
            )


def _check_moments_of_inertia(name: str, root: ElementTree.Element, model: pin.Model) -> None:
    """Check that no link, including everything welded to it, has a negative moment of inertia."""
    # Pinocchio's inertias are sums, which may be positive although a part is negative
    for i, inertia in list(enumerate(model.inertias))[1:]:
        smallest = float(inertia.inertia.diagonal().min())
        if smallest < -_ROUNDING:
            where = (
                "The base"
                if model.names[i] == "root_joint"
                else f"The link moved by joint {model.names[i]!r}"
            )
            raise InputError(
                f"{where} of {name}, with everything welded to it, has a negative moment of "
                f"inertia, {smallest:.4g} kg m². Make ixx, iyy and izz of <inertia> positive."
            )


def _check_reserved_names(name: str, root: ElementTree.Element, model: pin.Model) -> None:
    """Check that the names "base" and "root_joint" are used for the base only."""
    base_frame = next((frame for frame in model.frames if frame.name == "base"), None)
    if base_frame is not None and base_frame.parentJoint != int(has_floating_base(model)):
        raise InputError(
            f"A moving {'link' if base_frame.type == pin.BODY else 'joint'} of {name} has the name "
            f"base, which is reserved for the root link of every robot. Rename it."
        )
    if list(model.names).count("root_joint") > 1:
        raise InputError(
            f"A joint of {name} has the name root_joint, which Pinocchio uses for the joint of a "
            f"floating base. Rename it."
        )


def _check_joint_types(name: str, root: ElementTree.Element, model: pin.Model) -> None:
    """Check that every joint has one degree of freedom."""
    names = [joint.get("name", "") for joint in _movable_joints(root)]
    for joint in model.joints:
        if joint.nv > 1 and model.names[joint.id] in names:
            raise InputError(
                f"Joint {model.names[joint.id]!r} of {name} has {joint.nv} degrees of freedom, but "
                f"a motor drives only one. Make it revolute, continuous, prismatic or fixed. To "
                f"free the base, use floating=True."
            )


def _check_couplings(name: str, root: ElementTree.Element, model: pin.Model) -> None:
    """Check that no joint mimics another joint."""
    names = [joint.get("name", "") for joint in _movable_joints(root)]
    masters = {
        joint.get("name", ""): mimic.get("joint", "")
        for joint in _movable_joints(root)
        for mimic in joint.findall("mimic")
    }
    if masters:
        pairs = ", ".join(
            [f"{joint} mimics {master}" for joint, master in masters.items()][:2]
            + ["…"] * (len(masters) > 2)
        )
        coupled = [joint for joint in names if joint in masters or joint in masters.values()]
        raise InputError(
            f"Joints of {name} are coupled: {pairs}. Eqs. (1)-(7) need a separate motor for every "
            f"joint. Lock these joints with locked={coupled}, or remove <mimic> from the URDF if "
            f"they do have separate motors."
        )


_CHECKS = (
    _check_inertials,
    _check_limits_and_axes,
    _check_moments_of_inertia,
    _check_reserved_names,
    _check_joint_types,
    _check_couplings,
)


def _movable_joints(root: ElementTree.Element) -> list[ElementTree.Element]:
    """Return the joints of a URDF that are not fixed."""
    return [joint for joint in root.findall("joint") if joint.get("type") != "fixed"]


def with_locked_joints(urdf: str, model: pin.Model, q: Array, joints: Collection[str]) -> str:
    """Return a URDF with some joints fixed at their positions in a configuration."""
    data, root = model.createData(), ElementTree.fromstring(urdf)
    pin.framesForwardKinematics(model, data, q)
    for joint in root.findall("joint"):
        if joint.get("name") in joints:
            links = [joint.find(end).get("link") for end in ("parent", "child")]  # type: ignore[union-attr]  # Pinocchio read it
            parent, child = (data.oMf[model.getFrameId(link, pin.BODY)] for link in links)
            placement = parent.actInv(child)
            for element in (*joint.findall("origin"), *joint.findall("mimic")):
                joint.remove(element)
            numbers = {"xyz": placement.translation, "rpy": pin.rpy.matrixToRpy(placement.rotation)}
            ElementTree.SubElement(
                joint,
                "origin",
                {key: " ".join(map(repr, map(float, row))) for key, row in numbers.items()},
            )
            joint.set("type", "fixed")
    return ElementTree.tostring(root, encoding="unicode")


def without_world_link(urdf: str) -> str:
    """Return a URDF without the link "world" and the joints attached to it.

    Some URDFs have such a link below the base.
    """
    root = ElementTree.fromstring(urdf)
    for element in [
        *root.findall("link[@name='world']"),
        *root.findall("joint/parent[@link='world']/.."),
    ]:
        root.remove(element)
    return ElementTree.tostring(root, encoding="unicode")


def _as_float(text: str | None) -> float:
    """Return a number of a URDF, or NaN if the text is not a number."""
    try:
        return float(text or "nan")
    except ValueError:
        return math.nan
