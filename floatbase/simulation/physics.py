"""A robot in MuJoCo: torques and pushes in, states and contact forces out."""

from __future__ import annotations

import copy
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
from floatbase.dynamics import UP, Contacts
from floatbase.errors import InputError
from floatbase.robots import Robot, State
from floatbase.simulation._conversion import Conversion
from floatbase.simulation.build import Ground, body_name, build_model
from floatbase.simulation.foot_contacts import FootContacts
from floatbase.simulation.push import Push, as_pushes

# part of the base's height at the last reset: a crouch keeps more, lying down does not
_FALLEN_HEIGHT_FRACTION = 0.4
_FALLEN_COSINE = float(
    np.cos(np.deg2rad(60.0))
)  # of the base's tilt since the last reset: no leg brings it back from there
# m: a base that begins lower than this lies on the ground, and its height measures no fall
_MIN_INITIAL_HEIGHT = 1e-3
_MAX_TIMESTEP = 0.1  # s: a robot falls 5 cm meanwhile, and no contact of 4 ms is followed
_FIRST_FATAL_WARNING = int(
    mujoco.mjtWarning.mjWARN_BADQPOS
)  # this warning of MuJoCo and the later ones: its numbers mean nothing any more


class Simulation:
    """A robot on the ground in MuJoCo, driven by joint torques.

    MuJoCo reads the robot's own URDF. A floating base gets a free joint, each foot a ball (a flat
    foot one at each corner), each joint a torque motor with the robot's limit and rotor inertia,
    the ground planes with friction. Joint friction and damping are off, as in (1)-(7); the URDF's
    joint limits are on. Only feet and ground touch, after a fall `link_collisions` too.

    robot as from `fb.load`; ground: a `Ground`, or the coefficient of friction of a level one;
    timestep in s. `model` and `data` are MuJoCo's own, `feet` the robot's feet as `Contacts`.
    Raises `SimulationError` when MuJoCo cannot build the robot. What it was made with cannot
    be set; what `model` and `data` hold may change. A copy has `model` and `data` of its own.
    """

    _example = "fb.Simulation(robot)"
    __setattr__ = refuse_new_attributes

    def __init__(self, robot: Robot, ground: Ground | float = 1.0, timestep: float = 1e-3):
        self._robot = as_instance("robot", robot, Robot)
        self._ground = ground if isinstance(ground, Ground) else Ground(mu=ground)
        self._timestep = as_positive("timestep", timestep, "s", maximum=_MAX_TIMESTEP)
        self._feet = Contacts.feet(robot)
        self._model = build_model(robot, self.ground, self.timestep)
        self._data = mujoco.MjData(self.model)
        self._conversion = Conversion(robot, self.model)
        self._actuator_ids = np.array(
            [self.model.actuator(name).id for name in robot.joint_names], dtype=int
        )
        self._foot_contacts = FootContacts(self.model, self.ground, self.point_names)
        self._planes = list(
            zip(self.ground.normals.tolist(), self.ground.offsets.tolist(), strict=True)
        )
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
        return copy.deepcopy(self)  # two robots with the same data would move each other

    def _refresh_views(self) -> None:
        """Views into MuJoCo's memory of what every tick looks at: to ask MuJoCo for them takes
        longer than to look.
        """
        data = self.data
        self._qpos, self._qvel, self._warnings = (
            data.qpos,
            data.qvel,
            data.warning.number[_FIRST_FATAL_WARNING:],
        )
        self._base_position, self._base_vertical = (
            data.xpos[self._base_body],
            data.xmat[self._base_body, 2::3],
        )  # origin and z axis

    def __setstate__(self, state: dict[str, Any]) -> None:
        """A copy has MuJoCo's data of its own."""
        vars(self).update(state)
        self._refresh_views()

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self._robot

    @property
    def ground(self) -> Ground:
        """The ground that it stands on."""
        return self._ground

    @property
    def timestep(self) -> float:
        """Length of a step [s]."""
        return self._timestep

    @property
    def feet(self) -> Contacts:
        """The robot's feet."""
        return self._feet

    @property
    def model(self) -> mujoco.MjModel:
        """MuJoCo's model; while `link_collisions` are on, another one."""
        return self._model

    @property
    def data(self) -> mujoco.MjData:
        """MuJoCo's data of `model`."""
        return self._data

    @property
    def point_names(self) -> tuple[str, ...]:
        """Names of the points of the robot that can touch the ground: feet, or corners of flat
        feet.
        """
        return self.feet.point_names

    @property
    def foot_contacts(self) -> FootContacts:
        """Reader of the feet's contacts."""
        return self._foot_contacts

    @property
    def time(self) -> float:
        """s since the last reset."""
        return float(self.data.time)

    @property
    def q(self) -> Array:
        """Configuration in the package's convention, shape (nq,).

        `sim.reset(sim.state.replace(q=…))` puts the robot into another one, at time 0.
        """
        return self._conversion.q(self._qpos)

    @property
    def v(self) -> Array:
        """Velocity in the package's convention, shape (nv,)."""
        return self._conversion.v(self._qpos, self._qvel)

    @property
    def joint_state(self) -> tuple[Array, Array]:
        """Angles, rad (or m), and velocities of the actuated joints, shape (d,) each, as
        `Actuators` take them.
        """
        return self._conversion.joint_state(self._qpos, self._qvel)

    @property
    def state(self) -> State:
        """The robot's state now."""
        return State(self.robot, self.q, self.v)

    @property
    def diverged(self) -> bool:
        """Whether positions, velocities, accelerations or torques became infinite, NaN or larger
        than MuJoCo takes.
        """
        # MuJoCo itself finds out only in the next step; a velocity that is not finite has made a
        # position that is none
        return not isfinite(self._qpos.dot(self._qpos)) or any(self._warnings.tolist())

    @property
    def fallen(self) -> bool:
        """Whether a floating base has lost 60 % of its height, or tilts by 60°, since the last
        reset.
        """
        if not self.robot.is_floating:
            return False
        sunk = (
            self._start_height - self._base_height()
            > (1.0 - _FALLEN_HEIGHT_FRACTION) * self._nominal_height
        )
        return sunk or _dot(self._base_vertical.tolist(), self._start_vertical) < _FALLEN_COSINE

    @property
    def link_collisions(self) -> bool:
        """Whether the ground touches links, too, not only feet: the hulls of the URDF's collision
        shapes. A reset ends it.

        A fallen robot lies on them, as `rollout(…, settling_time=1.0)` shows. Before a fall only
        feet touch, as in (7), and links in the ground come out slowly. Links go through each other.
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
        """Let the ground touch the links' hulls, or not."""
        self._link_collisions = enabled
        self.model.geom_conaffinity[self._hull_geoms] = enabled
        self.model.body_conaffinity[self._hull_bodies] = enabled  # bodies that MuJoCo looks at

    def reset(self, state: State | None = None) -> None:
        """Put the robot into a state, standing on the ground by default, at time 0.

        By default it is turned with a slope; on a ground of several planes its base is as the
        posture has it.
        """
        state = self._standing_state() if state is None else as_instance("state", state, State)
        if state.robot != self.robot:
            raise InputError(
                f"this simulation holds {self.robot.name}; the state belongs to another robot."
            )
        self.link_collisions = False
        mujoco.mj_resetData(self.model, self.data)
        self._qpos[:], self._qvel[:] = self._conversion.to_mujoco(state.q, state.v)
        mujoco.mj_forward(self.model, self.data)
        self._start_height = self._nominal_height = self._base_height()
        self._start_vertical = self._base_vertical.tolist()
        if (
            self._nominal_height <= _MIN_INITIAL_HEIGHT
        ):  # it lies: a fall is measured by the way to the centre of mass
            self._nominal_height = float(np.linalg.norm(state.com - self._base_position))

    def step(self, tau: npt.ArrayLike, pushes: tuple[Push, ...] = ()) -> None:
        """Advance by one timestep under torques, shape (d,), N·m, clipped to the motors' limits,
        and present pushes.
        """
        self.advance(as_array("torques", tau, (self.robot.d,), "N·m"), as_pushes(pushes))

    def advance(self, tau: Array, pushes: tuple[Push, ...] = ()) -> None:
        """`step` without its check, for loops that have checked the torques already: float64,
        finite, shape (d,).
        """
        self.data.ctrl[self._actuator_ids] = tau
        self.data.xfrc_applied[:] = 0.0
        for push in pushes:
            fraction = push.active_fraction(self.data.time, self.timestep)
            if fraction > 0.0:
                self._apply_push(push, fraction * push.force)
        mujoco.mj_step(self.model, self.data)

    def torques(self) -> Array:
        """Torques of the motors during the last step, within their limits, shape (d,), N·m."""
        return self.torques_of(self.data.actuator_force)

    def torques_of(self, actuator_force: Array) -> Array:
        """`torques` for MuJoCo's forces of all its actuators, shape (…, d), unchecked."""
        return actuator_force[..., self._actuator_ids]

    def contact_forces(self) -> Array:
        """Forces of the ground on the robot during the last step, shape (n_points, 3), N, world,
        ordered as `point_names`.
        """
        geoms, contact_frame_forces = self.read_contacts()
        forces: Array = self.contact_forces_of(geoms[None], contact_frame_forces[None])[0]
        return forces

    def read_contacts(self) -> tuple[npt.NDArray[np.int32], Array]:
        """The feet's contacts now, as `FootContacts.read` gives them."""
        return self.foot_contacts.read(self.model, self.data, self._link_collisions)

    def contact_forces_of(self, geoms: npt.NDArray[np.int32], contact_frame_forces: Array) -> Array:
        """`contact_forces` at N instants, shape (N, n_points, 3), N, for what `read_contacts` gave
        then, unchecked.
        """
        return self.foot_contacts.forces(geoms, contact_frame_forces)

    def contact_positions(self) -> Array:
        """World positions of the points, shape (n_points, 3), m: the point of each ball that is
        nearest to the ground.
        """
        return self.foot_contacts.positions(self.data.geom_xpos[self.foot_contacts.geoms])

    def pushed_body(self, push: Push) -> int:
        """MuJoCo's number of the body that a push acts on; `InputError` for a link that is bolted
        to the ground.
        """
        frame = self.robot.model.frames[self.robot.frame_id(as_instance("push", push, Push).frame)]
        joint = self.robot.model.names[frame.parentJoint]
        if joint in self.robot.joint_names:
            return int(self.model.joint(joint).bodyid[0])
        if self.robot.is_floating:
            return self._base_body
        moving = ", ".join(
            f.name
            for f in self.robot.model.frames
            if f.parentJoint > 0 and f.type == pin.FrameType.BODY
        )
        reason = f"{self.robot.name} is bolted to the ground there"
        raise InputError(
            f"a push at {push.frame!r} moves nothing: {reason}. Push a link that moves: {moving}."
        )

    def _apply_push(self, push: Push, force: Array) -> None:
        """Add a force at the origin of a push's frame: MuJoCo takes it at the body's centre of
        mass.
        """
        frame, body = (
            self.robot.model.frames[self.robot.frame_id(push.frame)],
            self.pushed_body(push),
        )
        position = (
            self.data.xpos[body] + self.data.xmat[body].reshape(3, 3) @ frame.placement.translation
        )
        self.data.xfrc_applied[body, :3] += force
        self.data.xfrc_applied[body, 3:] += cross(position - self.data.xipos[body], force)

    def _standing_state(self) -> State:
        """The robot standing on the ground, turned with a slope so that every foot touches."""
        if len(self._planes) > 1:
            return self.robot.standing(normal=self.ground.normals, offset=self.ground.offsets)
        state = self.robot.standing()
        if not self.robot.is_floating:
            return state
        normal, offset = self.ground.normals[0], self.ground.offsets[0]
        rotation = pin.Quaternion.FromTwoVectors(np.array(UP), np.array(normal))
        orientation = (rotation * pin.Quaternion(*state.q[[6, 3, 4, 5]])).normalized()
        position = rotation.matrix() @ state.q[:3] + offset * normal
        return state.replace(q=np.concatenate([position, orientation.coeffs(), state.q[7:]]))

    def _base_height(self) -> float:
        """Height of the base's origin over the nearest plane of the ground, m."""
        position = self._base_position.tolist()
        height: float = min([_dot(normal, position) - offset for normal, offset in self._planes])
        return height

    def __repr__(self) -> str:
        return f"Simulation({self.robot.name}, t={self.time:.3f} s, timestep={self.timestep:g} s)"


def _dot(a: list[float], b: list[float]) -> float:
    """aᵀ b of three numbers each; numpy's own takes three times as long."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
