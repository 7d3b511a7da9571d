"""MJCF files: MuJoCo compiles them, and the robot in the result is written as a URDF.

Bodies, sites and named geoms that can touch others become links. The module imports MuJoCo, so it
is imported on first use.
"""

from __future__ import annotations

import os
import xml.etree.ElementTree as ElementTree
from collections import Counter
from pathlib import Path
from typing import NamedTuple
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._validation import Array
from floatbase.errors import InputError, unknown_name
from floatbase.robots._checks import clamp_to_limits, has_floating_base
from floatbase.robots._mujoco_motors import gear, largest_torque, motors_of
from floatbase.robots.inertia import origin_attributes, shifted, text_of
from floatbase.robots.urdf import parse_urdf, read_text

_Joint, _Geom = mujoco.mjtJoint, mujoco.mjtGeom
_JOINT_TYPES = {_Joint.mjJNT_HINGE: "revolute", _Joint.mjJNT_SLIDE: "prismatic"}
_LAST_VISIBLE_GROUP = 2  # MuJoCo's viewer hides geoms of the groups 3 to 5 at first
_NO_COLOUR = [0.5, 0.5, 0.5, 1.0]  # MuJoCo's colour of a geom that has none
_MESH_FILES = (".stl", ".obj", ".dae")
_GRAVITY = [0.0, 0.0, -9.81]


class Mjcf(NamedTuple):
    """A robot in an MJCF file."""

    urdf: str
    model: pin.Model
    posture: Array
    has_keyframes: bool
    differences: list[str]  # between the robot and the file


def read_mjcf(name: str, file: Path, floating: bool | None, keyframe: str | None) -> Mjcf:
    """Return the robot in an MJCF file, with the base as in the file if `floating` is None.

    The posture is that of the keyframe, by default that of the first one or the initial one.
    """
    folder, text = file.resolve().parent, read_text(file)
    try:
        tag = (root := ElementTree.fromstring(text)).tag
        if tag != "mujoco":
            advice = " Load it with fb.load_urdf." if tag == "robot" else ""
            raise ValueError(f"its outermost element is <{tag}>, but it must be <mujoco>.{advice}")
        folders = [folder, *((folder / m.get("file", "")).parent for m in root.iter("model"))]
        spec = mujoco.MjSpec.from_file(str(file))
        missing = _drop_what_is_missing(spec, folders)
        # welded bodies are links, and visual geoms are drawn
        spec.compiler.fusestatic = spec.compiler.discardvisual = False
        compiled = spec.compile()
        if not np.isfinite([*compiled.qpos0, *compiled.key_qpos.flat]).all():
            raise ValueError("a position of a body, a joint or in a keyframe is not finite.")
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f"{file} cannot be read as an MJCF: {error}") from None
    writer = _Writer(name, compiled, spec, folder, bool(floating))
    urdf, qpos = writer.urdf(floating is False), writer.configuration(keyframe)
    model = parse_urdf(name, urdf, bool(writer.root) if floating is None else floating)
    q, armature = pin.neutral(model), np.zeros(model.nv)
    if has_floating_base(model):
        start = compiled.jnt_qposadr[compiled.body_jntadr[writer.root]]
        place = np.append(compiled.body_pos[writer.root], compiled.body_quat[writer.root])
        place = qpos[start : start + 7] if writer.root in writer.free else place
        q[:7] = place[[0, 1, 2, 4, 5, 6, 3]]
    for i in writer.joints:
        joint = model.joints[model.getJointId(writer.label("joint", i))]
        x = qpos[compiled.jnt_qposadr[i]]
        q[joint.idx_q :][: joint.nq] = x if joint.nq == 1 else (np.cos(x), np.sin(x))
        armature[joint.idx_v] = writer.with_motors(i, "armature")
    model.armature = armature
    posture = clamp_to_limits(model, pin.normalize(model, q))
    return Mjcf(urdf, model, posture, compiled.nkey > 0, writer.differences(missing))


def _drop_what_is_missing(spec: mujoco.MjSpec, folders: list[Path]) -> list[str]:
    """Remove the geoms whose mesh file is missing, and return the names of these meshes.

    The others get the paths of their files, beside the MJCF or one attached to it. Parts that a
    robot does not need, such as textures and terrain, are removed as well. So are contacts with
    geoms that only the scene around the robot has.
    """
    for texture in spec.textures:
        texture.file, texture.cubefiles = "", [""] * len(texture.cubefiles)
        texture.builtin, texture.width, texture.height = mujoco.mjtBuiltin.mjBUILTIN_FLAT, 1, 1
    missing = dict[str, mujoco.MjsMesh]()
    for mesh in filter(lambda mesh: mesh.file, spec.meshes):
        file = Path(mesh.file).name if spec.strippath else mesh.file
        paths = [folder / (mesh.compiler.meshdir or "") / file for folder in folders]
        found = [str(path) for path in paths if path.is_file()]
        mesh.file = (found or [mesh.file])[0]
        if not found:
            missing[mesh.name or Path(mesh.file).stem] = mesh
    spec.strippath = False  # paths are complete now
    for geom in list(spec.geoms):
        body = geom.parent
        has_mass = not body.explicitinertial and geom.mass != 0.0 and geom.density != 0.0
        if geom.meshname in missing and has_mass and body.name != "world":
            raise ValueError(
                f"the mass of body {body.name!r} depends on the mesh {geom.meshname!r}, whose file "
                f"is missing. Provide the file, or give the body an <inertial>."
            )
        if geom.meshname in missing or geom.type == _Geom.mjGEOM_HFIELD:
            spec.delete(geom)
    names = {geom.name for geom in spec.geoms}
    pairs = [pair for pair in spec.pairs if not {pair.geomname1, pair.geomname2} <= names]
    for part in (*missing.values(), *spec.hfields, *spec.skins, *spec.sensors, *pairs):
        spec.delete(part)
    return list(missing)


class _Writer:
    """Writes the robot of a compiled model as a URDF."""

    def __init__(
        self, name: str, model: mujoco.MjModel, spec: mujoco.MjSpec, folder: Path, floating: bool
    ):
        self._name, self._model, self._spec, self._folder = name, model, spec, folder
        self.free = set(model.jnt_bodyid[model.jnt_type == int(_Joint.mjJNT_FREE)].tolist())
        self.root = self._find_root(floating)
        bodies = [b for b in range(model.nbody) if self._is_of_robot(model.body_rootid[b])]
        self._bodies = bodies
        moved = enumerate(model.jnt_bodyid.tolist())
        self.joints = [joint for joint, b in moved if b in bodies and b != self.root]
        self._couplings = self._find_couplings()
        self._links, self._joint_elements = dict[str, str](), dict[str, str]()  # by name

    def _find_root(self, floating: bool) -> int:
        """Return the body with the floating base, or 0, the world, for a fixed base."""
        model = self._model
        joints = Counter(model.body_rootid[model.jnt_bodyid].tolist())  # of each child of the world
        bolted = [root for root in joints if root not in self.free]
        largest = max(self.free, key=joints.__getitem__, default=0)
        if largest and (joints[largest] > 1 or not bolted):
            return largest
        if floating and len(bolted) != 1:
            raise InputError(
                f"The base of {self._name} cannot float. This needs a <freejoint>, or exactly one "
                f"moving body that is attached to the world, not {self._labels('body', bolted)}."
            )
        return bolted[0] if floating else 0

    def _is_of_robot(self, root: int) -> bool:
        """Return whether the bodies below a child of the world belong to the robot."""
        return bool(root == self.root if self.root else root not in self.free)

    def _find_couplings(self) -> dict[int, int]:
        """Return the joints whose positions are linear in that of a joint, and the constraints."""
        model, couplings = self._model, dict[int, int]()
        is_coupling = (model.eq_type == int(mujoco.mjtEq.mjEQ_JOINT)) & (model.eq_active0 != 0)
        is_coupling &= ~model.eq_data[:, 2:5].any(axis=1)
        is_coupling &= np.isin(model.eq_obj1id, self.joints) & np.isin(model.eq_obj2id, self.joints)
        for constraint in np.flatnonzero(is_coupling).tolist():
            couplings.setdefault(int(model.eq_obj1id[constraint]), constraint)
        return couplings

    def _mimic(self, joint: int) -> str:
        """Write the coupling of a joint to its leader, if it has one."""
        if joint not in self._couplings:
            return ""
        model, constraint = self._model, self._couplings[joint]
        leader, (constant, slope) = model.eq_obj2id[constraint], model.eq_data[constraint, :2]
        rest, leader_rest = model.qpos0[model.jnt_qposadr[[joint, leader]]]
        return (
            f"<mimic joint={quoteattr(self.label('joint', leader))} multiplier='{text_of(slope)}' "
            f"offset='{text_of(rest + constant - slope * leader_rest)}'/>"
        )

    def label(self, kind: str, number: int) -> str:
        """Return the name of a body, joint, geom, …, or one made from its number."""
        new, kind_id = f"{kind}_{number}", getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}")
        while mujoco.mj_name2id(self._model, kind_id, new) >= 0:  # it is the name of another one
            new += "_"
        return getattr(self._model, kind)(number).name or new

    def _labels(self, kind: str, numbers: npt.ArrayLike) -> list[str]:
        """Return the names of several bodies, joints, …."""
        return [self.label(kind, number) for number in np.array(numbers, dtype=int).tolist()]

    def urdf(self, is_bolted: bool) -> str:
        """Write the URDF, with a base that could float welded to the world if `is_bolted`."""
        model, root = self._model, self.root
        for body in self._bodies:
            self._add_body(body)
        if root and is_bolted:
            self._links["world"] = ""
            place = _placement(model.body_pos[root], model.body_quat[root])
            self._add_joint("world weld", "fixed", "world", self.label("body", root), place)
        for geom in range(model.ngeom):
            if model.geom_bodyid[geom] in self._bodies:
                self._add_geom(geom)
        for site in range(model.nsite):
            if model.site_bodyid[site] in self._bodies:
                place = _placement(model.site_pos[site], model.site_quat[site])
                self._frame(model.site(site).name, model.site_bodyid[site], place)
        links = [f"<link name={quoteattr(k)}>{text}</link>" for k, text in self._links.items()]
        elements = "".join([*links, *self._joint_elements.values()])
        return f"<robot name={quoteattr(self._name)}>{elements}</robot>"

    def _add_body(self, body: int) -> None:
        """Write a link and the joints to its parent; several joints have links between them."""
        model, name = self._model, self.label("body", body)
        R = _placement(np.zeros(3), model.body_iquat[body]).rotation
        tensor = R @ np.diag(model.body_inertia[body]) @ R.T
        pairs = [(i, j) for i in range(3) for j in range(i, 3)]
        entries = " ".join(f"i{'xyz'[i]}{'xyz'[j]}='{text_of(tensor[i, j])}'" for i, j in pairs)
        self._links[name] = (
            f"<inertial>{_origin(shifted(model.body_ipos[body]))}"
            f"<mass value='{text_of(model.body_mass[body])}'/><inertia {entries}/></inertial>"
        )
        if body == self.root:
            return
        parent = self.label("body", model.body_parentid[body])
        place = _placement(model.body_pos[body], model.body_quat[body])
        joints = model.body_jntadr[body] + np.arange(model.body_jntnum[body])
        for joint in joints:
            anchor = model.jnt_pos[joint]
            is_body = joint == joints[-1] and not anchor.any()
            child = name if is_body else f"{self.label('joint', joint)} link"
            self._links.setdefault(child, "")
            self._add_moving_joint(joint, parent, child, place * shifted(anchor))
            parent, place = child, shifted(-anchor)
        if parent != name:
            self._add_joint(f"{name} weld", "fixed", parent, name, place)

    def _add_joint(
        self, name: str, kind: str, parent: str, child: str, place: pin.SE3, rest: str = ""
    ) -> None:
        """Write a joint."""
        self._joint_elements[name] = (
            f"<joint name={quoteattr(name)} type='{kind}'>{_origin(place)}"
            f"<parent link={quoteattr(parent)}/><child link={quoteattr(child)}/>{rest}</joint>"
        )

    def _add_moving_joint(self, joint: int, parent: str, child: str, place: pin.SE3) -> None:
        """Write a joint with its axis, limits and friction; `place` is its anchor."""
        model, name = self._model, self.label("joint", joint)
        kind, limited = _Joint(int(model.jnt_type[joint])), bool(model.jnt_limited[joint])
        if kind not in _JOINT_TYPES:
            raise InputError(
                f"Joint {name!r} of {self._name} is a {kind.name[6:].lower()} joint, but a motor "
                f"drives only one degree of freedom. Replace it by hinges, or remove it, which "
                f"welds its body to the parent."
            )
        # MuJoCo measures motion from the reference
        back = -model.qpos0[model.jnt_qposadr[joint]] * model.jnt_axis[joint]
        is_hinge = kind == _Joint.mjJNT_HINGE
        place = place * (pin.SE3(pin.exp3(back), np.zeros(3)) if is_hinge else shifted(back))
        lower, upper = model.jnt_range[joint] if limited else np.zeros(2)
        dof = model.jnt_dofadr[joint]
        torque = largest_torque(model, joint)
        effort = text_of(torque if np.isfinite(torque) else 0.0)  # 0 if unlimited
        rest = (
            f"<axis xyz='{text_of(model.jnt_axis[joint])}'/><limit lower='{text_of(lower)}' "
            f"upper='{text_of(upper)}' effort='{effort}' velocity='0'/>"
            f"<dynamics damping='{text_of(self.with_motors(joint, 'damping'))}' "
            f"friction='{text_of(model.dof_frictionloss[dof])}'/>{self._mimic(joint)}"
        )
        kind_name = "continuous" if is_hinge and not limited else _JOINT_TYPES[kind]
        self._add_joint(name, kind_name, parent, child, place, rest)

    def _frame(self, name: str, body: int, place: pin.SE3) -> bool:
        """Write a massless link, unless it has no name or that of another part of the robot."""
        is_new = name != "" and name not in self._links and name not in self._joint_elements
        if is_new:
            self._links[name] = ""
            self._add_joint(f"{name} weld", "fixed", self.label("body", body), name, place)
        return is_new

    def _add_geom(self, geom: int) -> None:
        """Write the shape of a geom; a named one that can touch others gets a link."""
        model, name, body = self._model, self._model.geom(geom).name, self._model.geom_bodyid[geom]
        pairs = np.concatenate([model.pair_geom1, model.pair_geom2])
        touches = model.geom_contype[geom] or model.geom_conaffinity[geom] or geom in pairs
        shapes, place = self._shapes(geom)
        link = self.label("body", body)
        if shapes and touches and self._frame(name, body, place):
            link, place = name, pin.SE3.Identity()
        rgba, material = model.geom_rgba[geom], model.geom_matid[geom]
        if material >= 0 and np.allclose(rgba, _NO_COLOUR):
            rgba = model.mat_rgba[material]
        is_visible = model.geom_group[geom] <= _LAST_VISIBLE_GROUP and rgba[3] > 0.0
        colour = f"<material name='{text_of(rgba)}'><color rgba='{text_of(rgba)}'/></material>"
        for shape, offset in shapes:
            text = f"{_origin(place * offset)}<geometry>{shape}</geometry>"
            if is_visible:
                self._links[link] += f"<visual>{text}{colour}</visual>"
            if touches:
                self._links[link] += f"<collision>{text}</collision>"

    def _shapes(self, geom: int) -> tuple[list[tuple[str, pin.SE3]], pin.SE3]:
        """Return the URDF's shapes for a geom, and the geom's placement in its body."""
        model, middle = self._model, pin.SE3.Identity()
        kind, size = _Geom(int(model.geom_type[geom])), model.geom_size[geom]
        place = _placement(model.geom_pos[geom], model.geom_quat[geom])
        ball = f"<sphere radius='{text_of(size[0])}'/>"
        cylinder = f"<cylinder radius='{text_of(size[0])}' length='{text_of(2.0 * size[1])}'/>"
        ends = [(ball, shifted([0.0, 0.0, z])) for z in (-size[1], size[1])]
        round_shapes = {
            _Geom.mjGEOM_SPHERE: [(ball, middle)],
            _Geom.mjGEOM_CYLINDER: [(cylinder, middle)],
            _Geom.mjGEOM_CAPSULE: [(cylinder, middle), *ends],
        }
        if kind in round_shapes:
            return round_shapes[kind], place
        if kind == _Geom.mjGEOM_MESH:
            mesh = model.geom_dataid[geom]
            asset = self._spec.meshes[mesh]
            path = Path(asset.file)
            is_moved = asset.refpos.any() or asset.refquat[0] != 1.0
            if asset.file and path.suffix.lower() in _MESH_FILES and not is_moved:
                location = Path(os.path.relpath(path, self._folder)).as_posix()
                file = quoteattr(f"package://{location}")
                # MuJoCo moves the origin of a mesh to its centre of mass
                centre = _placement(model.mesh_pos[mesh], model.mesh_quat[mesh])
                shape = f"<mesh filename={file} scale='{text_of(asset.scale)}'/>"
                return [(shape, middle)], place * centre.inverse()
        if kind not in (_Geom.mjGEOM_BOX, _Geom.mjGEOM_ELLIPSOID, _Geom.mjGEOM_MESH):
            return [], place  # planes are no part of a robot
        # the box itself, or that around an ellipsoid or another mesh
        box = model.geom_aabb[geom]
        return [(f"<box size='{text_of(2.0 * box[3:])}'/>", shifted(box[:3]))], place

    def configuration(self, keyframe: str | None) -> Array:
        """Return MuJoCo's qpos in a keyframe; by default in the first one, or else initially."""
        model = self._model
        names = self._labels("key", range(model.nkey))
        if keyframe is not None and keyframe not in names:
            raise unknown_name(
                f"keyframe of {self._name}", keyframe, names, "posture=[…] takes joint positions."
            )
        index = 0 if keyframe is None else names.index(keyframe)
        qpos: Array = model.key_qpos[index] if names else model.qpos0
        return qpos

    def with_motors(self, joint: int, quantity: str) -> float:
        """Return the armature [kg m² or kg] or the damping of a joint, with that of its motors."""
        model, motors = self._model, motors_of(self._model, joint)
        of_joint = getattr(model, f"dof_{quantity}")[model.jnt_dofadr[joint]]
        of_motors = gear(model, motors) ** 2 @ getattr(model, f"actuator_{quantity}")[motors]
        return float(of_joint + of_motors)

    def differences(self, missing: list[str]) -> list[str]:
        """Name everything that the robot does not have as in the file."""
        model, option = self._model, self._model.opt
        joints, bodies = np.array(self.joints, dtype=int), np.array(self._bodies)
        is_weightless = option.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY
        gravity = np.zeros(3) if is_weightless else option.gravity
        is_usual = np.allclose(gravity, _GRAVITY) and option.density == option.viscosity == 0.0
        surroundings = f"gravity {text_of(gravity)}, density {option.density:g}"
        roots = np.unique(model.body_rootid[model.jnt_bodyid]).tolist()
        others = [root for root in roots if not self._is_of_robot(root)]
        nonlinear = [model.jnt_stiffnesspoly, model.dof_dampingpoly[model.jnt_dofadr]]
        coefficients = np.column_stack([model.jnt_stiffness, *nonlinear])[joints]
        springs = joints[np.flatnonzero(coefficients.any(axis=1))]
        base = [model.body_jntadr[self.root]] if self.root in self.free else []
        heavy = [joint for joint in base if model.dof_armature[model.jnt_dofadr[joint]]]
        constraints = list(self._couplings.values())
        coupled = {*self._couplings, *model.eq_obj2id[constraints].tolist()}  # they are locked
        driven = [i for i in self.joints if i not in coupled and model.nactuator]
        passive = [i for i in driven if not motors_of(model, i)]
        differences = {
            "without meshes whose file is missing": missing,
            "without equality constraints": self._labels(
                "equality", sorted({*np.flatnonzero(model.eq_active0).tolist()} - {*constraints})
            ),
            "without tendons": self._labels("tendon", range(model.ntendon)),
            "without other moving bodies": self._labels("body", others),
            "without springs or nonlinear damping": self._labels("joint", springs),
            "without the armature of free joints": self._labels("joint", heavy),
            "without gravity compensation": self._labels(
                "body", bodies[model.body_gravcomp[bodies] != 0]
            ),
            "in air with gravity of 9.81 m/s²": [] if is_usual else [f"not {surroundings}"],
            "with motors at joints that have no actuator": self._labels("joint", passive),
        }
        return [
            f"{difference} ({', '.join(parts[:3])}{', …' * (len(parts) > 3)})"
            for difference, parts in differences.items()
            if parts
        ]


def _placement(position: npt.ArrayLike, wxyz: npt.ArrayLike) -> pin.SE3:
    """Return the placement with a quaternion w x y z."""
    w, x, y, z = np.asarray(wxyz)
    return pin.SE3(pin.Quaternion(w, x, y, z).normalized().toRotationMatrix(), np.array(position))


def _origin(place: pin.SE3) -> str:
    """Write a placement."""
    return "<origin xyz='{xyz}' rpy='{rpy}'/>".format(**origin_attributes(place))
