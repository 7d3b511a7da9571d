"""A simulation in which terms of (7) can be changed or switched off while it runs, to see what each
of them does; and a controller that drives motors of the base there.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import mujoco
import numpy as np
import numpy.typing as npt

from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_bool,
    as_instance,
    as_positive,
    as_strings,
    checked,
    cross,
)
from floatbase.control import Command
from floatbase.dynamics import Contacts, equations_of_motion
from floatbase.errors import InputError, unknown_name
from floatbase.playground.mismatch import ModelMismatch
from floatbase.robots import Robot, State
from floatbase.simulation import Controller, Ground, Push, Simulation


def _as_friction(name: str, value: object) -> float | None:
    """Check a friction coefficient; None is allowed."""
    return None if value is None else as_positive(name, value)


@dataclass(frozen=True)
class Perturbation(Value):
    """What holds in a `PerturbedSimulation` instead of (7), M q̈ + h = S τ + Jᵀ λ. The defaults are
    physics as it is.

    mass: all masses and inertias as a multiple of the robot's own, M and h.
    gravity: whether there is gravity.
    velocity_forces: whether there are Coriolis and centrifugal forces, the part of h that grows
        with the velocity, in the coordinates of (7); else they are cancelled at every timestep.
    friction: coefficient of all feet on the ground; None leaves the ground's.
    disabled_contacts: names of contact points that go through the ground, so that Jᵀ λ lacks them.
    adhesion_force: N, with which the ground pulls each contact point that touches it: so much nᵀ λ
        may be negative.
    """

    mass: float = field(default=1.0, metadata=checked(as_positive))
    gravity: bool = field(default=True, metadata=checked(as_bool))
    velocity_forces: bool = field(default=True, metadata=checked(as_bool))
    friction: float | None = field(default=None, metadata=checked(_as_friction))
    disabled_contacts: Iterable[str] = field(default=(), metadata=checked(as_strings))
    adhesion_force: float = field(default=0.0, metadata=checked(as_positive, "N", allow_zero=True))


class PerturbedSimulation(Simulation):
    """A `Simulation` whose `perturbation` can be set at any time, and that can push the base as if
    it had motors of its own.

    robot, ground, timestep: as for `Simulation`. perturbation: what holds at first.
    """

    def __init__(
        self,
        robot: Robot,
        ground: Ground | float = 1.0,
        timestep: float = 1e-3,
        perturbation: Perturbation | None = None,
    ):
        as_instance("robot", robot, Robot)
        self._perturbation = Perturbation()
        self._base_wrench: Array = np.zeros(6)
        super().__init__(robot, ground, timestep)
        model = self.model
        self._scratch = mujoco.MjData(model)  # for what is computed beside the step
        self._nominal = {
            name: np.array(getattr(model, name))
            for name in ("body_mass", "body_inertia", "dof_armature")
        }
        self._nominal_gravity = np.array(model.opt.gravity)
        self.perturbation = Perturbation() if perturbation is None else perturbation

    @property
    def perturbation(self) -> Perturbation:
        """What holds; set another one to change it."""
        return self._perturbation

    @perturbation.setter
    def perturbation(self, perturbation: Perturbation) -> None:
        """Raises `UnknownNameError` for a disabled contact point that does not exist."""
        for name in as_instance("perturbation", perturbation, Perturbation).disabled_contacts:
            if name not in self.point_names:
                raise unknown_name("contact point", name, self.point_names)
        model, self._perturbation = self.model, perturbation
        for name, nominal in self._nominal.items():
            getattr(model, name)[:] = perturbation.mass * nominal
        model.opt.gravity[:] = perturbation.gravity * self._nominal_gravity
        model.geom_friction[:, 0] = (
            self.ground.mu if perturbation.friction is None else perturbation.friction
        )
        for name, ball in zip(self.point_names, self.foot_contacts.geoms, strict=True):
            model.geom_conaffinity[ball] = name not in perturbation.disabled_contacts
        mujoco.mj_setConst(model, self._scratch)

    @property
    def base_wrench(self) -> Array:
        """Force and moment of motors that the base does not have, shape (6,), N and N·m, at its
        origin in its axes.
        """
        return self._base_wrench

    @base_wrench.setter
    def base_wrench(self, wrench: npt.ArrayLike) -> None:
        if not self.robot.is_floating:
            raise InputError(
                f"{self.robot.name} is bolted to the ground; only a floating base has a wrench."
            )
        self._base_wrench = as_array("base_wrench", wrench, (6,), "N and N·m")

    def reset(self, state: State | None = None) -> None:
        """As `Simulation.reset`; the base's wrench is zero again."""
        self._base_wrench = np.zeros(6)
        super().reset(state)

    def advance(self, tau: Array, pushes: tuple[Push, ...] = ()) -> None:
        """As `Simulation.advance`, with what the perturbation adds."""
        data, applied = self.data, self.data.qfrc_applied
        applied[:] = 0.0
        if not self._perturbation.velocity_forces:
            applied += self._velocity_compensation()
        if self._perturbation.adhesion_force:
            self._apply_adhesion(applied)
        if self._base_wrench.any():
            R = np.empty(9)
            mujoco.mju_quat2Mat(R, data.qpos[3:7])
            applied[:3] += (
                R.reshape(3, 3) @ self._base_wrench[:3]
            )  # MuJoCo: linear in world axes, angular in the base's
            applied[3:6] += self._base_wrench[3:]
        super().advance(tau, pushes)

    def _velocity_compensation(self) -> Array:
        """The forces, as MuJoCo takes them, that cancel what h of (7) has because of the velocity.

        MuJoCo's bias forces less those at rest are that for its own coordinates, in which the
        base's velocity is along world axes. In (7) it is along the base's own, which turn: M times
        ω × v of the base comes to it.
        """
        model, data = self.model, self._scratch
        data.qpos[:], data.qvel[:] = self.data.qpos, self.data.qvel
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        bias_forces, frame_correction = np.array(data.qfrc_bias), np.zeros(model.nv)
        if self.robot.is_floating:
            R = np.empty(9)
            mujoco.mju_quat2Mat(R, data.qpos[3:7])
            acceleration = np.zeros(model.nv)
            acceleration[:3] = cross(R.reshape(3, 3) @ data.qvel[3:6], data.qvel[:3])
            mujoco.mj_mulM(model, data, frame_correction, acceleration)
        data.qvel[:] = 0.0
        mujoco.mj_fwdVelocity(model, data)
        return bias_forces - data.qfrc_bias + frame_correction

    def _apply_adhesion(self, applied: Array) -> None:
        """Add the adhesion force on each ball that touches the ground."""
        # contacts where the feet are now: the step before found them where it began
        mujoco.mj_fwdPosition(self.model, self.data)
        foot_geoms = set(self.foot_contacts.geoms.tolist())
        for plane, ball in self.data.contact.geom.tolist():
            if ball in foot_geoms:
                force = -self._perturbation.adhesion_force * self.ground.normals[plane]
                position, body = self.data.geom_xpos[ball], int(self.model.geom_bodyid[ball])
                mujoco.mj_applyFT(
                    self.model, self.data, force, np.zeros(3), position, body, applied
                )

    def contact_forces_of(self, geoms: npt.NDArray[np.int32], contact_frame_forces: Array) -> Array:
        """As there, less the adhesion force: the force between ground and foot."""
        forces = super().contact_forces_of(geoms, contact_frame_forces)
        if self._perturbation.adhesion_force:
            planes, foot_geoms = geoms[:, :, 0], geoms[:, :, 1]
            rows, columns = np.nonzero(np.isin(foot_geoms, self.foot_contacts.geoms))
            points = np.argmax(foot_geoms[rows, columns, None] == self.foot_contacts.geoms, axis=1)
            forces[rows, points] -= (
                self._perturbation.adhesion_force * self.ground.normals[planes[rows, columns]]
            )
        return forces


class BaseMotors:
    """A controller around another one that drives motors of the base which no robot has: S without
    its zeros.

    At each control step `sim.base_wrench` becomes the base's rows of (7), M q̈ + h - Jᵀ λ, of what
    the controller plans, with M, h and J as it assumes them: zero, but for rounding, unless it
    assumes such motors.

    mismatch: the controller's; None for none.
    """

    def __init__(
        self,
        controller: Controller,
        sim: PerturbedSimulation,
        mismatch: ModelMismatch | None = None,
    ):
        self.controller, self.sim = controller, sim
        self.mismatch = ModelMismatch() if mismatch is None else mismatch

    @property
    def contacts(self) -> Contacts:
        """Those of the controller now."""
        held: Contacts = self.controller.contacts  # type: ignore[attr-defined]
        return held

    def __call__(self, q: npt.ArrayLike, v: npt.ArrayLike, t: float = 0.0) -> Command:
        """The command of the controller at q, (nq,), and v, (nv,), at t in s."""
        command: Command = self.controller(q, v, t)  # type: ignore[arg-type]
        eom = self.mismatch.assumed_equations(
            equations_of_motion(State(self.sim.robot, q, v), self.contacts)
        )
        self.sim.base_wrench = (eom.M @ command.qdd + eom.h - eom.J.T @ command.forces)[:6]
        return command
