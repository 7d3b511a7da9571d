"""URDF texts: read, joints made fixed, bolts taken away, and what (1)-(7) cannot hold named."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Collection
from pathlib import Path

import pinocchio as pin

from floatbase._validation import Array
from floatbase.errors import InputError
from floatbase.robots._checks import has_floating_base

_INERTIA_ATTRIBUTES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_LIMITED_JOINT_TYPES = ("revolute", "prismatic")  # types of joints that need a <limit>
# kg m²: programs that write URDFs put -5e-20 for an inertia of 0, and no part of a robot has so
# little
_ROUNDING = 1e-12


def read_urdf(path: Path) -> str:
    """The text of a URDF file. Raises `InputError` for one that is not there or cannot be read."""
    try:
        return path.read_bytes().decode(
            "utf-8-sig", errors="replace"
        )  # a comment in another encoding changes no robot
    except (OSError, ValueError) as error:  # a name with a zero byte is a ValueError
        reason = getattr(error, "strerror", None) or error
        raise InputError(
            f"there is no file {path.absolute()} to read ({reason}); give the path of a URDF file."
        ) from None


def parse_urdf(name: str, urdf: str, floating: bool) -> pin.Model:
    """Pinocchio's model of a URDF text, with a root joint where the base is free to move.

    Raises `InputError` for a text that is no URDF, or no XML: Pinocchio forgives more there than
    what reads it later.
    """
    try:
        ElementTree.fromstring(urdf)
        return pin.buildModelFromXML(urdf, *([pin.JointModelFreeFlyer()] if floating else []))
    except (ElementTree.ParseError, RuntimeError, ValueError) as error:
        raise InputError(f"{name} cannot be read as a URDF: {_parse_error(urdf, error)}") from None


def _parse_error(urdf: str, error: Exception) -> str:
    """Why a text is no URDF; Pinocchio writes the reason to the terminal, not into its error."""
    if "xacro:" in urdf:
        return (
            f"{str(error).rstrip('.')}. It is written in xacro: run xacro first, as in xacro "
            f"robot.xacro > robot.urdf."
        )
    if isinstance(error, ElementTree.ParseError):
        return str(error)
    root = ElementTree.fromstring(urdf)
    if root.tag != "robot":
        return f"its outermost element is <{root.tag}>; that of a URDF is <robot>."
    for kind in ("link", "joint"):
        for duplicate, count in Counter(
            element.get("name") for element in root.findall(kind)
        ).items():
            if count > 1:
                return f"{count} {kind}s are called {duplicate!r}; give each a name of its own."
    for joint in root.findall("joint"):
        if joint.get("type") in _LIMITED_JOINT_TYPES and joint.find("limit") is None:
            return (
                f"{joint.get('type')} joint {joint.get('name')!r} has no <limit>, with lower, "
                f"upper, effort and velocity."
            )
    return str(error)


def check_urdf(name: str, urdf: str, model: pin.Model) -> None:
    """Raise `InputError` for what Pinocchio reads without a word and (1)-(7) cannot hold."""
    root = ElementTree.fromstring(urdf)
    for check in _CHECKS:
        check(name, root, model)


def _check_inertials(name: str, root: ElementTree.Element, model: pin.Model) -> None:
    """Masses and inertias are numbers, and no mass is negative."""
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
                    f"<inertial> of link {link.get('name')!r} of {name} has {invalid[0]}; it needs "
                    f"a mass ≥ 0, kg, and six numbers ixx … izz, kg m²."
                )


def _check_limits_and_axes(name: str, root: ElementTree.Element, model: pin.Model) -> None:
    """Lower limits lie below upper limits, and axes have a direction."""
    for joint in _movable_joints(root):
        label, limit, axis = joint.get("name"), joint.find("limit"), joint.find("axis")
        lower, upper = (
            _as_float(limit.get(end, "0")) if limit is not None else 0.0
            for end in ("lower", "upper")
        )
        if joint.get("type") in _LIMITED_JOINT_TYPES and lower > upper:
            raise InputError(
                f"joint {label!r} of {name} has the lower limit {lower:g} above the upper limit "
                f"{upper:g} (rad, or m; a limit that is not given is 0). Swap lower and upper in "
                f"<limit>, or make it continuous if it turns without limit."
            )
        if axis is not None and not any(map(_as_float, axis.get("xyz", "1").split())):
            raise InputError(
                f"joint {label!r} of {name} has an <axis> of zeros; give its direction, as in "
                f'xyz="0 0 1".'
            )


def _check_moments_of_inertia(name: str, root: ElementTree.Element, model: pin.Model) -> None:
    """No link has a negative moment of inertia, with all that is welded to it."""
    for i, inertia in list(enumerate(model.inertias))[1:]:  # a sum may mend a negative part
        smallest = float(inertia.inertia.diagonal().min())
        if smallest < -_ROUNDING:
            where = (
                "the base"
                if model.names[i] == "root_joint"
                else f"the link that joint {model.names[i]!r} moves"
            )
            raise InputError(
                f"{where} of {name} has a negative moment of inertia, {smallest:.4g} kg m², with "
                f"all that is welded to it; ixx, iyy and izz of <inertia> must be above zero there."
            )


def _check_reserved_names(name: str, root: ElementTree.Element, model: pin.Model) -> None:
    """Nothing has the name of the base link's frame or of the base's own joint."""
    base_frame = next((frame for frame in model.frames if frame.name == "base"), None)
    if base_frame is not None and base_frame.parentJoint != int(has_floating_base(model)):
        raise InputError(
            f"a {'link' if base_frame.type == pin.BODY else 'joint'} of {name} that moves is "
            f"called base, the word for the link that all others hang from, on every robot; "
            f"rename it."
        )
    if list(model.names).count("root_joint") > 1:
        raise InputError(
            f"a joint of {name} is called root_joint, as Pinocchio calls that of a free base; "
            f"rename it."
        )


def _check_joint_types(name: str, root: ElementTree.Element, model: pin.Model) -> None:
    """Every joint moves in one way."""
    names = [joint.get("name", "") for joint in _movable_joints(root)]
    for joint in model.joints:
        if joint.nv > 1 and model.names[joint.id] in names:
            raise InputError(
                f"joint {model.names[joint.id]!r} of {name} moves in {joint.nv} ways; a motor "
                f"drives one. Make it revolute, continuous, prismatic or fixed; the base is made "
                f"free by floating=True."
            )


def _check_couplings(name: str, root: ElementTree.Element, model: pin.Model) -> None:
    """No joint mimics another."""
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
            f"joints of {name} are coupled: {pairs}. Such couplings are not part of (1)-(7), where "
            f"every joint has a motor of its own. Hold these joints still, locked={coupled}, or "
            f"take <mimic> out of the URDF where they do have motors."
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
    return [joint for joint in root.findall("joint") if joint.get("type") != "fixed"]


def with_locked_joints(urdf: str, model: pin.Model, q: Array, joints: Collection[str]) -> str:
    """The URDF with joints made fixed where the configuration q has them."""
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
    """The URDF without the link "world", which some have below the base, and without the joints
    that hang from it.
    """
    root = ElementTree.fromstring(urdf)
    for element in [
        *root.findall("link[@name='world']"),
        *root.findall("joint/parent[@link='world']/.."),
    ]:
        root.remove(element)
    return ElementTree.tostring(root, encoding="unicode")


def _as_float(text: str | None) -> float:
    """A number of a URDF, NaN where there is none."""
    try:
        return float(text or "nan")
    except ValueError:
        return math.nan
