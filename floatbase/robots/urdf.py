"""URDF texts: read, joints made fixed, bolts taken away, and what (1)-(7) cannot hold named."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Collection
from pathlib import Path

import pinocchio as pin

from floatbase._arrays import Array
from floatbase.errors import InputError

_ENTRIES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def read_urdf(path: Path) -> str:
    """The text of a URDF file. Raises `InputError` for one that is not there or cannot be read."""
    try:
        return path.read_bytes().decode("utf-8-sig", errors="replace")  # a comment in another encoding changes no robot
    except (OSError, ValueError) as error:  # a name with a zero byte is a ValueError
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"there is no file {path.absolute()} to read ({reason}); give the path of a URDF file.") from None


def model_of(name: str, urdf: str, floating: bool) -> pin.Model:
    """Pinocchio's model of a URDF text, with a root joint where the base is free to move.

    Raises `InputError` for a text that is no URDF, or no XML: Pinocchio forgives more there than what reads it later.
    """
    try:
        ElementTree.fromstring(urdf)
        return pin.buildModelFromXML(urdf, *([pin.JointModelFreeFlyer()] if floating else []))
    except (ElementTree.ParseError, RuntimeError, ValueError) as error:
        raise InputError(f"{name} cannot be read as a URDF: {error}") from None


def check_urdf(name: str, urdf: str, model: pin.Model) -> None:
    """Raise `InputError` for what Pinocchio reads without a word and (1)-(7) cannot hold."""
    root = ElementTree.fromstring(urdf)
    for link in root.findall("link"):
        for inertial in link.findall("inertial"):
            mass, tensor = inertial.find("mass"), inertial.find("inertia")
            given = {"mass": mass.get("value") if mass is not None else None}
            given |= {entry: tensor.get(entry) if tensor is not None else None for entry in _ENTRIES}
            wrong = [f"{key} {text}" for key, text in given.items() if not math.isfinite(_number(text))]
            wrong += [f"mass {given['mass']}"] if _number(given["mass"]) < 0.0 else []
            if wrong:
                where = f"<inertial> of link {link.get('name')!r} of {name}"
                raise InputError(f"{where} has {wrong[0]}; it needs a mass ≥ 0, kg, and six numbers ixx … izz, kg m².")
    moving = [joint for joint in root.findall("joint") if joint.get("type") != "fixed"]
    names = [joint.get("name", "") for joint in moving]
    if list(model.names).count("root_joint") > 1:
        raise InputError(f"a joint of {name} is called root_joint, as Pinocchio calls that of a free base; rename it.")
    for joint in model.joints:
        if joint.nv > 1 and model.names[joint.id] in names:
            raise InputError(
                f"joint {model.names[joint.id]!r} of {name} moves in {joint.nv} ways; a motor drives one. Make it "
                "revolute, continuous, prismatic or fixed; the base is made free by floating=True."
            )
    masters = {joint.get("name", ""): mimic.get("joint", "") for joint in moving for mimic in joint.findall("mimic")}
    if masters:
        pairs = ", ".join([f"{joint} mimics {master}" for joint, master in masters.items()][:2] + ["…"] * (len(masters) > 2))
        held = [joint for joint in names if joint in masters or joint in masters.values()]
        raise InputError(
            f"joints of {name} are coupled: {pairs}. Such couplings are not part of (1)-(7), where every joint has a motor of "
            f"its own. Hold these joints still, locked={held}, or take <mimic> out of the URDF where they do have motors."
        )


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
            ElementTree.SubElement(joint, "origin", {key: " ".join(map(repr, map(float, row))) for key, row in numbers.items()})
            joint.set("type", "fixed")
    return ElementTree.tostring(root, encoding="unicode")


def without_bolts(urdf: str) -> str:
    """The URDF without the link "world", which some have below the base, and without the joints that hang from it."""
    root = ElementTree.fromstring(urdf)
    for element in [*root.findall("link[@name='world']"), *root.findall("joint/parent[@link='world']/..")]:
        root.remove(element)
    return ElementTree.tostring(root, encoding="unicode")


def _number(text: str | None) -> float:
    """A number of a URDF, NaN where there is none."""
    try:
        return float(text or "nan")
    except ValueError:
        return math.nan
