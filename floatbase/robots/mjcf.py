"""MJCF files: MuJoCo compiles them, and the robot in the result is written as a URDF.

Bodies, sites and named collision shapes become links. The module imports MuJoCo, so it is imported
on first use.
"""

from __future__ import annotations

import os
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._validation import Array
from floatbase.errors import InputError, unknown_name
from floatbase.robots._checks import has_floating_base
from floatbase.robots.urdf import read_text

_Joint, _Geom, _Equality = mujoco.mjtJoint, mujoco.mjtGeom, mujoco.mjtEq
_JOINT_TYPES = {_Joint.mjJNT_HINGE: "revolute", _Joint.mjJNT_SLIDE: "prismatic"}
_JOINT_TRANSMISSIONS = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
_LAST_VISIBLE_GROUP = 2  # MuJoCo's viewer hides geoms of the groups 3 to 5 at first
_NO_COLOUR = [0.5, 0.5, 0.5, 1.0]  # MuJoCo's colour of a geom that has none
_MESH_FILES = (".stl", ".obj", ".dae")
_GRAVITY = (0.0, 0.0, -9.81)

_Shape = tuple[str, dict[str, str], pin.SE3]  # element, its numbers, placement in the geom
# base with the quaternion x y z w, joint → rad or m
Configuration = tuple[Array, dict[str, float]]


@dataclass(frozen=True)
class Mjcf:
    """A robot in an MJCF file."""

    urdf: str
    is_floating: bool
    folder: Path
    rotor_inertias: Mapping[str, float]  # joint → kg m² or kg
    initial: Configuration
    keyframes: Mapping[str, Configuration]
    differences: tuple[str, ...]  # between the robot and the file

    def armature(self, model: pin.Model) -> Array:
        """Return the rotor inertias that M includes, shape (nv,)."""
        armature = np.zeros(model.nv)
        for name, inertia in self.rotor_inertias.items():
            armature[model.idx_vs[model.getJointId(name)]] = inertia
        return armature

    def posture(self, model: pin.Model, keyframe: str | None) -> Array:
        """Return q in a keyframe; by default in the first one, or else in the initial state."""
        if keyframe is not None and keyframe not in self.keyframes:
            raise unknown_name(
                "keyframe", keyframe, self.keyframes, "posture=[…] takes joint positions."
            )
        q = pin.neutral(model)
        base, angles = (
            next(iter(self.keyframes.values()), self.initial)
            if keyframe is None
            else self.keyframes[keyframe]
        )
        if has_floating_base(model) and self.is_floating:
            q[:7] = base
        for name, angle in angles.items():
            joint = model.joints[model.getJointId(name)]
            turn = [angle] if joint.nq == 1 else [np.cos(angle), np.sin(angle)]
            q[joint.idx_q : joint.idx_q + joint.nq] = turn
        normalized: Array = pin.normalize(model, q)
        return normalized


def read_mjcf(name: str, source: str | Path, floating: bool | None) -> Mjcf:
    """Return the robot in an MJCF, given as a text or as the path of a file.

    The base is as in the file if `floating` is None.
    """
    text = read_text(source) if isinstance(source, Path) else source
    folder = source.resolve().parent if isinstance(source, Path) else Path.cwd()
    try:
        tag = ElementTree.fromstring(text).tag
        if tag != "mujoco":
            advice = " Load it with fb.load_urdf." if tag == "robot" else ""
            raise ValueError(f"its outermost element is <{tag}>, but it must be <mujoco>.{advice}")
        spec = (
            mujoco.MjSpec.from_file(str(source))
            if isinstance(source, Path)
            else mujoco.MjSpec.from_string(text)
        )
        missing = _drop_what_is_missing(spec, folder)
        # welded bodies are links, and visual geoms are drawn
        spec.compiler.fusestatic = spec.compiler.discardvisual = False
        model = spec.compile()
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f"{name} is not a valid MJCF: {error}") from None
    return _Writer(name, model, spec, folder, floating).robot(missing)


def _drop_what_is_missing(spec: mujoco.MjSpec, folder: Path) -> list[str]:
    """Remove the geoms whose mesh file is missing, and return the names of these meshes.

    Parts that a robot does not need, such as textures and terrain, are removed as well. So are
    contacts with geoms that only the scene around the robot has.
    """
    for texture in spec.textures:
        texture.file, texture.cubefiles = "", [""] * len(texture.cubefiles)
        texture.builtin, texture.width, texture.height = mujoco.mjtBuiltin.mjBUILTIN_FLAT, 1, 1
    missing = {
        mesh.name or Path(mesh.file).stem: mesh
        for mesh in spec.meshes
        if mesh.file and not _mesh_path(spec, mesh, folder).is_file()
    }
    for geom in list(spec.geoms):
        if geom.meshname in missing or geom.type == _Geom.mjGEOM_HFIELD:
            spec.delete(geom)
    names = {geom.name for geom in spec.geoms}
    pairs = [pair for pair in spec.pairs if not {pair.geomname1, pair.geomname2} <= names]
    for part in (*missing.values(), *spec.hfields, *spec.skins, *spec.sensors, *pairs):
        spec.delete(part)
    return list(missing)


def _mesh_path(spec: mujoco.MjSpec, mesh: mujoco.MjsMesh, folder: Path) -> Path:
    """Return the path of a mesh's file."""
    file = Path(mesh.file).name if spec.strippath else mesh.file
    return folder / (mesh.compiler.meshdir or "") / file


class _Writer:
    """Writes the robot of a compiled model as a URDF."""

    def __init__(
        self,
        name: str,
        model: mujoco.MjModel,
        spec: mujoco.MjSpec,
        folder: Path,
        floating: bool | None,
    ):
        self.name, self.model, self.spec, self.folder = name, model, spec, folder
        self.urdf = ElementTree.Element("robot", name=name)
        self.root = self._find_root(floating)
        self.bodies = [
            body for body in range(model.nbody) if self._is_of_robot(int(model.body_rootid[body]))
        ]
        self.joints = [
            joint
            for joint in range(model.njnt)
            if model.jnt_bodyid[joint] in self.bodies and model.jnt_bodyid[joint] != self.root
        ]
        self.differences = list[str]()

    def _label(self, kind: str, number: int) -> str:
        """Return the name of a body, joint, geom, …, or one made from its number."""
        return getattr(self.model, kind)(number).name or f"{kind}_{number}"

    def _note(self, difference: str, names: list[str]) -> None:
        """Remember a difference from the file, with the parts that it concerns."""
        if names:
            more = ", …" if len(names) > 3 else ""
            self.differences.append(f"{difference} ({', '.join(names[:3])}{more})")

    # --- choice of the robot ---

    def _find_root(self, floating: bool | None) -> int:
        """Return the body with the floating base, or 0, the world, for a fixed base."""
        model = self.model
        n_joints = dict.fromkeys(map(int, model.body_rootid[1:]), 0)
        for body in model.jnt_bodyid:
            n_joints[int(model.body_rootid[body])] += 1
        self.free = [
            int(model.jnt_bodyid[joint])
            for joint in range(model.njnt)
            if model.jnt_type[joint] == _Joint.mjJNT_FREE
        ]
        bolted = [root for root, count in n_joints.items() if count and root not in self.free]
        largest = max(self.free, key=n_joints.__getitem__, default=0)
        if largest and (n_joints[largest] > 1 or not bolted):
            return largest
        if not floating:
            return 0
        roots = bolted or list(n_joints)
        if len(roots) != 1:
            names = ", ".join(self._label("body", root) for root in roots) or "none"
            raise InputError(
                f"The base of {self.name} cannot float, because the bodies attached to the world "
                f"are {names}. A floating base needs exactly one, or a <freejoint>."
            )
        return roots[0]

    def _is_of_robot(self, root: int) -> bool:
        """Return whether the bodies below a child of the world belong to the robot."""
        return root == self.root if self.root else root not in self.free

    # --- writing ---

    def robot(self, missing: list[str]) -> Mjcf:
        """Return the robot; `missing` are meshes without a file."""
        model = self.model
        for body in self.bodies:
            self._add_body(body)
        for geom in range(model.ngeom):
            if model.geom_bodyid[geom] in self.bodies:
                self._add_geom(geom)
        for site in range(model.nsite):
            if model.site_bodyid[site] in self.bodies and model.site(site).name:
                place = _placement(model.site_pos[site], model.site_quat[site])
                self._add_frame(model.site(site).name, int(model.site_bodyid[site]), place)
        self._couple_joints()
        self._note("without meshes whose file is missing", missing)
        self._find_other_parts()
        return Mjcf(
            urdf=ElementTree.tostring(self.urdf, encoding="unicode"),
            is_floating=self.root > 0,
            folder=self.folder,
            rotor_inertias={
                self._label("joint", joint): self._rotor_inertia(joint) for joint in self.joints
            },
            initial=self._configuration(model.qpos0),
            keyframes={
                model.key(i).name or f"key_{i}": self._configuration(model.key_qpos[i])
                for i in range(model.nkey)
            },
            differences=tuple(self.differences),
        )

    def _add_body(self, body: int) -> None:
        """Write a link and the joints to its parent; several joints have links between them."""
        model, name = self.model, self._label("body", body)
        link = ElementTree.SubElement(self.urdf, "link", name=name)
        if model.body_mass[body] > 0.0:
            inertial = ElementTree.SubElement(link, "inertial")
            _add_origin(inertial, pin.SE3(np.eye(3), model.body_ipos[body]))
            ElementTree.SubElement(inertial, "mass", value=_text(model.body_mass[body]))
            R = _placement(np.zeros(3), model.body_iquat[body]).rotation
            tensor = R @ np.diag(model.body_inertia[body]) @ R.T
            entries = {
                f"i{'xyz'[i]}{'xyz'[j]}": tensor[i, j] for i in range(3) for j in range(i, 3)
            }
            ElementTree.SubElement(
                inertial, "inertia", {key: _text(value) for key, value in entries.items()}
            )
        if body == self.root:
            return
        parent = self._label("body", int(model.body_parentid[body]))
        place = _placement(model.body_pos[body], model.body_quat[body])
        first = int(model.body_jntadr[body])
        for joint in range(first, first + int(model.body_jntnum[body])):
            anchor, is_last = model.jnt_pos[joint], joint == first + model.body_jntnum[body] - 1
            child = name if is_last and not anchor.any() else f"{self._label('joint', joint)} link"
            if child != name:
                ElementTree.SubElement(self.urdf, "link", name=child)
            self._add_joint(joint, parent, child, place * pin.SE3(np.eye(3), anchor))
            parent, place = child, pin.SE3(np.eye(3), -anchor)
        if parent != name:
            self._add_fixed_joint(parent, name, place)

    def _add_joint(self, joint: int, parent: str, child: str, place: pin.SE3) -> None:
        """Write a joint at its anchor."""
        model, label = self.model, self._label("joint", joint)
        kind = _Joint(int(model.jnt_type[joint]))
        if kind not in _JOINT_TYPES:
            raise InputError(
                f"Joint {label!r} of {self.name} is a {kind.name[6:].lower()} joint, but a motor "
                f"drives only one degree of freedom. Replace it by hinges, or remove it from the "
                f"MJCF, which welds its body to the parent."
            )
        axis, reference = model.jnt_axis[joint], float(model.qpos0[model.jnt_qposadr[joint]])
        back = -reference * axis  # MuJoCo measures motion from the reference
        is_hinge = kind == _Joint.mjJNT_HINGE
        place = place * (
            pin.SE3(pin.exp3(back), np.zeros(3)) if is_hinge else pin.SE3(np.eye(3), back)
        )
        limited = bool(model.jnt_limited[joint])
        element = ElementTree.SubElement(
            self.urdf,
            "joint",
            name=label,
            type="continuous" if is_hinge and not limited else _JOINT_TYPES[kind],
        )
        _add_origin(element, place)
        ElementTree.SubElement(element, "parent", link=parent)
        ElementTree.SubElement(element, "child", link=child)
        ElementTree.SubElement(element, "axis", xyz=_text(axis))
        lower, upper = model.jnt_range[joint] if limited else (0.0, 0.0)
        ElementTree.SubElement(
            element,
            "limit",
            lower=_text(lower),
            upper=_text(upper),
            effort=_text(self._largest_torque(joint)),
            velocity="0",  # MJCF has no velocity limits
        )
        dof = int(model.jnt_dofadr[joint])
        ElementTree.SubElement(
            element,
            "dynamics",
            damping=_text(model.dof_damping[dof]),
            friction=_text(model.dof_frictionloss[dof]),
        )

    def _add_fixed_joint(self, parent: str, child: str, place: pin.SE3) -> None:
        """Write the weld of a link to its parent."""
        joint = ElementTree.SubElement(self.urdf, "joint", name=f"{child} weld", type="fixed")
        _add_origin(joint, place)
        ElementTree.SubElement(joint, "parent", link=parent)
        ElementTree.SubElement(joint, "child", link=child)

    def _add_frame(self, name: str, body: int, place: pin.SE3) -> ElementTree.Element | None:
        """Write a massless link, unless another part of the robot has its name."""
        taken = {element.get("name") for element in self.urdf}
        if name in taken:
            return None
        self._add_fixed_joint(self._label("body", body), name, place)
        return ElementTree.SubElement(self.urdf, "link", name=name)

    def _add_geom(self, geom: int) -> None:
        """Write the shape of a geom; a named one that touches others gets a link, as feet need."""
        model = self.model
        body, name = int(model.geom_bodyid[geom]), model.geom(geom).name
        pairs = {*model.pair_geom1.tolist(), *model.pair_geom2.tolist()}
        touches = bool(model.geom_contype[geom] or model.geom_conaffinity[geom]) or geom in pairs
        shapes, place = self._shapes(geom)
        link = self._add_frame(name, body, place) if touches and name and shapes else None
        if link is None:
            label = self._label("body", body)
            link = next(e for e in self.urdf if e.tag == "link" and e.get("name") == label)
        else:
            place = pin.SE3.Identity()
        rgba, material = model.geom_rgba[geom], int(model.geom_matid[geom])
        if material >= 0 and np.allclose(rgba, _NO_COLOUR):
            rgba = model.mat_rgba[material]
        visible = model.geom_group[geom] <= _LAST_VISIBLE_GROUP and rgba[3] > 0.0
        for tag in [*["visual"] * bool(visible), *["collision"] * touches]:
            for kind, numbers, offset in shapes:
                shape = ElementTree.SubElement(link, tag)
                _add_origin(shape, place * offset)
                ElementTree.SubElement(ElementTree.SubElement(shape, "geometry"), kind, numbers)
                if tag == "visual":
                    colour = ElementTree.SubElement(shape, "material", name=_text(rgba))
                    ElementTree.SubElement(colour, "color", rgba=_text(rgba))

    def _shapes(self, geom: int) -> tuple[list[_Shape], pin.SE3]:
        """Return the URDF's shapes for a geom and its placement in its body."""
        model = self.model
        size, middle = model.geom_size[geom], pin.SE3.Identity()
        place = _placement(model.geom_pos[geom], model.geom_quat[geom])
        match _Geom(int(model.geom_type[geom])):
            case _Geom.mjGEOM_SPHERE:
                return [("sphere", {"radius": _text(size[0])}, middle)], place
            case _Geom.mjGEOM_BOX:
                return [("box", {"size": _text(2.0 * size)}, middle)], place
            case _Geom.mjGEOM_CYLINDER | _Geom.mjGEOM_CAPSULE as kind:
                numbers = {"radius": _text(size[0]), "length": _text(2.0 * size[1])}
                ends = [pin.SE3(np.eye(3), np.array([0.0, 0.0, z])) for z in (-size[1], size[1])]
                balls = [("sphere", {"radius": _text(size[0])}, end) for end in ends]
                round_ends = balls if kind == _Geom.mjGEOM_CAPSULE else []
                return [("cylinder", numbers, middle), *round_ends], place
            case _Geom.mjGEOM_MESH:
                mesh = int(model.geom_dataid[geom])
                file = self.spec.meshes[mesh]
                path = _mesh_path(self.spec, file, self.folder)
                reference = _placement(file.refpos, file.refquat).inverse()
                is_scaled_by_urdf = np.ptp(file.scale) == 0.0 or np.all(
                    reference.rotation == np.eye(3)
                )
                if file.file and path.suffix.lower() in _MESH_FILES and is_scaled_by_urdf:
                    relative = Path(os.path.relpath(path, self.folder)).as_posix()
                    numbers = {"filename": f"package://{relative}", "scale": _text(file.scale)}
                    # MuJoCo moves the origin of a mesh to its centre of mass
                    centre = _placement(model.mesh_pos[mesh], model.mesh_quat[mesh])
                    reference.translation = file.scale * reference.translation
                    return [("mesh", numbers, middle)], place * centre.inverse() * reference
        # the box around an ellipsoid or around a mesh of other files
        box = model.geom_aabb[geom]
        if _Geom(int(model.geom_type[geom])) in (_Geom.mjGEOM_ELLIPSOID, _Geom.mjGEOM_MESH):
            offset = pin.SE3(np.eye(3), box[:3])
            return [("box", {"size": _text(2.0 * box[3:])}, offset)], place
        return [], place  # planes and height fields are no part of a robot

    # --- numbers ---

    def _rotor_inertia(self, joint: int) -> float:
        """Return the rotor inertia that a joint feels."""
        model, motors = self.model, self._motors(joint)
        inertia = model.dof_armature[model.jnt_dofadr[joint]]
        return float(inertia + (self._gear(motors) ** 2 * model.actuator_armature[motors]).sum())

    def _motors(self, joint: int) -> list[int]:
        """Return the actuators of a joint."""
        model = self.model
        return [
            i
            for i in range(model.nactuator)
            if model.actuator_trntype[i] in _JOINT_TRANSMISSIONS
            and model.actuator_trnid[i, 0] == joint
        ]

    def _gear(self, motors: int | list[int]) -> Array:
        """Return the gear ratios of actuators of joints."""
        ratios: Array = self.model.actuator_gear[self.model.actuator_outadr[motors], 0]
        return ratios

    def _largest_torque(self, joint: int) -> float:
        """Return the torque or force that all actuators of a joint can apply; 0 if unlimited."""
        model, motors = self.model, self._motors(joint)
        torque = sum(map(self._largest_force, motors)) if motors else np.inf
        if model.jnt_actfrclimited[joint]:
            torque = min(torque, _magnitude(model.jnt_actfrcrange[joint]))
        return float(torque) if np.isfinite(torque) else 0.0

    def _largest_force(self, motor: int) -> float:
        """Return the torque or force that an actuator can apply to its joint."""
        model, force = self.model, np.inf
        is_torque_motor = (
            model.actuator_gaintype[motor] == mujoco.mjtGain.mjGAIN_FIXED
            and model.actuator_biastype[motor] == mujoco.mjtBias.mjBIAS_NONE
        )
        control = model.actuator_ctrladr[motor]
        if is_torque_motor and model.actuator_ctrllimited[control]:
            gain = model.actuator_gainprm[motor, 0]
            force = abs(gain) * _magnitude(model.actuator_ctrlrange[control])
        if model.actuator_forcelimited[motor]:
            force = min(force, _magnitude(model.actuator_forcerange[motor]))
        return float(force * abs(self._gear(motor)))

    def _configuration(self, qpos: Array) -> Configuration:
        """Return the base, with the quaternion x y z w, and the joints in a configuration."""
        model, base = self.model, pin.SE3ToXYZQUAT(pin.SE3.Identity())
        if self.root in self.free:
            start = int(model.jnt_qposadr[model.body_jntadr[self.root]])
            base = qpos[start : start + 7][[0, 1, 2, 4, 5, 6, 3]]
        return base, {
            self._label("joint", joint): float(qpos[model.jnt_qposadr[joint]])
            for joint in self.joints
        }

    # --- what does not fit ---

    def _couple_joints(self) -> None:
        """Write linear couplings of two joints as <mimic>; other equality constraints are noted."""
        model, others = self.model, []
        elements = {e.get("name"): e for e in self.urdf.findall("joint")}
        for i in np.flatnonzero(model.eq_active0):
            first, second = int(model.eq_obj1id[i]), int(model.eq_obj2id[i])
            is_linear = (
                model.eq_type[i] == _Equality.mjEQ_JOINT
                and {first, second} <= set(self.joints)
                and not model.eq_data[i, 2:5].any()
            )
            if is_linear:
                q1, q2 = model.qpos0[model.jnt_qposadr[[first, second]]]
                offset, ratio = model.eq_data[i, :2]
                ElementTree.SubElement(
                    elements[self._label("joint", first)],
                    "mimic",
                    joint=self._label("joint", second),
                    multiplier=_text(ratio),
                    offset=_text(q1 + offset - ratio * q2),
                )
            else:
                others.append(self._label("equality", int(i)))
        self._note("without equality constraints", others)

    def _find_other_parts(self) -> None:
        """Name everything that the URDF does not have."""
        model = self.model
        joints = np.array(self.joints, dtype=int)
        movable = sorted({int(model.body_rootid[body]) for body in model.jnt_bodyid})
        others = [body for body in movable if not self._is_of_robot(body)]
        self._note("without other moving bodies", [self._label("body", body) for body in others])
        self._note("without tendons", [self._label("tendon", i) for i in range(model.ntendon)])
        sprung = joints[model.jnt_stiffness[joints] != 0.0]
        self._note("without springs of joints", [self._label("joint", j) for j in sprung])
        floats = [body for body in self.bodies if model.body_gravcomp[body]]
        self._note("without gravity compensation", [self._label("body", body) for body in floats])
        is_weightless = model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY
        gravity = np.zeros(3) if is_weightless else model.opt.gravity
        if not np.allclose(gravity, _GRAVITY):
            self._note("with gravity of 9.81 m/s²", [f"not {_text(gravity)}"])
        if model.opt.density or model.opt.viscosity:
            self._note("without a fluid", [f"density {model.opt.density:g}"])
        passive = [j for j in self.joints if not self._motors(j)] if model.nactuator else []
        self._note(
            "with motors at joints that have no actuator",
            [self._label("joint", joint) for joint in passive],
        )


def _magnitude(limits: Array) -> float:
    """Return the largest magnitude that both directions of a range allow."""
    smallest, largest = sorted(map(float, np.abs(limits)))
    return smallest if limits[0] < 0.0 < limits[1] else largest


def _placement(position: npt.ArrayLike, wxyz: npt.ArrayLike) -> pin.SE3:
    """Return the placement with a quaternion w x y z."""
    w, x, y, z = np.asarray(wxyz)
    return pin.SE3(pin.Quaternion(w, x, y, z).normalized().toRotationMatrix(), np.array(position))


def _text(numbers: npt.ArrayLike) -> str:
    """Return numbers as a URDF has them, without rounding."""
    return " ".join(map(repr, map(float, np.ravel(numbers))))


def _add_origin(element: ElementTree.Element, place: pin.SE3) -> None:
    """Write a placement."""
    rpy = pin.rpy.matrixToRpy(place.rotation)
    ElementTree.SubElement(element, "origin", xyz=_text(place.translation), rpy=_text(rpy))
