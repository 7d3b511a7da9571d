"""A robot in MuJoCo: torques and pushes in, states and contact forces out."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import ClassVar, Self

import mujoco
import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._arrays import Array, Fixed, Value, checked, cross, number, of_kind, positive, said, text
from floatbase.dynamics import UP, Contacts
from floatbase.errors import InputError
from floatbase.robots import Robot, State
from floatbase.simulation.build import Ground, body_name, build_model
from floatbase.simulation.conversion import Conversion

_FALLEN_HEIGHT = 0.4  # part of the base's height at the last reset: a crouch keeps more, lying down does not
_FALLEN_COSINE = float(np.cos(np.deg2rad(60.0)))  # of the base's tilt since the last reset: no leg brings it back from there
_LEAST_STATURE = 1e-3  # m: a base that begins lower than this lies on the ground, and its height measures no fall
_LONGEST_TIMESTEP = 0.1  # s: a robot falls 5 cm meanwhile, and no contact of 4 ms is followed
_CLOCK_ERROR = 1e-9  # s: the clock is a sum of timesteps; the rounding of a minute of milliseconds is 5e-11 s
_ANOTHER = "make another, fb.Simulation(robot, ground=…, timestep=…)"
_MOVE = "sim.reset(sim.state.replace(q=…, v=…)) puts the robot there, at time 0"
_FATAL = int(mujoco.mjtWarning.mjWARN_BADQPOS)  # this warning of MuJoCo and the later ones: its numbers mean nothing any more


@dataclass(frozen=True, eq=False)
class Push(Value):
    """A force on the robot for a while.

    A timestep that the push covers in part gets that part of the force: its impulse is force times duration.

    force: (3,) N, world, at the origin of the frame.
    start, duration: s, on the simulation's clock.
    frame: name of a frame of the robot; "base" is the base link.
    """

    force: Array
    start: float = 0.0
    duration: float = 0.1
    frame: str = "base"

    def __post_init__(self) -> None:
        object.__setattr__(self, "force", checked("force of the push", self.force, (3,), "N"))
        object.__setattr__(self, "start", positive("start of the push", self.start, "s", allow_zero=True))
        object.__setattr__(self, "duration", positive("duration of the push", self.duration, "s"))
        text("frame of the push", self.frame)

    def acts_at(self, t: float) -> bool:
        """Whether the push acts at t, s."""
        t = number("t", t, "s")
        return self.start - _CLOCK_ERROR <= t < self.start + self.duration - _CLOCK_ERROR

    def _share(self, t: float, timestep: float) -> float:
        """The part of the step from t to t + timestep, s, in which the push acts: 0 to 1."""
        acting = min(self.start + self.duration, t + timestep) - max(self.start, t)
        return max(0.0, acting) / timestep


def pushes_of(pushes: Sequence[Push]) -> tuple[Push, ...]:
    """A list of pushes as a tuple, checked."""
    if not isinstance(pushes, Sequence):
        raise InputError(f"pushes must be a list, as in pushes=[fb.Push(…)], not {said(pushes)}.")
    return tuple(of_kind("each of the pushes", push, Push, "fb.Push([0.0, 30.0, 0.0])") for push in pushes)


def acting(pushes: tuple[Push, ...], begin: float, end: float) -> tuple[Push, ...]:
    """Those that act at any time from begin to end, s."""
    return tuple(p for p in pushes if p.start < end - _CLOCK_ERROR and begin < p.start + p.duration - _CLOCK_ERROR)


class Simulation(Fixed):
    """A robot on the ground in MuJoCo, driven by joint torques.

    MuJoCo reads the robot's own URDF. A floating base gets a free joint, each foot a ball (a flat foot one at each corner),
    each joint a torque motor with the robot's limit and rotor inertia, the ground a plane with friction. Joint friction and
    damping are off, as in (1)-(7); the URDF's joint limits are on. Only feet and ground touch.

    robot as from `fb.load`; ground: a `Ground`, or the coefficient of friction of a level one; timestep in s. `model` and
    `data` are MuJoCo's own, `feet` the robot's feet as `Contacts`. Raises `SimulationError` when MuJoCo cannot build the robot.
    What it was made with does not change any more; what `model` and `data` hold may. A copy has `model` and `data` of its own.
    """

    _instead: ClassVar[dict[str, str]] = {
        **dict.fromkeys(("robot", "ground", "timestep", "feet", "model", "data", "point_names"), _ANOTHER),
        **dict.fromkeys(("state", "q", "v", "joints", "time"), _MOVE),
    }

    def __init__(self, robot: Robot, ground: Ground | float = 1.0, timestep: float = 1e-3):
        self.robot = of_kind("robot", robot, Robot)
        self.ground = ground if isinstance(ground, Ground) else Ground(mu=ground)
        self.timestep = positive("timestep", timestep, "s", most=_LONGEST_TIMESTEP)
        self.feet = Contacts.feet(robot)
        self.model = build_model(robot, self.ground, self.timestep)
        self.data = mujoco.MjData(self.model)
        self._convert = Conversion(robot, self.model)
        self._motors = np.array([self.model.actuator(name).id for name in robot.joint_names], dtype=int)
        self._balls = np.array([self.model.geom(name).id for name in self.point_names], dtype=int)
        self._point_of_geom = np.zeros(self.model.ngeom, dtype=int)
        self._point_of_geom[self._balls] = np.arange(len(self._balls))
        self._below = self.model.geom_size[self._balls, :1] * self.ground.normal
        self._base = self.model.body(body_name(robot.base)).id if robot.is_floating else 0
        self.reset()
        self._made = True

    def __copy__(self) -> Self:
        return copy.deepcopy(self)  # two robots with the same data would move each other

    @property
    def point_names(self) -> tuple[str, ...]:
        """Names of the points of the robot that can touch the ground: feet, or corners of flat feet."""
        return self.feet.point_names

    @property
    def time(self) -> float:
        """s since the last reset."""
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
    def joints(self) -> tuple[Array, Array]:
        """Angles, rad (or m), and velocities of the actuated joints, shape (d,) each, as `Actuators` take them."""
        return self._convert.joints(self.data.qpos, self.data.qvel)

    @property
    def state(self) -> State:
        """The robot's state now."""
        return State(self.robot, self.q, self.v)

    @property
    def diverged(self) -> bool:
        """Whether positions, velocities, accelerations or torques became infinite, NaN or larger than MuJoCo takes."""
        qpos, qvel = self.data.qpos, self.data.qvel  # MuJoCo itself finds out only in the next step
        return not isfinite(qpos @ qpos + qvel @ qvel) or bool(self.data.warning.number[_FATAL:].any())

    @property
    def fallen(self) -> bool:
        """Whether a floating base has lost 60 % of its height, or tilts by 60°, since the last reset."""
        if not self.robot.is_floating:
            return False
        sunk = self._start_height - self._base_height() > (1.0 - _FALLEN_HEIGHT) * self._stature
        return sunk or float(self._base_vertical() @ self._start_vertical) < _FALLEN_COSINE

    def reset(self, state: State | None = None) -> None:
        """Put the robot into a state, standing upright on the ground's plane by default, at time 0."""
        state = self._standing() if state is None else of_kind("state", state, State)
        if state.robot != self.robot:
            raise InputError(f"this simulation holds {self.robot.name}; the state belongs to another robot.")
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:], self.data.qvel[:] = self._convert.to_mujoco(state.q, state.v)
        mujoco.mj_forward(self.model, self.data)
        self._start_height = self._stature = self._base_height()
        self._start_vertical = self._base_vertical()
        if self._stature <= _LEAST_STATURE:  # it lies: a fall is measured by the way to the centre of mass
            self._stature = float(np.linalg.norm(state.com - self.data.xpos[self._base]))

    def step(self, tau: npt.ArrayLike, pushes: tuple[Push, ...] = ()) -> None:
        """Advance by one timestep under torques, shape (d,), N·m, clipped to the motors' limits, and present pushes."""
        self.advance(checked("torques", tau, (self.robot.d,), "N·m"), pushes_of(pushes))

    def advance(self, tau: Array, pushes: tuple[Push, ...] = ()) -> None:
        """`step` without its check, for loops that have checked the torques already: float64, finite, shape (d,)."""
        self.data.ctrl[self._motors] = tau
        self.data.xfrc_applied[:] = 0.0
        for push in pushes:
            share = push._share(self.data.time, self.timestep)
            if share > 0.0:
                self._apply(push, share * push.force)
        mujoco.mj_step(self.model, self.data)

    def torques(self) -> Array:
        """Torques that the motors gave during the last step, within their limits, shape (d,), N·m."""
        return self.data.actuator_force[self._motors]

    def contact_forces(self) -> Array:
        """Forces of the ground on the robot during the last step, shape (n_points, 3), N, world, ordered as `point_names`."""
        forces, wrench, contact = np.zeros((len(self._balls), 3)), np.zeros(6), self.data.contact
        for i, (_, ball) in enumerate(contact.geom):  # from the plane to the ball
            mujoco.mj_contactForce(self.model, self.data, i, wrench)
            forces[self._point_of_geom[ball]] = wrench[:3]
        # one plane, so one frame for all contacts: its rows are normal and tangents
        return forces @ contact.frame[0].reshape(3, 3) if len(contact) else forces

    def contact_positions(self) -> Array:
        """World positions of the points, shape (n_points, 3), m: the lowest point of each ball along the ground's normal."""
        return self.data.geom_xpos[self._balls] - self._below

    def pushed_body(self, push: Push) -> int:
        """MuJoCo's number of the body that a push acts on; `InputError` for a link that is bolted to the ground."""
        frame = self.robot.model.frames[self.robot.frame_id(of_kind("push", push, Push).frame)]
        joint = self.robot.model.names[frame.parentJoint]
        if joint in self.robot.joint_names:
            return int(self.model.joint(joint).bodyid[0])
        if self.robot.is_floating:
            return self._base
        moving = ", ".join(f.name for f in self.robot.model.frames if f.parentJoint > 0 and f.type == pin.FrameType.BODY)
        held = f"{self.robot.name} is bolted to the ground there"
        raise InputError(f"a push at {push.frame!r} moves nothing: {held}. Push a link that moves: {moving}.")

    def _apply(self, push: Push, force: Array) -> None:
        """Add a force at the origin of a push's frame: MuJoCo takes it at the body's centre of mass."""
        frame, body = self.robot.model.frames[self.robot.frame_id(push.frame)], self.pushed_body(push)
        at = self.data.xpos[body] + self.data.xmat[body].reshape(3, 3) @ frame.placement.translation
        self.data.xfrc_applied[body, :3] += force
        self.data.xfrc_applied[body, 3:] += cross(at - self.data.xipos[body], force)

    def _standing(self) -> State:
        """The robot standing on the ground; on a slope turned with it, so that every foot touches."""
        state = self.robot.standing()
        if not self.robot.is_floating:
            return state
        turn = pin.Quaternion.FromTwoVectors(np.array(UP), np.array(self.ground.normal))
        attitude = (turn * pin.Quaternion(*state.q[[6, 3, 4, 5]])).normalized()
        return state.replace(q=np.concatenate([turn.matrix() @ state.q[:3], attitude.coeffs(), state.q[7:]]))

    def _base_height(self) -> float:
        """Height of the base's origin over the ground, m."""
        return float(self.ground.normal @ self.data.xpos[self._base])

    def _base_vertical(self) -> Array:
        """The base's z axis, shape (3,), world."""
        return self.data.xmat[self._base, 2::3].copy()

    def __repr__(self) -> str:
        return f"Simulation({self.robot.name}, t={self.time:.3f} s, timestep={self.timestep:g} s)"
