"""URDF text: reading, checking, writing it in one form for all programs, and locking joints."""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ElementTree
from collections import Counter, defaultdict
from collections.abc import Collection
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pinocchio as pin

from floatbase._files import file_errors, read_file
from floatbase._validation import MAX_MAGNITUDE, Array, short_repr
from floatbase.errors import InputError, RobotWarning, warn
from floatbase.robots._checks import has_floating_base
from floatbase.robots.inertia import origin_attributes, read_inertia, read_numbers

Element = ElementTree.Element

_LIMITED_JOINT_TYPES = ("revolute", "prismatic")  # joint types that need a <limit>
_JOINT_TYPES = (*_LIMITED_JOINT_TYPES, "continuous", "fixed", "floating", "planar")
# the elements that are kept, each with those that are kept inside it
_CHILDREN = {
    "robot": ("link", "joint", "material"),
    "link": ("inertial", "visual", "collision", "collision_checking"),
    "inertial": ("origin", "mass", "inertia"),
    "visual": ("origin", "geometry", "material"),
    "collision": ("origin", "geometry"),
    "geometry": ("box", "cylinder", "sphere", "capsule", "mesh"),
    "collision_checking": ("capsule", "convex"),  # Pinocchio's, with names of collision shapes
    "material": ("color", "texture"),
    "joint": ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic"),
}
_REPEATABLE = ("link", "joint", "material", "visual", "collision", "capsule", "convex")
# how many numbers each attribute holds
_NUMBERS = {
    "origin": {"xyz": 3, "rpy": 3},
    "mass": {"value": 1},
    "inertia": dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), 1),
    "axis": {"xyz": 3},
    "limit": dict.fromkeys(("lower", "upper", "effort", "velocity"), 1),
    "dynamics": {"damping": 1, "friction": 1},
    "mimic": {"multiplier": 1, "offset": 1},
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "mesh": {"scale": 3},
    "color": {"rgba": 4},
}
_NOT_NEGATIVE = ("value", "effort", "velocity", "damping", "friction", "size", "radius", "length")
_REQUIRED = {"joint": ("parent", "child"), "inertial": ("mass", "inertia")}
# attributes with a default; all other attributes of an element are required
_OPTIONAL = ("xyz", "rpy", "lower", "upper", "damping", "friction", "multiplier", "offset", "scale")
# what all readers read as the same number; Python's float() accepts more, such as 1_000
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
_OLD_ENCODING = rb"(?i)<\?xml[^>]*encoding=.(iso-8859-1|iso-8859-15|windows-1252)\b"
_INFINITY = re.compile(r"[+-]?inf(inity)?", re.IGNORECASE)
_XACRO = "Run xacro first, as in `xacro robot.urdf.xacro > robot.urdf` (`pip install xacro`)."
_OTHER_FORMATS = {
    "mujoco": "This is an MJCF file. Load it with fb.load_mjcf.",
    "sdf": "This is an SDF file. Load the URDF from which it was made, or convert it, for example "
    "with `sdf2urdf` of the ROS package pysdf.",
}
_MOST_LINKS = 1000  # Pinocchio's recursion ends the program in a chain of about 4000
# kg m²: some programs write -5e-20 for an inertia of 0, and every real part of a robot has more
_ROUNDING = 1e-12


def read_text(path: Path) -> str:
    """Read the text of a URDF or MJCF file."""
    advice = "Pass the path of a URDF or MJCF file."
    with file_errors("path", path.absolute(), "robot.urdf", "cannot be read", advice):
        data = read_file(path)
    encoding = "utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    if declared := re.match(_OLD_ENCODING, data):
        encoding = declared[1].decode()
    # a comment in another encoding does not change the robot
    return data.decode(encoding, errors="replace")


def normalize_urdf(name: str, text: str, floating: bool) -> str:
    """Return a URDF that Pinocchio, MuJoCo and Python's XML read in the same way.

    Only links, joints and materials remain. All their numbers are checked. A floating base is the
    first link with mass. Ignored content is warned about.
    """
    root = _parse_xml(name, text)
    ignored = [
        f"<{part.tag}> {key}={value!r}"
        for part in root.findall("mujoco//*")
        for key, value in part.items()
    ]
    if ignored:
        warn(
            f"MuJoCo's settings in the URDF of {name} are ignored: {', '.join(ignored)}. They "
            f"would change the simulation, but not the controller.",
            RobotWarning,
        )
    _normalize_element(root, name)
    base = _check_tree(name, root)
    for joint in root.findall("joint"):
        _normalize_joint(name, joint)
    if floating:
        _remove_links_below_base(root, base)
    return ElementTree.tostring(root, encoding="unicode")


def _parse_xml(name: str, text: str) -> Element:
    """Return the outermost element of a URDF; other formats are an `InputError`."""
    # other readers accept prefixes that are not declared, such as drake:acceleration
    prefixes = set(re.findall(r"[\s</]([A-Za-z_][\w.-]*):[A-Za-z_]", text))
    prefixes -= {"xml", "xmlns", *re.findall(r"xmlns:([\w.-]+)", text)}
    declarations = "".join(f' xmlns:{prefix}="{prefix}"' for prefix in sorted(prefixes))
    text = re.sub(r"<robot(?=\s)", f"<robot{declarations}", text, count=1)
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        hint = f" The file is written in xacro. {_XACRO}" if "xacro:" in text else ""
        if "<robot" not in text:
            hint = f" A URDF contains <robot>, but this text begins with {text[:40]!r}."
        raise InputError(f"{name} is not a valid URDF: {error}.{hint}") from None
    if any("xacro" in element.tag for element in root.iter()):
        raise InputError(f"{name} is not a URDF: the file is written in xacro. {_XACRO}")
    namespace = root.tag[: root.tag.find("}") + 1]  # readers other than Python's ignore it
    for element in root.iter():
        element.tag = element.tag.removeprefix(namespace)
    if root.tag != "robot":
        hint = _OTHER_FORMATS.get(root.tag, "Pass the path of a URDF file.")
        raise InputError(
            f"{name} is not a URDF: its outermost element is <{root.tag}>, but it must be <robot>. "
            f"{hint}"
        )
    return root


def _normalize_element(element: Element, where: str) -> None:
    """Remove what not all readers know, and check all numbers."""
    if element.tag in _NUMBERS:
        _normalize_numbers(element, where)
    if element.tag in ("link", "joint"):
        where = f"{element.tag} {element.get('name')!r} of {where}"
    elif element.tag != "robot":
        where = f"<{element.tag}> of {where}"
    seen = set[str]()
    for child in list(element):
        repeated = child.tag in seen and child.tag not in _REPEATABLE
        if repeated and element.tag in ("link", "joint", "inertial"):
            raise InputError(f"More than one <{child.tag}> in {where}. Keep one of them.")
        is_known = child.tag in _CHILDREN.get(element.tag, ())
        if repeated or not is_known or (child.tag == "mesh" and not child.get("filename")):
            element.remove(child)
            continue
        seen.add(child.tag)
        if element.tag == "geometry" and child.tag == "capsule":
            child.tag = "cylinder"  # Pinocchio's reader knows no capsule
        _normalize_element(child, where)
        if child.tag in ("visual", "collision") and child.find("geometry/*") is None:
            element.remove(child)
    missing = [tag for tag in _REQUIRED.get(element.tag, ()) if tag not in seen]
    if missing:
        raise InputError(f"There is no <{missing[0]}> in {where}. Add it.")


def _normalize_numbers(element: Element, where: str) -> None:
    """Write numbers without blanks around them, and remove attributes that few readers know."""
    if "quat_xyzw" in element.attrib:
        raise InputError(f"<{element.tag}> of {where} has quat_xyzw. Write the rotation as rpy.")
    for key in list(element.attrib):
        if key not in (*_NUMBERS[element.tag], "filename", "joint"):
            del element.attrib[key]
    for key, count in _NUMBERS[element.tag].items():
        text = element.get(key)
        if text is None and key in _OPTIONAL:
            continue
        words = (text or "").split()
        if len(words) != count or not all(_is_number(word, key) for word in words):
            found = f"no {key}" if text is None else f"{key}={text!r}"
            needed = f"{count} numbers, separated by blanks," if count > 1 else "a number"
            least = 0.0 if key in _NOT_NEGATIVE else -MAX_MAGNITUDE
            needed += f" from {least:g} to {MAX_MAGNITUDE:g}"
            hint = " Write decimals with a point." if "," in (text or "") else ""
            hint = f" The file is written in xacro. {_XACRO}" if "$" in (text or "") else hint
            raise InputError(f"<{element.tag}> of {where} has {found}, but needs {needed}.{hint}")
        if element.tag == "limit" and abs(float(words[0])) > MAX_MAGNITUDE:
            words = [str(math.copysign(math.inf, float(words[0])))]  # some programs write 1.8e308
        element.set(key, " ".join(words))


def _is_number(word: str, key: str) -> bool:
    """Return whether all readers read a word as the same valid number."""
    is_limit = key in _NUMBERS["limit"]
    is_infinite = is_limit and _INFINITY.fullmatch(word) is not None
    if not (is_infinite or _NUMBER.fullmatch(word)) or (key in _NOT_NEGATIVE and float(word) < 0.0):
        return False
    return is_limit or abs(float(word)) <= MAX_MAGNITUDE


def _check_tree(name: str, root: Element) -> str:
    """Return the name of the base, after checking names and types and that links form a tree."""
    for kind in ("link", "joint"):
        names = Counter(element.get("name", "") for element in root.findall(kind))
        for label, count in names.items():
            if count > 1 or not label:
                raise InputError(
                    f"{name} has {count} {kind}s with the name {label!r}. Each needs a name of "
                    f"its own."
                )
    links = [link.get("name", "") for link in root.findall("link")]
    if not 0 < len(links) <= _MOST_LINKS:
        raise InputError(
            f"{name} has {len(links)} <link> elements. Pass the path of a URDF file with links, at "
            f"most {_MOST_LINKS}."
        )
    parents = {link: dict[str, str]() for link in links}  # of each link, by the joint between them
    for joint in root.findall("joint"):
        label, (parent, child) = joint.get("name", ""), _ends(joint)
        missing = [link for link in (parent, child) if link not in links]
        if missing or joint.get("type") not in _JOINT_TYPES:
            raise InputError(
                f"Joint {label!r} of {name} connects link {missing[0]!r}, which does not exist."
                if missing
                else f"Joint {label!r} of {name} has the type {joint.get('type')!r}. It must be "
                f"one of {', '.join(_JOINT_TYPES[:4])}."
            )
        parents[child][label] = parent
    for link, labels in parents.items():
        if len(labels) > 1:
            raise InputError(
                f"Link {link!r} of {name} has {len(labels)} parents, through the joints "
                f"{', '.join(labels)}. A URDF cannot describe closed loops. Keep one of the joints."
            )
    try:
        TopologicalSorter({link: labels.values() for link, labels in parents.items()}).prepare()
    except CycleError as error:
        raise InputError(
            f"The joints of {name} form a loop through {short_repr(error.args[1])}. Every link "
            f"except the base needs one parent, and the base none. Remove a joint of the loop."
        ) from None
    roots = [link for link in links if not parents[link]]
    if len(roots) > 1:
        raise InputError(
            f"{len(roots)} links of {name} have no parent: {', '.join(roots)}. Only the base has "
            f"none. Connect the others with joints, or remove them."
        )
    return roots[0]


def _ends(joint: Element) -> list[str]:
    """Return the names of the links that a joint connects, parent first."""
    return [joint.find(end).get("link", "") for end in ("parent", "child")]  # type: ignore[union-attr]  # it was checked


def _normalize_joint(name: str, joint: Element) -> None:
    """Check the axis and limits of a joint, and write out what readers complete differently."""
    label, kind, limit = joint.get("name"), joint.get("type"), joint.find("limit")
    if kind == "fixed":
        for tag in ("axis", "limit", "dynamics", "mimic"):
            for element in joint.findall(tag):
                joint.remove(element)
        return
    mimic = joint.find("mimic")
    if mimic is not None and not mimic.get("joint"):
        raise InputError(
            f"<mimic> of joint {label!r} of {name} names no joint. Add the joint that it follows, "
            f'as in joint="finger".'
        )
    axis = joint.find("axis")
    if axis is None:
        axis = ElementTree.SubElement(joint, "axis")
    axis.attrib.setdefault("xyz", "1 0 0")
    if max(map(abs, read_numbers(axis, "xyz"))) < 1e-12:  # rounding error
        raise InputError(
            f'The <axis> of joint {label!r} of {name} is zero. Set a direction, as in xyz="0 0 1".'
        )
    if limit is None:
        if kind in _LIMITED_JOINT_TYPES:
            raise InputError(
                f"{kind} joint {label!r} of {name} has no <limit>. Add one with lower, upper, "
                f"effort and velocity."
            )
        return
    lower, upper = (float(limit.get(end, "0")) for end in ("lower", "upper"))
    has_range = kind in _LIMITED_JOINT_TYPES
    if has_range and (lower > upper or math.isinf(lower) != math.isinf(upper)):
        raise InputError(
            f"Joint {label!r} of {name} has the limits lower={lower:g} and upper={upper:g} (rad or "
            f"m; a missing limit is 0). The lower limit must not be above the upper limit. Set "
            f"two finite limits, or make the joint continuous if it has no limits."
        )
    for key, value in (("lower", lower), ("upper", upper)):
        limit.attrib.pop(key, None)
        if has_range and lower != upper and not math.isinf(upper - lower):
            limit.set(key, repr(value))
    for key in ("effort", "velocity"):
        if math.isinf(float(limit.get(key, "0"))):
            limit.set(key, "0")  # unknown


def _remove_links_below_base(root: Element, base: str) -> None:
    """Make the first link with mass the base, if links without mass lie below it.

    Files for a robot on a stand, and files in which a joint frees the base, have such links.
    """
    links = {link.get("name", ""): link for link in root.findall("link")}
    joints_of = defaultdict[str, list[Element]](list)
    for joint in root.findall("joint"):
        joints_of[_ends(joint)[0]].append(joint)
    below, origins, is_free, is_stand = list[Element](), list[Element](), False, False
    while len(joints_of[base]) == 1 and read_inertia(links[base]).mass == 0.0:
        link, (joint,) = links[base], joints_of[base]
        is_free |= joint.get("type") == "floating"
        is_stand |= base.lower() == "world"
        is_bare = joint.get("type") == "fixed" and {part.tag for part in link} <= {"inertial"}
        if joint.get("type") not in ("fixed", "floating") or not (is_free or is_stand or is_bare):
            break
        below += [link, joint]
        origins += joint.findall("origin")
        base = _ends(joint)[1]
    is_tilted = any(any(read_numbers(origin, "rpy")[:2]) for origin in origins)
    if is_tilted and not is_free:  # the lowest link shows which way is up: move it to the base
        for origin in origins:
            origin.attrib.pop("xyz", None)
    elif is_free or is_stand or any(any(read_numbers(origin, "xyz")) for origin in origins):
        for element in below:
            root.remove(element)


def parse_urdf(name: str, urdf: str, floating: bool) -> pin.Model:
    """Build the Pinocchio model of a URDF text, with a root joint if the base is floating."""
    try:
        return pin.buildModelFromXML(urdf, *([pin.JointModelFreeFlyer()] if floating else []))
    except (RuntimeError, ValueError) as error:
        raise InputError(f"{name} is not a valid URDF: {error}") from None


def check_model(name: str, model: pin.Model) -> None:
    """Raise `InputError` for a model that eqs. (1)-(7) cannot represent."""
    _check_moments_of_inertia(name, model)
    base = next((frame for frame in model.frames if frame.name == "base"), model.frames[0])
    if base.parentJoint > has_floating_base(model):
        raise InputError(
            f"A moving {'link' if base.type == pin.BODY else 'joint'} of {name} has the name base, "
            f"which is reserved for the root link of every robot. Rename it."
        )
    if list(model.names).count("root_joint") > 1:
        raise InputError(
            f"A joint of {name} has the name root_joint, which Pinocchio uses for the joint of a "
            f"floating base. Rename it."
        )
    for joint in list(model.joints)[2 if has_floating_base(model) else 1 :]:
        if joint.nv > 1:
            raise InputError(
                f"Joint {model.names[joint.id]!r} of {name} has {joint.nv} degrees of freedom, but "
                f"a motor drives only one. Make it revolute, continuous, prismatic or fixed. Only "
                f"the base may move freely, with floating=True."
            )


def _check_moments_of_inertia(name: str, model: pin.Model) -> None:
    """Check that no link, including everything welded to it, has a negative moment of inertia."""
    # Pinocchio's inertias are sums, which may be positive although a part is negative
    for i, inertia in list(enumerate(model.inertias))[1:]:
        smallest = float(inertia.inertia.diagonal().min())
        if smallest < -_ROUNDING:
            label = model.names[i]
            where = "base" if label == "root_joint" else f"link moved by joint {label!r}"
            raise InputError(
                f"The {where} of {name}, with everything welded to it, has a negative moment of "
                f"inertia, {smallest:.4g} kg m². Make ixx, iyy and izz of <inertia> positive."
            )


def with_locked_joints(urdf: str, model: pin.Model, q: Array, joints: Collection[str]) -> str:
    """Return a URDF with some joints fixed at their positions in a configuration."""
    data, root = model.createData(), ElementTree.fromstring(urdf)
    pin.framesForwardKinematics(model, data, q)
    for joint in root.findall("joint"):
        if joint.get("name") in joints:
            parent, child = (data.oMf[model.getFrameId(link, pin.BODY)] for link in _ends(joint))
            for element in (*joint.findall("origin"), *joint.findall("mimic")):
                joint.remove(element)
            ElementTree.SubElement(joint, "origin", origin_attributes(parent.actInv(child)))
            joint.set("type", "fixed")
    return ElementTree.tostring(root, encoding="unicode")
