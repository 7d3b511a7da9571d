"""`Simulation`: a robot in MuJoCo, driven by torques and pushes."""

from __future__ import annotations

import copy
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from math import isfinite
from typing import Any, Self

import mujoco
import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._validation import (
    Array,
    as_array,
    as_bool,
    as_instance,
    as_positive,
    cross,
    refuse_new_attributes,
)
from floatbase.dynamics import Contacts, MotionConstraint
from floatbase.dynamics._compiled import acceleration_at
from floatbase.errors import InputError, SimulationError
from floatbase.robots import Robot, State
from floatbase.simulation._conversion import Conversion
from floatbase.simulation.build import body_name, build_model, build_spec, world_of
from floatbase.simulation.connections import Connections, parts_of
from floatbase.simulation.foot_contacts import FootContacts
from floatbase.simulation.ground import Ground
from floatbase.simulation.push import Push, as_pushes
from floatbase.simulation.start import standing_on

# fraction of the base's height at the last reset: a crouching robot keeps more, a lying one less
FALLEN_HEIGHT_FRACTION = 0.4
# of the base's tilt since the last reset: no leg can recover from more
FALLEN_COSINE = float(np.cos(np.deg2rad(60.0)))
# m: a base that begins lower than this lies on the ground, so its height cannot indicate a fall
_MIN_INITIAL_HEIGHT = 1e-3
_MAX_TIMESTEP = 0.1  # s: a robot falls 5 cm in it, and contacts of 4 ms are no longer resolved
# after this warning of MuJoCo or a later one, its numbers are meaningless
_FIRST_FATAL_WARNING = int(mujoco.mjtWarning.mjWARN_BADQPOS)


class Simulation:
    """A robot on the ground in MuJoCo, driven by joint torques.

    MuJoCo reads the robot's own URDF. A floating base gets a free joint, each point foot one ball,
    each wheel a thin disc, and each flat foot a ball at each corner. Each joint gets a torque motor
    with the robot's torque limit and rotor inertia. Joint friction and joint damping are off, as in
    eqs. (1)-(7), except with `joint_losses`. The joint limits of the URDF are on. Only the feet
    collide with the ground; after a fall the links can collide with it, too (`link_collisions`).

    Constructor arguments cannot be changed later, but the contents of `model` and `data` can. A
    copy has its own `model` and `data`.

    Parameters
    ----------
    robot : Robot
        The robot, as from `fb.load`.
    ground : Ground or float, optional
        The ground, or the coefficient of friction of level ground [-].
    timestep : float, optional
        Length of a step [s].
    joint_losses : bool, optional
        Whether the joint damping and dry friction in the robot's file act, as in
        <dynamics damping="0.1" friction="0.5"/>. The equations and the controllers ignore them.
    contacts : Contacts, optional
        Contacts of a controller that exist in the simulation, besides the feet: point contacts,
        flat feet and wheels at other frames, fixed frames and rigid connections. A reset fixes the
        frames where they are. The normals and coefficients of friction are those of the ground.

    Raises
    ------
    InputError
        If the ground accelerates below a robot with a fixed base.
    SimulationError
        If MuJoCo cannot build the robot, or if its mass, gravity, M or h differ from those of the
        robot.

    Notes
    -----
    The physics engine is MuJoCo ([Todorov2012]_).

    Examples
    --------
    >>> import floatbase as fb
    >>> robot = fb.load("go2")
    >>> sim = fb.Simulation(robot, ground=0.8)
    >>> sim.reset(robot.standing())
    >>> sim
    Simulation(go2, t=0.000 s, timestep=0.001 s)
    """

    _example = "fb.Simulation(robot)"
    __setattr__ = refuse_new_attributes

    def __init__(
        self,
        robot: Robot,
        ground: Ground | float = 1.0,
        timestep: float = 1e-3,
        *,
        joint_losses: bool = False,
        contacts: Contacts | None = None,
    ):
        self._robot = as_instance("robot", robot, Robot)
        self._thread_lock = threading.RLock()  # two threads in one MjData crash the process
        self._ground = ground if isinstance(ground, Ground) else Ground(mu=ground)
        self._timestep = as_positive("timestep", timestep, "s", maximum=_MAX_TIMESTEP)
        self._feet = Contacts.feet(robot) if robot.feet else Contacts.none()
        self._joint_losses = as_bool("joint_losses", joint_losses)
        contacts = self._feet if contacts is None else as_instance("contacts", contacts, Contacts)
        extra = parts_of(self._feet, contacts)
        self._contacts = self._feet + extra
        self._world = world_of(self.ground, self.timestep, self.joint_losses, extra)
        if self.ground.acceleration is not None and not robot.is_floating:
            raise InputError(
                f"The ground accelerates, but {robot.name} has a fixed base, which is at rest. Use "
                f"a robot with a floating base, or a ground without acceleration."
            )
        self._model = build_model(robot, self._world)
        self._connections = Connections(self.model, extra)
        self._gravity = self.model.opt.gravity.copy()
        # of the ground
        self._ground_position, self._ground_velocity = np.zeros(3), np.zeros(3)
        self._data = mujoco.MjData(self.model)
        self._conversion = Conversion(robot, self.model)
        self._actuator_ids = np.array(
            [self.model.actuator(name).id for name in robot.joint_names], dtype=int
        )
        self._foot_contacts = FootContacts(self.model, self.ground, self.point_names)
        normals, offsets = self.ground.normals.tolist(), self.ground.offsets.tolist()
        self._planes = list(zip(normals, offsets, strict=True))
        # the hulls are the only meshes; a body that has a foot can always touch
        self._hull_geoms = np.flatnonzero(self.model.geom_type == mujoco.mjtGeom.mjGEOM_MESH)
        self._hull_bodies = np.setdiff1d(
            self.model.geom_bodyid[self._hull_geoms],
            self.model.geom_bodyid[self.foot_contacts.geoms],
        )
        self._set_hulls_touch(False)
        self._base_body = self.model.body(body_name(robot.base)).id if robot.is_floating else 0
        self._refresh_views()
        self.reset()

    def __copy__(self) -> Self:
        return copy.deepcopy(self)  # two simulations that share data would move each other's robot

    def _refresh_views(self) -> None:
        """Keep views into MuJoCo's memory for values of each step: asking MuJoCo takes longer."""
        data = self.data
        self._qpos = data.qpos
        self._qvel = data.qvel
        self._warnings = data.warning.number[_FIRST_FATAL_WARNING:]
        self._base_position = data.xpos[self._base_body]  # of its origin
        self._base_vertical = data.xmat[self._base_body, 2::3]  # its z axis

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "_thread_lock"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore a copy, which has its own MuJoCo data."""
        vars(self).update(state, _thread_lock=threading.RLock())
        self._refresh_views()

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self._robot

    @property
    def ground(self) -> Ground:
        """The ground."""
        return self._ground

    @property
    def timestep(self) -> float:
        """Length of a step [s]."""
        return self._timestep

    @property
    def joint_losses(self) -> bool:
        """Whether the damping and dry friction of the joints act."""
        return self._joint_losses

    @property
    def feet(self) -> Contacts:
        """Contacts of all the robot's feet."""
        return self._feet

    @property
    def contacts(self) -> Contacts:
        """The feet, and the other contacts that exist in the simulation."""
        return self._contacts

    @property
    def connections(self) -> Contacts:
        """Fixed frames and rigid connections in `contacts`."""
        return self._connections.contacts

    @property
    def ground_position(self) -> Array:
        """How far the ground has moved since the last reset, shape (3,), world frame [m].

        MuJoCo's `data` is relative to the ground. The acceleration of the ground is subtracted from
        gravity in MuJoCo's `model`.
        """
        return self._ground_position.copy()

    @property
    def model(self) -> mujoco.MjModel:
        """MuJoCo's model; switching `link_collisions` changes it."""
        return self._model

    @property
    def data(self) -> mujoco.MjData:
        """MuJoCo's data of `model`."""
        return self._data

    @property
    def point_names(self) -> tuple[str, ...]:
        """Names of the points in `contacts`: point feet, and corners of flat feet."""
        return self.contacts.point_names

    @property
    def foot_contacts(self) -> FootContacts:
        """Reader of the feet's contacts."""
        return self._foot_contacts

    @property
    def time(self) -> float:
        """Time since the last reset [s]."""
        return float(self.data.time)

    @property
    def q(self) -> Array:
        """Configuration in the package's convention, shape (nq,).

        Use `sim.reset(sim.state.replace(q=...))` to change it; this also sets the time to 0.
        """
        q = self._conversion.q(self._qpos)
        if self._ground.acceleration is not None:
            q[:3] += self._ground_position
        return q

    @property
    def v(self) -> Array:
        """Velocity in the package's convention, shape (nv,)."""
        qvel = self._qvel
        if self._ground.acceleration is not None:
            qvel = qvel.copy()
            qvel[self._conversion.qvel_of_v[:3]] += self._ground_velocity
        return self._conversion.v(self._qpos, qvel)

    @property
    def joint_state(self) -> tuple[Array, Array]:
        """Positions [rad or m] and velocities of the actuated joints, shape (d,) each."""
        return self._conversion.joint_state(self._qpos, self._qvel)

    @property
    def state(self) -> State:
        """Present state of the robot."""
        return State(self.robot, self.q, self.v)

    @property
    def diverged(self) -> bool:
        """Whether a position, velocity, acceleration or torque became infinite, NaN or too big."""
        # MuJoCo itself notices only in the next step; by then, a velocity that is not finite has
        # already made a position not finite
        return not isfinite(self._qpos.dot(self._qpos)) or any(self._warnings.tolist())

    @property
    def fallen(self) -> bool:
        """Whether a floating base lost 60 % of its height or tilted by 60° since the last reset."""
        if not self.robot.is_floating:
            return False
        largest_drop = (1.0 - FALLEN_HEIGHT_FRACTION) * self._nominal_height
        sunk = self._start_height - self._base_height() > largest_drop
        return sunk or _dot(self._base_vertical.tolist(), self._start_vertical) < FALLEN_COSINE

    @property
    def link_collisions(self) -> bool:
        """Whether the links can collide with the ground, too, through hulls of their shapes.

        These collisions are off until a fall, so that only feet touch the ground, as in eq. (7),
        and a reset switches them off again. `rollout(..., settling_time=1.0)` switches them on
        after a fall, so that the robot comes to lie on its links. Links that are below the ground
        at that time come out slowly. Links never collide with each other.
        """
        return self._link_collisions

    @link_collisions.setter
    def link_collisions(self, enabled: bool) -> None:
        if as_bool("link_collisions", enabled) == self._link_collisions:
            return
        self._set_hulls_touch(bool(enabled))
        if self._hull_geoms.size:
            mujoco.mj_forward(self.model, self.data)

    def _set_hulls_touch(self, enabled: bool) -> None:
        """Switch collisions between the ground and the links' hulls on or off."""
        self._link_collisions = enabled
        self.model.geom_conaffinity[self._hull_geoms] = enabled
        self.model.body_conaffinity[self._hull_bodies] = enabled  # MuJoCo checks bodies first

    def reset(self, state: State | None = None) -> None:
        """Put the robot into a state, at time 0.

        Parameters
        ----------
        state : State, optional
            The state; its robot may have other masses, as from `Robot.with_payload`. By default the
            robot stands on the ground with all feet. On a slope, a robot with more than two feet is
            tilted with the ground. A biped stays upright instead, and its soles are turned into the
            slope; its CoM stays above its feet as on level ground. On several planes or on boxes,
            the base is oriented as in the standing posture. Each foot must be clear of the edges of
            boxes; on an edge it would overlap the box.

        Raises
        ------
        InputError
            If the state belongs to a different robot, or if not all feet can reach the ground.
        SimulationError
            If another thread is using the simulation.
        """
        state = standing_on(self.robot, self.ground) if state is None else state
        if not self.robot.has_joints_of(as_instance("state", state, State).robot):
            raise InputError(
                f"The state belongs to a different robot. This simulation is for "
                f"{self.robot.name}. Pass a state of that robot."
            )
        with self._exclusive():
            self.link_collisions = False
            mujoco.mj_resetData(self.model, self.data)
            self._qpos[:], self._qvel[:] = self._conversion.to_mujoco(state.q, state.v)
            self._ground_position[:] = self._ground_velocity[:] = 0.0
            if len(self.connections):
                mujoco.mj_kinematics(self.model, self.data)
                self._connections.fix(self.model, self.data, state)
            mujoco.mj_forward(self.model, self.data)
        self._start_height = self._nominal_height = self._base_height()
        self._start_vertical = self._base_vertical.tolist()
        if self._nominal_height <= _MIN_INITIAL_HEIGHT:
            # it lies on the ground: measure a fall by the distance to the centre of mass
            self._nominal_height = float(np.linalg.norm(state.com - self._base_position))

    @contextmanager
    def _exclusive(self) -> Iterator[None]:
        """Reserve the simulation for the current thread, or raise `SimulationError`."""
        if not self._thread_lock.acquire(blocking=False):
            raise SimulationError(
                "Another thread is using this simulation, for example a live run. Pause the run, "
                "or make a second simulation with copy.copy(sim)."
            )
        try:
            yield
        finally:
            self._thread_lock.release()

    def spec(self) -> mujoco.MjSpec:
        """Return a new description of the model, for example to write it as XML.

        Returns
        -------
        mujoco.MjSpec
            The description from which `model` was compiled. `sim.spec().to_xml()` is its XML.
        """
        spec = build_spec(self.robot, self._world)
        for mesh in spec.meshes:  # the hulls of links
            spec.geom(mesh.name).conaffinity = int(self._link_collisions)
        return spec

    def step(self, tau: npt.ArrayLike, pushes: tuple[Push, ...] = ()) -> None:
        """Advance the simulation by one timestep.

        Parameters
        ----------
        tau : array_like, shape (d,)
            Joint torques, clipped to the motors' limits [N·m].
        pushes : tuple of Push, optional
            External forces; each acts during its own time.

        Raises
        ------
        InputError
            If the torques or pushes are invalid.
        SimulationError
            If another thread is using the simulation.
        """
        torques, pushes = as_array("torques", tau, (self.robot.d,), "N·m"), as_pushes(pushes)
        with self._exclusive():
            self._advance(torques, pushes)

    def _advance(self, tau: Array, pushes: tuple[Push, ...] = ()) -> None:
        """Advance by one timestep without the checks of `step`; the torques are float64."""
        self.data.ctrl[self._actuator_ids] = tau
        self.data.xfrc_applied[:] = 0.0
        for push in pushes:
            fraction = push.active_fraction(self.data.time, self.timestep)
            if fraction > 0.0:
                self._apply_push(push, fraction * push.force)
        if self._ground.acceleration is None:
            mujoco.mj_step(self.model, self.data)
            return
        middle = self.time + 0.5 * self.timestep  # second order
        acceleration = acceleration_at(self._ground.acceleration, middle)
        self.model.opt.gravity[:] = self._gravity - acceleration  # in the ground's frame
        mujoco.mj_step(self.model, self.data)
        self._ground_velocity += self.timestep * acceleration  # as MuJoCo integrates
        self._ground_position += self.timestep * self._ground_velocity

    def torques(self) -> Array:
        """Return the motor torques of the last step, within the motors' limits.

        Returns
        -------
        ndarray, shape (d,)
            Joint torques [N·m].
        """
        torques: Array = self.data.actuator_force[self._actuator_ids]
        return torques

    def contact_forces(self) -> Array:
        """Return the contact forces on the robot during the last step.

        Returns
        -------
        ndarray, shape (points, 3)
            Force on each point of `point_names`, in the world frame [N].
        """
        geoms, contact_frame_forces = self._read_contacts()
        forces: Array = self._contact_forces_of(geoms[None], contact_frame_forces[None])[0]
        return forces

    def _read_contacts(self) -> tuple[npt.NDArray[np.int32], Array]:
        """Return the present contacts of the feet as `FootContacts.read` does."""
        return self.foot_contacts.read(self.model, self.data, self._link_collisions)

    def _contact_forces_of(
        self, geoms: npt.NDArray[np.int32], contact_frame_forces: Array
    ) -> Array:
        """Convert contacts of N instants to forces, shape (N, points, 3), world frame [N]."""
        return self.foot_contacts.forces(geoms, contact_frame_forces)

    def accelerometer(self) -> Array:
        """Return what an accelerometer in the base measured at the beginning of the last step.

        Returns
        -------
        ndarray, shape (3,)
            Acceleration of the base's origin minus gravity, in the base frame [m/s²]. At rest on
            level ground it is (0, 0, 9.81).
        """
        acceleration = -self.model.opt.gravity  # plus that of the ground, in whose frame data is
        if self.robot.is_floating:
            acceleration = acceleration + self.data.qacc[self._conversion.qvel_of_v[:3]]
        measured: Array = self.data.xmat[self._base_body].reshape(3, 3).T @ acceleration
        return measured

    def contact_positions(self) -> Array:
        """Return the positions of the contact points: the point of each ball nearest to the ground.

        Returns
        -------
        ndarray, shape (points, 3)
            Position of each point of `point_names`, in the world frame [m].
        """
        geoms, data = self.foot_contacts.geoms, self.data
        positions = self.foot_contacts.positions(data.geom_xpos[geoms], data.geom_xmat[geoms])
        return positions + self._ground_position

    def connection_forces(self) -> Array:
        """Return the forces of `connections` during the last step.

        Returns
        -------
        ndarray, shape (6 n,)
            For each of the n connections, force [N] and moment [N·m] on its first frame about that
            frame's origin, in world axes, as its λ.
        """
        return self._connections.forces(self.model, self.data)

    def has(self, contact: MotionConstraint) -> bool:
        """Return whether the simulation has a contact or another constraint of a controller.

        Parameters
        ----------
        contact : MotionConstraint
            The contact.

        Returns
        -------
        bool
            Whether the contact exists. A contact with an acceleration needs a ground with one.
        """
        if contact.name not in self.contacts.names:
            return False
        is_at_rest = getattr(contact, "acceleration", None) is None
        is_point = len(getattr(contact, "point_names", ())) == 1  # also in the middle of a sole
        is_alike = is_point or contact.k == self.contacts[contact.name].k
        return is_alike and (is_at_rest or self.ground.acceleration is not None)

    def pushed_body(self, push: Push) -> int:
        """Return MuJoCo's id of the body that a push acts on.

        Parameters
        ----------
        push : Push
            The push.

        Returns
        -------
        int
            MuJoCo's id of the body.

        Raises
        ------
        InputError
            If the pushed link is fixed to the ground.
        """
        frame = self.robot.model.frames[self.robot.frame_id(as_instance("push", push, Push).frame)]
        joint = self.robot.model.names[frame.parentJoint]
        if joint in self.robot.joint_names:
            return int(self.model.joint(joint).bodyid[0])
        if self.robot.is_floating:
            return self._base_body
        links = [f for f in self.robot.model.frames if f.type == pin.FrameType.BODY]
        raise InputError(
            f"A push at {push.frame!r} has no effect, because {self.robot.name} is fixed to the "
            f"ground there. Push a link that moves: "
            f"{', '.join(link.name for link in links if link.parentJoint > 0)}."
        )

    def _apply_push(self, push: Push, force: Array) -> None:
        """Apply a force at the origin of a push's frame.

        MuJoCo applies forces at the body's centre of mass, so a moment is added.
        """
        frame = self.robot.model.frames[self.robot.frame_id(push.frame)]
        body = self.pushed_body(push)
        position = (
            self.data.xpos[body] + self.data.xmat[body].reshape(3, 3) @ frame.placement.translation
        )
        self.data.xfrc_applied[body, :3] += force
        self.data.xfrc_applied[body, 3:] += cross(position - self.data.xipos[body], force)

    def _base_height(self) -> float:
        """Return the height of the base's origin above the nearest plane of the ground [m].

        A box below the base counts, too.
        """
        position = self._base_position.tolist()
        height: float = min([_dot(normal, position) - offset for normal, offset in self._planes])
        if self._ground.boxes:
            height = min(height, position[2] - self._ground.height(position[:2]))
        return height

    def __repr__(self) -> str:
        return f"Simulation({self.robot.name}, t={self.time:.3f} s, timestep={self.timestep:g} s)"


def _dot(a: list[float], b: list[float]) -> float:
    """Return aᵀ b of two lists of three numbers; NumPy takes three times as long."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
