"""Changes of the masses in a model and its URDF: a point mass on a link, or all masses scaled."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._validation import Array

_UPPER = "xx", "xy", "xz", "yy", "yz", "zz"  # entries of a tensor in a URDF, row by row


def add_point_mass(
    model: pin.Model, urdf: str, frame_id: int, mass: float, position: npt.ArrayLike
) -> tuple[pin.Model, str]:
    """Return a model and its URDF with a point mass fixed to a link."""
    carrier = link = model.frames[frame_id]
    while link.type != pin.FrameType.BODY:
        link = model.frames[link.parentFrame]
    in_joint = carrier.placement.act(np.array(position))
    model = model.copy()
    model.inertias[carrier.parentJoint] += _point_mass(mass, in_joint)
    root = ElementTree.fromstring(urdf)
    (element,) = (one for one in root.findall("link") if one.get("name") == link.name)
    inertia = read_inertia(element) + _point_mass(mass, link.placement.actInv(in_joint))
    _write_inertia(element, inertia)
    return model, ElementTree.tostring(root, encoding="unicode")


def scale_masses(model: pin.Model, urdf: str, factor: float) -> tuple[pin.Model, str]:
    """Return a model and its URDF with all masses multiplied by a factor."""
    model = model.copy()
    for i, inertia in enumerate(model.inertias):
        model.inertias[i] = _scaled(inertia, factor)
    model.armature = factor * model.armature
    root = ElementTree.fromstring(urdf)
    for link in root.findall("link"):
        if link.find("inertial") is not None:
            _write_inertia(link, _scaled(read_inertia(link), factor))
    return model, ElementTree.tostring(root, encoding="unicode")


def _point_mass(mass: float, position: Array) -> pin.Inertia:
    """Return the inertia of a point mass at a position, shape (3,) [m]."""
    inertia = pin.Inertia.Zero()
    inertia.mass, inertia.lever = mass, np.array(position)
    return inertia


def _scaled(inertia: pin.Inertia, factor: float) -> pin.Inertia:
    """Return an inertia whose mass and tensor are multiplied by a factor."""
    scaled = pin.Inertia.Zero()  # the constructor rejects tensors that are not positive definite
    scaled.mass, scaled.lever = factor * inertia.mass, np.array(inertia.lever)
    scaled.inertia = factor * inertia.inertia
    return scaled


def read_numbers(element: ElementTree.Element | None, name: str) -> Array:
    """Return an attribute of three numbers, zeros by default."""
    text = "0 0 0" if element is None else element.get(name, "0 0 0")
    return np.array(text.split(), dtype=np.float64)


def text_of(numbers: npt.ArrayLike) -> str:
    """Return numbers as a URDF has them, without rounding."""
    return " ".join(map(repr, np.ravel(numbers).astype(float).tolist()))


def shifted(translation: npt.ArrayLike) -> pin.SE3:
    """Return the placement that only shifts."""
    return pin.SE3(np.eye(3), np.array(translation))


def origin_attributes(place: pin.SE3) -> dict[str, str]:
    """Return the attributes of an <origin>."""
    rpy = pin.rpy.matrixToRpy(place.rotation)
    return {"xyz": text_of(place.translation), "rpy": text_of(rpy)}


def read_inertia(link: ElementTree.Element) -> pin.Inertia:
    """Return the inertia of a link in the link's frame; zero without <inertial>."""
    inertia = pin.Inertia.Zero()
    mass, tensor = link.find("inertial/mass"), link.find("inertial/inertia")
    if mass is None or tensor is None:
        return inertia
    origin = link.find("inertial/origin")
    inertia.mass = float(mass.get("value", 0.0))
    inertia.lever = read_numbers(origin, "xyz")
    xx, xy, xz, yy, yz, zz = (float(tensor.get(f"i{axes}", 0.0)) for axes in _UPPER)
    R = pin.rpy.rpyToMatrix(read_numbers(origin, "rpy"))
    inertia.inertia = R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.T
    return inertia


def _write_inertia(link: ElementTree.Element, inertia: pin.Inertia) -> None:
    """Replace <inertial> of a link by an inertia in the link's frame."""
    for old in link.findall("inertial"):
        link.remove(old)
    inertial, tensor = ElementTree.SubElement(link, "inertial"), inertia.inertia
    ElementTree.SubElement(inertial, "origin", xyz=text_of(inertia.lever), rpy="0 0 0")
    ElementTree.SubElement(inertial, "mass", value=repr(float(inertia.mass)))
    upper = zip(_UPPER, tensor[np.triu_indices(3)], strict=True)
    ElementTree.SubElement(inertial, "inertia", {f"i{axes}": repr(float(x)) for axes, x in upper})
