"""A robot in MuJoCo: torques and pushes in, states and contact forces out."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any, ClassVar, Self

import mujoco
import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._validation import (
    Array,
    FixedAttributes,
    Value,
    as_array,
    as_bool,
    as_instance,
    as_number,
    as_positive,
    as_string,
    cross,
    short_repr,
)
from floatbase.dynamics import UP, Contacts
from floatbase.errors import InputError
from floatbase.robots import Robot, State
from floatbase.simulation.build import Ground, body_name, build_model
from floatbase.simulation.conversion import Conversion
from floatbase.simulation.fallen_model import FallenModel, build_fallen_model

# part of the base's height at the last reset: a crouch keeps more, lying down does not
_FALLEN_HEIGHT_FRACTION = 0.4
_FALLEN_COSINE = float(
    np.cos(np.deg2rad(60.0))
)  # of the base's tilt since the last reset: no leg brings it back from there
# m: a base that begins lower than this lies on the ground, and its height measures no fall
_MIN_INITIAL_HEIGHT = 1e-3
_MAX_TIMESTEP = 0.1  # s: a robot falls 5 cm meanwhile, and no contact of 4 ms is followed
# s: the clock is a sum of timesteps; the rounding of a minute of milliseconds is 5e-11 s
_CLOCK_TOLERANCE = 1e-9
_RECREATE_HINT = "make another, fb.Simulation(robot, ground=…, timestep=…)"
_RESET_HINT = "sim.reset(sim.state.replace(q=…, v=…)) puts the robot there, at time 0"
_FIRST_FATAL_WARNING = int(
    mujoco.mjtWarning.mjWARN_BADQPOS
)  # this warning of MuJoCo and the later ones: its numbers mean nothing any more


@dataclass(frozen=True, eq=False)
class Push(Value):
    """A force on the robot for a while.

    A timestep that the push covers in part gets that part of the force: its impulse is force times
    duration.

    force: (3,) N, world, at the origin of the frame.
    start, duration: s, on the simulation's clock.
    frame: name of a frame of the robot; "base" is the base link.
    """

    force: Array
    start: float = 0.0
    duration: float = 0.1
    frame: str = "base"

    def __post_init__(self) -> None:
        object.__setattr__(self, "force", as_array("force of the push", self.force, (3,), "N"))
        object.__setattr__(
            self, "start", as_positive("start of the push", self.start, "s", allow_zero=True)
        )
        object.__setattr__(
            self, "duration", as_positive("duration of the push", self.duration, "s")
        )
        as_string("frame of the push", self.frame)

    def acts_at(self, t: float) -> bool:
        """Whether the push acts at t, s."""
        t = as_number("t", t, "s")
        return self.start - _CLOCK_TOLERANCE <= t < self.start + self.duration - _CLOCK_TOLERANCE

    def _active_fraction(self, t: float, timestep: float) -> float:
        """The part of the step from t to t + timestep, s, in which the push acts: 0 to 1."""
        active_time = min(self.start + self.duration, t + timestep) - max(self.start, t)
        return max(0.0, active_time) / timestep


def as_pushes(pushes: Sequence[Push]) -> tuple[Push, ...]:
    """A list of pushes as a tuple, checked."""
    if not isinstance(pushes, Sequence):
        raise InputError(
            f"pushes must be a list, as in pushes=[fb.Push(…)], not {short_repr(pushes)}."
        )
    return tuple(
        as_instance("each of the pushes", push, Push, "fb.Push([0.0, 30.0, 0.0])")
        for push in pushes
    )


def active_pushes(pushes: tuple[Push, ...], begin: float, end: float) -> tuple[Push, ...]:
    """Those that act at any time from begin to end, s."""
    return tuple(
        p
        for p in pushes
        if p.start < end - _CLOCK_TOLERANCE and begin < p.start + p.duration - _CLOCK_TOLERANCE
    )


class Simulation(FixedAttributes):
    """A robot on the ground in MuJoCo, driven by joint torques.

    MuJoCo reads the robot's own URDF. A floating base gets a free joint, each foot a ball (a flat
    foot one at each corner), each joint a torque motor with the robot's limit and rotor inertia,
    the ground planes with friction. Joint friction and damping are off, as in (1)-(7); the URDF's
    joint limits are on. Only feet and ground touch, after a fall `link_collisions` too.

    robot as from `fb.load`; ground: a `Ground`, or the coefficient of friction of a level one;
    timestep in s. `model` and `data` are MuJoCo's own, `feet` the robot's feet as `Contacts`.
    Raises `SimulationError` when MuJoCo cannot build the robot. What it was made with does not
    change any more; what `model` and `data` hold may. A copy has `model` and `data` of its own.
    While `link_collisions` touch the ground they are another pair, which has what was changed in
    the first.
    """

    _hints: ClassVar[dict[str, str]] = {
        **dict.fromkeys(
            ("robot", "ground", "timestep", "feet", "model", "data", "point_names"), _RECREATE_HINT
        ),
        **dict.fromkeys(("state", "q", "v", "joint_state", "time"), _RESET_HINT),
    }

    def __init__(self, robot: Robot, ground: Ground | float = 1.0, timestep: float = 1e-3):
        self.robot = as_instance("robot", robot, Robot)
        self.ground = ground if isinstance(ground, Ground) else Ground(mu=ground)
        self.timestep = as_positive("timestep", timestep, "s", maximum=_MAX_TIMESTEP)
        self.feet = Contacts.feet(robot)
        self.model = build_model(robot, self.ground, self.timestep)
        self.data = mujoco.MjData(self.model)
        self._conversion = Conversion(robot, self.model)
        self._actuator_ids = np.array(
            [self.model.actuator(name).id for name in robot.joint_names], dtype=int
        )
        self._foot_geoms = np.array(
            [self.model.geom(name).id for name in self.point_names], dtype=int
        )
        self._upright_foot_geoms = (
            self._foot_geoms
        )  # the same in `_raw_contacts`, which count as the upright model does
        # of each plane, which is a geom; known from its first contact on
        self._contact_frames, self._planes_without_frame = (
            np.zeros((self.model.ngeom, 3, 3)),
            set(range(len(self.ground.normals))),
        )
        self._max_contacts = len(self._foot_geoms) * len(
            self.ground.normals
        )  # of feet: in a valley a ball touches two planes
        self._planes = list(
            zip(self.ground.normals.tolist(), self.ground.offsets.tolist(), strict=True)
        )
        self._radii = self.model.geom_size[self._foot_geoms, :1]
        self._upright, self._link_collisions = (self.model, self.data), False
        self._fallen_model: FallenModel | None = None  # from the first fall on
        self._base_body = self.model.body(body_name(robot.base)).id if robot.is_floating else 0
        self._refresh_views()
        self.reset()
        self._initialised = True

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
    def point_names(self) -> tuple[str, ...]:
        """Names of the points of the robot that can touch the ground: feet, or corners of flat
        feet.
        """
        return self.feet.point_names

    @property
    def time(self) -> float:
        """s since the last reset."""
        return float(self.data.time)

    @property
    def q(self) -> Array:
        """Configuration in the package's convention, shape (nq,)."""
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
        The first time takes longer: the shapes are read.
        """
        return self._link_collisions

    @link_collisions.setter
    def link_collisions(self, enabled: bool) -> None:
        if as_bool("link_collisions", enabled) == self._link_collisions:
            return
        self._link_collisions = bool(enabled)
        if self._fallen_model is None:
            self._fallen_model = build_fallen_model(self.robot, self.ground, self.timestep)
        if self._fallen_model is None:  # nothing could touch
            return
        if enabled:
            self._fallen_model.copy_from_upright(*self._upright)
            self._activate_model(
                self._fallen_model.model,
                self._fallen_model.data,
                self._fallen_model.from_upright[self._upright_foot_geoms],
            )
        else:
            self._fallen_model.copy_to_upright(*self._upright)
            self._activate_model(*self._upright, self._upright_foot_geoms)

    def _activate_model(
        self, model: mujoco.MjModel, data: mujoco.MjData, foot_geoms: npt.NDArray[np.int_]
    ) -> None:
        """Go on with another model and its data, in which the feet's balls have these numbers."""
        vars(self).update(model=model, data=data, _foot_geoms=foot_geoms)
        self._refresh_views()

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
            fraction = push._active_fraction(self.data.time, self.timestep)
            if fraction > 0.0:
                self._apply_push(push, fraction * push.force)
        mujoco.mj_step(self.model, self.data)

    def torques(self) -> Array:
        """Torques that the motors gave during the last step, within their limits, shape (d,), N·m."""
        return self._torques_from(self.data.actuator_force)

    def _torques_from(self, actuator_force: Array) -> Array:
        """`torques` for MuJoCo's forces of all its actuators, shape (…, d)."""
        return actuator_force[..., self._actuator_ids]

    def contact_forces(self) -> Array:
        """Forces of the ground on the robot during the last step, shape (n_points, 3), N, world,
        ordered as `point_names`.
        """
        geoms, contact_frame_forces = self._raw_contacts()
        return self._contact_forces_from(geoms[None], contact_frame_forces[None])[0]

    def _raw_contacts(self) -> tuple[npt.NDArray[np.int32], Array]:
        """What MuJoCo has of n contacts of feet now: geoms as the upright model has them, (n, 2),
        and forces in their frame, (3 n,), N.
        """
        data = self.data
        contact, forces, n_limits = data.contact, data.efc_force, data.nl
        if n_limits:  # behind the joints at their limits come the contacts
            forces = forces[n_limits:]
        geoms = contact.geom  # from the plane to a ball or a link
        if forces.size != 3 * len(
            geoms
        ):  # a ball that only just touches has none, another cone than ours has others
            forces = np.zeros((len(geoms), 6))
            for i, wrench in enumerate(forces):
                mujoco.mj_contactForce(self.model, data, i, wrench)
            forces = forces[:, :3].ravel()
        if self._planes_without_frame and len(
            geoms
        ):  # all balls on a plane have one contact frame at all times
            for i, (plane, geom) in enumerate(geoms.tolist()):
                if geom in self._foot_geoms:
                    self._contact_frames[plane] = contact.frame[i].reshape(3, 3)
                    self._planes_without_frame.discard(plane)
        if self._link_collisions and self._fallen_model is not None:
            geoms = self._fallen_model.to_upright[geoms].astype(np.int32)
            feet = geoms[:, 1] >= 0
            geoms, forces = geoms[feet], forces.reshape(-1, 3)[feet].ravel()
        return geoms, forces

    def _contact_forces_from(
        self, geoms: npt.NDArray[np.int32], contact_frame_forces: Array
    ) -> Array:
        """`contact_forces` of N instants, shape (N, n_points, 3), N, from their `_raw_contacts`,
        with geom 0 for none.
        """
        n, planes, foot_geoms = len(geoms), geoms[:, :, 0], geoms[:, :, 1]
        forces, per_contact = (
            np.zeros((n, self._upright[0].ngeom, 3)),
            contact_frame_forces.reshape(*foot_geoms.shape, 3),
        )
        for plane in range(len(self._planes)):
            rows, columns = np.nonzero(
                planes == plane
            )  # no ball touches a plane twice, so nothing is added to a sum twice
            forces[rows, foot_geoms[rows, columns]] += (
                per_contact[rows, columns] @ self._contact_frames[plane]
            )  # rows: normal, tangents
        return forces[:, self._upright_foot_geoms]

    def contact_positions(self) -> Array:
        """World positions of the points, shape (n_points, 3), m: the point of each ball that is
        nearest to the ground.
        """
        return self._lowest_points(self.data.geom_xpos[self._foot_geoms])

    def _lowest_points(self, centres: Array) -> Array:
        """`contact_positions` for centres of the balls, shape (…, n_points, 3), m."""
        nearest = np.argmin(self.ground.clearances(centres), axis=-1)
        return centres - self._radii * self.ground.normals[nearest]

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
        """The robot standing on the ground; on a slope turned with it, so that every foot touches."""
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
        return min([_dot(normal, position) - offset for normal, offset in self._planes])

    def __repr__(self) -> str:
        return f"Simulation({self.robot.name}, t={self.time:.3f} s, timestep={self.timestep:g} s)"


def _dot(a: list[float], b: list[float]) -> float:
    """aᵀ b of three numbers each; numpy's own takes three times as long."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
