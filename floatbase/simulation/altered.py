"""A simulation in which terms of (7) can be changed or switched off while it runs, to see what each of them does."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import mujoco
import numpy as np
import numpy.typing as npt

from floatbase._validation import Array, Value, as_array, as_bool, as_instance, as_positive, as_strings, cross
from floatbase.errors import InputError, unknown_name
from floatbase.robots import Robot, State
from floatbase.simulation.build import Ground
from floatbase.simulation.physics import Push, Simulation


@dataclass(frozen=True, eq=False)
class World(Value):
    """What holds in an `AlteredSimulation` instead of (7), M q̈ + h = S τ + Jᵀ λ. The defaults are physics as it is.

    mass: all masses and inertias as a multiple of the robot's own, M and h.
    gravity: whether there is gravity.
    velocity_forces: whether there are Coriolis and centrifugal forces, the part of h that grows with the velocity, in the
        coordinates of (7); else they are cancelled at every timestep.
    friction: coefficient of all feet on the ground; None leaves the ground's.
    untouched: names of contact points that go through the ground, so that Jᵀ λ lacks them.
    magnets: N, with which the ground pulls each contact point that touches it: so much nᵀ λ may be negative.
    """

    mass: float = 1.0
    gravity: bool = True
    velocity_forces: bool = True
    friction: float | None = None
    untouched: Iterable[str] = ()
    magnets: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "mass", as_positive("mass in the world, as a multiple of the robot's,", self.mass))
        object.__setattr__(self, "untouched", as_strings("untouched", self.untouched))
        object.__setattr__(self, "magnets", as_positive("magnets of the ground", self.magnets, "N", allow_zero=True))
        if self.friction is not None:
            object.__setattr__(self, "friction", as_positive("friction coefficient of the world", self.friction))
        for name in ("gravity", "velocity_forces"):
            as_bool(name, getattr(self, name))


class AlteredSimulation(Simulation):
    """A `Simulation` whose `world` can be set at any time, and that can push the base as if it had motors of its own.

    robot, ground, timestep: as for `Simulation`. world: what holds at first.
    """

    def __init__(self, robot: Robot, ground: Ground | float = 1.0, timestep: float = 1e-3, world: World | None = None):
        as_instance("robot", robot, Robot)
        self._world = World()
        self._base_wrench: Array = np.zeros(6)
        super().__init__(robot, ground, timestep)
        model = self.model
        self._own = {name: np.array(getattr(model, name)) for name in ("body_mass", "body_inertia", "dof_armature")}
        self._gravity = np.array(model.opt.gravity)
        self.world = World() if world is None else world

    @property
    def world(self) -> World:
        """What holds; set another one to change it."""
        return self._world

    @world.setter
    def world(self, world: World) -> None:
        """Raises `UnknownNameError` for an untouched point that does not exist."""
        for name in as_instance("world", world, World).untouched:
            if name not in self.point_names:
                raise unknown_name("contact point", name, self.point_names)
        model, self._world = self.model, world
        for name, own in self._own.items():
            getattr(model, name)[:] = world.mass * own
        model.opt.gravity[:] = world.gravity * self._gravity
        model.geom_friction[:, 0] = self.ground.mu if world.friction is None else world.friction
        model.geom_conaffinity[self._balls] = 1
        model.geom_conaffinity[[self._balls[self.point_names.index(name)] for name in world.untouched]] = 0
        mujoco.mj_setConst(model, self._scratch)

    @property
    def base_wrench(self) -> Array:
        """Force and moment of motors that the base does not have, shape (6,), N and N·m, at its origin in its axes."""
        return self._base_wrench

    @base_wrench.setter
    def base_wrench(self, wrench: npt.ArrayLike) -> None:
        if not self.robot.is_floating:
            raise InputError(f"{self.robot.name} is bolted to the ground; only a floating base has a wrench.")
        self._base_wrench = as_array("base_wrench", wrench, (6,), "N and N·m")

    def reset(self, state: State | None = None) -> None:
        """As `Simulation.reset`; the base's wrench is zero again."""
        self._base_wrench = np.zeros(6)
        super().reset(state)

    def advance(self, tau: Array, pushes: tuple[Push, ...] = ()) -> None:
        """As `Simulation.advance`, with what the world adds."""
        data, applied = self.data, self.data.qfrc_applied
        applied[:] = 0.0
        if not self._world.velocity_forces:
            applied += self._velocity_forces()
        if self._world.magnets:
            self._pull_feet(applied)
        if self._base_wrench.any():
            R = np.empty(9)
            mujoco.mju_quat2Mat(R, data.qpos[3:7])
            applied[:3] += R.reshape(3, 3) @ self._base_wrench[:3]  # MuJoCo: linear in world axes, angular in the base's
            applied[3:6] += self._base_wrench[3:]
        super().advance(tau, pushes)

    def _velocity_forces(self) -> Array:
        """The forces, as MuJoCo takes them, that cancel what h of (7) has because of the velocity.

        MuJoCo's bias forces less those at rest are that for its own coordinates, in which the base's velocity is along world
        axes. In (7) it is along the base's own, which turn: M times ω × v of the base comes to it.
        """
        scratch = self._scratch
        scratch.qpos[:], scratch.qvel[:] = self.data.qpos, self.data.qvel
        mujoco.mj_fwdPosition(self.model, scratch)
        mujoco.mj_fwdVelocity(self.model, scratch)
        moving, turning = np.array(scratch.qfrc_bias), np.zeros(self.model.nv)
        if self.robot.is_floating:
            R = np.empty(9)
            mujoco.mju_quat2Mat(R, scratch.qpos[3:7])
            acceleration = np.zeros(self.model.nv)
            acceleration[:3] = cross(R.reshape(3, 3) @ scratch.qvel[3:6], scratch.qvel[:3])
            mujoco.mj_mulM(self.model, scratch, turning, acceleration)
        scratch.qvel[:] = 0.0
        mujoco.mj_fwdVelocity(self.model, scratch)
        return moving - scratch.qfrc_bias + turning

    def _pull_feet(self, applied: Array) -> None:
        """Add the pull of the magnets on each ball that touches the ground."""
        # contacts where the feet are now: the step before found them where it began
        mujoco.mj_fwdPosition(self.model, self.data)
        balls = set(self._balls.tolist())
        for plane, ball in self.data.contact.geom.tolist():
            if ball in balls:
                force = -self._world.magnets * self.ground.normals[plane]
                at, body = self.data.geom_xpos[ball], int(self.model.geom_bodyid[ball])
                mujoco.mj_applyFT(self.model, self.data, force, np.zeros(3), at, body, applied)

    def _forces_of(self, geoms: npt.NDArray[np.int32], numbers: Array) -> Array:
        """As there, less what the magnets pull: the force between ground and foot."""
        forces = super()._forces_of(geoms, numbers)
        if self._world.magnets:
            planes, balls = geoms[:, :, 0], geoms[:, :, 1]
            rows, columns = np.nonzero(np.isin(balls, self._feet))
            points = np.argmax(balls[rows, columns, None] == self._feet, axis=1)
            forces[rows, points] -= self._world.magnets * self.ground.normals[planes[rows, columns]]
        return forces

    def _watch(self) -> None:
        """As there, with data of the present model for what is computed beside the step."""
        super()._watch()
        self._scratch = mujoco.MjData(self.model)
