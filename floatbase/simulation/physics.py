"""MuJoCo from the same URDF: ground, feet, torque motors, pushes, measured contact forces."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, field
from math import isfinite

import mujoco
import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._arrays import Array, checked, positive, read_only, unit_vector
from floatbase.dynamics import UP
from floatbase.errors import InputError, SimulationError
from floatbase.robots import Foot, Robot, State
from floatbase.simulation.conversion import Conversion, body_name

_CORNER_RADIUS = 0.005  # m: a flat foot stands on small balls whose lowest points are its corners
_GROUND = "ground"
FALLEN_HEIGHT = 0.4  # a base is down when less is left of its height over the ground at the last reset
FALLEN_TILT = np.deg2rad(60.0)  # between the base's vertical now and at the last reset


@dataclass(frozen=True, eq=False)
class Push:
    """A force on the robot for a while.

    force: (3,) N, world, at the origin of a frame of the robot; "base" is the base link. start, duration: s.
    """

    force: Array
    start: float = 0.0
    duration: float = 0.1
    frame: str = "base"

    def __post_init__(self) -> None:
        object.__setattr__(self, "force", checked("force of the push", self.force, (3,), "N"))
        object.__setattr__(self, "start", positive("start of the push", self.start, "s", allow_zero=True))
        object.__setattr__(self, "duration", positive("duration of the push", self.duration, "s"))

    def acts_at(self, t: float) -> bool:
        """Whether the push acts in the step that begins at t, s."""
        return self.start - 1e-9 <= t < self.start + self.duration - 1e-9


@dataclass(frozen=True)
class Ground:
    """The ground: a plane through the origin. normal: (3,), world, made unit. mu: coefficient of friction with the feet."""

    mu: float = 1.0
    normal: Array = field(default_factory=lambda: UP)

    def __post_init__(self) -> None:
        object.__setattr__(self, "mu", positive("friction coefficient mu of the ground", self.mu))
        object.__setattr__(self, "normal", unit_vector("normal of the ground", self.normal))


class Simulation:
    """A robot on the ground in MuJoCo, driven by joint torques.

    The model is edited from the robot's own URDF: free joint for a floating base, a ball at each foot (or at each
    corner of a flat foot), a plane with friction, a torque motor with its limit on each joint, rotor inertia as in the
    robot. Joint friction and damping are off, as in (1)-(7); joint limits of the URDF are on. Only feet and ground touch.
    ground: a `Ground`, or the coefficient of friction of a level one. timestep: s.
    Raises `SimulationError` when MuJoCo cannot build the robot.
    """

    def __init__(self, robot: Robot, ground: Ground | float = 1.0, timestep: float = 1e-3):
        if not isinstance(robot, Robot):
            raise InputError(f"Simulation needs a Robot, as from fb.load, not {robot!r}.")
        self.robot = robot
        self.ground = ground if isinstance(ground, Ground) else Ground(mu=ground)
        self.timestep = positive("timestep", timestep, "s")
        self.model = _build(robot, self.ground, self.timestep)
        self.data = mujoco.MjData(self.model)
        self._convert = Conversion(robot, self.model)
        self._motors = np.array([self.model.actuator(name).id for name in robot.joint_names], dtype=int)
        self._points = {geom: i for i, geom in enumerate(_point_geoms(robot))}
        self._point_of_geom = {self.model.geom(name).id: i for name, i in self._points.items()}
        self._wrench = np.zeros(6)
        self._pushed = self.data.xfrc_applied
        warning = mujoco.mjtWarning
        kinds = (warning.mjWARN_BADQPOS, warning.mjWARN_BADQVEL, warning.mjWARN_BADQACC, warning.mjWARN_BADCTRL)
        self._warnings = [self.data.warning[int(kind)] for kind in kinds]
        self._geoms = np.array([self.model.geom(name).id for name in self._points], dtype=int)
        self._below = self.model.geom_size[self._geoms, 0][:, None] * self.ground.normal
        self._base = self.model.body(body_name(robot.base)).id if robot.is_floating else 0
        self.reset()

    @property
    def point_names(self) -> tuple[str, ...]:
        """Names of the points of the robot that can touch the ground: feet, or corners of flat feet."""
        return tuple(self._points)

    @property
    def time(self) -> float:
        """s."""
        return float(self.data.time)

    @property
    def q(self) -> Array:
        """Configuration in the package's convention, shape (nq,)."""
        return self._convert.q(self.data.qpos)

    @property
    def v(self) -> Array:
        """Velocity in the package's convention, shape (nv,)."""
        return self._convert.v(self.data.qpos, self.data.qvel)

    @property
    def state(self) -> State:
        """The robot's state now."""
        return State(self.robot, self.q, self.v)

    @property
    def diverged(self) -> bool:
        """Whether MuJoCo met numbers it could not go on with since the last reset; it drops torques beyond 1e10."""
        bad = any(warning.number for warning in self._warnings)
        qpos, qvel = self.data.qpos, self.data.qvel
        return bad or not (isfinite(qpos @ qpos) and isfinite(qvel @ qvel))

    @property
    def fallen(self) -> bool:
        """Whether a floating base is far lower or more tilted than at the last reset."""
        if not self.robot.is_floating:
            return False
        height, up = self._base_pose()
        sunk = self._upright[0] - height > (1.0 - FALLEN_HEIGHT) * self._stature
        return sunk or float(up @ self._upright[1]) < np.cos(FALLEN_TILT)

    def reset(self, state: State | None = None) -> None:
        """Put the robot into a state, standing upright on the ground's plane by default, at time 0."""
        state = self._standing() if state is None else state
        if not isinstance(state, State):
            raise InputError(f"reset needs a State, as robot.standing(), not {state!r}.")
        if state.robot is not self.robot:
            raise InputError(f"this simulation holds {self.robot.name}; the state belongs to another robot.")
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:], self.data.qvel[:] = self._convert.to_mujoco(state.q, state.v)
        mujoco.mj_forward(self.model, self.data)
        self._upright = self._base_pose()
        self._stature = self._base_stature(state)

    def step(self, tau: npt.ArrayLike, pushes: tuple[Push, ...] = ()) -> None:
        """Advance by one timestep under torques, shape (d,), N·m, clipped to the motors' limits, and present pushes."""
        self.data.ctrl[self._motors] = self._checked_torques(tau)
        self._pushed[:] = 0.0
        for push in pushes:
            if push.acts_at(self.time):
                self._apply(push)
        mujoco.mj_step(self.model, self.data)

    def _checked_torques(self, tau: npt.ArrayLike) -> npt.ArrayLike:
        """The torques, or an `InputError`; their square tells in a third of the time that all of them are finite."""
        if type(tau) is np.ndarray and tau.shape == self._motors.shape and tau.dtype == np.float64 and isfinite(tau @ tau):
            return tau
        return checked("torques", tau, (self.robot.d,), "N·m")

    def torques(self) -> Array:
        """Torques that the motors gave during the last step, within their limits, shape (d,), N·m."""
        return self.data.actuator_force[self._motors]

    def contact_forces(self) -> Array:
        """Forces of the ground on the robot during the last step, shape (n_points, 3), N, world, ordered as `point_names`."""
        forces = np.zeros((len(self._points), 3))
        for i in range(self.data.ncon):
            contact = self.data.contact[i]
            point = self._point_of_geom.get(contact.geom[1], -1)
            if point < 0 or contact.efc_address < 0:
                continue
            mujoco.mj_contactForce(self.model, self.data, i, self._wrench)
            # rows of the frame: normal from the ground (geom 0) to the foot (geom 1), then two tangents
            forces[point] += contact.frame.reshape(3, 3).T @ self._wrench[:3]
        return forces

    def contact_positions(self) -> Array:
        """World positions of the points, shape (n_points, 3), m: the lowest point of each ball along the ground's normal."""
        return self.data.geom_xpos[self._geoms] - self._below

    def _standing(self) -> State:
        """The robot standing on the ground; on a slope turned with it, so that every foot touches."""
        state = self.robot.standing()
        if not self.robot.is_floating:
            return state
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), np.array(self.ground.normal))
        attitude = (turn * pin.Quaternion(*state.q[[6, 3, 4, 5]])).normalized()
        return state.replace(q=np.concatenate([turn.matrix() @ state.q[:3], attitude.coeffs(), state.q[7:]]))

    def _base_pose(self) -> tuple[float, Array]:
        """Height of the base's origin over the ground, m, and its vertical in the world, shape (3,)."""
        vertical = self.data.xmat[self._base].reshape(3, 3)[:, 2]
        return float(self.ground.normal @ self.data.xpos[self._base]), vertical.copy()

    def _base_stature(self, state: State) -> float:
        """What a fall is measured by, m: the height of the base at a reset; of a base that begins on the ground or below it,
        how far the centre of mass is from it."""
        height = self._upright[0]
        return height if height > 1e-3 else float(np.linalg.norm(state.com - self.data.xpos[self._base]))

    def pushed_body(self, push: Push) -> int:
        """MuJoCo's number of the body that a push acts on.

        Raises `UnknownNameError` for a frame that the robot lacks, `InputError` for one that is bolted to the ground.
        """
        frame = self.robot.model.frames[self.robot.frame_id(push.frame)]
        joint = self.robot.model.names[frame.parentJoint]
        if joint in self.robot.joint_names:
            return int(self.model.joint(joint).bodyid[0])
        if self.robot.is_floating:
            return self._base
        moving = [f.name for f in self.robot.model.frames if f.parentJoint > 0 and f.type == pin.FrameType.BODY]
        raise InputError(
            f"a push at {push.frame!r} moves nothing: {self.robot.name} is bolted to the ground there. "
            f"Push a link that moves: {', '.join(moving)}."
        )

    def _apply(self, push: Push) -> None:
        """Add a push at its frame's origin: MuJoCo takes it at the body's centre of mass."""
        frame, body = self.robot.model.frames[self.robot.frame_id(push.frame)], self.pushed_body(push)
        at = self.data.xpos[body] + self.data.xmat[body].reshape(3, 3) @ frame.placement.translation
        self._pushed[body, :3] += push.force
        self._pushed[body, 3:] += np.cross(at - self.data.xipos[body], push.force)

    def __repr__(self) -> str:
        return f"Simulation({self.robot.name}, t={self.time:.3f} s, timestep={self.timestep:g} s)"


def _build(robot: Robot, ground: Ground, timestep: float) -> mujoco.MjModel:
    """The edited model."""
    spec = _spec(robot)
    spec.option.timestep = timestep
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 100.0  # friction as stiff as the normal: feet creep less
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    if robot.is_floating:
        spec.body(body_name(robot.base)).add_freejoint()
    for joint in spec.joints:
        if joint.name in robot.joint_names:
            at = robot.model.idx_vs[robot.model.getJointId(joint.name)]
            joint.armature = float(robot.model.armature[at])
            joint.damping[:] = 0.0
            joint.frictionloss = 0.0
    _add_ground(spec, ground)
    for foot in robot.feet:
        _add_foot(spec, foot, ground.mu)
    for name, limit in zip(robot.joint_names, robot.torque_limits, strict=True):
        _add_motor(spec, name, float(limit))
    try:
        model = spec.compile()
    except ValueError as error:
        raise SimulationError(f"MuJoCo cannot build {robot.name} from {robot.urdf.name}: {error}") from None
    if model.nv != robot.nv:
        raise SimulationError(
            f"MuJoCo finds {model.nv} degrees of freedom in {robot.urdf.name}, the robot has {robot.nv}: "
            "its model was changed after it was read from the URDF."
        )
    return model


def _spec(robot: Robot) -> mujoco.MjSpec:
    """The URDF without its shapes: they are the viewer's business, and feet are added as balls."""
    root = ElementTree.parse(robot.urdf).getroot()
    if robot.is_floating:
        _rename_links(root)
    for link in root.findall("link"):
        for shape in link.findall("visual") + link.findall("collision"):
            link.remove(shape)
    try:
        spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))
    except ValueError as error:
        raise SimulationError(f"MuJoCo cannot read {robot.urdf.name}: {error}") from None
    spec.compiler.fusestatic = True  # welded links become one body
    for body in spec.bodies:
        if not _is_possible(body):
            _hand_inertia_on(body)
    return spec


def _rename_links(root: ElementTree.Element) -> None:
    """Give every link the name that it has as a body: MuJoCo welds a link called world to its own world."""
    for link in root.findall("link"):
        link.set("name", body_name(link.get("name", "")))
    for end in (*root.findall("joint/parent"), *root.findall("joint/child")):
        end.set("link", body_name(end.get("link", "")))


def _inertia(body: mujoco.MjsBody) -> pin.Inertia:
    """A body's inertia in its own frame, as the URDF gives it."""
    ixx, iyy, izz, ixy, ixz, iyz = body.fullinertia
    tensor = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
    R = _rotation(body.iquat)  # the tensor's axes may be turned from the body's
    inertia = pin.Inertia.Zero()  # its constructor refuses tensors that are not positive, and we look for those
    inertia.mass, inertia.lever, inertia.inertia = float(body.mass), np.array(body.ipos), R @ tensor @ R.T
    return inertia


def _is_possible(body: mujoco.MjsBody) -> bool:
    """Whether some mass distribution has this inertia: principal values positive, none larger than the two others' sum."""
    if not np.isfinite(body.fullinertia[0]):
        return True  # the URDF gives none
    smallest, middle, largest = np.linalg.eigvalsh(_inertia(body).inertia)
    return bool(smallest > 1e-15 and smallest + middle >= largest * (1.0 - 1e-9))


def _hand_inertia_on(body: mujoco.MjsBody) -> None:
    """Add a placeholder link's impossible inertia to a welded neighbour's: their sum, which is all that moves, is possible."""
    welded = {child.name: (child, _placement(child).inverse()) for child in body.bodies if not child.joints}
    if not body.joints and body.parent.name != "world":
        welded[body.parent.name] = (body.parent, _placement(body))
    neighbours = [found for found in welded.values() if np.isfinite(found[0].fullinertia[0])]
    if not neighbours:
        return  # MuJoCo will say what is wrong with it
    neighbour, placement = max(neighbours, key=lambda found: float(found[0].mass))
    total = _inertia(neighbour) + placement.act(_inertia(body))
    tensor = total.inertia
    neighbour.mass, neighbour.ipos, neighbour.iquat = total.mass, total.lever, [1.0, 0.0, 0.0, 0.0]
    neighbour.fullinertia = [*tensor.diagonal(), tensor[0, 1], tensor[0, 2], tensor[1, 2]]
    body.mass, body.fullinertia, body.explicitinertial = 0.0, [np.nan, 0.0, 0.0, 0.0, 0.0, 0.0], False


def _placement(body: mujoco.MjsBody) -> pin.SE3:
    """A body's frame in its parent's."""
    return pin.SE3(_rotation(body.quat), np.array(body.pos))


def _rotation(wxyz: np.ndarray) -> np.ndarray:
    """The rotation matrix of one of MuJoCo's quaternions."""
    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, np.array(wxyz))
    return R.reshape(3, 3)


def _add_ground(spec: mujoco.MjSpec, ground: Ground) -> None:
    quat = np.zeros(4)
    mujoco.mju_quatZ2Vec(quat, np.array(ground.normal))
    plane = spec.worldbody.add_geom(
        name=_GROUND,
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[0.0, 0.0, 0.05],
        quat=quat,
        contype=1,
        conaffinity=0,
    )
    _set_contact(plane, ground.mu)


def _add_foot(spec: mujoco.MjSpec, foot: Foot, mu: float) -> None:
    body = spec.body(body_name(foot.frame))
    if body is None:
        raise SimulationError(f"the foot {foot.frame} is no link of the URDF; give feet by the names of their links.")
    for name, centre, radius in _balls(foot):
        ball = body.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[radius, 0.0, 0.0],
            pos=centre,
            mass=0.0,
            contype=0,
            conaffinity=1,
        )
        _set_contact(ball, mu)


def _set_contact(geom: mujoco.MjsGeom, mu: float) -> None:
    """Friction without spinning or rolling resistance, and a contact as stiff as 1 kHz allows."""
    geom.condim = 3
    geom.friction = [mu, 0.0, 0.0]
    geom.solref = [0.004, 1.0]
    geom.solimp = [0.95, 0.99, 0.001, 0.5, 2.0]


def _balls(foot: Foot) -> list[tuple[str, Array, float]]:
    """Name, centre in the frame and radius of each ball that a foot stands on."""
    if foot.corners is None:
        return [(foot.frame, foot.centre, max(foot.radius, 1e-4))]
    up = np.array([0.0, 0.0, _CORNER_RADIUS])
    return [(f"{foot.frame} corner {i}", read_only(c + up), _CORNER_RADIUS) for i, c in enumerate(foot.corners)]


def _point_geoms(robot: Robot) -> list[str]:
    return [name for foot in robot.feet for name, _, _ in _balls(foot)]


def _add_motor(spec: mujoco.MjSpec, joint: str, limit: float) -> None:
    motor = spec.add_actuator(name=joint, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    motor.set_to_motor()
    if np.isfinite(limit):
        motor.ctrllimited = mujoco.mjtLimited.mjLIMITED_TRUE
        motor.ctrlrange = [-limit, limit]
