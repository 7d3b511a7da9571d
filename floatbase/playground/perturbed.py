"""Simulation with modified physics, and a controller that drives motors of the base.

Terms of eq. (7) can be changed or switched off while the simulation runs.
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
    as_callable,
    as_instance,
    as_positive,
    as_strings,
    checked,
    cross,
)
from floatbase.control import Command
from floatbase.dynamics import UP, Contacts, equations_of_motion
from floatbase.errors import InputError, unknown_name
from floatbase.playground.mismatch import ModelMismatch
from floatbase.robots import Robot, State
from floatbase.simulation import Controller, Ground, Push, Simulation


def _as_friction(name: str, value: object) -> float | None:
    """Check a friction coefficient; None is allowed."""
    return None if value is None else as_positive(name, value)


@dataclass(frozen=True)
class Perturbation(Value):
    """Difference between a `PerturbedSimulation` and the exact equations of motion, eq. (7).

    Eq. (7) is M q̈ + h = S τ + Jᵀ λ. By default, the physics is exact.

    Parameters
    ----------
    mass : float
        Actual masses and inertias as a multiple of the robot's nominal ones, dimensionless. It
        scales M and h.
    gravity : bool
        Whether there is gravity.
    velocity_forces : bool
        Whether there are Coriolis and centrifugal forces, the velocity-dependent part of h in the
        coordinates of eq. (7). Otherwise they are cancelled at each timestep.
    friction : float or None
        Friction coefficient of all feet on the ground, dimensionless. None keeps the ground's
        coefficient.
    disabled_contacts : iterable of str
        Names of contact points that pass through the ground. The forces of these points are missing
        in Jᵀ λ.
    adhesion_force : float
        Force with which the ground attracts each touching contact point [N]. The normal force nᵀ λ
        may be negative by this amount.
    """

    mass: float = field(default=1.0, metadata=checked(as_positive))
    gravity: bool = field(default=True, metadata=checked(as_bool))
    velocity_forces: bool = field(default=True, metadata=checked(as_bool))
    friction: float | None = field(default=None, metadata=checked(_as_friction))
    disabled_contacts: Iterable[str] = field(default=(), metadata=checked(as_strings))
    adhesion_force: float = field(default=0.0, metadata=checked(as_positive, "N", allow_zero=True))


class PerturbedSimulation(Simulation):
    """`Simulation` whose perturbation can be changed at any time, with optional motors of the base.

    Parameters
    ----------
    robot : Robot
        Robot to simulate.
    ground : Ground or float, optional
        Ground, or friction coefficient of level ground [-].
    timestep : float, optional
        Timestep of the physics [s].
    perturbation : Perturbation, optional
        Initial perturbation. By default, the physics is exact.
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
        tops = np.tile(UP, (len(self.ground.boxes), 1))
        self._ground_normals = np.concatenate([self.ground.normals, tops])  # one for each geom
        self._scratch = mujoco.MjData(model)  # for computations outside the step
        self._nominal = {
            name: np.array(getattr(model, name))
            for name in ("body_mass", "body_inertia", "dof_armature")
        }
        self._nominal_gravity = np.array(model.opt.gravity)
        self._nominal_friction = np.array(model.geom_friction[:, 0])
        self.perturbation = Perturbation() if perturbation is None else perturbation

    @property
    def perturbation(self) -> Perturbation:
        """Current perturbation. Assign a new one to change the physics."""
        return self._perturbation

    @perturbation.setter
    def perturbation(self, perturbation: Perturbation) -> None:
        """Change the perturbation; raise `UnknownNameError` for an unknown contact point."""
        for name in as_instance("perturbation", perturbation, Perturbation).disabled_contacts:
            if name not in self.point_names:
                raise unknown_name("contact point", name, self.point_names)
        model, self._perturbation = self.model, perturbation
        for name, nominal in self._nominal.items():
            getattr(model, name)[:] = perturbation.mass * nominal
        self._gravity = perturbation.gravity * self._nominal_gravity
        model.opt.gravity[:] = self._gravity
        model.geom_friction[:, 0] = (
            self._nominal_friction if perturbation.friction is None else perturbation.friction
        )
        for name, ball in zip(self.point_names, self.foot_contacts.geoms, strict=True):
            model.geom_conaffinity[ball] = name not in perturbation.disabled_contacts
        mujoco.mj_setConst(model, self._scratch)

    @property
    def base_wrench(self) -> Array:
        """Wrench of the base's motors, shape (6,), in the frame of the base [N and N·m]."""
        return self._base_wrench

    @base_wrench.setter
    def base_wrench(self, wrench: npt.ArrayLike) -> None:
        """Set the wrench; raise `InputError` if the robot has a fixed base."""
        if not self.robot.is_floating:
            raise InputError(
                f"{self.robot.name} has a fixed base. base_wrench needs a floating base."
            )
        self._base_wrench = as_array("base_wrench", wrench, (6,), "N and N·m")

    def reset(self, state: State | None = None) -> None:
        """Reset the simulation as `Simulation.reset` does, and set the base wrench to zero.

        Parameters
        ----------
        state : State, optional
            State to start from. By default, the robot stands.
        """
        self._base_wrench = np.zeros(6)
        super().reset(state)

    def _advance(self, tau: Array, pushes: tuple[Push, ...] = ()) -> None:
        """Advance by one timestep, with the forces of the perturbation."""
        data, applied = self.data, self.data.qfrc_applied
        applied[:] = 0.0
        if not self._perturbation.velocity_forces:
            applied += self._velocity_compensation()
        if self._perturbation.adhesion_force:
            self._apply_adhesion(applied)
        if self._base_wrench.any():
            R = np.empty(9)
            mujoco.mju_quat2Mat(R, data.qpos[3:7])
            # MuJoCo: linear in the world frame, angular in the base frame
            applied[:3] += R.reshape(3, 3) @ self._base_wrench[:3]
            applied[3:6] += self._base_wrench[3:]
        super()._advance(tau, pushes)

    def _velocity_compensation(self) -> Array:
        """Return generalized forces that cancel the velocity part of h, in MuJoCo coordinates."""
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
        # update the contacts: the last step found them for the positions at its beginning
        mujoco.mj_fwdPosition(self.model, self.data)
        foot_geoms = set(self.foot_contacts.geoms.tolist())
        for ground, ball in np.sort(self.data.contact.geom, axis=1).tolist():
            if ball in foot_geoms:
                force = -self._perturbation.adhesion_force * self._ground_normals[ground]
                position, body = self.data.geom_xpos[ball], int(self.model.geom_bodyid[ball])
                mujoco.mj_applyFT(
                    self.model, self.data, force, np.zeros(3), position, body, applied
                )

    def _contact_forces_of(
        self, geoms: npt.NDArray[np.int32], contact_frame_forces: Array
    ) -> Array:
        """Convert contacts to forces as `Simulation` does, minus the adhesion force [N]."""
        forces = super()._contact_forces_of(geoms, contact_frame_forces)
        if self._perturbation.adhesion_force:
            planes, foot_geoms = geoms[:, :, 0], geoms[:, :, 1]
            rows, columns = np.nonzero(np.isin(foot_geoms, self.foot_contacts.geoms))
            points = np.argmax(foot_geoms[rows, columns, None] == self.foot_contacts.geoms, axis=1)
            forces[rows, points] -= (
                self._perturbation.adhesion_force * self._ground_normals[planes[rows, columns]]
            )
        return forces


class BaseMotors:
    """Controller that also drives motors of the base, as if S had no zero rows.

    This controller wraps another one. At each control step, `sim.base_wrench` becomes the base's
    rows of M q̈ + h - Jᵀ λ in eq. (7) for the planned values, with M, h and J as the controller
    assumes them. The wrench is zero, up to rounding, unless the controller assumes such motors.

    Parameters
    ----------
    controller : Controller
        Controller to wrap.
    sim : PerturbedSimulation
        Simulation whose base wrench is set.
    mismatch : ModelMismatch, optional
        Mismatch of the controller. By default, its model is exact.

    Raises
    ------
    InputError
        If an argument has the wrong type, or if the controller has no `contacts`.
    """

    def __init__(
        self,
        controller: Controller,
        sim: PerturbedSimulation,
        mismatch: ModelMismatch | None = None,
    ):
        self.controller: Controller = as_callable("controller", controller, "controller(q, v, t)")
        as_instance("contacts of the controller", getattr(controller, "contacts", None), Contacts)
        self.sim = as_instance("sim", sim, PerturbedSimulation)
        self.mismatch = (
            ModelMismatch()
            if mismatch is None
            else as_instance("mismatch", mismatch, ModelMismatch)
        )

    @property
    def contacts(self) -> Contacts:
        """Current contacts of the controller."""
        held: Contacts = self.controller.contacts  # type: ignore[attr-defined]
        return held

    def __call__(self, q: npt.ArrayLike, v: npt.ArrayLike, t: float = 0.0) -> Command:
        """Compute the controller's command, and set the base wrench of the simulation.

        Parameters
        ----------
        q : array_like, shape (nq,)
            Configuration.
        v : array_like, shape (nv,)
            Velocity.
        t : float, optional
            Time [s].

        Returns
        -------
        Command
            Command of the wrapped controller.
        """
        command: Command = self.controller(q, v, t)  # type: ignore[arg-type]
        eom = self.mismatch.assumed_equations(
            equations_of_motion(State(self.sim.robot, q, v), self.contacts)
        )
        self.sim.base_wrench = (eom.M @ command.qdd + eom.h - eom.J.T @ command.forces)[:6]
        return command
